//! The motion over a piece of a step, enclosed.

use std::cell::RefCell;

use filippov_expr::{Enclosure, Interval, Motion};
use smallvec::SmallVec;

use crate::stepper::Interpolant;
use crate::tolerances::{EPS, PROBED};

/// The states between two points of a step, as bounds of the continuous extension and of its rate.
pub struct Tube<'a> {
    interpolant: &'a Interpolant,
    /// Middle and half length of the piece, in steps.
    middle: f64,
    radius: f64,
    /// How far the motion may lie beside the extension, by state; empty: not at all.
    margin: &'a [f64],
}

impl<'a> Tube<'a> {
    /// The piece from theta = `a` to `b`, with a `margin` for every state around it (none if empty).
    pub fn new(interpolant: &'a Interpolant, (a, b): (f64, f64), margin: &'a [f64]) -> Self {
        Tube {
            interpolant,
            middle: 0.5 * (a + b),
            radius: 0.5 * (b - a),
            margin,
        }
    }
}

impl Motion for Tube<'_> {
    fn time(&self) -> Interval {
        let (t0, dt) = (self.interpolant.t0, self.interpolant.dt);
        let centre = t0 + self.middle * dt;
        Interval::around(centre, self.radius * dt + EPS * t0.abs())
    }

    /// The polynomial is expanded around the middle of the piece,
    ///
    ///   p(theta) = d0 + d1 u + .. + d5 u^5,   |u| <= radius,
    ///
    /// so that its bounds are d0 +- sum |dk| radius^k, and those of its slope d1 +- sum k |dk| radius^(k-1).
    fn state(&self, index: usize) -> Enclosure {
        let margin = self.margin.get(index).copied().unwrap_or(0.0);
        let dt = self.interpolant.dt;
        if let Some(value) = self.interpolant.constant(index) {
            return Enclosure {
                value: Interval::around(value, margin),
                rate: Interval::around(0.0, PROBED * margin).scaled(1.0 / dt),
            };
        }
        let d = self.interpolant.expanded(index, self.middle);
        let (mut spread, mut slope_spread, mut power) = (0.0, 0.0, 1.0);
        for (k, coefficient) in d.iter().enumerate().skip(1) {
            if k > 1 {
                slope_spread += k as f64 * coefficient.abs() * power;
            }
            power *= self.radius;
            spread += coefficient.abs() * power;
        }
        // A state that stands still stays a point: the rounding is a fraction of what moves.
        let size: f64 = d.iter().skip(1).map(|c| c.abs()).sum();
        Enclosure {
            value: Interval::around(d[0], spread + 8.0 * EPS * size + margin),
            rate: Interval::around(
                d.get(1).copied().unwrap_or(0.0),
                slope_spread + 16.0 * EPS * size + PROBED * margin,
            )
            .scaled(1.0 / dt),
        }
    }
}

/// A tube that many functions ask for the same states.
pub struct RememberedTube<'t> {
    tube: &'t Tube<'t>,
    states: RefCell<SmallVec<[Option<Enclosure>; 8]>>,
}

impl<'t> RememberedTube<'t> {
    /// The tube of a motion of `n` states.
    pub fn new(tube: &'t Tube<'t>, n: usize) -> Self {
        RememberedTube {
            tube,
            states: RefCell::new(SmallVec::from_elem(None, n)),
        }
    }
}

impl Motion for RememberedTube<'_> {
    fn time(&self) -> Interval {
        self.tube.time()
    }

    fn state(&self, index: usize) -> Enclosure {
        let known = &mut self.states.borrow_mut()[index];
        *known.get_or_insert_with(|| self.tube.state(index))
    }
}
