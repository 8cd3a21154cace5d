//! Limits of switches and of impacts that come faster and faster: jumped to, with what follows there.

use smallvec::{smallvec, SmallVec};

use crate::decisions::limits::{limit_of, reach, Limit};
use crate::decisions::{Cause, Decision};
use crate::error::FieldError;
use crate::field::{ContactField, Motion, Projector};
use crate::integrate::actions::instant::is_reset;
use crate::integrate::integrator::Integrator;
use crate::mode::Mode;
use crate::solution::Switch;
use crate::status::Stop;
use crate::switching::Kind;
use crate::system::dot;
use crate::tolerances::{IMPACTS_AGREE, SURFACE_NOISE, UNRESOLVED_FLIGHT};

/// The end of a sequence of impacts.
pub(in crate::integrate) struct Rest {
    t: f64,
    x: Vec<f64>,
    surface: usize,
}

impl Integrator<'_> {
    /// Where and when the last impacts end, if the speed after them is below what the tolerance resolves: of four
    /// impacts the three intervals shrink by ratios that agree, and the rest of the series is geometric. Its error
    /// is a multiple of the square of that speed. `first` is the first switch of this instant.
    pub(in crate::integrate) fn impacts_end(
        &self,
        first: usize,
        after: &Mode,
    ) -> Result<Option<Rest>, FieldError> {
        let switches = self.recorder.switches();
        let Some(last) = switches.get(first).filter(|_| switches.len() == first + 1) else {
            return Ok(None);
        };
        let &[j] = &last.surfaces[..] else {
            return Ok(None);
        };
        let departs = after.entries()[j] == self.triggers().side(j, None);
        if !is_reset(last)
            || !departs
            || !self.triggers().is_only_trigger(j)
            || self.motion.mode != *after
        {
            return Ok(None);
        }
        let signs = after.signs();
        let side = after.entries()[j];
        let (t, x) = (self.t, &self.x[..]);
        let mut row = vec![0.0; x.len()];
        let rate = self.system.rate_gradient(j, t, x, &signs, &mut row)?;
        let falls = self
            .system
            .lie_derivative(j, j, &[side, side], t, x, &signs)?;
        if falls.value * f64::from(side) >= 0.0 {
            return Ok(None);
        }
        let height = 0.5 * rate.rate * rate.rate / falls.value.abs();
        let size = self.system.surface_size(j, t, x, &signs)?;
        let is_unresolved = height <= UNRESOLVED_FLIGHT * SURFACE_NOISE * size;
        let distance = rate.rate.abs() / dot(&row, &row).sqrt();
        if !is_unresolved && distance >= reach(&self.scale, &self.x) {
            return Ok(None);
        }
        let here = Rest {
            t,
            x: x.to_vec(),
            surface: j,
        };
        Ok(match self.limit_of_impacts(switches, last) {
            Some(limit) if limit.t <= self.horizon => Some(limit),
            _ => is_unresolved.then_some(here),
        })
    }

    fn limit_of_impacts(&self, switches: &[Switch], last: &Switch) -> Option<Rest> {
        let (_, earlier) = switches.split_last()?;
        let [a, b, c] = earlier.last_chunk::<3>()?;
        let repeats = |s: &Switch| {
            is_reset(s) && s.surfaces == last.surfaces && s.mode_after == last.mode_after
        };
        if ![a, b, c].into_iter().all(repeats) {
            return None;
        }
        let intervals = [b.t - a.t, c.t - b.t, last.t - c.t];
        let (before, ratio) = (intervals[1] / intervals[0], intervals[2] / intervals[1]);
        let agree = (ratio - before).abs() <= IMPACTS_AGREE * (1.0 - ratio);
        if !(ratio > 0.0 && ratio < 1.0 && before < 1.0 && agree) {
            return None;
        }
        let share = ratio / (1.0 - ratio);
        let states = last.y_after.iter().zip(&c.y_after);
        Some(Rest {
            t: last.t + share * intervals[2],
            x: states.map(|(y, before)| y + share * (y - before)).collect(),
            surface: *last.surfaces.first()?,
        })
    }

    /// Moves to the end of the impacts and goes on from there.
    pub(in crate::integrate) fn come_to_rest(
        &mut self,
        rest: Rest,
        before: Mode,
    ) -> Result<Option<Stop>, FieldError> {
        let Rest { t, mut x, surface } = rest;
        let contact = before.with(surface, 0);
        let (sides, discrete) = (&self.motion.sides, &self.motion.discrete);
        if let Some(mut field) =
            ContactField::new(self.system, self.actions, &contact, sides, discrete)
        {
            field.project(t, &mut x)?;
        }
        if x.iter().any(|v| !v.is_finite()) {
            return Ok(Some(Stop::NotFinite));
        }
        self.recorder
            .begin_segment(self.t, &before, SmallVec::new(), &self.motion.discrete);
        self.motion.mode = before.clone();
        let y_before = x.clone();
        if t > self.t {
            self.move_straight(t, x)?;
        } else {
            self.x = x;
            self.recorder.jump(self.t, &self.x);
        }
        self.stats.n_switches += 1;
        let due = self.reached_beside(&before, surface)?;
        if !due.is_empty() {
            self.record_rest(y_before, surface, before.clone(), before.clone(), "");
            return self.act(due);
        }
        let Decision { rule, decided } = self.decide(Cause::Anew(&before))?;
        let next = match decided {
            Ok(next) => next,
            Err(stop) => return Ok(Some(stop)),
        };
        self.record_rest(y_before, surface, before, next.mode.clone(), rule.name());
        self.begin(next)
    }

    fn record_rest(
        &mut self,
        y_before: Vec<f64>,
        surface: usize,
        before: Mode,
        after: Mode,
        rule: &'static str,
    ) {
        self.recorder.switch(Switch {
            t: self.t,
            y_before: y_before.into(),
            y_after: SmallVec::from_slice(&self.x),
            kind: Kind::Accumulation,
            surfaces: smallvec![surface],
            mode_before: before,
            mode_after: after,
            note: String::new(),
            rule,
        });
    }

    /// The actions at other surfaces that the jump to the limit passed: the point is moved back onto them.
    fn reached_beside(&mut self, before: &Mode, surface: usize) -> Result<Vec<usize>, FieldError> {
        let signs = before.signs();
        let h = self.surface_values(&signs)?;
        let passed = (0..h.len()).filter(|&k| {
            let side = before.entries()[k];
            k != surface && self.triggers().is_only_trigger(k) && h[k] * f64::from(side) < 0.0
        });
        let passed: Vec<usize> = passed
            .filter(|&k| self.triggers().side(k, None) == before.entries()[k])
            .collect();
        if passed.is_empty() {
            return Ok(Vec::new());
        }
        let set: Vec<usize> = passed.iter().copied().chain([surface]).collect();
        let mut projector = Projector::new(self.x.len(), self.system.n_surfaces());
        projector.project_onto(self.system, &set, self.t, &mut self.x, &signs)?;
        self.recorder.jump(self.t, &self.x);
        self.motion
            .restart(self.system, self.t, before.clone(), &[]);
        let h = self.surface_values(&signs)?;
        self.note_residuals(&h, &set);
        let due = passed.iter().flat_map(|&k| {
            let side = before.entries()[k];
            self.triggered_at(k, side).collect::<Vec<_>>()
        });
        Ok(due.collect())
    }
}

