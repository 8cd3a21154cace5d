//! Hidden dynamics where one component at most is within the transition, in closed form.

use super::first_zero::falling_zero;
use crate::cube::{NormalFields, Vector};

/// The component within the transition: s' = alpha + beta s. Without one all velocities are constant, and these are 0.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Inner {
    s: f64,
    alpha: f64,
    beta: f64,
}

/// A component beyond the transition, at the distance w >= 0 of it: w' = p + q s.
#[derive(Clone, Copy, Debug)]
struct Outer {
    w: f64,
    p: f64,
    q: f64,
}

/// Moves `u` to the border of its cell, or until the component within the transition reaches its level if it is the
/// `watched` one. `None` if this is never: then that component is at its limit.
pub(super) fn pass(
    fields: &NormalFields,
    sides: &[i8],
    u: &mut [f64],
    watched: Option<(usize, f64)>,
) -> Option<f64> {
    let free = sides.iter().position(|&side| side == 0);
    let centre: Vector = sides.iter().map(|&side| f64::from(side)).collect();
    let (middle, mut slopes) = (fields.interpolate(&centre), Vector::new());
    let mut inner = Inner::default();
    if let Some(i) = free {
        slopes = fields.derivative(&centre, i);
        (inner.s, inner.alpha, inner.beta) = (u[i], middle[i], slopes[i]);
    }
    let velocity = inner.velocity();
    let mut border = 1.0_f64.copysign(velocity);
    if let Some((_, level)) = watched.filter(|watched| free == Some(watched.0)) {
        let is_ahead = (level - inner.s) * velocity > 0.0;
        border = if is_ahead { level } else { border };
    }
    let end = inner.time_to(border);
    let limit = if end.is_finite() {
        border
    } else if velocity == 0.0 {
        inner.s
    } else {
        -inner.alpha / inner.beta
    };
    let clipped = (0..u.len()).filter(|&i| sides[i] != 0);
    let outer = |i: usize, u: f64| Outer {
        w: centre[i] * u - 1.0,
        p: centre[i] * middle[i],
        q: slopes.get(i).map_or(0.0, |slope| centre[i] * slope),
    };
    let times = clipped
        .clone()
        .map(|i| (outer(i, u[i]).time_to_zero(&inner, end, limit), i));
    let first = times.min_by(|a, b| a.0.total_cmp(&b.0));
    let first = first.filter(|first| first.0.is_finite() && first.0 <= end);
    let time = first.map_or(end, |first| first.0);
    if let Some(i) = free {
        u[i] = first.map_or(limit, |_| inner.at(time));
    }
    if time == f64::INFINITY {
        return None;
    }
    for i in clipped {
        let w = match first.is_some_and(|first| first.1 == i) {
            true => 0.0,
            false => outer(i, u[i]).at(&inner, time).max(0.0),
        };
        u[i] = centre[i] * (1.0 + w);
    }
    Some(time)
}

impl Inner {
    fn velocity(&self) -> f64 {
        self.alpha + self.beta * self.s
    }

    /// When s passes this value: infinite if never.
    fn time_to(&self, s: f64) -> f64 {
        let theta = (s - self.s) / self.velocity();
        let z = self.beta * theta;
        if !theta.is_finite() || theta < 0.0 || z <= -1.0 {
            f64::INFINITY
        } else if z == 0.0 {
            theta
        } else {
            z.ln_1p() / self.beta
        }
    }

    fn at(&self, t: f64) -> f64 {
        self.s + self.velocity() * self.phi(t)
    }

    /// Integral of exp(beta t).
    fn phi(&self, t: f64) -> f64 {
        if self.beta == 0.0 {
            t
        } else {
            (self.beta * t).exp_m1() / self.beta
        }
    }

    /// Integral of phi; by its series where the closed form cancels.
    fn psi(&self, t: f64) -> f64 {
        let z = self.beta * t;
        if z.abs() > 0.5 {
            return (self.phi(t) - t) / self.beta;
        }
        let terms = (3..20).rev();
        0.5 * t * t * terms.fold(1.0, |sum, k| 1.0 + sum * z / f64::from(k))
    }
}

impl Outer {
    fn at(&self, inner: &Inner, t: f64) -> f64 {
        let bend = self.q * inner.velocity();
        let curved = if bend == 0.0 {
            0.0
        } else {
            bend * inner.psi(t)
        };
        self.w + (self.p + self.q * inner.s) * t + curved
    }

    /// When w falls to 0, until s is at its `limit` at the time `end`: infinite if it does not.
    fn time_to_zero(&self, inner: &Inner, end: f64, limit: f64) -> f64 {
        // w' is monotone in s, and s in time.
        let (slope, last) = (self.p + self.q * inner.s, self.p + self.q * limit);
        let bend = self.q * inner.velocity();
        let high = if slope >= 0.0 && last >= 0.0 {
            f64::INFINITY
        } else if bend == 0.0 {
            return self.w / -slope;
        } else if slope < 0.0 && last > 0.0 {
            inner.time_to(-self.p / self.q)
        } else if end.is_finite() {
            end
        } else {
            // A time well after the zero of w, because |w(t) - w(0) - last t| <= |bend / beta^2|.
            2.0 * (self.w + (bend / (inner.beta * inner.beta)).abs()) / -last
        };
        if !high.is_finite() || self.at(inner, high) > 0.0 {
            return f64::INFINITY;
        }
        let motion = |t: f64| (self.at(inner, t), self.p + self.q * inner.at(t));
        falling_zero(0.0, high, motion)
    }
}
