//! Ends of sliding at which multipliers are lost: two-folds, double zeros, folds and jumps that vanish.
//!
//! A two-fold is a point where both fields become tangent to the surface at once. Before it the motion is attracted from both sides, behind it from none. Near it the multiplier is the quotient of two
//! small numbers, which are known to the tolerance only: where both vanish within it, the motion has arrived.

use smallvec::{smallvec, SmallVec};

use super::event::Reached;
use super::point::{Notes, Point};
use super::surroundings::Surroundings;

use crate::error::FieldError;
use crate::mode::Mode;
use crate::motion::{shares_of_rows, ModeField, SmoothField};
use crate::motion::{Guard, Leading, RootEnd, TwoFold, TwoFoldMotion};
use crate::system::{dot, dot_magnitude};
use crate::tolerances::{
    ARRIVED, AT_FOLD, ERRORS_OF_STEPS, INSIDE_SHARES, MOST_HALVINGS, NEWTON_STEPS, TANGENT,
};

/// A time and the state there.
type TimeAndState = (f64, Vec<f64>);

/// The components of both fields normal to a surface, f- first.
struct Components {
    values: [f64; 2],
    /// Their derivatives by state and time, time last.
    rows: [Vec<f64>; 2],
    /// What rounding makes of their difference.
    rounding: f64,
    /// What errors of the state within the tolerance make of one of them.
    error: f64,
}

impl Components {
    fn of(at: &Point, j: usize, (t, x): (f64, &[f64])) -> Result<Self, FieldError> {
        let n = x.len();
        let mut values = [0.0; 2];
        let mut rows = [vec![0.0; n + 1], vec![0.0; n + 1]];
        for (k, side) in [-1, 1].into_iter().enumerate() {
            let signs = at.arrival.mode.with(j, side).signs();
            let row = &mut rows[k];
            let partials = at
                .system
                .rate_gradient(j, &at.place_at(t, x, &signs), &mut row[..n])?;
            (values[k], row[n]) = (partials.rate, partials.time);
        }
        let size = |row: &[f64]| dot_magnitude(&row[..n], x) + (row[n] * t).abs();
        let errors = (0..n).map(|i| {
            let largest = rows[0][i].abs().max(rows[1][i].abs());
            largest * at.scale.of(i, x[i], x[i])
        });
        Ok(Components {
            values,
            rounding: TANGENT * (size(&rows[0]) + size(&rows[1])),
            error: errors.sum(),
            rows,
        })
    }

    /// The sum with these weights, and its derivatives.
    fn mixture(&self, [minus, plus]: [f64; 2]) -> (f64, Vec<f64>) {
        let mix = |a: f64, b: f64| minus * a + plus * b;
        let pairs = self.rows[0].iter().zip(&self.rows[1]);
        let row = pairs.map(|(a, b)| mix(*a, *b)).collect();
        (mix(self.values[0], self.values[1]), row)
    }

    /// The difference of the components, and how well it is known.
    fn difference(&self) -> (f64, f64) {
        let difference = self.values[0] - self.values[1];
        (difference, self.error.max(self.rounding))
    }
}

/// Differences across the surface would mix both fields: only exact derivatives tell a two-fold.
fn is_known(at: &Point, j: usize) -> bool {
    !at.system.sticks_at(j) && at.system.lie_tolerance(2) <= TANGENT
}

/// How fast a motion with this velocity moves, in tolerances.
fn speed(at: &Point, x: &[f64], velocity: &[f64]) -> f64 {
    let parts = velocity.iter().zip(x).enumerate();
    let parts = parts.map(|(i, (v, x))| v.abs() / at.scale.of(i, *x, *x));
    parts.fold(0.0, f64::max)
}

/// What the end of sliding on one surface is, where its multiplier may be lost.
pub(crate) enum EndOfSliding {
    /// An exit like any other.
    Exit,
    /// The motion has come to a two-fold, which is here.
    TwoFold(TimeAndState),
    /// The difference of the normal components has a double zero, and the motion goes on from here, in this mode.
    DoubleZero(TimeAndState, Mode),
}

/// What the end of sliding on surface `j` is, if no other surface vanishes. The steps before say whether it may be a double
/// zero or a two-fold; behind `horizon` there is none.
pub(crate) fn end_of_sliding(
    at: &Point,
    notes: &mut Notes,
    j: usize,
    (may_lose, approaches): (bool, bool),
    horizon: f64,
) -> Result<EndOfSliding, FieldError> {
    let mut reached = Reached::default();
    reached.find(at, notes)?;
    if !reached.surfaces.is_empty() {
        return Ok(EndOfSliding::Exit);
    }
    if may_lose {
        let beyond = beyond_double_zero(at, notes, j)?;
        if let Some(place) = beyond.filter(|(t, _)| *t <= horizon) {
            return Ok(EndOfSliding::DoubleZero(place, reached.before));
        }
    }
    Ok(match approaches {
        true => two_fold_here(at)?.map_or(EndOfSliding::Exit, EndOfSliding::TwoFold),
        false => EndOfSliding::Exit,
    })
}

