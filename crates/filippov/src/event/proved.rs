//! The first zero where bounds decide every piece: few values are needed then.

use super::certificate::{Bound, Bounds, Verdict};
use super::isolate::{Bracket, Sampled};
use super::series::Near;
use crate::error::FieldError;
use crate::tolerances::BOUNDS_DEPTH;

/// What bounds prove about the first zero of a function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Proved {
    /// There is none.
    Nothing,
    /// It is the only one in the bracket.
    Single(Bracket),
    /// They do not decide all pieces in front of it.
    Unknown,
}

/// The first zero of `g` on [a, b], `left` > 0 and `right` being its values there. A piece whose bounds say
/// nothing is halved a few times. `near` is where a zero is expected, if anywhere.
///
/// # Errors
/// If `g` raises.
pub fn first_zero_proved(
    g: Sampled,
    bounds: Bounds,
    piece: (f64, f64),
    ends: (f64, f64),
    noise: f64,
    near: Option<Near>,
) -> Result<Proved, FieldError> {
    let is_decided = ends.0 > noise && ends.1.abs() > noise;
    if !is_decided {
        return Ok(Proved::Unknown);
    }
    let proved = proved(g, bounds, piece, ends, noise, BOUNDS_DEPTH)?;
    Ok(match (proved, near) {
        (Proved::Single(bracket), Some(Near { theta, slope, .. }))
            if bracket.lo < theta && theta < bracket.hi && slope < 0.0 =>
        {
            Proved::Single(Bracket {
                guess: theta,
                slope,
                ..bracket
            })
        }
        _ => proved,
    })
}

/// The first zero of `g` on [a, b] where it is expected, if bounds prove that `g` falls through zero around there and
/// has no zero before; `left` > 0 is the value at a. One value and two bounds do; the values at the ends of the
/// bracket are those that the slope allows at most and at least.
///
/// # Errors
/// If `g` raises.
pub fn expected_zero_proved(
    g: Sampled,
    bounds: Bounds,
    (a, b): (f64, f64),
    left: f64,
    noise: f64,
    near: Near,
) -> Result<Option<Bracket>, FieldError> {
    // A function that rises at first does not fall throughout.
    let falls = near.slope_at_start < 0.0;
    let m = if falls { a } else { 0.5 * (a + b) };
    let Some(last) = bounds(m, b).filter(|_| left > noise && m < near.theta && near.theta < b)
    else {
        return Ok(None);
    };
    if last.verdict(b - m, None, noise) != Verdict::Falling {
        return Ok(None);
    }
    let value = g(near.theta)?;
    let least_slope = -last.slope.hi;
    let g_lo = value + least_slope * (near.theta - m);
    let g_hi = value - least_slope * (b - near.theta);
    if !(g_lo > noise && g_hi < -noise) {
        return Ok(None);
    }
    let is_clear = |first: Bound| first.verdict(m - a, None, noise) == Verdict::Clear;
    if !falls && !bounds(a, m).is_some_and(is_clear) {
        return Ok(None);
    }
    Ok(Some(Bracket {
        lo: m,
        hi: b,
        g_lo,
        g_hi,
        guess: near.theta,
        slope: near.slope,
    }))
}

fn proved(
    g: Sampled,
    bounds: Bounds,
    (a, b): (f64, f64),
    (left, right): (f64, f64),
    noise: f64,
    depth: u32,
) -> Result<Proved, FieldError> {
    let Some(bound) = bounds(a, b) else {
        return Ok(Proved::Unknown);
    };
    match bound.verdict(b - a, None, noise) {
        Verdict::Clear if right > 0.0 => return Ok(Proved::Nothing),
        Verdict::Open if bound.lowest(b - a, Some(left), Some(right)) > noise => {
            return Ok(Proved::Nothing)
        }
        Verdict::Rising if right > 0.0 => return Ok(Proved::Nothing),
        Verdict::Falling if right > 0.0 => return Ok(Proved::Nothing),
        Verdict::Falling => {
            return Ok(Proved::Single(Bracket {
                lo: a,
                hi: b,
                g_lo: left,
                g_hi: right,
                guess: a + (b - a) * left / (left - right),
                slope: (right - left) / (b - a),
            }))
        }
        _ if depth == 0 => return Ok(Proved::Unknown),
        _ => {}
    }
    let m = 0.5 * (a + b);
    let middle = g(m)?;
    // Nothing is proved next to a value within rounding, or that does not exist.
    if middle.is_nan() || middle.abs() <= noise {
        return Ok(Proved::Unknown);
    }
    let first = proved(g, bounds, (a, m), (left, middle), noise, depth - 1)?;
    if first != Proved::Nothing {
        return Ok(first);
    }
    proved(g, bounds, (m, b), (middle, right), noise, depth - 1)
}

#[cfg(test)]
mod tests {
    use filippov_expr::Interval;

    use super::{first_zero_proved, Proved};
    use crate::event::certificate::Bound;

    /// cos(w theta) + shift, with bounds by its slope.
    fn search(w: f64, shift: f64) -> Proved {
        let value = |theta: f64| (w * theta).cos() + shift;
        let mut g = |theta: f64| Ok(value(theta));
        let mut bounds = |a: f64, b: f64| {
            let (m, r) = (0.5 * (a + b), 0.5 * (b - a));
            Some(Bound {
                value: Interval::around(value(m), w * r),
                slope: Interval::around(-w * (w * m).sin(), w * w * r),
            })
        };
        let ends = (value(0.0), value(1.0));
        first_zero_proved(&mut g, &mut bounds, (0.0, 1.0), ends, 1e-14, None).unwrap()
    }

    #[test]
    fn the_first_of_several_zeros_is_bracketed() {
        let Proved::Single(bracket) = search(8.0, 0.2) else {
            panic!("not found");
        };
        let zero = (-0.2_f64).acos() / 8.0;
        assert!(bracket.lo < zero && zero < bracket.hi && bracket.hi < 0.5);
        assert_eq!(search(8.0, 1.5), Proved::Nothing);
    }

    #[test]
    fn a_touch_is_not_decided() {
        assert_eq!(search(8.0, 1.0), Proved::Unknown);
    }
}
