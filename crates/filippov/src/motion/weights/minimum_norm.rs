//! The Filippov combination of least norm.

use super::RuleFailure;
use crate::cube::{Matrix, NormalFields};
use crate::tolerances::{EPS, MOST_HALVINGS, PROPORTIONAL};

/// The weights that minimise |w|_2 subject to
///
/// ```text
/// sum_k w_k f_j^k = 0 for all j,   sum_k w_k = 1,   w_k >= 0 .
/// ```
///
/// For two surfaces the solutions of the equations are a line, on which the nearest point is clipped to the
/// admissible segment ([`Segment`]); for more a small quadratic program is solved. The weights are continuous
/// and only piecewise smooth.
///
/// # Errors
/// If no convex combination is tangent to all surfaces.
pub fn minimum_norm(fields: &NormalFields) -> Result<Vec<f64>, RuleFailure> {
    if fields.m() == 2 {
        let segment = Segment::of(fields).ok_or(RuleFailure::Undetermined)?;
        return Ok(segment.nearest());
    }
    by_quadratic_program(fields)
}

/// The weights of two surfaces that solve the equations, `origin + s direction`, and the range of s in which they
/// are not negative. The origin is the solution of least norm.
#[derive(Clone, Debug, PartialEq)]
pub struct Segment {
    origin: [f64; 4],
    direction: [f64; 4],
    low: f64,
    high: f64,
    /// The smallest weight that does not depend on s.
    fixed: f64,
}

impl Segment {
    /// The segment for these fields; `None` if the equations are dependent.
    pub fn of(fields: &NormalFields) -> Option<Segment> {
        let equations = Equations::of(fields);
        let origin: [f64; 4] = equations.least_solution()?.try_into().ok()?;
        let mut direction = [0.0; 4];
        for (omitted, value) in direction.iter_mut().enumerate() {
            let mut minor = Matrix::zeros(3);
            for row in 0..3 {
                let others = (0..4).filter(|&k| k != omitted);
                for (column, k) in others.enumerate() {
                    minor[(row, column)] = equations.columns[k][row];
                }
            }
            *value = minor.determinant() * if omitted % 2 == 0 { 1.0 } else { -1.0 };
        }
        let largest = direction.iter().fold(0.0_f64, |m, d| m.max(d.abs()));
        direction.iter_mut().for_each(|d| *d /= largest);
        let (mut low, mut high, mut fixed) = (f64::NEG_INFINITY, f64::INFINITY, f64::INFINITY);
        for (w, d) in origin.iter().zip(direction) {
            if d.abs() <= PROPORTIONAL {
                fixed = fixed.min(*w);
            } else if d > 0.0 {
                low = low.max(-w / d);
            } else {
                high = high.min(-w / d);
            }
        }
        (low.is_finite() && high.is_finite()).then_some(Segment {
            origin,
            direction,
            low,
            high,
            fixed,
        })
    }

    /// The length of the range of s, or the smallest weight that does not depend on s: where it becomes negative,
    /// no combination is left.
    pub fn length(&self) -> f64 {
        self.fixed.min(self.high - self.low)
    }

    /// The weights of least norm. Beyond the end of the range its middle is taken, a continuation for trial steps.
    fn nearest(&self) -> Vec<f64> {
        let s = if self.low <= self.high {
            0.0_f64.clamp(self.low, self.high)
        } else {
            0.5 * (self.low + self.high)
        };
        let pairs = self.origin.iter().zip(&self.direction);
        pairs.map(|(w, d)| w + s * d).collect()
    }
}

/// The equations A w = e: one row per surface, in units of its largest component, and the sum.
struct Equations {
    /// The columns of A, one per pattern.
    columns: Vec<Vec<f64>>,
}

impl Equations {
    fn of(fields: &NormalFields) -> Equations {
        let sizes: Vec<f64> = (0..fields.m()).map(|j| fields.row_size(j)).collect();
        let column = |pattern| {
            let components = fields.at(pattern);
            let scaled = components.iter().zip(&sizes).map(|(f, s)| f / s);
            scaled.chain([1.0]).collect()
        };
        Equations {
            columns: (0..fields.n_patterns()).map(column).collect(),
        }
    }

