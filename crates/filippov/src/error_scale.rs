//! The tolerances of a run: the weights of an error, and the sizes of the states.

use crate::options::Options;

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

/// What is near, in a system whose states differ in size. The absolute tolerances tell how the sizes compare, and the state itself how
/// large they are. The unit of time is that in which a state changes by its size.
#[derive(Clone, Copy, Debug)]
pub struct Units<'a> {
    atol: &'a [f64],
    /// The largest of them.
    most: f64,
    /// Where the absolute tolerance governs the error, for the largest one.
    floor: f64,
    /// The state.
    x: &'a [f64],
    /// The size of a state that is zero, for the largest absolute tolerance.
    least: f64,
    /// How many sizes a state changes by in a unit of the user's time; zero if it is not known.
    pace: f64,
}

impl<'a> From<&'a Options> for Units<'a> {
    fn from(options: &'a Options) -> Self {
        let most = options.atol.iter().fold(0.0, |most: f64, a| most.max(*a));
        let floor = most / options.rtol;
        Units {
            atol: &options.atol,
            most,
            floor,
            least: if floor > 0.0 { floor } else { 1.0 },
            ..Units::ONES
        }
    }
}

impl<'a> Units<'a> {
    /// Those of a system whose states and times are about 1.
    pub const ONES: Units<'static> = Units {
        atol: &[],
        most: 1.0,
        floor: 1.0,
        x: &[],
        least: 1.0,
        pace: 0.0,
    };

    /// The size of the states for which these are the tolerances: the default ones are for states of size 1.
    pub fn size_meant(options: &Options) -> f64 {
        Units::from(options).least * (Options::RTOL / Options::ATOL)
    }

    /// Those at a point: a state that is zero has the size of the smallest one there that is not, in comparison.
    #[inline(never)]
    #[must_use]
    pub fn at<'s>(self, x: &'s [f64]) -> Units<'s>
    where
        'a: 's,
    {
        let sizes = x.iter().enumerate().map(|(i, x)| x.abs() / self.part(i));
        let known = sizes.filter(|size| *size > self.floor);
        let least = known.fold(f64::INFINITY, f64::min);
        Units {
            x,
            least: if least.is_finite() { least } else { self.least },
            ..self
        }
    }

    /// With the pace of a motion in these sizes.
    #[must_use]
    pub fn with_pace(self, pace: f64) -> Self {
        Units { pace, ..self }
    }

    /// The size of state `i`.
    #[inline(never)]
    pub fn of_state(&self, i: usize) -> f64 {
        self.x.get(i).map_or(0.0, |x| x.abs()) + self.least * self.part(i)
    }

    /// A short time at `t`.
    pub fn of_time(&self, t: f64) -> f64 {
        if self.pace > 0.0 && self.pace.is_finite() {
            1.0 / self.pace
        } else {
            1.0 + t.abs()
        }
    }

    /// The sizes of `n` states as parts of the largest; none if they are the same.
    #[inline(never)]
    pub fn parts(&self, n: usize) -> Vec<f64> {
        let parts = (0..n).map(|i| self.part(i));
        match parts.clone().all(|part| part == 1.0) {
            true => Vec::new(),
            false => parts.collect(),
        }
    }

    #[inline(never)]
    fn part(&self, i: usize) -> f64 {
        match self.atol.get(i) {
            Some(atol) if *atol > 0.0 && self.atol.len() > 1 => atol / self.most,
            _ => 1.0,
        }
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
