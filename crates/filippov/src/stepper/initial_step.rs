//! The first step size.

use super::ErrorScale;
use crate::error::FieldError;
use crate::motion::SmoothField;
use crate::powers::power;
use crate::tolerances::{EPS, GUESS_ROUNDINGS, SMALLEST_GUESS};

/// Hairer's guess of the first step of a method of order 5, from two derivatives.
///
/// Costs one evaluation. Reference: Hairer, Norsett, Wanner (1993), section II.4.
///
/// # Errors
/// If a function of the user raises.
pub fn initial_step(
    field: &mut dyn SmoothField,
    t: f64,
    y: &[f64],
    dy: &[f64],
    scale: &ErrorScale,
    longest: f64,
) -> Result<f64, FieldError> {
    let d0 = scale.norm(y, y);
    let d1 = scale.norm(dy, y);
    let guess = if d0 < 1e-5 || d1 < 1e-5 {
        1e-6
    } else {
        0.01 * d0 / d1
    };
    let shortest = shortest_guess(t);
    let guess = guess.max(shortest).min(longest);
    let mut moved: Vec<f64> = y.iter().zip(dy).map(|(y, dy)| y + guess * dy).collect();
    let mut dy_moved = vec![0.0; y.len()];
    field.eval(t + guess, &mut moved, &mut dy_moved)?;
    let change: Vec<f64> = dy_moved.iter().zip(dy).map(|(a, b)| a - b).collect();
    let d2 = scale.norm(&change, y) / guess;
    if !d2.is_finite() {
        return Ok(guess);
    }
    let fastest = d1.max(d2);
    let step = if fastest <= 1e-15 {
        (guess * 1e-3).max(1e-6)
    } else {
        power(0.01 / fastest, 0.2)
    };
    let step = step.min(100.0 * guess).max(shortest);
    Ok(step.min(longest))
}

/// The first step after a restart: at most `proposal`, the step of the motion before, and at most what
/// two derivatives of the new field support.
///
/// Hairer's rule aims at a hundredth of the tolerance; a restart may go 10^(2/5) further, because the
/// proposal comes from error control. Costs one evaluation.
///
/// # Errors
/// If a function of the user raises.
pub fn restart_step(
    field: &mut dyn SmoothField,
    t: f64,
    y: &[f64],
    dy: &[f64],
    scale: &ErrorScale,
    proposal: f64,
) -> Result<f64, FieldError> {
    let d0 = scale.norm(y, y);
    let d1 = scale.norm(dy, y);
    let probe = if d0 < 1e-5 || d1 < 1e-5 {
        0.01 * proposal
    } else {
        (0.01 * d0 / d1).min(proposal)
    };
    let mut moved: Vec<f64> = y.iter().zip(dy).map(|(y, dy)| y + probe * dy).collect();
    let mut dy_moved = vec![0.0; y.len()];
    field.eval(t + probe, &mut moved, &mut dy_moved)?;
    let change: Vec<f64> = dy_moved.iter().zip(dy).map(|(a, b)| a - b).collect();
    let fastest = d1.max(scale.norm(&change, y) / probe);
    if !fastest.is_finite() || fastest <= 1e-15 {
        return Ok(proposal);
    }
    Ok(proposal.min(power(0.1 / fastest, 0.2).max(shortest_guess(t))))
}

/// The shortest first step that is guessed: in large units of time Hairer's rules would fall below the rounding of the time.
fn shortest_guess(t: f64) -> f64 {
    SMALLEST_GUESS.max(GUESS_ROUNDINGS * EPS * t.abs())
}

/// As the guess of [`initial_step`] without its evaluation, and aiming at a thousandth of the tolerance
/// instead of a hundredth: a step whose error is negligible for any but a very fast field. Zero for a
/// field at rest, which says nothing (Hairer's limit).
pub fn tiny_step(y: &[f64], dy: &[f64], scale: &ErrorScale) -> f64 {
    let speed = scale.norm(dy, y);
    if speed < 1e-5 {
        0.0
    } else {
        power(0.001 / speed, 0.2)
    }
}
