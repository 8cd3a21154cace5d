//! When is the hidden dynamics of many surfaces sure to stay on a face?

use crate::cube::is_stable;
use crate::cube::newton;
use crate::cube::NormalFields;
use crate::tolerances::{HIDDEN_OUTWARDS, HIDDEN_REST, HIDDEN_REST_REACH};

/// The multipliers at which the motion comes to rest on the face of these sides, if it is sure to
/// do so: the components within the transition move no more, Newton's method finds an attracting
/// rest point next to them, and there all clipped components move outwards.
pub(super) fn rest_on_face(
    fields: &NormalFields,
    sides: &[i8],
    lambda: &[f64],
    velocity: &[f64],
) -> Option<Vec<f64>> {
    let free: Vec<usize> = (0..sides.len()).filter(|&i| sides[i] == 0).collect();
    let rests = free.iter().all(|&i| velocity[i].abs() <= HIDDEN_REST);
    let leaves = |i: usize, v: f64| f64::from(sides[i]) * v > HIDDEN_OUTWARDS;
    let clipped_leave = |v: &[f64]| (0..sides.len()).all(|i| sides[i] == 0 || leaves(i, v[i]));
    if !rests || !clipped_leave(velocity) {
        return None;
    }
    let here: Vec<f64> = free.iter().map(|&i| lambda[i]).collect();
    let face = fields.restrict(sides);
    let root = newton(&face, &here)?;
    let near = root
        .iter()
        .zip(&here)
        .all(|(a, b)| (a - b).abs() <= HIDDEN_REST_REACH && a.abs() <= 1.0);
    let mut full = lambda.to_vec();
    for (&i, &value) in free.iter().zip(&root) {
        full[i] = value;
    }
    let attracts = is_stable(&face.jacobian(&root));
    (near && attracts && clipped_leave(&fields.interpolate(&full))).then_some(root)
}
