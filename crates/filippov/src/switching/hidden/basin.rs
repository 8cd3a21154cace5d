//! A neighbourhood of a stable root from which the hidden dynamics of two surfaces surely tends to it.

use crate::cube::Bilinear;
use crate::tolerances::BASIN_SHARE;

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
    form: [[f64; 2]; 2],
    level: f64,
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
        let off = -factor * (b * d + a * c);
        let form = [
            [factor * (determinant + d * d + c * c), off],
            [off, factor * (determinant + a * a + b * b)],
        ];
        let bend = [bilinear.rows()[0][3], bilinear.rows()[1][3]];
        let pull = [0, 1].map(|i: usize| form[i][0] * bend[0] + form[i][1] * bend[1]);
        let to_border = 1.0 - root[0].abs().max(root[1].abs());
        let radius = BASIN_SHARE * to_border.min(1.0 / pull[0].hypot(pull[1]));
        let (mean, half) = (
            0.5 * (form[0][0] + form[1][1]),
            0.5 * (form[0][0] - form[1][1]),
        );
        let smallest = (form[0][0] * form[1][1] - off * off) / (mean + half.hypot(off));
        Some(Basin {
            root,
            form,
            level: smallest * radius * radius,
        })
    }

    /// Does the motion from u tend to the root?
    pub fn contains(&self, u: [f64; 2]) -> bool {
        self.energy(u) < self.level
    }

    /// e . Q e.
    pub fn energy(&self, u: [f64; 2]) -> f64 {
        let [x, y] = [u[0] - self.root[0], u[1] - self.root[1]];
        let [[xx, xy], [_, yy]] = self.form;
        xx * x * x + 2.0 * xy * x * y + yy * y * y
    }
}
