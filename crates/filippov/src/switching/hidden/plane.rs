//! Hidden dynamics of two surfaces, exact from event to event.

use super::basin::Basin;
use super::cell::{Cell, StepEnd};
use super::returns::{Returns, Verdict};
use super::strip::{Strip, StripEnd};
use super::{clipped, side, Outcome};
use crate::cube::Bilinear;
use crate::cube::Lap;
use crate::cube::NormalFields;
use crate::mode::Mode;
use crate::patience::Patience;
use crate::tolerances::{MOST_PIECES, MOST_TESTS};

/// Follows the motion from u, piece by piece: corner, strip, or a step within the square.
///
/// | certificate | outcome |
/// |---|---|
/// | a corner whose field points outwards in both components | region |
/// | a strip with an attracting rest point at which the clipped component grows | sliding on one |
/// | the basin of a stable root | sliding on both |
/// | a return to the half line {y = P.y, x > P.x} that is not further out than the last | sliding on both |
/// | rotating fields with gamma > 1, and returns that have come far out | outward spiral |
pub(super) fn limit(fields: &NormalFields, u: [f64; 2], patience: Patience) -> Outcome {
    let mut plane = Plane::new(fields, u);
    for _ in 0..MOST_PIECES {
        if let Some(outcome) = plane.piece() {
            return outcome;
        }
        if plane.square.tests > MOST_TESTS || patience.is_over() {
            break;
        }
    }
    plane.out_of_work()
}

struct Plane {
    u: [f64; 2],
    bilinear: Bilinear,
    /// The only root that a cycle can enclose.
    root: Option<[f64; 2]>,
    basin: Option<Basin>,
    gamma: Option<f64>,
    square: Cell,
    returns: Returns,
}

impl Plane {
    fn new(fields: &NormalFields, u: [f64; 2]) -> Self {
        let bilinear = Bilinear::of_fields(fields);
        let root = bilinear.root().filter(|root| root.in_square());
        let root = root.map(|root| root.point);
        Plane {
            u,
            bilinear,
            root,
            basin: root.and_then(|root| Basin::around(&bilinear, root)),
            gamma: Lap::around(fields, [-1, -1]).map(|lap| lap.gamma),
            square: Cell::new(fields, &[0, 0]),
            returns: Returns::default(),
        }
    }

    fn piece(&mut self) -> Option<Outcome> {
        let [x, y] = self.u;
        let velocity = self
            .bilinear
            .value([x.clamp(-1.0, 1.0), y.clamp(-1.0, 1.0)]);
        match [side(x, velocity[0]), side(y, velocity[1])] {
            [0, 0] => self.step_in_square(velocity),
            [0, side] => self.pass_strip(0, side),
            [side, 0] => self.pass_strip(1, side),
            sides => self.pass_corner(sides, velocity),
        }
    }

    /// A straight line to the nearer border, or away for ever.
    fn pass_corner(&mut self, sides: [i8; 2], velocity: [f64; 2]) -> Option<Outcome> {
        let borders = sides.map(f64::from);
        let outwards = [0, 1].map(|i: usize| borders[i] * velocity[i]);
        let time = [0, 1].map(|i: usize| {
            if outwards[i] < 0.0 {
                (borders[i] - self.u[i]) / velocity[i]
            } else {
                f64::INFINITY
            }
        });
        let first = usize::from(time[1] < time[0]);
        if time[first].is_finite() {
            let other = 1 - first;
            let moved = self.u[other] + velocity[other] * time[first];
            // Not across its own border by rounding.
            self.u[other] = borders[other] * (borders[other] * moved).max(1.0);
            self.u[first] = borders[first];
            None
        } else if outwards[0] > 0.0 && outwards[1] > 0.0 {
            Some(Outcome::Region(Mode::new(sides.to_vec())))
        } else {
            Some(Outcome::Unknown)
        }
    }

    /// Component `free` is within the transition, the other one beyond it on this side.
    fn pass_strip(&mut self, free: usize, side: i8) -> Option<Outcome> {
        let (held, border) = (1 - free, f64::from(side));
        let [along, across] = [free, held].map(|j| {
            let [a, b, c, d] = self.bilinear.rows()[j];
            let [by_held, by_free] = if held == 0 { [b, c] } else { [c, b] };
            [a + border * by_held, by_free + border * d]
        });
        let strip = Strip {
            s: self.u[free],
            w: border * self.u[held] - 1.0,
            alpha: along[0],
            beta: along[1],
            p: border * across[0],
            q: border * across[1],
        };
        let section = self.root.filter(|_| held == 0 && side == 1);
        let (mut low, mut high) = (-1.0, 1.0);
        if let Some([_, y]) = section {
            match self.u[1].partial_cmp(&y) {
                Some(std::cmp::Ordering::Less) => high = y,
                Some(std::cmp::Ordering::Greater) => low = y,
                _ => {}
            }
        }
        match strip.pass(low, high) {
            StripEnd::Across { s, w } => {
                self.u[free] = s;
                self.u[held] = border * (1.0 + w);
                let returned = section.filter(|&[_, y]| s == y);
                return returned.and_then(|[x, _]| self.note_return(self.u[0] - x));
            }
            StripEnd::Inwards { s } => {
                self.u[free] = s;
                self.u[held] = border;
            }
            StripEnd::Outwards { s } => {
                let mut mode = vec![0, 0];
                mode[held] = side;
                return Some(Outcome::Sliding {
                    mode: Mode::new(mode),
                    multipliers: vec![s],
                    oscillates: false,
                });
            }
            StripEnd::AtRest => return Some(Outcome::Unknown),
        }
        None
    }

    fn step_in_square(&mut self, velocity: [f64; 2]) -> Option<Outcome> {
        if self.basin.is_some_and(|basin| basin.contains(self.u)) {
            return Some(self.stays(false));
        }
        if velocity == [0.0, 0.0] {
            return Some(Outcome::AtRest);
        }
        let section = self.root.map(|[_, y]| (1, y));
        let (_, end) = self.square.advance(&mut self.u, section);
        let [x, _] = self.root?;
        if end == StepEnd::Level && self.u[0] > x {
            return self.note_return(self.u[0] - x);
        }
        None
    }

    fn note_return(&mut self, distance: f64) -> Option<Outcome> {
        match self.returns.note(distance) {
            Verdict::Open => None,
            Verdict::ToTheRoot => Some(self.stays(self.basin.is_none())),
            Verdict::ToACycle => Some(self.stays(true)),
            Verdict::TooMany => Some(self.out_of_work()),
            // Without rotation for ever the next laps come back, or end in a certificate.
            Verdict::Far => {
                let gamma = self.gamma.filter(|&gamma| gamma > 1.0);
                gamma.map(|gamma| Outcome::OutwardSpiral { gamma })
            }
        }
    }

    fn stays(&self, oscillates: bool) -> Outcome {
        Outcome::Sliding {
            mode: Mode::new(vec![0, 0]),
            multipliers: self.root.map_or(Vec::new(), |point| clipped(&point)),
            oscillates,
        }
    }

    fn out_of_work(&self) -> Outcome {
        if self.returns.contracts() {
            self.stays(self.basin.is_none())
        } else {
            Outcome::Unknown
        }
    }
}
