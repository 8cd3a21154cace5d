//! Contact: which bodies stay, which leave, and what slides beside them.

use crate::error::FieldError;
use crate::event::EventFunction;
use crate::field::{ContactField, SmoothField};
use crate::integrate::decisions::transition::{Decided, Left, Lefts};
use crate::integrate::detection::detect::Found;
use crate::integrate::integrator::Integrator;
use crate::integrate::motion::ModeField;
use crate::integrate::Stop;
use crate::mode::Mode;
use crate::switching::Leading;
use crate::system::dot;
use crate::tolerances::{DRIFT_SHARE, MOST_IN_CONTACT, NO_GAP, VANISHING_MULTIPLIER};

/// An entry of the mode that is known before the decision: that of a multiplier that just vanished.
type Known = (usize, i8);

/// The field of a mode at the current point, if all of its multipliers are admissible.
struct Tried {
    velocity: Vec<f64>,
}

impl<'a> Integrator<'a> {
    /// An event while bodies are in contact, that triggers no action: a body leaves, or a surface of another kind
    /// is reached or left. `surfaces` vanish at the event.
    pub(in crate::integrate) fn decide_in_contact(
        &mut self,
        event: &Found,
        surfaces: &[usize],
    ) -> Result<Option<Stop>, FieldError> {
        let before = self.motion.mode.clone();
        let (contacts, mut meeting): (Vec<usize>, Vec<usize>) =
            before.sliding_set().partition(|&j| self.is_only_trigger(j));
        let mut mode = before.clone();
        for &j in surfaces {
            if self.is_only_trigger(j) {
                mode.set(j, -before.entries()[j]);
            } else {
                meeting.push(j);
            }
        }
        meeting.sort_unstable();
        let known = self.vanished(event);
        let (after, left) = match self.place_in_contact(mode, &contacts, &meeting, &known)? {
            Ok(decided) => decided,
            Err(stop) => return Ok(Some(stop)),
        };
        let changed = |j: &usize| before.entries()[*j] != after.entries()[*j];
        let mut concerned: Vec<usize> = (0..before.entries().len()).filter(changed).collect();
        if concerned.is_empty() {
            concerned = surfaces.to_vec();
        }
        self.record(before, after.clone(), &concerned);
        self.begin(after, &left)
    }

    /// The entries that follow from the exit functions that vanish at an event.
    fn vanished(&self, event: &Found) -> Vec<Known> {
        let ModeField::Contact(field) = &self.motion.field else {
            return Vec::new();
        };
        let contacts: Vec<usize> = field.contacts().collect();
        let entry = |function: &EventFunction| match *function {
            EventFunction::Exit(index) if index < contacts.len() => {
                Some((contacts[index], self.trigger_side(contacts[index], None)))
            }
            EventFunction::Exit(index) => {
                let (position, end) = ((index - contacts.len()) / 2, (index - contacts.len()) % 2);
                let side = if end == 0 { -1 } else { 1 };
                field.sliding().get(position).map(|&j| (j, side))
            }
            _ => None,
        };
        event.functions.iter().filter_map(entry).collect()
    }

    /// The mode where bodies touch without velocity (`contacts`) and other surfaces vanish (`meeting`): that with the
    /// most bodies in contact and surfaces slid on, of which all forces push and all multipliers are admissible.
    pub(in crate::integrate) fn place_in_contact(
        &mut self,
        mode: Mode,
        contacts: &[usize],
        meeting: &[usize],
        known: &[Known],
    ) -> Result<Decided, FieldError> {
        let all: Vec<usize> = contacts.iter().chain(meeting).copied().collect();
        if all.len() > MOST_IN_CONTACT {
            return Ok(Err(Stop::Contact { surfaces: all }));
        }
        let mut modes = vec![mode.clone()];
        for &j in &all {
            let entries = match known.iter().find(|(surface, _)| *surface == j) {
                Some(&(_, entry)) => vec![entry],
                None if contacts.contains(&j) => vec![0, self.trigger_side(j, None)],
                None => vec![0, -1, 1],
            };
            let extended =
                |mode: &Mode| entries.iter().map(|&e| mode.with(j, e)).collect::<Vec<_>>();
            modes = modes.iter().flat_map(extended).collect();
        }
        modes.sort_by_key(|mode| usize::MAX - mode.codimension());
        for tried in modes {
            let Some(Tried { velocity }) = self.try_mode(&tried)? else {
                continue;
            };
            if let Some(left) = self.leave(&tried, contacts, meeting, known, &velocity)? {
                return Ok(Ok((tried, left)));
            }
        }
        Ok(Err(Stop::Contact { surfaces: all }))
    }

