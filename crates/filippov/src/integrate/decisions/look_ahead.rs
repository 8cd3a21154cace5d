//! Where derivatives at the point do not tell what follows: the modes are tried for a moment.
//!
//! So it is where two surfaces touch one another: seen from the point they are one, and a moment later they are two, in an
//! order that decides.

use crate::error::FieldError;
use crate::field::SmoothField;
use crate::integrate::decisions::transition::{Decided, Left, Lefts};
use crate::integrate::integrator::Integrator;
use crate::integrate::motion::ModeField;
use crate::mode::Mode;
use crate::switching::Leading;
use crate::tolerances::{LOOK_AHEAD, MAX_LIE_ORDER, MOST_TRIED, SURFACE_NOISE};

impl Integrator<'_> {
    /// What follows where two surfaces touch one another, without being in one place.
    pub(in crate::integrate) fn decide_where_two_touch(
        &mut self,
        mode: &Mode,
        meeting: &[usize],
    ) -> Result<Option<Decided>, FieldError> {
        match *meeting {
            [j, k] if self.touch_one_another(j, k, mode)? => self.decide_by_trial(mode, meeting),
            _ => Ok(None),
        }
    }

    /// The only mode, but for sliding on all of `meeting`, in which a motion goes on for a moment: it keeps to what it slides
    /// on, and to its sides of the others. `None` if there is none, or several.
    pub(in crate::integrate) fn decide_by_trial(
        &mut self,
        mode: &Mode,
        meeting: &[usize],
    ) -> Result<Option<Decided>, FieldError> {
        if meeting.len() > MOST_TRIED {
            return Ok(None);
        }
        let mut found: Option<(Mode, Lefts)> = None;
        let mut entries = vec![-1_i8; meeting.len()];
        loop {
            if entries.iter().any(|&entry| entry != 0) {
                let mut candidate = mode.clone();
                let pairs = meeting.iter().zip(&entries);
                pairs.for_each(|(&j, &entry)| candidate.set(j, entry));
                if let Some(left) = self.goes_on_in(&candidate, meeting)? {
                    if found.replace((candidate, left)).is_some() {
                        return Ok(None);
                    }
                }
            }
            let Some(place) = entries.iter().position(|&entry| entry < 1) else {
                return Ok(found.map(Ok));
            };
            entries[place] += 1;
            entries[..place].fill(-1);
        }
    }

    /// What a motion leaves that goes on in this mode for a moment, if it does.
    fn goes_on_in(
        &mut self,
        candidate: &Mode,
        meeting: &[usize],
    ) -> Result<Option<Lefts>, FieldError> {
        let leaving = meeting
            .iter()
            .copied()
            .filter(|&j| candidate.entries()[j] != 0);
        let leaving: Vec<usize> = leaving.collect();
        let moment = LOOK_AHEAD * (self.horizon - self.t);
        let mut values = [1.0, 0.5].map(|_| vec![0.0; leaving.len()]);
        for (share, values) in [1.0, 0.5].into_iter().zip(&mut values) {
            let Some(h) = self.surfaces_after(candidate, share * moment)? else {
                return Ok(None);
            };
            for (&j, value) in leaving.iter().zip(values) {
                let (h, size) = h[j];
                if h * f64::from(candidate.entries()[j]) <= SURFACE_NOISE * size {
                    return Ok(None);
                }
                *value = h;
            }
        }
        let [full, half] = values;
        let left = leaving
            .iter()
            .zip(full.iter().zip(half))
            .map(|(&j, (full, half))| {
                let order = (full / half)
                    .log2()
                    .round()
                    .clamp(1.0, MAX_LIE_ORDER as f64) as usize;
                let factorial: f64 = (1..=order).map(|k| k as f64).product();
                let value = factorial * full / moment.powi(order as i32);
                Left::Surface(j, Leading { order, value })
            });
        Ok(Some(left.collect()))
    }

    /// The switching functions, and their sizes, after some time of motion in a mode; `None` if its multipliers are beyond
    /// their ends.
    fn surfaces_after(
        &mut self,
        candidate: &Mode,
        time: f64,
    ) -> Result<Option<Vec<(f64, f64)>>, FieldError> {
        let (signs, law) = (candidate.signs(), self.options.into());
        let mut field = ModeField::of(self.system, law, candidate);
        let mut x = self.x.clone();
        let mut velocity = vec![0.0; x.len()];
        // The midpoint rule.
        for share in [0.5, 1.0] {
            let mut from = x.clone();
            let t = self.t + (share - 0.5) * time;
            field.eval(t, &mut from, &mut velocity)?;
            let pairs = x.iter_mut().zip(self.x.iter().zip(&velocity));
            pairs.for_each(|(x, (start, v))| *x = start + share * time * v);
            field.project(self.t + share * time, &mut x)?;
        }
        let exits = field.exits(self.t + time, &mut x)?;
        self.stats.n_field_evaluations += field.n_evaluations();
        if exits.iter().any(|exit| exit.is_nan() || *exit <= 0.0) {
            return Ok(None);
        }
        let mut h = vec![0.0; signs.len()];
        let t = self.t + time;
        self.system.surfaces(t, &x, &signs, &mut h)?;
        let sized = h.into_iter().enumerate().map(|(j, h)| {
            let size = self.system.surface_size(j, t, &x, &signs)?;
            Ok((h, size))
        });
        sized.collect::<Result<Vec<_>, FieldError>>().map(Some)
    }
}
