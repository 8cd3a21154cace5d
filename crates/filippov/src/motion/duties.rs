//! What is asked of every motion: of a region, of sliding, of contact.

use smallvec::SmallVec;

use super::guard::Guards;
use super::SmoothField;
use crate::error::FieldError;

/// Values of the guards of sliding, or of contact: positive inside.
pub(crate) type Exits = SmallVec<[f64; 6]>;

/// The smooth field of a mode with what ends it. In a region nothing does but its surfaces, and there is nothing to be moved
/// onto: that is what the methods do that are not given.
///
/// Duties of an implementer, beside those of [`SmoothField`]:
///
/// 1. `guards` names what ends the motion beside the surfaces that it does not slide on; never another list for one motion.
/// 2. `last_exits` has their values at the last evaluation, in that order: positive inside, NaN where there is no field.
/// 3. `exits` and `exits_at` evaluate nothing else where their values cost less than the field.
/// 4. `multipliers` has those of the last evaluation, in the order of the surfaces slid on; none where there is no root.
/// 5. `project` leaves a point as it is where the motion is drawn back to its surfaces.
pub trait Motion: SmoothField {
    /// What ends the motion, beside the surfaces that it does not slide on.
    fn guards(&self) -> Guards {
        Guards::new()
    }

    /// The values of these guards at the last evaluation.
    fn last_exits(&self) -> &[f64] {
        &[]
    }

    /// The values at (t, x), after moving x onto the surfaces slid on.
    ///
    /// # Errors
    /// If a function of the user raises.
    fn exits(&mut self, t: f64, x: &mut [f64]) -> Result<Exits, FieldError> {
        self.eval(t, x, &mut vec![0.0; x.len()])?;
        Ok(self.last_exits().into())
    }

    /// The values at a point (t, x) of the surfaces slid on.
    ///
    /// # Errors
    /// If a function of the user raises.
    fn exits_at(&mut self, t: f64, x: &mut [f64]) -> Result<Exits, FieldError> {
        self.eval_unprojected(t, x, &mut vec![0.0; x.len()])?;
        Ok(self.last_exits().into())
    }

    /// The multipliers at the last evaluation, in the order of the surfaces slid on.
    fn multipliers(&self) -> SmallVec<[f64; 2]> {
        SmallVec::new()
    }

    /// Moves `x` onto the surfaces slid on.
    ///
    /// # Errors
    /// If a function of the user raises.
    fn project(&mut self, _: f64, _: &mut [f64]) -> Result<(), FieldError> {
        Ok(())
    }
}
