//! Two-folds that a sliding motion runs into: points where both fields become tangent to the surface at once.
//!
//! Before it the motion is attracted from both sides, behind it from none. Near it the multiplier is the quotient of two
//! small numbers, which are known to the tolerance only: where both vanish within it, the motion has arrived.

use super::point::Point;

use crate::error::FieldError;
use crate::field::ModeField;
use crate::field::{eval_on_side, SmoothField};
use crate::switching::{Leading, Matrix, TwoFold, TwoFoldMotion};
use crate::system::{dot, dot_magnitude, RatePartials};
use crate::tolerances::{
    AT_TWO_FOLD, EPS, INSIDE_SHARES, KNOWN_MULTIPLIER, LOST_MULTIPLIER, MOST_DOUBLINGS,
    NEWTON_STEPS, SETTLED, TANGENT,
};

/// The two-fold that the motion on one surface has come to, if it has: its time and state.
pub(crate) fn two_fold_here(at: &Point) -> Result<Option<(f64, Vec<f64>)>, FieldError> {
    let mut field = at.arrival.field.borrow_mut();
    let ModeField::Sliding(field) = &mut **field else {
        return Ok(None);
    };
    let (j, mut x) = (field.surface(), at.x.to_vec());
    // Differences across the surface would mix both fields: only exact derivatives tell a two-fold.
    if at.system.sticks_at(j) || at.system.lie_tolerance(2) > TANGENT {
        return Ok(None);
    }
    let mut velocity = vec![0.0; x.len()];
    field.eval(at.t, &mut x, &mut velocity)?;
    let (minus, along_minus) = rate_on_side(at, j, -1, at.t, &x)?;
    let (plus, along_plus) = rate_on_side(at, j, 1, at.t, &x)?;
    let (distance, time) = (minus.rate - plus.rate, minus.time - plus.time);
    let pairs = along_minus.iter().zip(&along_plus);
    let gradient: Vec<f64> = pairs.map(|(a, b)| a - b).collect();
    let tolerance = at.scale.along(&gradient, &x);
    let size = dot_magnitude(&along_minus, &x) + dot_magnitude(&along_plus, &x);
    let rounding = TANGENT * (size + (minus.time.abs() + plus.time.abs()) * at.t.abs());
    if distance.abs() <= rounding {
        return Ok(Some((at.t, at.x.to_vec())));
    }
    if distance.abs() > AT_TWO_FOLD * tolerance {
        return Ok(None);
    }
    let rate = time + dot(&gradient, &velocity);
    let ahead = -distance / rate;
    let t = at.t + ahead;
    if !(ahead > 0.0 && t > at.t) {
        return Ok(Some((at.t, at.x.to_vec())));
    }
    let pairs = x.iter().zip(&velocity);
    let end: Vec<f64> = pairs.map(|(x, v)| x + ahead * v).collect();
    let moved = velocity.iter().enumerate();
    let speed = moved.map(|(i, v)| v.abs() / at.scale.of(i, x[i], x[i]));
    let unit = 1.0 / speed.fold(0.0, f64::max).max(1.0 / ahead);
    let Some((t, end)) = settle_on_zeros(at, j, &[0.0, 1.0], (t, end), unit)? else {
        return Ok(None);
    };
    let moves = |(i, (a, b)): (usize, (&f64, &f64))| {
        (a - b).abs() <= 10.0 * AT_TWO_FOLD * at.scale.tolerance(i, *a, *b)
    };
    let is_near = end.iter().zip(at.x).enumerate().all(moves);
    let is_ahead = t > at.t;
    Ok(is_near.then(|| match is_ahead {
        true => (t, end),
        false => (at.t, at.x.to_vec()),
    }))
}

/// The point where the motion on surface `j` goes on beyond a double zero of the difference of the normal components, if
/// there is one here. The multiplier, the quotient of two functions that vanish, is lost in errors around it. The straight
/// continuation is taken to where it is known again: where the difference is as large as errors of the components,
/// which is at the root of a tolerance, so that the way is straight up to a tolerance. `None` too where the difference
/// changes its sign, as at a two-fold.
pub(crate) fn beyond_double_zero(
    at: &Point,
    j: usize,
) -> Result<Option<(f64, Vec<f64>)>, FieldError> {
    if at.system.sticks_at(j) || at.system.lie_tolerance(2) > TANGENT {
        return Ok(None);
    }
    let (difference, error) = difference_and_error(at, j, at.t, at.x)?;
    if difference.abs() > LOST_MULTIPLIER * error {
        return Ok(None);
    }
    // The motion along which the components stay nearest to zero.
    let motions = TwoFold::new(at.system, j, 1, (at.t, at.x), at.arrival.signs).motions()?;
    let rate = |first: Leading| {
        if first.order == 1 {
            first.value.abs()
        } else {
            0.0
        }
    };
    let rate = |motion: &TwoFoldMotion| rate(motion.minus) + rate(motion.plus);
    let slowest = motions.iter().min_by(|a, b| rate(a).total_cmp(&rate(b)));
    // At a multiplier near its end the motion may have come to a true exit.
    let is_inside = |weight: &f64| (INSIDE_SHARES..1.0 - INSIDE_SHARES).contains(weight);
    let Some(weight) = slowest.map(|motion| motion.weight).filter(is_inside) else {
        return Ok(None);
    };
    let mut velocity = vec![0.0; at.x.len()];
    for (side, share) in [(-1, 1.0 - weight), (1, weight)] {
        let signs = at.arrival.mode.with(j, side).signs();
        let mut field = vec![0.0; at.x.len()];
        eval_on_side(at.system, at.t, at.x, &signs, &mut field)?;
        let pairs = velocity.iter_mut().zip(&field);
        pairs.for_each(|(v, f)| *v += share * f);
    }
    let moved = velocity.iter().enumerate();
    let speed = moved.map(|(i, v)| v.abs() / at.scale.of(i, at.x[i], at.x[i]));
    let mut ahead = 1.0 / speed.fold(0.0, f64::max);
    let (mut last, mut is_lost) = (difference, difference.abs() <= AT_TWO_FOLD * error);
    for _ in 0..MOST_DOUBLINGS {
        if !ahead.is_finite() {
            return Ok(None);
        }
        let pairs = at.x.iter().zip(&velocity);
        let end = pairs.map(|(x, v)| x + ahead * v).collect();
        let Some((t, end)) = settle_on_zeros(at, j, &[weight], (at.t + ahead, end), ahead)? else {
            return Ok(None);
        };
        let (difference, error) = difference_and_error(at, j, t, &end)?;
        let is_known = difference.abs() > AT_TWO_FOLD * error;
        if is_known && difference.abs() > last.abs() {
            let is_ahead = is_lost && t > at.t;
            return Ok((difference > 0.0 && is_ahead).then_some((t, end)));
        }
        is_lost |= !is_known;
        (last, ahead) = (difference, 2.0 * ahead);
    }
    Ok(None)
}

