//! Surfaces in the place of one another: which of them decides, and what the others do.
//!
//! A kink, as of `abs` or `maximum`, is a surface on whose sign the field does not depend while the point is on it. Where it is
//! in the place of another surface, as `x` beside `x + x*abs(x)` or both arguments of a maximum that vanish together, it has no
//! multiplier: the other one decides, and the kink goes with it.

use crate::error::FieldError;
use crate::event::{EventFunction, Monitored};
use crate::field::Projector;
use crate::integrate::decisions::transition::{Decided, Left, Lefts};
use crate::integrate::integrator::Integrator;
use crate::mode::Mode;
use crate::switching::{decide, first_nonzero, Arrival, Leading};
use crate::system::dot;
use crate::tolerances::{BESIDE, COINCIDE, MOST_MEETING, TANGENT};

/// A kink in the place of another surface.
struct Kink {
    surface: usize,
    /// The surface that decides.
    beside: usize,
}

impl Integrator<'_> {
    /// Those of `meeting` that are kinks in the place of others of it.
    fn coinciding_kinks(
        &mut self,
        mode: &Mode,
        meeting: &[usize],
    ) -> Result<Vec<Kink>, FieldError> {
        let mut kinks: Vec<Kink> = Vec::new();
        if !(2..=MOST_MEETING).contains(&meeting.len()) || !self.have_parallels(meeting, mode)? {
            return Ok(kinks);
        }
        let corners = self.corners(meeting, mode)?;
        let free = (0..meeting.len()).filter(|&place| !corners.depends_on(place));
        let free: Vec<usize> = free.map(|place| meeting[place]).collect();
        for &j in meeting {
            let is_kink = |k: usize| kinks.iter().any(|kink| kink.surface == k);
            if is_kink(j) {
                continue;
            }
            let is_open = |k: usize| {
                let decides = kinks.iter().any(|kink| kink.beside == k);
                k != j && !is_kink(k) && !decides
            };
            let others: Vec<usize> = free.iter().copied().filter(|&k| is_open(k)).collect();
            let found = self.in_the_place_of(j, &others, mode)?;
            kinks.extend(found.into_iter().map(|surface| Kink { surface, beside: j }));
        }
        self.motion.meets_kinks |= !kinks.is_empty();
        Ok(kinks)
    }

    /// Have two of the surfaces the same normal, or has one none?
    pub(in crate::integrate) fn have_parallels(
        &self,
        meeting: &[usize],
        mode: &Mode,
    ) -> Result<bool, FieldError> {
        let rows = meeting.iter().map(|&j| self.normal(j, mode));
        let rows: Vec<Vec<f64>> = rows.collect::<Result<_, _>>()?;
        let pairs = (0..rows.len()).flat_map(|j| (0..j).map(move |k| (j, k)));
        let mut pairs = pairs.map(|(j, k)| parallel(&rows[j], &rows[k]));
        Ok(pairs.any(|parallel| parallel))
    }

    /// Have two surfaces the same normal here, without being in one place?
    pub(in crate::integrate) fn touch_one_another(
        &mut self,
        j: usize,
        k: usize,
        mode: &Mode,
    ) -> Result<bool, FieldError> {
        let are_parallel = self.have_parallels(&[j, k], mode)?;
        Ok(are_parallel && self.in_the_place_of(j, &[k], mode)?.is_empty())
    }

    /// The meeting without its kinks, decided by `decide`, or by one surface where only that is left; `None` where
    /// there are no kinks.
    pub(in crate::integrate) fn decide_without_kinks(
        &mut self,
        mode: &Mode,
        meeting: &[usize],
        decide_others: impl FnOnce(&mut Self, &[usize]) -> Result<Decided, FieldError>,
    ) -> Result<Option<Decided>, FieldError> {
        let kinks = self.coinciding_kinks(mode, meeting)?;
        if kinks.is_empty() {
            return Ok(None);
        }
        let is_kink = |j: usize| kinks.iter().any(|kink| kink.surface == j);
        let others: Vec<usize> = meeting.iter().copied().filter(|&j| !is_kink(j)).collect();
        let decided = match *others {
            [j] => {
                let arrival = match mode.entries()[j] {
                    0 => Arrival::Start,
                    side => Arrival::Region(side),
                };
                let decision = decide(self.system, j, arrival, self.t, &self.x, &mode.signs())?;
                self.follow_at_surface(mode, j, decision)
            }
            _ => decide_others(self, &others)?,
        };
        self.take_along(&kinks, decided).map(Some)
    }

    /// The decision of the others, with the kinks in their places.
    fn take_along(&self, kinks: &[Kink], decided: Decided) -> Result<Decided, FieldError> {
        let Ok((mut after, mut left)) = decided else {
            return Ok(decided);
        };
        for &Kink { surface, beside } in kinks {
            if after.entries()[beside] != 0 {
                self.leave_together(beside, surface, &mut after, &mut left)?;
            } else if after.entries()[surface] == 0 {
                after.set(surface, 1);
            }
        }
        Ok(Ok((after, left)))
    }

    /// The surfaces that are in the place of those slid on: they vanish all along the motion, and are no events.
    pub(in crate::integrate) fn rest_on_coinciding(&mut self) -> Result<(), FieldError> {
        if !(self.system.has_nested_signs() || self.motion.meets_kinks) {
            return Ok(());
        }
        let mode = self.motion.mode.clone();
        for j in self.motion.sliding.clone() {
            let active = (0..self.motion.active.len()).filter(|&k| self.motion.active[k]);
            let others: Vec<usize> = active.filter(|&k| mode.entries()[k] != 0).collect();
            for k in self.in_the_place_of(j, &others, &mode)? {
                if !self.motion.resting.contains(&k) {
                    self.motion.resting.push(k);
                    let is_other = |m: &Monitored| m.function != EventFunction::Surface(k);
                    self.motion.monitored.retain(is_other);
                }
            }
        }
        Ok(())
    }

    /// Those of `others` whose functions vanish where that of surface j does, around the current point.
    fn in_the_place_of(
        &mut self,
        j: usize,
        others: &[usize],
        mode: &Mode,
    ) -> Result<Vec<usize>, FieldError> {
        // Beside the current point, so that surfaces that only touch are told apart.
        let t = self.t + BESIDE * (1.0 + self.t.abs());
        let shifts = (0..self.x.len()).map(|i| BESIDE * (1.0 + 1.0 / (2.0 + i as f64)));
        let pairs = self.x.iter().zip(shifts);
        let mut beside: Vec<f64> = pairs.map(|(x, d)| x + d * (1.0 + x.abs())).collect();
        let (signs, mut h) = (mode.signs(), vec![0.0; mode.entries().len()]);
        let mut projector = Projector::new(beside.len(), h.len());
        projector.project(self.system, j, t, &mut beside, &signs)?;
        self.system.surfaces(t, &beside, &signs, &mut h)?;
        let here = self.surface_values(&signs)?;
        let (mut found, mut gradient) = (Vec::new(), vec![0.0; beside.len()]);
        for &k in others {
            let rate = self.system.gradient(k, t, &beside, &signs, &mut gradient)?;
            let size = rate.abs() + gradient.iter().fold(0.0_f64, |sum, g| sum + g.abs());
            // One with a multiple zero has no gradient there.
            if h[k].abs().max(here[k].abs()) <= COINCIDE * size {
                found.push(k);
            }
        }
        Ok(found)
    }

    /// The sides of the surfaces that the motion rested on, after a switch.
    pub(in crate::integrate) fn leave_coinciding(
        &mut self,
        (mut after, mut left): (Mode, Lefts),
    ) -> Result<(Mode, Lefts), FieldError> {
        if !(self.system.has_nested_signs() || self.motion.meets_kinks) {
            return Ok((after, left));
        }
        let is_left = |j: &usize| after.entries()[*j] != 0;
        let sliding = self.motion.sliding().iter().copied();
        let leaving: Vec<usize> = sliding.filter(is_left).collect();
        for k in self.motion.resting.clone() {
            for &j in &leaving {
                let is_known = left.iter().any(|left| left.surface() == k);
                let is_there = || -> Result<bool, FieldError> {
                    Ok(parallel(&self.normal(j, &after)?, &self.normal(k, &after)?))
                };
                if !is_known && is_there()? {
                    self.leave_together(j, k, &mut after, &mut left)?;
                }
            }
        }
        Ok((after, left))
    }

    /// Surface k is left as surface j is, which is in the same place.
    fn leave_together(
        &self,
        j: usize,
        k: usize,
        after: &mut Mode,
        left: &mut Lefts,
    ) -> Result<(), FieldError> {
        let leading = left.iter().find_map(|left| match left {
            Left::Surface(of, leading) if *of == j => Some(*leading),
            _ => None,
        });
        let Some(Leading { order, value }) = leading else {
            return Ok(());
        };
        let (known, other) = (self.normal(j, after)?, self.normal(k, after)?);
        let ratio = dot(&known, &other) / dot(&known, &known);
        let mut leading = Leading {
            order,
            value: ratio * value,
        };
        if leading.value == 0.0 && after.codimension() == 0 {
            // A multiple zero.
            let (side, signs) = (after.entries()[k], after.signs());
            leading = first_nonzero(self.system, k, side, 1, self.t, &self.x, &signs)?;
        }
        if leading.value.is_finite() && leading.value != 0.0 {
            after.set(k, leading.sign());
            left.push(Left::Surface(k, leading));
        }
        Ok(())
    }

    /// The normal of a surface in time and space: the gradient, then the derivative in time.
    fn normal(&self, j: usize, mode: &Mode) -> Result<Vec<f64>, FieldError> {
        let (signs, n) = (mode.signs(), self.x.len());
        let mut row = vec![0.0; n + 1];
        row[n] = self
            .system
            .gradient(j, self.t, &self.x, &signs, &mut row[..n])?;
        Ok(row)
    }
}

/// Are two normals the same, up to their lengths, or is one zero?
fn parallel(one: &[f64], other: &[f64]) -> bool {
    let (product, squares) = (dot(one, other), dot(one, one) * dot(other, other));
    squares - product * product <= TANGENT * squares
}
