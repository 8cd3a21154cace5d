//! Fields and normal components of both sides of a surface.

use filippov_expr::{Graph, NodeId};

use super::{dot, PiecewiseSystem, Place};
use crate::error::FieldError;
use crate::system::{eval_off_surface, eval_on_side};

/// What sliding on one surface needs at a point: the fields of both sides with
/// their normal components. Also the scratch space for it.
#[derive(Clone, Debug)]
pub struct BothSides {
    /// dh_j/dt along the field of the side h < 0.
    pub normal_minus: f64,
    /// dh_j/dt along the field of the side h > 0.
    pub normal_plus: f64,
    /// The field of the side h < 0.
    pub f_minus: Vec<f64>,
    /// The field of the side h > 0.
    pub f_plus: Vec<f64>,
    gradient: Vec<f64>,
    signs: Vec<f64>,
    /// A field was not finite on its surface: from then on it is taken just inside at once.
    pub(super) meets_edges: bool,
    /// For a system that computes all at once.
    pub(super) outputs: Vec<f64>,
}

impl BothSides {
    /// Space for a system with n states and d surfaces.
    pub fn new(n: usize, d: usize) -> Self {
        BothSides {
            normal_minus: f64::NAN,
            normal_plus: f64::NAN,
            f_minus: vec![0.0; n],
            f_plus: vec![0.0; n],
            gradient: vec![0.0; n],
            signs: vec![0.0; d],
            meets_edges: false,
            outputs: vec![0.0; 2 + 2 * n],
        }
    }

    /// Forgets what was found out on the last surface.
    pub(crate) fn restart(&mut self) {
        self.meets_edges = false;
    }

    /// Fills everything from the field, the surfaces and the gradient of the system.
    pub(super) fn both_sides_by_parts<S: PiecewiseSystem + ?Sized>(
        &mut self,
        system: &S,
        j: usize,
        place: &Place<'_>,
    ) -> Result<u64, FieldError> {
        self.signs.copy_from_slice(place.signs);
        self.signs[j] = 1.0;
        let above = place.with_signs(&self.signs);
        let ht = system.gradient(j, &above, &mut self.gradient)?;
        let eval = if self.meets_edges {
            eval_off_surface
        } else {
            eval_on_side
        };
        let mut evaluations = eval(system, &above, &mut self.f_plus)?;
        self.signs[j] = -1.0;
        evaluations += eval(system, &place.with_signs(&self.signs), &mut self.f_minus)?;
        self.meets_edges |= evaluations > 2;
        self.normal_minus = ht + dot(&self.gradient, &self.f_minus);
        self.normal_plus = ht + dot(&self.gradient, &self.f_plus);
        Ok(evaluations)
    }

    /// Moves the fields from the signs -1 and +1 to -ratio and +ratio.
    pub(super) fn stretch(&mut self, ratio: f64) {
        let (near, far) = (0.5 * (1.0 + ratio), 0.5 * (1.0 - ratio));
        let apart = |minus: &mut f64, plus: &mut f64| {
            (*minus, *plus) = (near * *minus + far * *plus, far * *minus + near * *plus);
        };
        apart(&mut self.normal_minus, &mut self.normal_plus);
        for (minus, plus) in self.f_minus.iter_mut().zip(&mut self.f_plus) {
            apart(minus, plus);
        }
    }

    /// Are both normal components finite?
    pub fn is_finite(&self) -> bool {
        self.normal_minus.is_finite() && self.normal_plus.is_finite()
    }
}

/// Components at the signs -1 and +1 moved to -ratio and +ratio, as static friction above kinetic has them.
pub(super) fn stretched(
    graph: &mut Graph,
    [minus, plus]: [NodeId; 2],
    ratio: NodeId,
) -> [NodeId; 2] {
    let half = graph.constant(0.5);
    let (sum, difference) = (graph.add(minus, plus), graph.sub(plus, minus));
    let (middle, half_jump) = (graph.mul(half, sum), graph.mul(half, difference));
    let reach = graph.mul(ratio, half_jump);
    [graph.sub(middle, reach), graph.add(middle, reach)]
}
