//! The trial: follow a mode for a moment if no germ of its guards is known.
//!
//! So it is with functions that are called, and where two surfaces touch: seen from the point they are one, and a moment later
//! they are two, in an order that decides.

use super::point::{Left, Lefts, Next, Notes, Point};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::motion::{Guard, Leading, ModeField, SmoothField};
use crate::system::{dot, eval_on_side};
use crate::tolerances::{AT_SIDE, MAX_LIE_ORDER, ROUNDING, TRIALS};

/// Follows a motion for a moment, and longer until it is clear of rounding: of `noise` times its way.
pub(super) fn try_mode(
    at: &Point,
    notes: &mut Notes,
    next: &Next,
    meeting: &[usize],
    noise: f64,
) -> Result<Trial, FieldError> {
    let entries = next.mode.entries();
    let leaving: Vec<usize> = meeting
        .iter()
        .copied()
        .filter(|&j| entries[j] != 0)
        .collect();
    let velocity = at.velocity_from(notes, &next.mode, next.start.as_deref())?;
    let ends = ends_reached(next);
    if velocity.iter().any(|v| !v.is_finite()) {
        return Ok(Trial::WithinRounding);
    }
    let speed = largest_speed(at, notes, &next.mode, &leaving, &velocity)?;
    let moment = at.moment(notes, &next.mode.signs(), &velocity)?;
    for length in TRIALS {
        let trial = leaves_within(
            at,
            notes,
            next,
            (&leaving, &ends),
            (&velocity, speed),
            (length * moment, noise),
        )?;
        if !matches!(trial, Trial::WithinRounding) {
            return Ok(trial);
        }
    }
    Ok(Trial::WithinRounding)
}

/// The ends at which given multipliers begin, with their places among the exit functions.
fn ends_reached(next: &Next) -> Vec<(usize, Guard)> {
    let given = next.start.iter().filter(|start| start.is_given);
    let multipliers = given.flat_map(|start| &start.multipliers);
    let reserves = multipliers.flat_map(|l| [1.0 + l, 1.0 - l]);
    let guards = next.mode.sliding_set().flat_map(Guard::ends);
    let ends = guards.zip(reserves).enumerate();
    let reached = ends.filter(|(_, (_, reserve))| *reserve <= AT_SIDE);
    reached.map(|(place, (guard, _))| (place, guard)).collect()
}

/// The largest speed beside these surfaces: forces that cancel on one side of a surface have their size on the other one.
pub(super) fn largest_speed(
    at: &Point,
    notes: &mut Notes,
    mode: &Mode,
    meeting: &[usize],
    velocity: &[f64],
) -> Result<f64, FieldError> {
    let mut most = dot(velocity, velocity);
    let mut beyond = vec![0.0; velocity.len()];
    for &k in meeting.iter().filter(|&&k| mode.entries()[k] != 0) {
        let signs = mode.with(k, -mode.entries()[k]).signs();
        notes.n_field_evaluations += eval_on_side(at.system, &at.place(&signs), &mut beyond)?;
        let square = dot(&beyond, &beyond);
        most = if square.is_finite() {
            most.max(square)
        } else {
            most
        };
    }
    Ok(most.sqrt())
}

/// What becomes of a motion within a short time.
pub(super) enum Trial {
    /// It leaves surfaces to the sides of its mode.
    Leaves(Lefts),
    /// It leaves one to the other side, or its multipliers go beyond their ends.
    Ends,
    /// Some function is not clear of rounding, or the mode has no field.
    WithinRounding,
}

fn leaves_within(
    at: &Point,
    notes: &mut Notes,
    next: &Next,
    (leaving, ends): (&[usize], &[(usize, Guard)]),
    (velocity, largest_speed): (&[f64], f64),
    (moment, noise_of_way): (f64, f64),
) -> Result<Trial, FieldError> {
    let mut values = [1.0, 0.5].map(|_| vec![0.0; leaving.len()]);
    let signs = next.mode.signs();
    let mut gradient = vec![0.0; at.x.len()];
    let (mut start, mut h) = (vec![0.0; signs.len()], vec![0.0; signs.len()]);
    at.system
        .surfaces(&at.place_at(at.t, at.x, &signs), &mut start)?;
    let mut is_clear = true;
    for (share, values) in [1.0, 0.5].into_iter().zip(&mut values) {
        let mut field = at.field_of(&next.mode, next.start.as_deref());
        let (t, mut x) = (at.t + share * moment, at.x.to_vec());
        follow(&mut field, at.t, &mut x, share * moment)?;
        field.project(t, &mut x)?;
        let exits = field.exits(t, &mut x)?;
        notes.n_field_evaluations += field.n_evaluations();
        for (i, exit) in exits.iter().enumerate() {
            let noise = field.noise_of_exit(i);
            let is_held = ends.iter().any(|(place, _)| *place == i);
            if exit.is_nan() || *exit < -noise || (*exit == -noise && !is_held) {
                return Ok(Trial::Ends);
            }
            is_clear &= *exit > noise;
        }
        values.extend(ends.iter().map(|(place, _)| exits[*place]));
        at.system.surfaces(&at.place_at(t, &x, &signs), &mut h)?;
        for (k, &j) in leaving.iter().enumerate() {
            let size = at.system.surface_size(j, &at.place_at(t, &x, &signs))?;
            // The point is on the surface, but for a residual; fields that balance along the surface do so to rounding.
            let value = h[j] - start[j];
            values[k] = value;
            at.system.gradient(j, &at.place(&signs), &mut gradient)?;
            let slope = dot(&gradient, &gradient).sqrt();
            // A root has no slope at the point.
            let way = match slope.is_finite() {
                true => slope * moment,
                false => 0.0,
            };
            let rounding = ROUNDING * (size + largest_speed * way) + start[j].abs();
            if value.abs() <= rounding + noise_of_way * dot(velocity, velocity).sqrt() * way {
                is_clear = false;
            } else if value * f64::from(next.mode.entries()[j]) < 0.0 {
                return Ok(Trial::Ends);
            }
        }
    }
    if !is_clear {
        return Ok(Trial::WithinRounding);
    }
    let [full, half] = values;
    let guards = leaving.iter().map(|&j| Guard::Surface(j));
    let guards = guards.chain(ends.iter().map(|(_, guard)| *guard));
    let left = guards
        .zip(full.iter().zip(half))
        .map(|(guard, (full, half))| {
            let order = (full / half).log2().round();
            let order = order.clamp(1.0, MAX_LIE_ORDER as f64) as usize;
            let factorial: f64 = (1..=order).map(|k| k as f64).product();
            let value = factorial * full / moment.powi(order as i32);
            let leading = Leading { order, value };
            Left { guard, leading }
        });
    Ok(Trial::Leaves(left.collect()))
}

/// Moves x by one step of the classical method of fourth order (Hairer, Norsett, Wanner, Solving Ordinary Differential
/// Equations I, table II.1.2).
fn follow(field: &mut ModeField, t: f64, x: &mut [f64], step: f64) -> Result<(), FieldError> {
    let start = x.to_vec();
    let (mut stage, mut velocity) = (start.clone(), vec![0.0; start.len()]);
    for (share, ahead, weight) in [
        (0.0, 0.5, 1.0),
        (0.5, 0.5, 2.0),
        (0.5, 1.0, 2.0),
        (1.0, 0.0, 1.0),
    ] {
        field.eval(t + share * step, &mut stage, &mut velocity)?;
        for (i, v) in velocity.iter().enumerate() {
            x[i] += step * weight / 6.0 * v;
            stage[i] = start[i] + ahead * step * v;
        }
    }
    Ok(())
}
