//! The two bilinear equations of sliding on two surfaces, and the only root that can be followed.

use super::normal_fields::NormalFields;
use crate::tolerances::PROPORTIONAL;

/// The canopy of two surfaces, g_j(x, y) = a_j + b_j x + c_j y + d_j x y.
///
/// Eliminating y or x from g_1 = g_2 = 0 gives two quadratic equations
///
/// ```text
/// R(x) = q2 x^2 + q1 x + q0,   q2 = b2 d1 - b1 d2,   q1 = a2 d1 + b2 c1 - a1 d2 - b1 c2,   q0 = a2 c1 - a1 c2
/// S(y) = s2 y^2 + s1 y + s0,   s2 = c2 d1 - c1 d2,   s1 = a2 d1 + c2 b1 - a1 d2 - c1 b2,   s0 = a2 b1 - a1 b2
/// ```
///
/// with the same discriminant Delta, and det G = -R'(x) = S'(y) = +-sqrt(Delta) at a root.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bilinear {
    /// [a, b, c, d] of both surfaces.
    rows: [[f64; 4]; 2],
}

/// A root of both equations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Root {
    /// (x, y): the multipliers of both surfaces.
    pub point: [f64; 2],
    /// det G in units of the product of the largest coefficients of both rows.
    pub determinant: f64,
}

/// R, S with the highest coefficient first, and their discriminant.
struct Eliminated {
    r: [f64; 3],
    s: [f64; 3],
    delta: f64,
}

impl Bilinear {
    /// The canopy of the fields at an intersection of two surfaces.
    pub fn of_fields(fields: &NormalFields) -> Self {
        let values = fields.values();
        let row = |j: usize| {
            let [mm, pm, mp, pp] = [0, 1, 2, 3].map(|pattern| values[2 * pattern + j]);
            [
                0.25 * (mm + mp + pm + pp),
                0.25 * (pp + pm - mp - mm),
                0.25 * (pp + mp - pm - mm),
                0.25 * (pp + mm - pm - mp),
            ]
        };
        Bilinear {
            rows: [row(0), row(1)],
        }
    }

    /// The coefficients [a, b, c, d] of both surfaces.
    pub fn rows(&self) -> &[[f64; 4]; 2] {
        &self.rows
    }

    /// g(x, y).
    pub fn value(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        self.rows.map(|[a, b, c, d]| a + b * x + (c + d * x) * y)
    }

    /// G(x, y), with entry `[j][p]` the derivative of g_j by multiplier p.
    pub fn jacobian(&self, [x, y]: [f64; 2]) -> [[f64; 2]; 2] {
        self.rows.map(|[_, b, c, d]| [b + d * y, c + d * x])
    }

    /// Delta = (det G)^2 at the roots: the event function of an exit where both roots meet. It is a
    /// polynomial in the normal components, so it is as smooth as they are.
    pub fn discriminant(&self) -> f64 {
        eliminate(&self.rows).delta
    }

    /// Are both equations the same, with zeros in the square? Then they do not determine a point.
    pub fn is_undetermined(&self) -> bool {
        let Eliminated { r, s, .. } = eliminate(&self.normalised());
        let same = r.iter().chain(&s).all(|q| q.abs() <= PROPORTIONAL);
        same && self.rows.iter().all(has_zeros_in_square)
    }

    /// The root with det G > 0, anywhere in the plane; there is at most one. `None` if the roots are
    /// complex, at infinity, or undetermined.
    ///
    /// The other root, with det G < 0, is a saddle of the hidden dynamics for all scalings.
    pub fn root(&self) -> Option<Root> {
        let rows = self.normalised();
        let eliminated = eliminate(&rows);
        if eliminated.delta < 0.0 {
            return None;
        }
        let mut root = eliminated.root(eliminated.delta.sqrt())?;
        if eliminated.delta > PROPORTIONAL {
            let normalised = Bilinear { rows };
            root.point = normalised.polished(normalised.polished(root.point));
        }
        Some(root)
    }

