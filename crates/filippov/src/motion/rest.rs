//! Rest at a point that no motion leaves.

use smallvec::SmallVec;

use super::{Motion, SmoothField};
use crate::error::FieldError;

/// The state stays as it is. Nothing ends it but an action: the system does not depend on time.
#[derive(Clone)]
pub struct RestField {
    n_surfaces: usize,
}

impl RestField {
    /// Rest on so many surfaces.
    pub fn new(n_surfaces: usize) -> Self {
        RestField { n_surfaces }
    }
}

impl Motion for RestField {
    /// None of them is known: NaN.
    fn multipliers(&self) -> SmallVec<[f64; 2]> {
        SmallVec::from_elem(f64::NAN, self.n_surfaces)
    }
}

impl SmoothField for RestField {
    fn eval(&mut self, _: f64, _: &mut [f64], dx: &mut [f64]) -> Result<(), FieldError> {
        dx.fill(0.0);
        Ok(())
    }

    fn n_evaluations(&self) -> u64 {
        0
    }
}