impl Integrator<'_> {
    /// The limit that the last switches tend to, if they do and it is within the known times.
    pub(in crate::integrate) fn accumulation(&mut self) -> Result<Option<Limit>, FieldError> {
        if self.system.n_surfaces() < 2 {
            // Nothing can meet.
            return Ok(None);
        }
        let limit = self.ask(Cause::Start, |at, _| limit_of(at))?;
        Ok(limit.filter(|limit| limit.t <= self.horizon))
    }

    /// Moves to the limit and goes on from there.
    pub(in crate::integrate) fn jump_to(
        &mut self,
        limit: Limit,
        before: Mode,
    ) -> Result<Option<Stop>, FieldError> {
        self.recorder
            .begin_segment(self.t, &before, SmallVec::new(), &self.motion.discrete);
        self.motion.mode = before.clone();
        self.move_straight(limit.t, limit.x)?;
        self.stats.n_switches += 1;
        let Decision { rule, decided } = self.decide(Cause::Limit(&limit.meeting))?;
        // Where nothing is decided the run ends at the limit, having come there all the same.
        let after = decided.as_ref().map_or(&before, |next| &next.mode).clone();
        self.recorder.switch(Switch {
            t: self.t,
            y_before: SmallVec::from_slice(&self.x),
            y_after: SmallVec::from_slice(&self.x),
            kind: Kind::Accumulation,
            surfaces: limit.meeting.into(),
            mode_before: before,
            mode_after: after,
            note: String::new(),
            rule: rule.name(),
        });
        match decided {
            Ok(next) => self.begin(next),
            Err(stop) => Ok(Some(stop)),
        }
    }
}