    /// The root with det G > 0, continued beyond the point where both roots meet by the abscissa of
    /// the minimum of |Delta|: r = sqrt(max(Delta, 0)). A trial stage slightly beyond such a point
    /// is defined by it; at the point itself it is the double root (-q1/(2 q2), -s1/(2 s2)).
    pub fn extended_root(&self) -> Option<[f64; 2]> {
        let eliminated = eliminate(&self.normalised());
        let root = eliminated.root(eliminated.delta.max(0.0).sqrt())?;
        Some(root.point)
    }

    /// The root with det G > 0 if the motion can slide at it: inside the square and stable for some
    /// scaling of the surfaces, min(G11, G22) < 0.
    pub fn sliding_root(&self) -> Option<Root> {
        let root = self.root().filter(|root| root.in_square())?;
        let jacobian = self.jacobian(root.point);
        (jacobian[0][0] < 0.0 || jacobian[1][1] < 0.0).then_some(root)
    }

    /// How clearly there is a root in the square, stable or not: positive if and only if there is one, and zero where
    /// it reaches the border or meets the other one.
    pub fn root_margin(&self) -> f64 {
        let canopy = Bilinear {
            rows: self.normalised(),
        };
        let root = self.root().map(|root| root.point);
        let Some([x, y]) = root.or_else(|| self.extended_root()) else {
            return -1.0;
        };
        let inside = 1.0 - x.abs().max(y.abs());
        inside.min(canopy.discriminant())
    }

    fn normalised(&self) -> [[f64; 4]; 2] {
        self.rows.map(|row| {
            let largest = row.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            if largest > 0.0 {
                row.map(|v| v / largest)
            } else {
                row
            }
        })
    }

    fn polished(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let g = self.value([x, y]);
        let [[g11, g12], [g21, g22]] = self.jacobian([x, y]);
        let det = g11 * g22 - g12 * g21;
        let dx = (g22 * g[0] - g12 * g[1]) / det;
        let dy = (g11 * g[1] - g21 * g[0]) / det;
        if dx.is_finite() && dy.is_finite() {
            [x - dx, y - dy]
        } else {
            [x, y]
        }
    }
}

impl Root {
    /// Do both multipliers lie in (-1, 1)?
    pub fn in_square(&self) -> bool {
        self.point.iter().all(|v| v.abs() < 1.0)
    }
}

/// Does a + b x + c y + d x y change its sign, or vanish, over the square?
fn has_zeros_in_square([a, b, c, d]: &[f64; 4]) -> bool {
    let corners = [a + b + c + d, a + b - c - d, a - b + c - d, a - b - c + d];
    !(corners.iter().all(|&v| v > 0.0) || corners.iter().all(|&v| v < 0.0))
}

fn eliminate(rows: &[[f64; 4]; 2]) -> Eliminated {
    let [[a1, b1, c1, d1], [a2, b2, c2, d2]] = *rows;
    let r = [
        b2 * d1 - b1 * d2,
        a2 * d1 + b2 * c1 - a1 * d2 - b1 * c2,
        a2 * c1 - a1 * c2,
    ];
    let s = [
        c2 * d1 - c1 * d2,
        a2 * d1 + c2 * b1 - a1 * d2 - c1 * b2,
        a2 * b1 - a1 * b2,
    ];
    let delta = r[1] * r[1] - 4.0 * r[0] * r[2];
    Eliminated { r, s, delta }
}

impl Eliminated {
    /// The root with R' = -root_of_delta and S' = root_of_delta.
    fn root(&self, root_of_delta: f64) -> Option<Root> {
        let x = with_slope(self.r, -root_of_delta);
        let y = with_slope(self.s, root_of_delta);
        (x.is_finite() && y.is_finite()).then_some(Root {
            point: [x, y],
            determinant: root_of_delta,
        })
    }
}

/// The zero of p2 z^2 + p1 z + p0 with this slope,
/// z = (slope - p1)/(2 p2) = -2 p0/(slope + p1), by the quotient whose sum does not cancel.
fn with_slope([p2, p1, p0]: [f64; 3], slope: f64) -> f64 {
    let (over, under) = (slope - p1, slope + p1);
    if over.abs() >= under.abs() {
        over / (2.0 * p2)
    } else {
        -2.0 * p0 / under
    }
}
