//! Bounds of monitored functions along pieces of the step.

use std::cell::Cell;

use filippov_expr::Enclosure;

use super::detect::Detector;
use super::integrator::Integrator;
use crate::error::FieldError;
use crate::event::certificate::{is_clear, Bound};
use crate::event::isolate::PROBES;
use crate::event::tube::Tube;
use crate::event::{EventFunction, Monitored};
use crate::stepper::Interpolant;
use crate::system::PiecewiseSystem;
use crate::tolerances::{MARGIN, PROOF_DEPTH};

/// The continuous extension of a step, as far as it bounds what is monitored.
pub(super) struct BoundedCurve<'a> {
    pub system: &'a dyn PiecewiseSystem,
    pub interpolant: &'a Interpolant,
    pub signs: &'a [f64],
    pub sliding: &'a [usize],
    /// How far the projection onto a curved surface moves the extension.
    pub margin: &'a [f64],
    /// The normal components on the last piece of this extension: they are asked for one after the other.
    pub last: &'a Cell<Option<Piece>>,
}

/// A piece with the bounds of both normal components.
pub(super) type Piece = (f64, f64, [Enclosure; 2]);

impl BoundedCurve<'_> {
    /// The bounds of a function from theta = `a` to `b`, if the system can give any.
    pub fn over(&self, m: &Monitored, a: f64, b: f64) -> Option<Bound> {
        // An exit function is positive inside as it is, that of f+ with its sign changed.
        let (enclosure, orientation) = match (m.function, self.sliding) {
            (EventFunction::Surface(j), _) => {
                let tube = Tube::new(self.interpolant, (a, b), self.margin);
                let enclosure = self.system.enclose_surface(j, &tube, self.signs)?;
                (enclosure, m.orientation)
            }
            (EventFunction::ExitMinus, &[j]) => (self.normal_components(j, a, b)?[0], 1.0),
            (EventFunction::ExitPlus, &[j]) => (self.normal_components(j, a, b)?[1], -1.0),
            _ => return None,
        };
        Some(Bound::new(enclosure, orientation, self.interpolant.dt))
    }

    fn normal_components(&self, j: usize, a: f64, b: f64) -> Option<[Enclosure; 2]> {
        if let Some((_, _, known)) = self.last.get().filter(|last| (last.0, last.1) == (a, b)) {
            return Some(known);
        }
        let tube = Tube::new(self.interpolant, (a, b), self.margin);
        let components = self
            .system
            .enclose_normal_components(j, &tube, self.signs)?;
        self.last.set(Some((a, b, components)));
        Some(components)
    }
}

impl Integrator<'_> {
    /// Do bounds over the step prove that a function has no zero in it? `None`: there are no bounds.
    pub(super) fn prove_clear(&self, index: usize, value_at_end: f64) -> Option<bool> {
        let m = self.motion.monitored[index];
        let curve = BoundedCurve {
            system: self.system,
            interpolant: self.stepper.interpolant(),
            signs: &self.motion.signs,
            sliding: self.motion.sliding(),
            margin: &self.detector.margin,
            last: &self.detector.enclosed_exits,
        };
        // Next to a zero that is divided out the function itself may only rise.
        let at_start = if m.deflation.is_some() {
            f64::INFINITY
        } else {
            m.value
        };
        is_clear(
            &mut |a, b| curve.over(&m, a, b),
            at_start,
            value_at_end,
            m.noise,
            PROOF_DEPTH,
        )
    }

    /// How far the motion lies beside the continuous extension, from the probes of the step.
    pub(super) fn measure_margin(&mut self, dt: f64) -> Result<(), FieldError> {
        let Detector { margin, x, .. } = &mut self.detector;
        let is_curved = self
            .motion
            .sliding()
            .iter()
            .any(|&j| !self.system.is_affine(j));
        if !is_curved {
            return Ok(());
        }
        margin.resize(x.len(), 0.0);
        let mut moved = x.clone();
        for theta in PROBES {
            self.stepper.interpolant().at(theta, x);
            moved.copy_from_slice(x);
            self.motion.project(self.t + theta * dt, &mut moved)?;
            for ((margin, x), moved) in margin.iter_mut().zip(&*x).zip(&moved) {
                *margin = margin.max(MARGIN * (moved - x).abs());
            }
        }
        Ok(())
    }
}
