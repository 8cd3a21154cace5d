//! Surfaces that the motion does not reach while it stays near to where it has been.

use filippov_expr::{Enclosure, Interval, Motion};
use smallvec::SmallVec;

use crate::options::{Method, Options};
use crate::system::{PiecewiseSystem, Setting};
use crate::tolerances::{BOX_GROWTH, CLEAR_IN_BOX, FEWEST_ASLEEP, MOST_CHOSEN_SERIES};

/// Surfaces whose functions are proved to have one sign all over a box of times and states. While the motion stays in the box they
/// are not monitored.
///
/// The box is wider than where the motion has been, and wider again each time that the motion leaves it: it is left seldom,
/// and then all signs are proved anew. Where the motion comes near to a surface the proof fails, and the surface is monitored. How
/// wide the box is does not matter for what is proved.
#[derive(Clone, Debug, Default)]
pub(crate) struct Asleep {
    /// Systems with few surfaces do without.
    is_used: bool,
    /// Where the motion has been, time first.
    seen: Vec<[f64; 2]>,
    /// The box, time first.
    around: Vec<[f64; 2]>,
    /// The sign of each function in the box, 0 if it is not proved.
    sides: Vec<i8>,
    /// How many are proved.
    n_proved: usize,
    /// The discrete states that they are proved for.
    discrete: Vec<f64>,
}

impl Asleep {
    /// No surface is asleep yet. Functions that contain signs of others are always monitored, and so are those that a step
    /// must not pass ([`Method::Midpoint`]).
    pub fn new(system: &dyn PiecewiseSystem, options: &Options) -> Self {
        Asleep {
            is_used: system.n_surfaces() >= FEWEST_ASLEEP
                && system.enclosures().is_some()
                && !system.has_nested_signs()
                && options.method != Method::Midpoint,
            ..Asleep::default()
        }
    }

    /// May surfaces be asleep?
    #[inline(always)]
    pub fn is_used(&self) -> bool {
        self.is_used
    }

    /// Is any asleep?
    #[inline(always)]
    pub fn has_any(&self) -> bool {
        self.n_proved > 0
    }

    /// Is a surface asleep on this side?
    pub fn has(&self, j: usize, side: i8) -> bool {
        side != 0 && self.sides.get(j) == Some(&side)
    }

    /// Is its function proved to have one sign?
    pub fn is_proved(&self, j: usize) -> bool {
        self.sides.get(j).is_some_and(|&side| side != 0)
    }

    /// The curved switching functions that are not asleep, if surfaces are asleep and these are few.
    pub fn curved_awake(&self, system: &dyn PiecewiseSystem) -> Option<SmallVec<[usize; 4]>> {
        if !self.has_any() {
            return None;
        }
        let mut awake = SmallVec::new();
        for j in (0..system.n_surfaces()).filter(|&j| !system.is_affine(j)) {
            if self.is_proved(j) {
                continue;
            }
            if awake.len() == MOST_CHOSEN_SERIES {
                return None;
            }
            awake.push(j);
        }
        Some(awake)
    }

    /// Wakes all for good: where the field ends at its surfaces, their distance limits the steps.
    pub fn end(&mut self) {
        *self = Asleep::default();
    }

    /// Does the box contain this point, for these discrete states? If nothing is proved that does not matter.
    #[cold]
    #[inline(never)]
    pub fn contains_point(&self, t: f64, x: &[f64], discrete: &[f64]) -> bool {
        if self.around.is_empty() || self.discrete != discrete {
            return false;
        }
        self.n_proved == 0
            || self.contains(std::iter::once([t; 2]).chain(x.iter().map(|&x| [x; 2])))
    }

    /// What is proved at this point, for these discrete states.
    #[inline(always)]
    pub fn known_at(&self, t: f64, x: &[f64], discrete: &[f64]) -> Option<&Self> {
        match self.has_any() {
            true => self.contains_point(t, x, discrete).then_some(self),
            false => None,
        }
    }

    /// Does the box contain these ranges, time first, for these discrete states?
    pub fn contains_ranges(&self, ranges: &[[f64; 2]], discrete: &[f64]) -> bool {
        self.discrete == discrete && self.contains(ranges.iter().copied())
    }

    fn contains(&self, ranges: impl Iterator<Item = [f64; 2]>) -> bool {
        // A NaN is nowhere.
        self.around
            .iter()
            .zip(ranges)
            .all(|(around, range)| around[0] <= range[0] && range[1] <= around[1])
    }

    /// The motion is at this point: the box is made around it.
    pub fn look_around(&mut self, system: &dyn PiecewiseSystem, t: f64, x: &[f64], q: &[f64]) {
        let point = std::iter::once([t; 2]).chain(x.iter().map(|&x| [x; 2]));
        self.see(point);
        self.prove(system, q);
    }

