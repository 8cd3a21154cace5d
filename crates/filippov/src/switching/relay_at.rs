//! The relay problem of a system at a point where surfaces meet.

use crate::cube::{solve_relay_within, stay_together, RelayProblem, RelaySolution, Uniqueness};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::patience::Patience;
use crate::system::{dot, PiecewiseSystem};
use crate::tolerances::AT_SIDE;

/// Solves the relay problem at a point where the surfaces of `meeting` vanish, with the entries of `mode` there as
/// the first guess. `None` if the field is not affine in their signs, or if no solution was found. Returns
/// also the number of evaluations of the right-hand side.
///
/// # Errors
/// If a function of the user raises.
pub fn relay_at(
    system: &dyn PiecewiseSystem,
    (t, x): (f64, &[f64]),
    mode: &Mode,
    meeting: &[usize],
    patience: Patience,
) -> Result<(Option<RelaySolution>, u64), FieldError> {
    let parts = system
        .affine_signs()
        .and_then(|affine| Some((affine, affine.affine_parts(meeting)?)));
    let Some((affine, mut parts)) = parts else {
        return Ok((None, 0));
    };
    let signs: Vec<f64> = mode.entries().iter().map(|&e| f64::from(e)).collect();
    let evaluations = parts.evaluate(affine, t, x, &signs)?;
    let before: Vec<i8> = meeting.iter().map(|&j| mode.entries()[j]).collect();
    let problem = RelayProblem {
        nu: parts.nu(),
        n: parts.normal().clone(),
        noise: system.lie_tolerance(1),
    };
    let mut found = solve_relay_within(&problem, &before, patience).ok();
    if let Some(solution) = &mut found {
        let speed = 1.0 + dot(&parts.field, &parts.field).sqrt();
        solution.may_be_tangent = (0..meeting.len()).any(|i| {
            let sum = |row: &mut dyn Iterator<Item = (usize, f64)>| {
                row.map(|(_, v)| v.abs()).sum::<f64>()
            };
            let size = problem.nu[i].abs() + sum(&mut problem.n.row(i));
            let normal = parts.time_rates[i].abs() + sum(&mut parts.gradients.row(i));
            size <= AT_SIDE * normal * speed
        });
    }
    if let Some(solution) = found.as_mut().filter(|found| found.n_sharing > 0) {
        let sticking: Vec<usize> = (0..meeting.len())
            .filter(|&i| solution.modes[i] == 0)
            .collect();
        if !stay_together(&problem.n, &parts.gradients, &sticking) {
            solution.uniqueness = Uniqueness::Unknown;
        }
    }
    Ok((found, evaluations))
}
