//! The normal components of all fields at an intersection, and their multilinear interpolant.

use super::resolution::Undecided;
use super::small_matrix::Matrix;
use crate::tolerances::MOST_MEETING;

/// The normal components f_j^k = dh_j/dt along f^k of the m surfaces that meet, for all 2^m sign
/// patterns k.
///
/// Patterns are numbered by their bits: bit i is set where k_i = +1. In this numbering
/// `values[pattern * m + j]` is f_j^k. The *canopy* is the interpolant that is linear in each
/// multiplier,
///
/// ```text
/// g_j(lambda) = sum over k of prod_i (1 + k_i lambda_i)/2 * f_j^k .
/// ```
///
/// # Example
/// ```
/// use filippov::switching::NormalFields;
///
/// // One surface, attractive from both sides: f- = 3, f+ = -1.
/// let fields = NormalFields::new(1, vec![3.0, -1.0])?;
/// assert_eq!(fields.interpolate(&[0.5]), [0.0]);
/// # Ok::<(), filippov::switching::Undecided>(())
/// ```
///
/// Reference: N. Guglielmi, E. Hairer (2022), formula (2.3); `docs/theory/intersections.md`.
#[derive(Clone, Debug, PartialEq)]
pub struct NormalFields {
    m: usize,
    values: Vec<f64>,
}

impl NormalFields {
    /// Normal components from their values, `m * 2^m` of them.
    ///
    /// # Errors
    /// [`Undecided::Shape`] if the number of values does not fit, [`Undecided::NotFinite`] if one
    /// of them is not finite.
    pub fn new(m: usize, values: Vec<f64>) -> Result<Self, Undecided> {
        if m == 0 || m > MOST_MEETING || values.len() != m << m {
            return Err(Undecided::Shape {
                m,
                found: values.len(),
            });
        }
        if values.iter().any(|v| !v.is_finite()) {
            return Err(Undecided::NotFinite);
        }
        Ok(NormalFields { m, values })
    }

    /// Number of surfaces.
    pub fn m(&self) -> usize {
        self.m
    }

    /// Number of sign patterns, 2^m.
    pub fn n_patterns(&self) -> usize {
        1 << self.m
    }

    /// The values, as they were given.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// The components of one pattern.
    pub fn at(&self, pattern: usize) -> &[f64] {
        &self.values[pattern * self.m..(pattern + 1) * self.m]
    }

    /// The components of the region with these signs.
    pub fn in_region(&self, signs: &[i8]) -> &[f64] {
        self.at(pattern_of(signs))
    }

    /// The largest magnitude of all components.
    pub fn size(&self) -> f64 {
        self.values.iter().fold(0.0, |m, v| m.max(v.abs()))
    }

    /// The largest magnitude of the component normal to surface j.
    pub fn row_size(&self, j: usize) -> f64 {
        let row = self.values.iter().skip(j).step_by(self.m);
        row.fold(0.0, |m, v| m.max(v.abs()))
    }

    /// g(lambda).
    pub fn interpolate(&self, lambda: &[f64]) -> Vec<f64> {
        let mut g = vec![0.0; self.m];
        for (pattern, weight) in weights(lambda, None).into_iter().enumerate() {
            for (g, f) in g.iter_mut().zip(self.at(pattern)) {
                *g += weight * f;
            }
        }
        g
    }

    /// G(lambda), with entry (j, p) the derivative of g_j by lambda_p.
    pub fn jacobian(&self, lambda: &[f64]) -> Matrix {
        let mut jacobian = Matrix::zeros(self.m);
        for p in 0..self.m {
            for (pattern, weight) in weights(lambda, Some(p)).into_iter().enumerate() {
                for (j, f) in self.at(pattern).iter().enumerate() {
                    jacobian[(j, p)] += weight * f;
                }
            }
        }
        jacobian
    }

