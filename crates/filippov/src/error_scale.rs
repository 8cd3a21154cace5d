//! The tolerances of a run as the weights of an error.

/// The weights of the error norm: atol_i + rtol max(|y0_i|, |y1_i|). A component that is zero at both ends and has no
/// absolute tolerance does not count: nothing tells its size.
#[derive(Clone, Debug)]
pub struct ErrorScale {
    rtol: f64,
    atol: Vec<f64>,
}

impl ErrorScale {
    /// Tolerances for n components; `atol` holds one entry or n.
    pub fn new(rtol: f64, atol: &[f64], n: usize) -> Self {
        let atol = if atol.len() == 1 {
            vec![atol[0]; n]
        } else {
            atol.to_vec()
        };
        // A tolerance of zero would be one that nothing keeps, and nothing can be divided by.
        let atol = atol.into_iter().map(|a| a.max(f64::MIN_POSITIVE)).collect();
        ErrorScale { rtol, atol }
    }

    /// The scale of component `i`; infinite where it does not count.
    #[inline]
    pub fn of(&self, i: usize, y0: f64, y1: f64) -> f64 {
        scale(self.tolerance(i, y0, y1))
    }

    /// The absolute tolerances.
    pub(crate) fn atol(&self) -> &[f64] {
        &self.atol
    }

    /// The scale of a component with this absolute tolerance.
    #[inline(always)]
    pub(crate) fn by(&self, atol: f64, y0: f64, y1: f64) -> f64 {
        scale(tolerance(atol, self.rtol, y0, y1))
    }

    /// What component `i` may err by.
    #[inline]
    pub fn tolerance(&self, i: usize, y0: f64, y1: f64) -> f64 {
        tolerance(self.atol[i], self.rtol, y0, y1)
    }

    /// The size of component `i` at `y` is its magnitude. Where the magnitude is small, the size is the value below which the
    /// absolute tolerance governs the error. The size is infinite if the component is zero and has no absolute tolerance.
    pub fn size(&self, i: usize, y: f64) -> f64 {
        self.of(i, y, y) / self.rtol
    }

    /// The tolerance for a function with this gradient at `y`: the sum of what those of the components amount to.
    pub fn along(&self, gradient: &[f64], y: &[f64]) -> f64 {
        let components = gradient.iter().zip(y).enumerate();
        components
            .map(|(i, (g, y))| g.abs() * self.tolerance(i, *y, *y))
            .sum()
    }

    /// Largest component of `v` in units of the scale at `y`.
    pub fn largest(&self, v: &[f64], y: &[f64]) -> f64 {
        let components = v.iter().zip(y).enumerate();
        let ratios = components.map(|(i, (v, y))| v.abs() / self.of(i, *y, *y));
        ratios.fold(0.0, |most, ratio| if ratio > most { ratio } else { most })
    }

    /// Root mean square of `v` in units of the scale at `y`.
    pub fn norm(&self, v: &[f64], y: &[f64]) -> f64 {
        root_mean_square(v.len(), |i| v[i] / self.of(i, y[i], y[i]))
    }
}

#[inline(always)]
fn tolerance(atol: f64, rtol: f64, y0: f64, y1: f64) -> f64 {
    // Not `f64::max`: a NaN must survive, and one comparison is cheaper.
    let (a, b) = (y0.abs(), y1.abs());
    atol + rtol * if b < a { a } else { b }
}

/// What an error of this tolerance is measured in.
#[inline(always)]
fn scale(tolerance: f64) -> f64 {
    if tolerance == f64::MIN_POSITIVE {
        f64::INFINITY
    } else {
        tolerance
    }
}

/// Root mean square of n ratios; where their squares overflow, the largest of them.
#[inline(always)]
pub(crate) fn root_mean_square(n: usize, ratio: impl Fn(usize) -> f64) -> f64 {
    let mut sum = 0.0;
    for i in 0..n {
        let ratio = ratio(i);
        sum += ratio * ratio;
    }
    if sum == f64::INFINITY {
        return (0..n).map(|i| ratio(i).abs()).fold(0.0, f64::max);
    }
    (sum / n as f64).sqrt()
}
