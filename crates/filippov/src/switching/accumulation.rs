//! Returns to an intersection that come faster and faster: where and when they end.

use crate::tolerances::{ACCUMULATION_AGREEMENT, SLOWEST_ACCUMULATION};

/// One of several events of the same type: the same surface, the same modes before and after.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Return {
    /// When it happened.
    pub time: f64,
    /// Its distance to the suspected intersection.
    pub distance: f64,
}

/// The limit of a sequence of returns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accumulation {
    /// The time of the limit, T + (T - T_before) rho/(1 - rho). The state follows by the same
    /// formula, and has to be projected onto the intersection; the error is a multiple of the
    /// square of the distance.
    pub time: f64,
    /// Ratio rho of the last two intervals.
    pub ratio: f64,
}

/// The limit of the returns, if the last four of them show one: over three intervals distances and
/// intervals shrink by ratios that agree, and the last distance is below `delta`.
///
/// This serves cycles of any kind, with pieces of sliding and with fields that vary. Under constant
/// fields around two surfaces one lap suffices (`codim2::Lap::inward`).
pub fn accumulate(returns: &[Return], delta: f64) -> Option<Accumulation> {
    let &[a, b, c, d] = returns.last_chunk::<4>()?;
    let ratios = [
        interval_ratio(a, b, c),
        interval_ratio(b, c, d),
        c.distance / b.distance,
        d.distance / c.distance,
    ];
    let ratio = ratios[1];
    let shrinks = ratios.iter().all(|&r| r > 0.0 && r < SLOWEST_ACCUMULATION);
    let agree = ratios
        .iter()
        .all(|&r| (r - ratio).abs() <= ACCUMULATION_AGREEMENT * ratio);
    (shrinks && agree && d.distance < delta).then(|| Accumulation {
        time: d.time + (d.time - c.time) * ratio / (1.0 - ratio),
        ratio,
    })
}

fn interval_ratio(a: Return, b: Return, c: Return) -> f64 {
    (c.time - b.time) / (b.time - a.time)
}