/// The two-fold that the motion on one surface has come to, if it has: its time and state.
pub(super) fn two_fold_here(at: &Point) -> Result<Option<TimeAndState>, FieldError> {
    let mut field = at.arrival.field.borrow_mut();
    let ModeField::Sliding(field) = &mut **field else {
        return Ok(None);
    };
    let (j, mut x) = (field.surface(), at.x.to_vec());
    if !is_known(at, j) {
        return Ok(None);
    }
    let n = x.len();
    let mut velocity = vec![0.0; n];
    field.eval(at.t, &mut x, &mut velocity)?;
    let components = Components::of(at, j, (at.t, &x))?;
    let (distance, row) = components.mixture([1.0, -1.0]);
    let here = Some((at.t, at.x.to_vec()));
    if distance.abs() <= components.rounding {
        return Ok(here);
    }
    if distance.abs() > ERRORS_OF_STEPS * at.scale.along(&row[..n], &x) {
        return Ok(None);
    }
    let ahead = -distance / (row[n] + dot(&row[..n], &velocity));
    let t = at.t + ahead;
    if !(ahead > 0.0 && t > at.t) {
        return Ok(here);
    }
    let unit = 1.0 / speed(at, &x, &velocity).max(1.0 / ahead);
    let start = (t, at.moved(at.t, &x).along(&velocity, ahead));
    let Some((t, end)) = settle_on_zeros(at, j, &[0.0, 1.0], start, unit)? else {
        return Ok(None);
    };
    let is_near = |(i, (a, b)): (usize, (&f64, &f64))| {
        (a - b).abs() <= 10.0 * ERRORS_OF_STEPS * at.scale.tolerance(i, *a, *b)
    };
    if !end.iter().zip(at.x).enumerate().all(is_near) {
        return Ok(None);
    }
    if t <= at.t {
        return Ok(here);
    }
    Ok(is_straight(at, j, (t, &end))?.then_some((t, end)))
}

/// Is the straight way to this place accurate to errors of steps? A motion that rests near a two-fold for long does not come to
/// it: until then the fields change.
fn is_straight(at: &Point, j: usize, (t, end): (f64, &[f64])) -> Result<bool, FieldError> {
    let n = end.len();
    let (mut here, mut there) = (vec![0.0; n], vec![0.0; n]);
    for side in [-1, 1] {
        let signs = at.arrival.mode.with(j, side).signs();
        at.system.field(&at.place(&signs), &mut here)?;
        at.system.field(&at.place_at(t, end, &signs), &mut there)?;
        there.iter_mut().zip(&here).for_each(|(v, w)| *v -= w);
        if at.scale.largest(&there, end) * (t - at.t) > 10.0 * ERRORS_OF_STEPS {
            return Ok(false);
        }
    }
    Ok(true)
}

/// The point where the motion on surface `j` goes on beyond a double zero of the difference of the normal components, if
/// there is one here. The multiplier, the quotient of two functions that vanish, is lost in errors around it. The straight
/// continuation is taken to where it is known again: where the difference is as large as errors of the components,
/// which is at the root of a tolerance, so that the way is straight up to a tolerance. `None` too where the difference
/// changes its sign, as at a two-fold.
pub(super) fn beyond_double_zero(
    at: &Point,
    notes: &mut Notes,
    j: usize,
) -> Result<Option<TimeAndState>, FieldError> {
    if !is_known(at, j) {
        return Ok(None);
    }
    let (difference, error) = Components::of(at, j, (at.t, at.x))?.difference();
    if difference.abs() > ERRORS_OF_STEPS * error {
        return Ok(None);
    }
    // The motion along which the components stay nearest to zero.
    let motions = TwoFold::new(at.system, j, 1, at.place(at.arrival.signs)).motions()?;
    let rate = |first: Leading| match first.order {
        1 => first.value.abs(),
        _ => 0.0,
    };
    let rate = |motion: &TwoFoldMotion| rate(motion.minus) + rate(motion.plus);
    let slowest = motions.iter().min_by(|a, b| rate(a).total_cmp(&rate(b)));
    // At a multiplier near its end the motion may have come to a true exit.
    let is_inside = |weight: &f64| (INSIDE_SHARES..1.0 - INSIDE_SHARES).contains(weight);
    let Some(weight) = slowest.map(|motion| motion.weight).filter(is_inside) else {
        return Ok(None);
    };
    let mut velocity = vec![0.0; at.x.len()];
    let corners = at.corners(notes, &[j], at.arrival.mode)?;
    corners.combine(&[1.0 - weight, weight], &mut velocity);
    let mut ahead = 1.0 / speed(at, at.x, &velocity);
    let mut last = difference;
    // The way is doubled until Newton's method does not come to the surface any more.
    for _ in 0..MOST_HALVINGS {
        let start = (at.t + ahead, at.along(&velocity, ahead));
        let Some((t, end)) = settle_on_zeros(at, j, &[weight], start, ahead)? else {
            return Ok(None);
        };
        let (difference, error) = Components::of(at, j, (t, &end))?.difference();
        let is_known = difference.abs() > ERRORS_OF_STEPS * error;
        if is_known && difference.abs() > last.abs() {
            return Ok((difference > 0.0 && t > at.t).then_some((t, end)));
        }
        (last, ahead) = (difference, 2.0 * ahead);
    }
    Ok(None)
}