    /// Evaluates the field of a mode at the current point.
    fn try_mode(&mut self, mode: &Mode) -> Result<Option<Tried>, FieldError> {
        let (mut x, mut velocity) = (self.x.clone(), vec![0.0; self.x.len()]);
        let mut field = self.field_of(mode);
        field.eval(self.t, &mut x, &mut velocity)?;
        self.stats.n_field_evaluations += field.n_evaluations();
        if matches!(&field, ModeField::Contact(field) if !field.presses()) {
            return Ok(None);
        }
        let exits = field.last_exits();
        let size = exits.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let is_admissible = exits.iter().all(|&v| v >= -VANISHING_MULTIPLIER * size)
            && velocity.iter().all(|v| v.is_finite());
        Ok(is_admissible.then_some(Tried { velocity }))
    }

    fn field_of(&self, mode: &Mode) -> ModeField<'a> {
        let (sides, discrete) = (&self.motion.sides, &self.motion.discrete);
        match ContactField::new(self.system, self.actions, mode, sides, discrete) {
            Some(field) => ModeField::Contact(Box::new(field)),
            None => ModeField::of(self.system, self.options.into(), mode),
        }
    }

    /// What vanishes at the start of a motion with this velocity; `None` if it does not lead to where the mode is.
    fn leave(
        &mut self,
        mode: &Mode,
        contacts: &[usize],
        meeting: &[usize],
        known: &[Known],
        velocity: &[f64],
    ) -> Result<Option<Lefts>, FieldError> {
        // Above the static limit the slipping motion has an acceleration at once.
        let is_known = |j: usize| {
            let ratio = self.system.stick_ratio(j, self.t, &self.x, &mode.signs());
            ratio <= 1.0 + NO_GAP && known.iter().any(|(surface, _)| *surface == j)
        };
        let vanishes: Vec<bool> = contacts
            .iter()
            .chain(meeting)
            .map(|&j| is_known(j))
            .collect();
        let mut left = Lefts::new();
        for (&j, vanishes) in contacts.iter().chain(meeting).zip(vanishes) {
            let entry = mode.entries()[j];
            if entry == 0 {
                continue;
            }
            let order = 1 + usize::from(contacts.contains(&j));
            let mut leading = Leading {
                order,
                value: self.derivative_along(j, order, mode, velocity, 0.0)?,
            };
            if vanishes {
                // This derivative just vanished: the next one.
                let dt = DRIFT_SHARE * self.stepper.interpolant().dt;
                let later = self.derivative_along(j, order, mode, velocity, dt)?;
                leading = Leading {
                    order: order + 1,
                    value: (later - leading.value) / dt,
                };
            }
            if leading.value * f64::from(entry) < 0.0 {
                return Ok(None);
            }
            if leading.value == 0.0 {
                // Nothing moves the bodies together or apart.
                leading.order = 0;
            }
            left.push(Left::Surface(j, leading));
        }
        Ok(Some(left))
    }

    /// The first or second derivative of h_j along the motion of a mode, a time `dt` later.
    fn derivative_along(
        &mut self,
        j: usize,
        order: usize,
        mode: &Mode,
        velocity: &[f64],
        dt: f64,
    ) -> Result<f64, FieldError> {
        let t = self.t + dt;
        let moved = self.x.iter().zip(velocity).map(|(x, v)| x + dt * v);
        let mut x: Vec<f64> = moved.collect();
        let mut later = velocity.to_vec();
        if dt > 0.0 {
            self.field_of(mode).eval(t, &mut x, &mut later)?;
        }
        let (mut row, signs) = (vec![0.0; x.len()], mode.signs());
        let time = if order == 1 {
            self.system.gradient(j, t, &x, &signs, &mut row)?
        } else {
            let rate = self.system.rate_gradient(j, t, &x, &signs, &mut row)?;
            rate.time
        };
        Ok(time + dot(&row, &later))
    }

    /// A motion in a region, or sliding, that passes surfaces of triggers in the other direction while further
    /// surfaces vanish.
    pub(in crate::integrate) fn cross_beside_triggers(
        &mut self,
        surfaces: &[usize],
    ) -> Result<Option<Stop>, FieldError> {
        let before = self.motion.mode.clone();
        let mut mode = before.clone();
        for &j in surfaces.iter().filter(|&&j| self.is_only_trigger(j)) {
            mode.set(j, -before.entries()[j]);
        }
        let (after, left) = match self.place(Some(&mode))? {
            Ok(decided) => decided,
            Err(stop) => return Ok(Some(stop)),
        };
        self.residuals.clear();
        let changed = |j: &usize| before.entries()[*j] != after.entries()[*j];
        let concerned: Vec<usize> = (0..before.entries().len()).filter(changed).collect();
        self.record(before, after.clone(), &concerned);
        self.begin(after, &left)
    }
}
