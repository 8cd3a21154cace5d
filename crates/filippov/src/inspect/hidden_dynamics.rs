//! The hidden dynamics at an intersection, as data for a picture.

use crate::cube::{is_stable_for, roots_in_cube, stable_roots, NormalFields};
use crate::mode::Mode;
use crate::switching::{limit_of_hidden_dynamics, HiddenOutcome};

/// A root of the normal components: a rest point of the hidden dynamics.
#[derive(Clone, Debug, PartialEq)]
pub struct HiddenRoot {
    /// The multipliers.
    pub lambda: Vec<f64>,
    /// Does it attract, with the surfaces scaled by the given kappa?
    pub is_stable: bool,
}

/// The hidden dynamics at an intersection.
#[derive(Clone, Debug, PartialEq)]
pub struct HiddenDynamics {
    /// Rest points within the cube.
    pub roots: Vec<HiddenRoot>,
    /// The state in which the motion before comes in; 0 without a motion before, `None` if that motion does not
    /// arrive or is not determined.
    pub incoming: Option<Vec<f64>>,
    /// What follows from the incoming state.
    pub outcome: Option<HiddenOutcome>,
}

/// Finds rest points, the incoming state and its limit for the scaling `kappa`.
///
/// `before` is the mode of the motion before, restricted to the surfaces that meet: zero entries are slid on,
/// the others are reached from the side of the entry. For a region the motion passes through the corner.
pub fn hidden_dynamics(
    fields: &NormalFields,
    before: Option<&Mode>,
    kappa: &[f64],
) -> HiddenDynamics {
    let root = |lambda: Vec<f64>| HiddenRoot {
        is_stable: is_stable_for(&fields.jacobian(&lambda), kappa),
        lambda,
    };
    let roots = roots_in_cube(fields).points.into_iter().map(root).collect();
    let incoming = match before {
        None => Some(vec![0.0; fields.m()]),
        Some(mode) => incoming_state(fields, mode.entries()),
    };
    let outcome = incoming
        .as_deref()
        .map(|u| limit_of_hidden_dynamics(fields, u, kappa));
    HiddenDynamics {
        roots,
        incoming,
        outcome,
    }
}

/// The multipliers of the surfaces slid on, and the sides of the others, if these are reached from there.
fn incoming_state(fields: &NormalFields, mode: &[i8]) -> Option<Vec<f64>> {
    let multipliers = stable_roots(&fields.restrict(mode)).into_iter().next()?;
    let mut next = multipliers.into_iter();
    let entry = |&k: &i8| match k {
        0 => next.next(),
        side => Some(f64::from(side)),
    };
    let state: Vec<f64> = mode.iter().filter_map(entry).collect();
    let g = fields.interpolate(&state);
    let arrives = |i: usize| mode[i] == 0 || state[i] * g[i] < 0.0;
    (0..mode.len()).all(arrives).then_some(state)
}
