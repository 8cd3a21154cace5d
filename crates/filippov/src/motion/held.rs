//! What holds a motion on its surfaces: multipliers of sliding, and the accelerations that contacts give.

use super::{ContactField, IntersectionField, Motion, SlidingField, SmoothField};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::options::SlidingRule;
use crate::system::{dot_magnitude, Actions, PiecewiseSystem, Setting};
use crate::tolerances::{AT_SIDE, TANGENT};

/// What holds a motion on its surfaces at an instant.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Held {
    /// The surfaces slid on, increasing, with their multipliers; NaN where there is none.
    pub multipliers: Vec<(usize, f64)>,
    /// The surfaces slid on. Each has a number that replaces its sign in the field: its multiplier, times the ratio of static to
    /// kinetic friction where the motion sticks.
    pub signs: Vec<(usize, f64)>,
    /// The surfaces in contact, increasing, with the acceleration h'' away from the body's obstacle that each contact gives. Times
    /// the mass of the body it is the force of the contact.
    pub contacts: Vec<(usize, f64)>,
}

/// A motion of constant mode, as far as it determines what holds it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Piece {
    /// The mode.
    pub mode: Mode,
    /// The discrete states.
    pub discrete: Vec<f64>,
    /// The side of each surface on which the motion was last, 0 if it never was on one.
    pub sides: Vec<i8>,
    /// Multipliers of the surfaces slid on at the start of the piece: of several roots the motion follows the one near them.
    pub near: Vec<f64>,
    /// The state at its start, if it is known: rounding has the size of the largest states on the way.
    pub start: Vec<f64>,
}

impl Piece {
    /// What holds the motion at a point of it. Where surfaces meet it slides by this rule.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn held(
        &self,
        system: &dyn PiecewiseSystem,
        actions: &Actions<'_>,
        rule: SlidingRule,
        (t, y): (f64, &[f64]),
    ) -> Result<Held, FieldError> {
        let (mode, q) = (&self.mode, &self.discrete);
        let set: Vec<usize> = mode.sliding_set().collect();
        if set.is_empty() {
            return Ok(Held::default());
        }
        let mut y = y.to_vec();
        if !actions.list.is_empty() {
            let starts = actions.sides_at_start(mode.entries().len()).enumerate();
            let known = |j: usize| self.sides.get(j).copied().filter(|&side| side != 0);
            let sides: Vec<i8> = starts.map(|(j, start)| known(j).unwrap_or(start)).collect();
            if let Some(mut field) = ContactField::new(system, actions, mode, &sides, q) {
                field.eval(t, &mut y, &mut vec![0.0; system.n_states()])?;
                let contacts: Vec<_> = field.accelerations().collect();
                let all = set.into_iter().zip(field.multipliers());
                let slid_on = all.filter(|(j, _)| contacts.iter().all(|(k, _)| k != j));
                let multipliers = slid_on.map(|(j, value)| (j, as_multiplier(value)));
                let multipliers = multipliers.collect();
                return Ok(self.with_signs(system, (t, &y), multipliers, contacts));
            }
        }
        let system = system.reduced(&set).unwrap_or(system);
        let signs = mode.signs();
        let setting = Setting::new(&signs, q);
        let multipliers = match set.as_slice() {
            &[j] => vec![(j, self.on_one_surface(system, j, t, &mut y)?)],
            _ => {
                // The equations may have several roots: the motion follows one of them.
                let field = IntersectionField::new(system, &set, setting, &self.near);
                let mut field = field.with_rule(rule);
                field.eval(t, &mut y, &mut vec![0.0; system.n_states()])?;
                let values = field.multipliers().into_iter().map(as_multiplier);
                set.into_iter().zip(values).collect()
            }
        };
        Ok(self.with_signs(system, (t, &y), multipliers, Vec::new()))
    }

    fn with_signs(
        &self,
        system: &dyn PiecewiseSystem,
        (t, y): (f64, &[f64]),
        multipliers: Vec<(usize, f64)>,
        contacts: Vec<(usize, f64)>,
    ) -> Held {
        let signs = self.mode.signs();
        let place = Setting::new(&signs, &self.discrete).at(t, y);
        let sign = |&(j, lambda): &(usize, f64)| match system.sticks_at(j) {
            true => (j, lambda * system.stick_ratio(j, &place)),
            false => (j, lambda),
        };
        Held {
            signs: multipliers.iter().map(sign).collect(),
            multipliers,
            contacts,
        }
    }

    /// The multiplier of the one surface slid on. The state moves onto it.
    fn on_one_surface(
        &self,
        system: &dyn PiecewiseSystem,
        j: usize,
        t: f64,
        y: &mut [f64],
    ) -> Result<f64, FieldError> {
        let (mode, q) = (&self.mode, &self.discrete);
        let mut field = SlidingField::new(system, j, Setting::new(&mode.signs(), q));
        let components = field.normal_components(t, y)?;
        // At a two-fold from which sliding starts it is a quotient of two zeros, and known from the run.
        let lambda = match (components.minus - components.plus, &self.near[..]) {
            (0.0, &[known, ..]) => known,
            _ => as_multiplier(components.multiplier()),
        };
        // Near a two-fold it is a quotient of rounding errors, which are those of the largest states on the way.
        let share = (components.minus - components.plus).abs();
        let beyond = 0.5 * (lambda.abs() - 1.0) * share;
        if beyond > 0.0 {
            let (mut gradient, mut size, mut largest) = (y.to_vec(), 0.0, y.to_vec());
            let starts = self.start.iter().chain(std::iter::repeat(&0.0));
            for (largest, start) in largest.iter_mut().zip(starts) {
                *largest = largest.abs().max(start.abs());
            }
            for side in [-1, 1] {
                let signs = mode.with(j, side).signs();
                let place = Setting::new(&signs, q).at(t, y);
                let rate = system.rate_gradient(j, &place, &mut gradient)?;
                size += dot_magnitude(&gradient, &largest) + (rate.time * t).abs();
            }
            if beyond < TANGENT * size {
                return Ok(lambda.clamp(-1.0, 1.0));
            }
        }
        Ok(lambda)
    }
}

/// A multiplier as it is reported. At an exit rounding may carry it a little beyond one: it is reported as one. Where both
/// fields are tangent there is no multiplier: it is reported as NaN.
pub fn as_multiplier(lambda: f64) -> f64 {
    if !lambda.is_finite() {
        f64::NAN
    } else if lambda.abs() < 1.0 + 2.0 * AT_SIDE {
        lambda.clamp(-1.0, 1.0)
    } else {
        lambda
    }
}