    /// The motion goes along a step over these ranges, time first: the box is made wider.
    pub fn follow(&mut self, system: &dyn PiecewiseSystem, ranges: &[[f64; 2]], q: &[f64]) {
        self.see(ranges.iter().copied());
        self.prove(system, q);
    }

    fn see(&mut self, ranges: impl Iterator<Item = [f64; 2]>) {
        if self.seen.is_empty() {
            self.seen.extend(ranges);
            return;
        }
        for (seen, range) in self.seen.iter_mut().zip(ranges) {
            *seen = [seen[0].min(range[0]), seen[1].max(range[1])];
        }
    }

    /// Makes the box, and proves what signs the functions have in it.
    fn prove(&mut self, system: &dyn PiecewiseSystem, q: &[f64]) {
        self.around.clear();
        let wider = |&[lo, hi]: &[f64; 2]| {
            let by = BOX_GROWTH * (hi - lo).max(lo.abs().max(hi.abs()));
            [lo - by, hi + by]
        };
        self.around.extend(self.seen.iter().map(wider));
        // Times before the run do not come.
        self.around[0][0] = self.seen[0][0];
        self.discrete.clear();
        self.discrete.extend_from_slice(q);
        // No function contains a sign.
        let signs: SmallVec<[f64; 16]> = SmallVec::from_elem(1.0, system.n_surfaces());
        let setting = Setting::new(&signs, q);
        let around = Around(&self.around);
        let sides = (0..system.n_surfaces()).map(|j| {
            let bounds = system.enclose_surface(j, &around, setting);
            match bounds.map(|bounds| bounds.value) {
                // More than rounding: nothing counts as a touch there.
                Some(value) if value.lo > CLEAR_IN_BOX * value.hi => 1,
                Some(value) if value.hi < CLEAR_IN_BOX * value.lo => -1,
                _ => 0,
            }
        });
        self.sides.clear();
        self.sides.extend(sides);
        self.n_proved = self.sides.iter().filter(|&&side| side != 0).count();
    }
}

/// A box, time first, as a motion of which nothing else is known.
pub(super) struct Around<'a>(pub &'a [[f64; 2]]);

impl Motion for Around<'_> {
    fn time(&self) -> Interval {
        let [lo, hi] = self.0[0];
        Interval::hull(lo, hi)
    }

    fn state(&self, index: usize) -> Enclosure {
        let [lo, hi] = self.0[index + 1];
        Enclosure {
            value: Interval::hull(lo, hi),
            rate: Interval::ALL,
        }
    }
}

#[cfg(test)]
mod tests {
    use filippov_expr::{Backend, Graph, Names};

    use super::{Asleep, FEWEST_ASLEEP};
    use crate::options::Options;
    use crate::system::TracedSystem;

    /// x' = sum of the signs of x - k - 0.5, k = 0, 1, ...
    fn levels(n: usize) -> TracedSystem {
        let mut g = Graph::new();
        let x = g.state(0);
        let mut rate = g.constant(0.0);
        for k in 0..n {
            let level = g.constant(k as f64 + 0.5);
            let h = g.sub(x, level);
            let sign = g.sign(h);
            rate = g.add(rate, sign);
        }
        TracedSystem::new(g, vec![rate], Vec::new(), Names::default(), Backend::Auto).unwrap()
    }

    #[test]
    fn far_surfaces_are_proved_and_near_ones_are_not() {
        let system = levels(20);
        let mut asleep = Asleep::new(&system, &Options::default());
        assert!(asleep.is_used() && !asleep.contains_point(0.0, &[1.0], &[]));
        asleep.look_around(&system, 0.0, &[1.0], &[]);
        let [lo, hi] = asleep.around[1];
        assert!(lo < 1.0 && hi > 1.0 && asleep.has_any());
        for k in 0..20 {
            let level = k as f64 + 0.5;
            let is_outside = level < lo || level > hi;
            assert_eq!(asleep.is_proved(k), is_outside);
            assert_eq!(asleep.has(k, -1), level > hi);
        }
        assert!(asleep.contains_point(0.0, &[1.0], &[]));
        assert!(!asleep.contains_point(0.0, &[1.0], &[2.0]));
        assert!(!asleep.contains_point(0.0, &[hi + 1.0], &[]));
        asleep.end();
        assert!(!asleep.is_used() && !asleep.has_any());
    }

    #[test]
    fn few_surfaces_are_always_monitored() {
        let system = levels(FEWEST_ASLEEP - 1);
        assert!(!Asleep::new(&system, &Options::default()).is_used());
    }
}