/// The difference of the normal components of both sides, and errors of the components.
fn difference_and_error(at: &Point, j: usize, t: f64, x: &[f64]) -> Result<(f64, f64), FieldError> {
    let (minus, along_minus) = rate_on_side(at, j, -1, t, x)?;
    let (plus, along_plus) = rate_on_side(at, j, 1, t, x)?;
    let size = dot_magnitude(&along_minus, x) + dot_magnitude(&along_plus, x);
    let rounding = EPS * (size + (minus.time.abs() + plus.time.abs()) * t.abs());
    let pairs = along_minus.iter().zip(&along_plus).enumerate();
    let error: f64 = pairs
        .map(|(i, (a, b))| a.abs().max(b.abs()) * at.scale.of(i, x[i], x[i]))
        .sum();
    Ok((
        minus.rate - plus.rate,
        error.max(rounding / KNOWN_MULTIPLIER),
    ))
}

/// The nearest point to (t, x) where h_j and the normal components of the mixtures with these shares of f+ vanish,
/// distances measured in tolerances and times in `unit`s; `None` if Newton's method finds none.
fn settle_on_zeros(
    at: &Point,
    j: usize,
    shares: &[f64],
    start: (f64, Vec<f64>),
    unit: f64,
) -> Result<Option<(f64, Vec<f64>)>, FieldError> {
    let n = start.1.len();
    let mut units: Vec<f64> = (0..n)
        .map(|i| at.scale.of(i, start.1[i], start.1[i]))
        .collect();
    units.push(unit);
    let (mut t, mut x) = start;
    let mut h = vec![0.0; at.system.n_surfaces()];
    for _ in 0..NEWTON_STEPS {
        let signs = at.arrival.signs.clone();
        at.system.surfaces(t, &x, &signs, &mut h)?;
        let m = shares.len() + 1;
        let mut rows = vec![vec![0.0; n + 1]; m];
        rows[0][n] = at.system.gradient(j, t, &x, &signs, &mut rows[0][..n])?;
        let mut residuals = vec![0.0; m];
        residuals[0] = h[j];
        let (minus, along_minus) = rate_on_side(at, j, -1, t, &x)?;
        let (plus, along_plus) = rate_on_side(at, j, 1, t, &x)?;
        for (k, share) in shares.iter().enumerate() {
            let mix = |minus: f64, plus: f64| (1.0 - share) * minus + share * plus;
            residuals[k + 1] = mix(minus.rate, plus.rate);
            let row = &mut rows[k + 1];
            (0..n).for_each(|i| row[i] = mix(along_minus[i], along_plus[i]));
            row[n] = mix(minus.time, plus.time);
        }
        for row in &mut rows {
            row.iter_mut().zip(&units).for_each(|(g, unit)| *g *= unit);
        }
        let mut gram = Matrix::zeros(m);
        for (a, b) in (0..m).flat_map(|a| (0..m).map(move |b| (a, b))) {
            gram[(a, b)] = dot(&rows[a], &rows[b]);
        }
        let Some(shifts) = gram.solve(&residuals) else {
            return Ok(None);
        };
        let mut largest = 0.0_f64;
        for i in 0..=n {
            let move_in_units: f64 = (0..m).map(|k| rows[k][i] * shifts[k]).sum();
            largest = largest.max(move_in_units.abs());
            match x.get_mut(i) {
                Some(x) => *x -= units[i] * move_in_units,
                None => t -= unit * move_in_units,
            }
        }
        if largest.is_nan() || largest > 10.0 * AT_TWO_FOLD {
            return Ok(None);
        }
        if largest <= SETTLED {
            return Ok(Some((t, x)));
        }
    }
    Ok(None)
}

/// The normal component of the field on one side, and its gradient.
fn rate_on_side(
    at: &Point,
    j: usize,
    side: i8,
    t: f64,
    x: &[f64],
) -> Result<(RatePartials, Vec<f64>), FieldError> {
    let signs = at.arrival.mode.with(j, side).signs();
    let mut gradient = vec![0.0; x.len()];
    let partials = at.system.rate_gradient(j, t, x, &signs, &mut gradient)?;
    Ok((partials, gradient))
}
