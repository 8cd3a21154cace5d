//! Hidden dynamics around the root of two surfaces: where it surely tends to the root, and its returns to a half line.

use super::Outcome;
use crate::cube::Lap;
use crate::cube::{Bilinear, NormalFields};
use crate::mode::Mode;
use crate::tolerances::{AT_SIDE, AT_THE_ROOT, CYCLE, FAR_OUT, RETURNS_TO_A_CYCLE};

/// The only root that a cycle can enclose, with what is known of the motion around it.
///
/// Returns to the half line {y = P.y, x > P.x}: g_2 has one sign on it and orbits of the plane do not cross, so that their
/// distances from the root are monotone. One that is not further out than the one before proves that the motion stays bounded.
pub(super) struct Around {
    pub root: [f64; 2],
    basin: Option<Basin>,
    gamma: f64,
    last: Option<f64>,
    count: usize,
    contracts: bool,
}

impl Around {
    /// `None` if no root is in the square.
    pub fn root_of(fields: &NormalFields) -> Option<Around> {
        let bilinear = Bilinear::of_fields(fields);
        let root = bilinear.root().filter(|root| root.in_square())?.point;
        Some(Around {
            root,
            basin: Basin::around(&bilinear, root),
            gamma: Lap::around(fields, [-1, -1]).map_or(0.0, |lap| lap.gamma),
            last: None,
            count: 0,
            contracts: false,
        })
    }

    /// Does the motion from u surely tend to the root?
    pub fn attracts(&self, u: &[f64]) -> bool {
        let energy = |basin: Basin| basin.energy([u[0], u[1]]) < basin.level;
        self.basin.is_some_and(energy)
    }

    /// The motion stays around the root for ever.
    pub fn stays(&self, oscillates: bool) -> Outcome {
        Outcome::Sliding {
            mode: Mode::new(vec![0, 0]),
            multipliers: self.root.to_vec(),
            oscillates,
        }
    }

    /// Notes that u is on the line y = P.y.
    pub fn note(&mut self, u: &[f64]) -> Option<Outcome> {
        let distance = u[0] - self.root[0];
        let is_on_half_line = distance > 0.0;
        let last = is_on_half_line.then(|| self.last.replace(distance))??;
        self.count += 1;
        self.contracts |= distance <= last;
        if (distance - last).abs() <= CYCLE * last {
            Some(self.stays(true))
        } else if self.contracts && (distance < AT_THE_ROOT || self.count > RETURNS_TO_A_CYCLE) {
            Some(self.stays(self.basin.is_none()))
        } else if distance > FAR_OUT && self.gamma > 1.0 {
            // Without rotation for ever the next laps come back, or end in a certificate.
            Some(Outcome::OutwardSpiral { gamma: self.gamma })
        } else {
            None
        }
    }

    /// What is known when no more work is done.
    pub fn out_of_work(&self) -> Option<Outcome> {
        self.contracts.then(|| self.stays(self.basin.is_none()))
    }
}

/// The ellipse {e . Q e <= level} around the root, e the distance from it, where e . Q e decreases.
///
/// In the square the motion is e' = G e + d e_1 e_2. With G^T Q + Q G = -1,
///
/// ```text
/// (e . Q e)' = -|e|^2 + 2 (e . Q d) e_1 e_2 <= -|e|^2 (1 - |Q d| |e|),
/// ```
///
/// which is negative for |e| < 1/|Q d|.
#[derive(Clone, Copy, Debug)]
pub(super) struct Basin {
    root: [f64; 2],
    /// The entries xx, xy and yy of Q.
    form: [f64; 3],
    pub level: f64,
}

impl Basin {
    /// The basin of a root in the square; `None` if the root is not stable.
    pub fn around(bilinear: &Bilinear, root: [f64; 2]) -> Option<Basin> {
        let [[a, b], [c, d]] = bilinear.jacobian(root);
        let (trace, determinant) = (a + d, a * d - b * c);
        if !(trace < 0.0 && determinant > 0.0) {
            return None;
        }
        // Q = -(det G 1 + (G - tr G)^T (G - tr G)) / (2 tr G det G).
        let factor = -1.0 / (2.0 * trace * determinant);
        let xx = factor * (determinant + d * d + c * c);
        let xy = -factor * (b * d + a * c);
        let yy = factor * (determinant + a * a + b * b);
        let [bend_x, bend_y] = bilinear.rows().map(|row| row[3]);
        let pull = (xx * bend_x + xy * bend_y).hypot(xy * bend_x + yy * bend_y);
        let to_border = 1.0 - root[0].abs().max(root[1].abs());
        let radius = (1.0 - AT_SIDE) * to_border.min(1.0 / pull);
        let largest = 0.5 * (xx + yy) + (0.5 * (xx - yy)).hypot(xy);
        Some(Basin {
            root,
            form: [xx, xy, yy],
            level: (xx * yy - xy * xy) / largest * radius * radius,
        })
    }

    /// e . Q e.
    pub fn energy(&self, u: [f64; 2]) -> f64 {
        let [x, y] = [u[0] - self.root[0], u[1] - self.root[1]];
        let [xx, xy, yy] = self.form;
        xx * x * x + 2.0 * xy * x * y + yy * y * y
    }
}