/// The nearest place to this one where h_j and the normal components of the mixtures with these shares of f+ vanish,
/// distances measured in tolerances and times in `unit`s; `None` if Newton's method finds none.
fn settle_on_zeros(
    at: &Point,
    j: usize,
    shares: &[f64],
    (mut t, mut x): TimeAndState,
    unit: f64,
) -> Result<Option<TimeAndState>, FieldError> {
    let (n, signs) = (x.len(), at.arrival.signs);
    let units = (0..n).map(|i| at.scale.of(i, x[i], x[i])).chain([unit]);
    let units: Vec<f64> = units.collect();
    let mut h = vec![0.0; at.system.n_surfaces()];
    for _ in 0..NEWTON_STEPS {
        let components = Components::of(at, j, (t, &x))?;
        at.system.surfaces(&at.place_at(t, &x, signs), &mut h)?;
        let (mut values, mut rows) = (vec![h[j]], vec![0.0; n + 1]);
        rows[n] = at
            .system
            .gradient(j, &at.place_at(t, &x, signs), &mut rows[..n])?;
        for share in shares {
            let (value, row) = components.mixture([1.0 - share, *share]);
            values.push(value);
            rows.extend(row);
        }
        let in_units = rows.iter_mut().zip(units.iter().cycle());
        in_units.for_each(|(g, unit)| *g *= unit);
        let Some(parts) = shares_of_rows(&rows, &values) else {
            return Ok(None);
        };
        let mut largest = 0.0_f64;
        for (i, unit) in units.iter().enumerate() {
            let pairs = rows.chunks_exact(n + 1).zip(&parts);
            let shift: f64 = pairs.map(|(row, part)| row[i] * part).sum();
            largest = largest.max(shift.abs());
            *x.get_mut(i).unwrap_or(&mut t) -= unit * shift;
        }
        if largest > 10.0 * ERRORS_OF_STEPS {
            return Ok(None);
        }
        if largest <= ARRIVED {
            return Ok(Some((t, x)));
        }
    }
    Ok(None)
}

/// The functions that count as vanishing where steps of sliding shrink to nothing: the jump of the field across a surface has
/// vanished, the multipliers have met a fold beyond which there are none, or both fields are tangent to the surface.
pub(crate) fn lost_guards(
    at: &Point,
    notes: &mut Notes,
) -> Result<Option<SmallVec<[Guard; 2]>>, FieldError> {
    if at.arrival.slides_on_several() {
        let around = Surroundings::of(at, notes, at.arrival.sliding, at.arrival.mode)?;
        if around.is_ok_and(|around| around.has_silent(at)) {
            return Ok(Some(smallvec![Guard::Root(RootEnd::Stability)]));
        }
        return Ok(has_lost_root(at)?.then(|| smallvec![Guard::Root(RootEnd::Fold)]));
    }
    let &[j] = at.arrival.sliding else {
        return Ok(None);
    };
    let arrived = beyond_double_zero(at, notes, j)?.is_some() || two_fold_here(at)?.is_some();
    Ok(arrived.then(|| Guard::ends(j).as_slice().into()))
}

/// Has sliding on several surfaces come to a fold of its multipliers?
fn has_lost_root(at: &Point) -> Result<bool, FieldError> {
    let mut field = at.arrival.field.borrow_mut();
    let is_rootless = |field: &ModeField| matches!(field, ModeField::Intersection(f) if f.set().len() > 2 && f.is_rootless());
    let was_rootless = is_rootless(&field);
    let exits = field.exits(at.t, &mut at.x.to_vec())?;
    // The evaluation here may be the first one without a root.
    if was_rootless || is_rootless(&field) {
        return Ok(true);
    }
    let mut ends = field.guards().into_iter().zip(exits);
    Ok(ends.any(|(guard, exit)| guard == Guard::Root(RootEnd::Fold) && exit.abs() < AT_FOLD))
}
