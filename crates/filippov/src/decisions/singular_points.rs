//! Singular points of a surface: the gradient of its function vanishes there, and branches of it may meet, as those of x y at
//! the origin.

use super::point::{Cause, Decided, Notes, Point};
use crate::error::FieldError;
use crate::status::{Warning, WarningCode};
use crate::tolerances::ERRORS_OF_STEPS;

/// Adds a warning to what was decided after an event at a singular point of a surface: errors of the state decide which branch
/// the motion meets. There is nothing to choose, so that `nonunique="error"` does not end the run.
pub(super) fn doubt_at_singular_points(
    at: &Point,
    notes: &mut Notes,
    fresh: &[usize],
    decided: Decided,
) -> Result<Decided, FieldError> {
    let sliding = at.arrival.sliding;
    let is_touch = matches!(at.arrival.cause, Cause::Event { touch: true, .. });
    let is_doubted = |warning: &Warning| warning.code == WarningCode::NonUnique;
    // A surface that is crossed alone is reached on one branch.
    let is_on_one = sliding.is_empty() && fresh.len() < 2;
    if is_touch || is_on_one || notes.warnings.iter().any(is_doubted) {
        return Ok(decided);
    }
    let Ok(next) = &decided else {
        return Ok(decided);
    };
    for &j in fresh.iter().chain(sliding) {
        if !is_singular(at, j)? {
            continue;
        }
        notes.warnings.push(Warning {
            t: at.t,
            code: WarningCode::NonUnique,
            surfaces: vec![j],
            text: format!(
                "{} = 0 has no tangent here: branches of it meet within errors of the state, which decide how the motion goes \
                 on. The sign of a product is better written as the product of the signs, np.sign(a)*np.sign(b), so that each \
                 branch has a surface of its own",
                at.system.surface_name(j)
            ),
            candidates: vec![next.mode.clone()],
            rule: "",
        });
    }
    Ok(decided)
}

/// Does the gradient of h_j vanish within errors of the state? It changes by half of itself there, and about linearly: that of a
/// root, which has no bounds, does not.
fn is_singular(at: &Point, j: usize) -> Result<bool, FieldError> {
    if at.system.is_affine(j) {
        return Ok(false);
    }
    let (x, signs) = (at.x, at.arrival.signs);
    let gradient = |share: f64| -> Result<Vec<f64>, FieldError> {
        let errors = (0..x.len()).map(|i| share * at.scale.tolerance(i, x[i], x[i]));
        let moved: Vec<f64> = x.iter().zip(errors).map(|(x, error)| x + error).collect();
        let mut found = vec![0.0; x.len()];
        let place = at.place_at(at.t, &moved, signs);
        at.system.gradient(j, &place, &mut found)?;
        Ok(found)
    };
    let here = gradient(0.0)?;
    let (below, above) = (gradient(-ERRORS_OF_STEPS)?, gradient(ERRORS_OF_STEPS)?);
    let size = |of: &dyn Fn(usize) -> f64| {
        let found: Vec<f64> = (0..x.len()).map(of).collect();
        at.scale.along(&found, x)
    };
    let change = size(&|i| above[i] - below[i]);
    let bend = size(&|i| above[i] + below[i] - 2.0 * here[i]);
    Ok(change > size(&|i| here[i]) && bend < 0.5 * change)
}
