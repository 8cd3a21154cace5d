//! Hidden dynamics of three and more surfaces, by Taylor series from cell to cell.

use super::cell::Cell;
use super::certificate::rest_on_face;
use super::{clipped, side, Outcome};
use crate::cube::stable_roots_within;
use crate::cube::NormalFields;
use crate::mode::Mode;
use crate::patience::Patience;
use crate::tolerances::{
    AT_THE_ROOT, FIRST_WATCH, LAST_WATCH, MOST_PIECES, MOST_TESTS, STEADY_CYCLE,
};

/// Follows the motion from u until it has a certain outcome, or for a long time.
pub(super) fn limit(fields: &NormalFields, u: &[f64], patience: Patience) -> Outcome {
    let mut u = u.to_vec();
    let mut cell: Option<Cell> = None;
    let mut watch = Watch::new(&u);
    let mut tests = 0;
    let work = fields.m() * fields.m();
    for _ in 0..MOST_PIECES * 36 / work.max(36) {
        let lambda = clipped(&u);
        let velocity = fields.interpolate(&lambda);
        let pairs = u.iter().zip(&velocity);
        let sides: Vec<i8> = pairs.map(|(&u, &v)| side(u, v)).collect();
        if let Some(outcome) = certain(fields, &sides, &lambda, &velocity) {
            return outcome;
        }
        let mut here = match cell.take().filter(|cell| cell.sides == sides) {
            Some(cell) => cell,
            None => Cell::new(fields, &sides),
        };
        let before = here.tests;
        let (time, _) = here.advance(&mut u, None);
        tests += here.tests - before;
        if tests > MOST_TESTS || patience.is_over() {
            break;
        }
        cell = Some(here);
        if let Some(mode) = watch.note(time, &u) {
            return oscillation(fields, &mode, patience);
        }
        if watch.is_over() {
            break;
        }
    }
    Outcome::Unknown
}

fn certain(
    fields: &NormalFields,
    sides: &[i8],
    lambda: &[f64],
    velocity: &[f64],
) -> Option<Outcome> {
    let mut outwards = sides.iter().zip(velocity).map(|(&s, v)| f64::from(s) * v);
    if outwards.all(|speed| speed > 0.0) {
        return Some(Outcome::Region(Mode::new(sides.to_vec())));
    }
    if velocity.iter().all(|&v| v == 0.0) {
        // A rest point that attracts is a certain outcome too.
        let root = rest_on_face(fields, sides, lambda, velocity);
        return Some(root.map_or(Outcome::AtRest, |root| at_rest(sides, root)));
    }
    rest_on_face(fields, sides, lambda, velocity).map(|root| at_rest(sides, root))
}

fn at_rest(sides: &[i8], root: Vec<f64>) -> Outcome {
    Outcome::Sliding {
        mode: Mode::new(sides.to_vec()),
        multipliers: root,
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

/// The range of each component over windows of time, each twice as long as the one before.
///
/// A component that oscillates has the same range in both; one that grows leaves its range. This is
/// an observation, not a proof: growth by less than the tolerance over thousands of oscillations is
/// not seen.
struct Watch {
    time: f64,
    end: f64,
    before: Option<Vec<[f64; 2]>>,
    now: Vec<[f64; 2]>,
}

impl Watch {
    fn new(u: &[f64]) -> Self {
        Watch {
            time: 0.0,
            end: FIRST_WATCH,
            before: None,
            now: u.iter().map(|&v| [v, v]).collect(),
        }
    }

    fn is_over(&self) -> bool {
        self.end > LAST_WATCH
    }

    /// Notes the state after a step; at the end of a window the mode in which the motion
    /// oscillates, if so.
    fn note(&mut self, time: f64, u: &[f64]) -> Option<Vec<i8>> {
        self.time += time;
        for (range, &v) in self.now.iter_mut().zip(u) {
            *range = [range[0].min(v), range[1].max(v)];
        }
        if self.time < self.end {
            return None;
        }
        self.end = 2.0 * self.time;
        let mode = self.steady_mode();
        let next = u.iter().map(|&v| [v, v]).collect();
        self.before = Some(std::mem::replace(&mut self.now, next));
        mode.filter(|mode| mode.contains(&0))
    }

    fn steady_mode(&self) -> Option<Vec<i8>> {
        let pairs = self.before.as_ref()?.iter().zip(&self.now);
        pairs
            .map(|(&before, &now)| steady_entry(before, now))
            .collect()
    }
}

/// 0 for a component that keeps to its range, its side for one that leaves the range outwards.
fn steady_entry([low, high]: [f64; 2], [next_low, next_high]: [f64; 2]) -> Option<i8> {
    let width = high - low;
    let same = |a: f64, b: f64| (a - b).abs() <= STEADY_CYCLE * width + AT_THE_ROOT;
    if same(low, next_low) && same(high, next_high) {
        Some(0)
    } else if next_low > 1.0 && next_low >= high {
        Some(1)
    } else if next_high < -1.0 && next_high <= low {
        Some(-1)
    } else {
        None
    }
}
