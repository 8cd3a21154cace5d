//! The rounding of a switching function where it is evaluated.

use filippov_expr::{Enclosure, Interval, Motion};

use super::TracedSystem;
use crate::system::{Enclosures, Place};

/// A single point, as a motion.
struct StandingStill<'a> {
    t: f64,
    x: &'a [f64],
}

impl Motion for StandingStill<'_> {
    fn time(&self) -> Interval {
        Interval::point(self.t)
    }

    fn state(&self, index: usize) -> Enclosure {
        Enclosure {
            value: Interval::point(self.x[index]),
            rate: Interval::ZERO,
        }
    }
}

impl TracedSystem {
    /// Twice a bound of what rounding makes of h_j at a point, in interval arithmetic; 0 where there is none.
    pub(super) fn rounding_of_surface(&self, j: usize, place: &Place<'_>) -> f64 {
        let &Place { t, x, .. } = place;
        let enclosed = self.enclose_surface(j, &StandingStill { t, x }, place.setting());
        let width = enclosed.map_or(0.0, |h| h.value.hi - h.value.lo);
        if width.is_finite() {
            width
        } else {
            0.0
        }
    }
}
