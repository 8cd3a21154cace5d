//! Meetings of surfaces where the field is affine in their signs: one relay problem, whatever their number.

use crate::error::FieldError;
use crate::event::EventFunction;
use crate::field::SmoothField;
use crate::integrate::decisions::transition::{Decided, Left, Lefts};
use crate::integrate::detection::detect::Found;
use crate::integrate::integrator::Integrator;
use crate::integrate::Stop;
use crate::mode::Mode;
use crate::switching::{relay_at, RelaySolution, Undecided, Uniqueness};
use crate::tolerances::{AT_SIDE, DRIFT_SHARE, MOST_IN_LOOP, MOST_MEETING};

impl Integrator<'_> {
    /// What follows where the surfaces of `meeting` vanish, if the field is affine in their signs and the relay
    /// problem has certainly one solution; for many surfaces also if that is not known, with a warning. `None`
    /// otherwise.
    ///
    /// Several surfaces may be reached and left at one instant. Where first-order data leave both open, as they do at the
    /// exit of a multiplier, they are taken a moment later along the motion that ends.
    pub(in crate::integrate) fn decide_by_relay(
        &mut self,
        event: Option<&Found>,
        mode: &Mode,
        meeting: &[usize],
    ) -> Result<Option<Decided>, FieldError> {
        // From a start on two surfaces the motion may also spiral outwards: their trees know. Between parallel ones it cannot.
        if event.is_none() && meeting.len() == 2 && !self.have_parallels(meeting, mode)? {
            return Ok(None);
        }
        let exits = event.is_some_and(|event| {
            let mut functions = event.functions.iter();
            functions.any(|f| {
                matches!(
                    f,
                    EventFunction::Exit(_) | EventFunction::ExitMinus | EventFunction::ExitPlus
                )
            })
        });
        let mut found = self.solve_relay_at(mode, meeting, exits)?;
        let is_degenerate = |found: &Option<RelaySolution>| {
            found
                .as_ref()
                .is_some_and(|found| !found.degenerate.is_empty())
        };
        if is_degenerate(&found) && event.is_some() && !exits {
            found = self.solve_relay_at(mode, meeting, true)?;
        }
        let Some(mut found) = found else {
            return Ok(None);
        };
        if found.n_sharing > MOST_IN_LOOP {
            return Ok(Some(Err(Stop::Intersection {
                surfaces: meeting.to_vec(),
                candidates: Vec::new(),
                reason: Undecided::TooRedundant { n: found.n_sharing },
            })));
        }
        if !found.degenerate.is_empty() {
            if event.is_none() {
                return Ok(None);
            }
            self.let_go(mode, meeting, &mut found);
        }
        let is_certain = match found.uniqueness {
            Uniqueness::Certain => true,
            // Surfaces may be parallel at a point only: those that stay together are so along the motion.
            Uniqueness::OfMotion if found.n_sharing > 0 && event.is_some() => {
                let later = self.solve_relay_at(mode, meeting, true)?;
                later.is_some_and(|later| {
                    (later.uniqueness, &later.modes) == (found.uniqueness, &found.modes)
                })
            }
            other => other == Uniqueness::OfMotion,
        };
        if !is_certain && meeting.len() <= MOST_MEETING {
            return Ok(None);
        }
        let mut after = mode.clone();
        let (mut multipliers, entries) = (Vec::new(), found.modes.iter().zip(&found.signs));
        for (&j, (&entry, &sign)) in meeting.iter().zip(entries) {
            after.set(j, entry);
            if entry == 0 {
                multipliers.push(sign);
            }
        }
        if !is_certain {
            match self.choose(meeting, after.clone(), vec![after.clone()]) {
                Ok(chosen) => after = chosen,
                Err(stop) => return Ok(Some(Err(stop))),
            }
        }
        let left = self.departures_caught(&mut after, meeting, &multipliers)?;
        Ok(Some(Ok((after, left))))
    }

    /// What the motion in `after` leaves; surfaces that it would pass to the wrong side are slid on instead.
    fn departures_caught(
        &mut self,
        after: &mut Mode,
        meeting: &[usize],
        multipliers: &[f64],
    ) -> Result<Lefts, FieldError> {
        let mut left = self.departures(after, meeting, multipliers)?;
        for _ in meeting {
            let is_wrong = |l: &&Left| match l {
                Left::Surface(j, leading) => leading.value * f64::from(after.entries()[*j]) <= 0.0,
                Left::Exit(..) => false,
            };
            let wrong: Vec<usize> = left.iter().filter(is_wrong).map(Left::surface).collect();
            if wrong.is_empty() {
                break;
            }
            wrong.iter().for_each(|&j| after.set(j, 0));
            left = self.departures(after, meeting, &[])?;
        }
        Ok(left)
    }

    /// Multipliers at their ends with rates that vanish: loads passed on from a contact that begins to slip. Those
    /// that slid until now and are at the same end let go too; if the load does not grow they are caught at
    /// once. All others stay as they are.
    fn let_go(&self, mode: &Mode, meeting: &[usize], found: &mut RelaySolution) {
        let multipliers = self.motion.multipliers();
        for &k in &found.degenerate {
            let j = meeting[k];
            let before = mode.entries()[j];
            let position = self.motion.sliding().binary_search(&j);
            let lambda = position.ok().and_then(|at| multipliers.get(at));
            let is_at_end = lambda.is_some_and(|l| (l - found.signs[k]).abs() <= AT_SIDE);
            found.modes[k] = match before {
                0 if is_at_end => {
                    if found.signs[k] < 0.0 {
                        -1
                    } else {
                        1
                    }
                }
                other => other,
            };
        }
    }

    /// The relay problem at the current point, or a moment later.
    fn solve_relay_at(
        &mut self,
        mode: &Mode,
        meeting: &[usize],
        later: bool,
    ) -> Result<Option<RelaySolution>, FieldError> {
        let (mut t, mut x) = (self.t, self.x.clone());
        if later {
            let mut velocity = vec![0.0; x.len()];
            self.motion.field.eval(t, &mut x, &mut velocity)?;
            let dt = DRIFT_SHARE * self.stepper.interpolant().dt;
            x.iter_mut().zip(&velocity).for_each(|(x, v)| *x += dt * v);
            t += dt;
        }
        let (found, evaluations) = relay_at(self.system, (t, &x), mode, meeting)?;
        self.stats.n_field_evaluations += evaluations;
        Ok(found)
    }
}
