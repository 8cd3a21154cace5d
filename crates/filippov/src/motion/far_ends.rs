//! Multipliers that do not come to their ends while the motion stays near to where it is.

use filippov_expr::Motion;

use super::asleep::Around;
use crate::cube::IntervalVector;
use crate::page::IS_PAGE;
use crate::tolerances::{CLEAR_IN_BOX, MOST_BOX_STEPS, STEPS_BEFORE_BOX};

/// Multipliers that bounds over a box of times and states keep away from their ends. While the motion stays in the box their exit
/// functions have no zero, and no step has to prove that anew.
///
/// The first steps of a motion do without: between switches that follow fast upon one another a box does not pay. A box reaches as many
/// steps ahead as it turns out that all multipliers stay away from their ends in it, which is seldom left.
#[derive(Clone, Debug)]
pub(crate) struct FarEnds {
    /// The box, time first; empty if there is none.
    around: Vec<[f64; 2]>,
    /// By place among the surfaces slid on.
    is_far: Vec<bool>,
    /// Steps until the next box is tried.
    wait: u32,
    /// How many steps the next box reaches ahead.
    reach: f64,
}

impl Default for FarEnds {
    fn default() -> Self {
        FarEnds {
            around: Vec::new(),
            is_far: Vec::new(),
            wait: STEPS_BEFORE_BOX,
            reach: f64::from(STEPS_BEFORE_BOX),
        }
    }
}

impl FarEnds {
    /// Another motion begins.
    pub fn restart(&mut self) {
        self.leave();
        (self.wait, self.reach) = (STEPS_BEFORE_BOX, f64::from(STEPS_BEFORE_BOX));
    }

    fn leave(&mut self) {
        self.around.clear();
        self.is_far.clear();
    }

    /// Is the multiplier of this surface slid on away from both ends?
    #[inline]
    pub fn is_far(&self, place: usize) -> bool {
        self.places().get(place) == Some(&true)
    }

    /// Those by their places; empty if there are none.
    #[inline]
    pub fn places(&self) -> &[bool] {
        match IS_PAGE {
            true => &[],
            false => &self.is_far,
        }
    }

    /// Does a step have to ask whether it leaves the box, or for a new one? The first ones do not.
    #[inline]
    pub fn is_due(&mut self) -> bool {
        if IS_PAGE {
            return false;
        }
        if !self.around.is_empty() || self.wait == 0 {
            return true;
        }
        self.wait -= 1;
        false
    }

    /// The motion goes along a step over these ranges, time first: the box is left, and made anew, if they are not in it. `enclose`
    /// bounds the multipliers over a box.
    pub fn follow(
        &mut self,
        ranges: &[[f64; 2]],
        enclose: impl FnOnce(&dyn Motion) -> Option<IntervalVector>,
    ) {
        let is_inside = |(around, range): (&[f64; 2], &[f64; 2])| {
            // A NaN is nowhere.
            around[0] <= range[0] && range[1] <= around[1]
        };
        if !self.around.is_empty() && self.around.iter().zip(ranges).all(is_inside) {
            return;
        }
        self.leave();
        let wider = |&[lo, hi]: &[f64; 2]| {
            let by = self.reach * (hi - lo);
            [lo - by, hi + by]
        };
        self.around.extend(ranges.iter().map(wider));
        // The time goes on.
        self.around[0][0] = ranges[0][0];
        let clear = 1.0 - CLEAR_IN_BOX;
        if let Some(values) = enclose(&Around(&self.around)) {
            let is_far = values.iter().map(|l| -clear < l.lo && l.hi < clear);
            self.is_far.extend(is_far);
        }
        if self.is_far.contains(&true) {
            let all = !self.is_far.contains(&false);
            let factor = if all { 2.0 } else { 0.5 };
            self.reach = (factor * self.reach).clamp(1.0, MOST_BOX_STEPS);
        } else {
            self.leave();
            self.wait = STEPS_BEFORE_BOX * 4;
            self.reach = 1.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use filippov_expr::Interval;

    use super::{FarEnds, STEPS_BEFORE_BOX};

    #[test]
    fn a_box_is_made_after_some_steps_and_left_where_the_motion_goes() {
        let mut ends = FarEnds::default();
        for _ in 0..STEPS_BEFORE_BOX {
            assert!(!ends.is_due());
        }
        assert!(ends.is_due() && !ends.is_far(0));
        let mut asked = 0;
        // Multipliers x and 0.1 t where the step k is at x = 0.01 k.
        let mut step = |ends: &mut FarEnds, k: f64| {
            let ranges = [[k, k + 1.0], [0.01 * k, 0.01 * (k + 1.0)]];
            ends.follow(&ranges, |around| {
                asked += 1;
                let x = around.state(0).value;
                Some([x, around.time().scaled(0.1)].into_iter().collect())
            });
            asked
        };
        assert_eq!(step(&mut ends, 0.0), 1);
        assert!(ends.is_far(0) && ends.is_far(1) && !ends.is_far(2));
        assert_eq!(step(&mut ends, 2.0), 1);
        // From t = 10 on the second one is beyond its end.
        step(&mut ends, 12.0);
        assert!(ends.is_far(0) && !ends.is_far(1));
        ends.restart();
        assert!(!ends.is_far(0) && ends.places().is_empty() && !ends.is_due());
    }

    #[test]
    fn without_bounds_nothing_is_far() {
        let mut ends = FarEnds::default();
        while !ends.is_due() {}
        ends.follow(&[[0.0, 1.0], [0.0, f64::NAN]], |_| None);
        assert!(!ends.is_far(0) && !ends.is_due());
        while !ends.is_due() {}
        ends.follow(&[[0.0, 1.0]], |_| {
            Some([Interval::ALL].into_iter().collect())
        });
        assert!(!ends.is_far(0));
    }
}
