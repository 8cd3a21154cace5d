//! Bounds of a monitored function along pieces of the step.

use crate::event::certificate::Bound;
use crate::event::tube::Tube;
use crate::event::{EventFunction, Monitored};
use crate::stepper::Interpolant;
use crate::system::PiecewiseSystem;

/// What is needed to bound a monitored function along the continuous extension.
pub(super) struct BoundedCurve<'a> {
    pub system: &'a dyn PiecewiseSystem,
    pub interpolant: &'a Interpolant,
    pub signs: &'a [f64],
    pub sliding: Option<usize>,
    /// How far the projection onto a curved surface moves the extension.
    pub margin: &'a [f64],
    pub monitored: Monitored,
}

impl BoundedCurve<'_> {
    /// The bounds from theta = `a` to `b`, if the system can give any.
    pub fn over(&self, a: f64, b: f64) -> Option<Bound> {
        let tube = Tube::new(self.interpolant, (a, b), self.margin);
        let enclosure = match (self.monitored.function, self.sliding) {
            (EventFunction::Surface(j), _) => self.system.enclose_surface(j, &tube, self.signs),
            (EventFunction::ExitMinus, Some(j)) => {
                let components = self.system.enclose_normal_components(j, &tube, self.signs);
                components.map(|[minus, _]| minus)
            }
            (EventFunction::ExitPlus, Some(j)) => {
                let components = self.system.enclose_normal_components(j, &tube, self.signs);
                components.map(|[_, plus]| plus)
            }
            (_, None) => None,
        };
        // An exit function is positive inside as it is, that of f+ with its sign changed.
        let orientation = match self.monitored.function {
            EventFunction::Surface(_) | EventFunction::ExitMinus => self.monitored.orientation,
            EventFunction::ExitPlus => -self.monitored.orientation,
        };
        enclosure.map(|e| Bound::new(e, orientation, self.interpolant.dt))
    }
}
