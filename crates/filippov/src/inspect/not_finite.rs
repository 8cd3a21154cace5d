//! Where a run ended because the field is not finite: which components, and where.

use crate::mode::Mode;
use crate::system::eval_on_side;
use crate::system::{PiecewiseSystem, Setting};

/// Points at which the field is looked at beyond the last time: by the rounding of time, and 16 times further each.
const LOOKS: i32 = 8;

/// What is not finite near the end of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct NotFinitePlace {
    /// The time.
    pub t: f64,
    /// The state.
    pub x: Vec<f64>,
    /// Components of the field that are not finite, with their values.
    pub components: Vec<(usize, f64)>,
    /// Switching functions that are not finite, with their values.
    pub surfaces: Vec<(usize, f64)>,
}

impl NotFinitePlace {
    /// What is not finite, in words.
    pub fn text(&self, surface_name: impl Fn(usize) -> String) -> String {
        let component =
            |&(i, value): &(usize, f64)| format!("component {i} of the right-hand side is {value}");
        let surface = |&(j, value): &(usize, f64)| {
            format!("the switching function {} is {value}", surface_name(j))
        };
        let parts = self.components.iter().map(component);
        let parts: Vec<String> = parts.chain(self.surfaces.iter().map(surface)).collect();
        let state = state_text(&self.x);
        format!("At t = {:.10}, x = {state}: {}.", self.t, parts.join(", "))
    }
}

/// A state in words, long ones shortened.
pub fn state_text(x: &[f64]) -> String {
    let shown: Vec<String> = x.iter().take(6).map(|v| format!("{v:?}")).collect();
    let rest = if x.len() > shown.len() { ", ..." } else { "" };
    format!("[{}{rest}]", shown.join(", "))
}

/// What is not finite at the end (t, x) of a run in `mode` with the discrete states `q`, or just after it; `None` if that is not found.
///
/// A heuristic for messages: the motion is followed for a moment along the tangent, as long as it stays in its
/// region. Functions of the user that raise there are passed over.
pub fn not_finite(
    system: &dyn PiecewiseSystem,
    t: f64,
    x: &[f64],
    q: &[f64],
    mode: &Mode,
) -> Option<NotFinitePlace> {
    let upper = mode.signs();
    let mut lower = upper.clone();
    for j in mode.sliding_set() {
        lower[j] = -1.0;
    }
    let mut rate = vec![0.0; x.len()];
    let rounding = f64::EPSILON * t.abs().max(1.0);
    let reaches = (0..LOOKS).map(|k| rounding * 16_f64.powi(k));
    for reach in std::iter::once(0.0).chain(reaches) {
        let there: Vec<f64> = x.iter().zip(&rate).map(|(x, v)| x + reach * v).collect();
        let mut h = vec![0.0; system.n_surfaces()];
        let place = Setting::new(&upper, q).at(t + reach, &there);
        system.surfaces(&place, &mut h).ok()?;
        let mut found = NotFinitePlace {
            t: t + reach,
            x: there,
            components: Vec::new(),
            surfaces: bad(&h),
        };
        let entries = mode.entries().iter().zip(&h);
        if reach > 0.0 && entries.into_iter().any(|(&e, h)| f64::from(e) * h < 0.0) {
            return None;
        }
        for signs in [&upper, &lower] {
            let mut dx = vec![0.0; x.len()];
            let place = Setting::new(signs, q).at(found.t, &found.x);
            eval_on_side(system, &place, &mut dx).ok()?;
            for entry in bad(&dx) {
                if found.components.iter().all(|(i, _)| *i != entry.0) {
                    found.components.push(entry);
                }
            }
            rate = dx;
        }
        if !(found.components.is_empty() && found.surfaces.is_empty()) {
            return Some(found);
        }
    }
    None
}

fn bad(values: &[f64]) -> Vec<(usize, f64)> {
    let values = values.iter().copied().enumerate();
    values.filter(|(_, value)| !value.is_finite()).collect()
}