    fn n_rows(&self) -> usize {
        self.columns[0].len()
    }

    /// Right-hand sides: 1 for the sum.
    fn right(&self) -> Vec<f64> {
        let mut right = vec![0.0; self.n_rows()];
        right[self.n_rows() - 1] = 1.0;
        right
    }

    /// A A^T, from the columns for which `is_used`.
    fn gram(&self, is_used: impl Fn(usize) -> bool) -> Matrix {
        let mut gram = Matrix::zeros(self.n_rows());
        for (_, a) in self.columns.iter().enumerate().filter(|(k, _)| is_used(*k)) {
            for i in 0..a.len() {
                for j in 0..a.len() {
                    gram[(i, j)] += a[i] * a[j];
                }
            }
        }
        gram
    }

    /// A^T nu.
    fn back(&self, nu: &[f64]) -> Vec<f64> {
        let product = |a: &Vec<f64>| a.iter().zip(nu).map(|(a, nu)| a * nu).sum();
        self.columns.iter().map(product).collect()
    }

    /// The solution of least norm, of whatever signs: A^T (A A^T)^-1 e.
    fn least_solution(&self) -> Option<Vec<f64>> {
        let nu = self.gram(|_| true).solve(&self.right())?;
        Some(self.back(&nu))
    }

    /// Half of |max(A^T nu, 0)|^2 less e^T nu: convex, its lowest point gives the weights; and its gradient.
    fn dual(&self, nu: &[f64]) -> (f64, Vec<f64>) {
        let weights = self.back(nu);
        let mut gradient: Vec<f64> = self.right().iter().map(|e| -e).collect();
        let mut value = -nu[nu.len() - 1];
        for (a, w) in self.columns.iter().zip(weights).filter(|(_, w)| *w > 0.0) {
            value += 0.5 * w * w;
            gradient.iter_mut().zip(a).for_each(|(g, a)| *g += w * a);
        }
        (value, gradient)
    }
}

/// The dual of the quadratic program: w = max(A^T nu, 0) with nu the lowest point of a convex, piecewise quadratic
/// function, by Newton's method with a line search. It ends after finitely many pieces.
pub(super) fn by_quadratic_program(fields: &NormalFields) -> Result<Vec<f64>, RuleFailure> {
    let equations = Equations::of(fields);
    let n_rows = equations.n_rows();
    let mut nu = vec![0.0; n_rows];
    nu[n_rows - 1] = 1.0 / equations.columns.len() as f64;
    for _ in 0..MOST_HALVINGS {
        let (value, gradient) = equations.dual(&nu);
        if gradient.iter().all(|g| g.abs() <= PROPORTIONAL) {
            return Ok(equations.back(&nu).iter().map(|w| w.max(0.0)).collect());
        }
        let weights = equations.back(&nu);
        let mut hessian = equations.gram(|k| weights[k] > 0.0);
        let trace: f64 = (0..n_rows).map(|i| hessian[(i, i)]).sum();
        for i in 0..n_rows {
            hessian[(i, i)] += EPS * trace;
        }
        let step = hessian.solve(&gradient);
        let step = step.ok_or(RuleFailure::NoTangentCombination)?;
        let slope: f64 = step.iter().zip(&gradient).map(|(s, g)| s * g).sum();
        let moved = |length: f64| -> Vec<f64> {
            let pairs = nu.iter().zip(&step);
            pairs.map(|(nu, s)| nu - length * s).collect()
        };
        let mut length = 1.0;
        for _ in 0..MOST_HALVINGS {
            // Near the lowest point the values differ by rounding only; the full step is right there.
            let rounding = f64::EPSILON * value.abs();
            if equations.dual(&moved(length)).0 <= value - 0.25 * length * slope + rounding {
                break;
            }
            length *= 0.5;
        }
        nu = moved(length);
    }
    Err(RuleFailure::NoTangentCombination)
}
