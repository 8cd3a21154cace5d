//! The hidden dynamics from cell to cell, until it has an outcome.

use super::around::Around;
use super::cell::{Cell, StepEnd};
use super::watch::Watch;
use super::{exact, Outcome};
use crate::cube::{is_stable, newton, stable_roots_within, NormalFields};
use crate::mode::Mode;
use crate::patience::Patience;
use crate::tolerances::{DOUBTFUL, MOST_MEETING, MOST_WORK};

/// Follows the motion from u, piece by piece.
///
/// | certificate | outcome |
/// |---|---|
/// | no component is within the transition, and all move outwards | region |
/// | one component is and tends to a limit, at which all others move outwards | sliding on one |
/// | all that are have come to rest next to a stable root of their face, and all others move outwards | sliding |
/// | the basin of a stable root of two surfaces | sliding on both |
/// | a return to a half line from their root that is not further out than the last | sliding on both |
/// | rotating fields with gamma > 1, and returns that have come far out | outward spiral |
///
/// An oscillation of three and more surfaces has none; it is watched for a long time.
pub(super) fn limit(fields: &NormalFields, u: &[f64], patience: Patience) -> Outcome {
    let m = fields.m();
    let mut u = u.to_vec();
    let mut around = if m == 2 {
        Around::root_of(fields)
    } else {
        None
    };
    let mut watch = (m > 2).then(|| Watch::new(&u));
    let mut latest: Option<Cell> = None;
    let section = around.as_ref().map(|around| (1, around.root[1]));
    let few = MOST_MEETING.pow(2);
    let mut work = 0;
    while work < MOST_WORK * few / (m * m).max(few) {
        work += 1;
        let lambda = clipped(&u);
        let velocity = fields.interpolate(&lambda);
        let pairs = u.iter().zip(&velocity);
        let sides: Vec<i8> = pairs.map(|(&u, &v)| side(u, v)).collect();
        let n_inner = sides.iter().filter(|&&side| side == 0).count();
        let (time, at_section) = if n_inner < 2 {
            let is_beyond = sides[0] == 1;
            let Some(time) = exact::pass(fields, &sides, &mut u, section.filter(|_| is_beyond))
            else {
                return for_ever(fields, &sides, &u);
            };
            (time, is_beyond && section.is_some_and(|(_, y)| u[1] == y))
        } else {
            if let Some(around) = around.as_ref().filter(|around| around.attracts(&u)) {
                return around.stays(false);
            }
            if let Some(multipliers) = rest_on_face(fields, &sides, &lambda, &velocity) {
                return sliding(sides, multipliers);
            }
            if velocity.iter().all(|&v| v == 0.0) {
                return Outcome::AtRest;
            }
            let cell = latest.take().filter(|cell| cell.sides == sides);
            let mut cell = cell.unwrap_or_else(|| Cell::new(fields, &sides));
            let (time, end) = cell.advance(&mut u, section, &mut work);
            latest = Some(cell);
            (time, end == StepEnd::Level)
        };
        if let Some(outcome) = around
            .as_mut()
            .filter(|_| at_section)
            .and_then(|a| a.note(&u))
        {
            return outcome;
        }
        if let Some(mode) = watch.as_mut().and_then(|watch| watch.note(time, &u)) {
            return oscillation(fields, &mode, patience);
        }
        let is_watched_enough = watch.as_ref().is_some_and(Watch::is_over);
        if is_watched_enough || patience.is_over() {
            break;
        }
    }
    let known = around.and_then(|around| around.out_of_work());
    known.unwrap_or(Outcome::Unknown)
}

/// The outcome in a cell that is never left, with the component within the transition at its limit.
fn for_ever(fields: &NormalFields, sides: &[i8], u: &[f64]) -> Outcome {
    let lambda = clipped(u);
    let velocity = fields.interpolate(&lambda);
    let comes_back = |i: usize| f64::from(sides[i]) * velocity[i] < 0.0;
    let attracts = |i: usize| u[i].abs() < 1.0 && fields.derivative(&lambda, i)[i] < 0.0;
    let inner = sides.iter().position(|&side| side == 0);
    // Of two surfaces the caller looks whether the limit attracts.
    let holds = sides.len() == 2 || inner.is_none_or(attracts);
    let is_at_rest = velocity.iter().all(|&v| v == 0.0);
    match inner {
        _ if (0..sides.len()).any(comes_back) => Outcome::Unknown,
        Some(i) if holds && (sides.len() == 1 || !is_at_rest) => {
            sliding(sides.to_vec(), vec![u[i]])
        }
        _ if is_at_rest => Outcome::AtRest,
        None => Outcome::Region(Mode::new(sides.to_vec())),
        Some(_) => Outcome::Unknown,
    }
}

/// The multipliers at which the motion comes to rest on the face of these sides, if it is sure to
/// do so: the components within the transition move no more, Newton's method finds an attracting
/// rest point next to them, and there all clipped components move outwards.
fn rest_on_face(
    fields: &NormalFields,
    sides: &[i8],
    lambda: &[f64],
    velocity: &[f64],
) -> Option<Vec<f64>> {
    let rests = |i: usize, v: f64| sides[i] != 0 || v.abs() <= DOUBTFUL;
    let leaves = |i: usize, v: f64| sides[i] == 0 || f64::from(sides[i]) * v > DOUBTFUL;
    let stays = |v: &[f64]| (0..sides.len()).all(|i| rests(i, v[i]) && leaves(i, v[i]));
    if !stays(velocity) {
        return None;
    }
    let free: Vec<usize> = (0..sides.len()).filter(|&i| sides[i] == 0).collect();
    let here: Vec<f64> = free.iter().map(|&i| lambda[i]).collect();
    let face = fields.restrict(sides);
    let root = newton(&face, &here)?;
    let near = root
        .iter()
        .zip(&here)
        .all(|(a, b)| (a - b).abs() <= DOUBTFUL.sqrt() && a.abs() <= 1.0);
    let mut full = lambda.to_vec();
    for (&i, &value) in free.iter().zip(&root) {
        full[i] = value;
    }
    let attracts = is_stable(&face.jacobian(&root));
    (near && attracts && stays(&fields.interpolate(&full))).then_some(root)
}

fn sliding(sides: Vec<i8>, multipliers: Vec<f64>) -> Outcome {
    Outcome::Sliding {
        mode: Mode::new(sides),
        multipliers,
        oscillates: false,
    }
}

fn oscillation(fields: &NormalFields, mode: &[i8], patience: Patience) -> Outcome {
    let roots = stable_roots_within(&fields.restrict(mode), patience);
    Outcome::Sliding {
        mode: Mode::new(mode.to_vec()),
        multipliers: roots.into_iter().next().unwrap_or_default(),
        oscillates: true,
    }
}

/// The side of a component: -1, +1, or 0 within the transition. On the border the velocity decides.
fn side(u: f64, velocity: f64) -> i8 {
    if u > 1.0 || (u == 1.0 && velocity > 0.0) {
        1
    } else if u < -1.0 || (u == -1.0 && velocity < 0.0) {
        -1
    } else {
        0
    }
}

/// pi(u).
fn clipped(u: &[f64]) -> Vec<f64> {
    u.iter().map(|v| v.clamp(-1.0, 1.0)).collect()
}