    /// The fields on a face of the cube: the non-zero entries of `mode` are held, the zero entries are
    /// the surfaces that are left, in their order.
    pub fn restrict(&self, mode: &[i8]) -> NormalFields {
        let free: Vec<usize> = (0..self.m).filter(|&i| mode[i] == 0).collect();
        let held = pattern_of(mode);
        let mut values = Vec::with_capacity(free.len() << free.len());
        for pattern in 0..1_usize << free.len() {
            let bits = free.iter().enumerate();
            let full = bits.fold(held, |full, (bit, &i)| full | (pattern >> bit & 1) << i);
            values.extend(free.iter().map(|&j| self.at(full)[j]));
        }
        NormalFields {
            m: free.len(),
            values,
        }
    }

    /// The fields with the components of surface j multiplied by `factors[j]`: another scaling of h_j.
    #[must_use]
    pub fn scaled(&self, factors: &[f64]) -> NormalFields {
        self.map(|j, value| factors[j] * value)
    }

    /// The fields with `by[j]` added to all components of surface j: what a short time makes of them.
    #[must_use]
    pub fn shifted(&self, by: &[f64]) -> NormalFields {
        self.map(|j, value| value + by[j])
    }

    /// Is g affine in lambda, up to rounding? So it is where each sign enters the field by a term of
    /// its own, as friction does.
    pub fn is_affine(&self) -> bool {
        let corner = self.at(0);
        (0..self.n_patterns()).all(|pattern| {
            (0..self.m).all(|j| {
                let bits = (0..self.m).filter(|i| pattern >> i & 1 == 1);
                let sum: f64 = bits.map(|i| self.at(1 << i)[j] - corner[j]).sum();
                let rounding = 16.0 * f64::EPSILON * self.row_size(j);
                (self.at(pattern)[j] - corner[j] - sum).abs() <= rounding
            })
        })
    }

    /// The fields whose canopy on the whole cube is that of these on the half of it with
    /// lambda_axis on this side of 0.
    #[must_use]
    pub fn half(&self, axis: usize, side: i8) -> NormalFields {
        let mut values = self.values.clone();
        for pattern in 0..self.n_patterns() {
            let inner = (pattern >> axis & 1 == 1) != (side > 0);
            let opposite = pattern ^ (1 << axis);
            if inner {
                for j in 0..self.m {
                    let mean = 0.5 * (self.at(pattern)[j] + self.at(opposite)[j]);
                    values[pattern * self.m + j] = mean;
                }
            }
        }
        NormalFields { m: self.m, values }
    }

    /// The same surfaces with other values, as many.
    pub(super) fn with_values(&self, values: Vec<f64>) -> NormalFields {
        NormalFields { m: self.m, values }
    }

    fn map(&self, change: impl Fn(usize, f64) -> f64) -> NormalFields {
        let values = self.values.iter().enumerate();
        NormalFields {
            m: self.m,
            values: values.map(|(i, &v)| change(i % self.m, v)).collect(),
        }
    }
}

/// The number of the pattern with these signs; a zero entry leaves its bit unset.
pub(super) fn pattern_of(signs: &[i8]) -> usize {
    let bits = signs.iter().enumerate();
    bits.fold(0, |pattern, (i, &sign)| {
        pattern | usize::from(sign > 0) << i
    })
}

/// The weights prod_i (1 + k_i lambda_i)/2 of all patterns, or their derivatives by one multiplier.
fn weights(lambda: &[f64], derivative: Option<usize>) -> Vec<f64> {
    let mut weights = Vec::with_capacity(1 << lambda.len());
    weights.push(1.0);
    for (i, lam) in lambda.iter().enumerate() {
        let (minus, plus) = match derivative {
            Some(p) if p == i => (-0.5, 0.5),
            _ => (0.5 * (1.0 - lam), 0.5 * (1.0 + lam)),
        };
        for pattern in 0..1 << i {
            weights.push(plus * weights[pattern]);
            weights[pattern] *= minus;
        }
    }
    weights
}
