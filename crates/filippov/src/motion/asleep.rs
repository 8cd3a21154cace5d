//! Surfaces that the motion does not reach while it stays near to where it has been.

use filippov_expr::{Enclosure, Interval, Motion};
use smallvec::SmallVec;

use crate::options::{Method, Options};
use crate::page::IS_PAGE;
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
    /// The functions of which it is not proved.
    awake: Vec<usize>,
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
        !IS_PAGE && self.is_used
    }

    /// Is any asleep?
    #[inline(always)]
    pub fn has_any(&self) -> bool {
        !IS_PAGE && self.awake.len() < self.sides.len()
    }

    /// The others, in order.
    pub fn awake(&self) -> &[usize] {
        &self.awake
    }

    /// The curved switching functions that are not asleep, if surfaces are asleep and these are few.
    pub fn curved_awake(&self, system: &dyn PiecewiseSystem) -> Option<SmallVec<[usize; 4]>> {
        if !self.has_any() {
            return None;
        }
        let curved = self.awake.iter().filter(|&&j| !system.is_affine(j));
        let curved: SmallVec<[usize; 4]> = curved.copied().collect();
        (curved.len() <= MOST_CHOSEN_SERIES).then_some(curved)
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
        !self.has_any() || self.contains(std::iter::once([t; 2]).chain(x.iter().map(|&x| [x; 2])))
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
        self.discrete.clear();
        self.discrete.extend_from_slice(q);
        // No function contains a sign.
        let signs: SmallVec<[f64; 16]> = SmallVec::from_elem(1.0, system.n_surfaces());
        let setting = Setting::new(&signs, q);
        // Times before the run do not come. A function that does not depend on time has its sign for ever.
        let for_a_while = [self.seen[0][0], self.around[0][1]];
        self.around[0] = [self.seen[0][0], f64::INFINITY];
        let mut bounds = vec![Enclosure::UNKNOWN; system.n_surfaces()];
        system.enclose_surfaces(&Around(&self.around), setting, &mut bounds);
        self.sides.clear();
        self.sides.extend(bounds.into_iter().map(side_of));
        self.list_awake();
        let for_ever = std::mem::replace(&mut self.around[0], for_a_while);
        let n_awake = self.awake.len();
        for &j in &self.awake {
            let bounds = system.enclose_surface(j, &Around(&self.around), setting);
            self.sides[j] = bounds.map_or(0, side_of);
        }
        self.list_awake();
        if self.awake.len() == n_awake {
            self.around[0] = for_ever;
        }
    }

    fn list_awake(&mut self) {
        let awake = self
            .sides
            .iter()
            .enumerate()
            .filter(|(_, side)| **side == 0);
        self.awake.clear();
        self.awake.extend(awake.map(|(j, _)| j));
    }
}

/// The sign of a function with these bounds, 0 if it may vanish. It is larger than rounding: nothing counts as a touch there.
fn side_of(bounds: Enclosure) -> i8 {
    match bounds.value {
        value if value.lo > CLEAR_IN_BOX * value.hi => 1,
        value if value.hi < CLEAR_IN_BOX * value.lo => -1,
        _ => 0,
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
            assert_eq!(asleep.awake().contains(&k), !is_outside);
            let side = if level > hi { -1 } else { 1 };
            assert_eq!(asleep.sides[k], if is_outside { side } else { 0 });
        }
        assert!(asleep.contains_point(0.0, &[1.0], &[]));
        assert!(!asleep.contains_point(0.0, &[1.0], &[2.0]));
        assert!(!asleep.contains_point(0.0, &[hi + 1.0], &[]));
        asleep.end();
        assert!(!asleep.is_used() && !asleep.has_any());
    }

    #[test]
    fn what_depends_on_time_is_proved_for_a_while() {
        let proved_until = |is_in_time: bool| {
            let mut g = Graph::new();
            let (x, t) = (g.state(0), g.time());
            let mut rate = g.constant(0.0);
            for k in 0..FEWEST_ASLEEP {
                let level = g.constant(10.0 + k as f64);
                let h = g.sub(if k == 0 && is_in_time { t } else { x }, level);
                let sign = g.sign(h);
                rate = g.add(rate, sign);
            }
            let system =
                TracedSystem::new(g, vec![rate], Vec::new(), Names::default(), Backend::Auto);
            let (system, mut asleep) = (system.unwrap(), Asleep::default());
            asleep.follow(&system, &[[0.0, 1.0], [0.0, 1.0]], &[]);
            assert!(asleep.awake().is_empty());
            asleep.around[0][1]
        };
        assert_eq!(proved_until(false), f64::INFINITY);
        assert!((1.0..10.0).contains(&proved_until(true)));
    }

    #[test]
    fn few_surfaces_are_always_monitored() {
        let system = levels(FEWEST_ASLEEP - 1);
        assert!(!Asleep::new(&system, &Options::default()).is_used());
    }
}
