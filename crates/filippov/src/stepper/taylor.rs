//! The Taylor method: the coefficients of the motion are the step, its continuous extension and its error.

use smallvec::SmallVec;

use super::controller::{rough_exp2, rough_log2};
use super::{Attempt, ErrorScale, Interpolant, Step};
use crate::error::FieldError;
use crate::motion::{OwnJets, SmoothField};
use crate::page::IS_PAGE;
use crate::powers::power;
use crate::tolerances::{
    ERRORS_OF_STEPS, TAYLOR_DEAR, TAYLOR_LARGEST_ORDER, TAYLOR_NOISE, TAYLOR_ORDER_CHEAP,
    TAYLOR_ORDER_DEAR, TAYLOR_SLOW, TAYLOR_UNDERFLOW, WARY_GROWTH, WARY_POINTS, WARY_START,
};

/// The series of the present motion.
#[derive(Clone, Default)]
pub(super) struct MotionSeries {
    pub(super) jets: Option<OwnJets>,
    /// How long a step the series allows that was taken at the start of the motion, until the step.
    pub(super) reach: Option<f64>,
    /// The user was warned that a motion has no series.
    pub(super) has_warned: bool,
}

/// A Taylor step of variable length.
///
/// With coefficients up to order N in units of the tolerance, |c_k|, the step is as long as the last two
/// allow: |c_k| dt^k <= 1/10 for k = N - 1 and N. The first term left out is smaller by the ratio of the step to the
/// radius of convergence. At the end of the step the
/// derivative of the series is compared with the field. If the field may change without an effect on the coefficients
/// ([`wary_over`](Self::wary_over)), it is also compared at some points within the step.
///
/// Reference: Jorba, Zou, *A software package for the numerical integration of ODEs by means of high-order
/// Taylor methods*, Exp. Math. 14 (2005).
#[repr(C)]
#[derive(Clone)]
pub struct Taylor {
    pub(super) step: Step,
    n: usize,
    order: usize,
    /// Entries of a row: the states, then functions of them.
    width: usize,
    /// Coefficients in powers of time at the start of the step, in (order + 1) rows. Entries behind these rows are left from
    /// other motions and are not read.
    rows: Vec<f64>,
    /// The rows belong to the current start.
    is_expanded: bool,
    pub(super) series: MotionSeries,
    defect: Vec<f64>,
    /// Error of the attempted step in units of the tolerance.
    error: f64,
    /// The longest step at present, if the field may change where no coefficient tells.
    wary: Option<f64>,
    /// A state within the step, and the rate there.
    inner: [Vec<f64>; 2],
}

impl Taylor {
    /// The order for a relative tolerance. The higher the order, the longer and dearer the step; `operations` tells
    /// how many the coefficients up to an order take, if there are any.
    pub fn order_for(rtol: f64, operations: impl Fn(usize) -> Option<usize>) -> usize {
        let digits = -libm::log10(rtol).min(0.0);
        let order = |(per_digit, beside): (f64, f64)| {
            let order = (per_digit * digits + beside).ceil() as usize;
            order.clamp(2, TAYLOR_LARGEST_ORDER)
        };
        let cheap = order(TAYLOR_ORDER_CHEAP);
        match operations(cheap) {
            Some(count) if count > TAYLOR_DEAR => order(TAYLOR_ORDER_DEAR),
            _ => cheap,
        }
    }

    /// How many numbers its coefficients are, with those of functions of the states.
    pub fn n_in_rows(&self) -> usize {
        self.rows.len()
    }

    /// A stepper for n states.
    pub fn new(n: usize, order: usize) -> Self {
        Taylor {
            n,
            order,
            width: n,
            rows: Vec::new(),
            is_expanded: false,
            step: Step::new(n, Interpolant::powers(n, order)),
            series: MotionSeries::default(),
            defect: vec![0.0; n],
            error: 0.0,
            wary: None,
            inner: Default::default(),
        }
    }

    /// The same for a field that may change where no coefficient tells: first steps are short beside this time span.
    #[must_use]
    pub fn wary_over(mut self, span: f64) -> Self {
        self.wary = Some(WARY_START * span);
        self.inner = [vec![0.0; self.n], vec![0.0; self.n]];
        self
    }

    /// The order of the method.
    pub fn order(&self) -> usize {
        self.order
    }

    /// Are the coefficients at the start of the step known?
    pub fn is_expanded(&self) -> bool {
        self.is_expanded
    }

    /// Takes the coefficients at the start `y` of a step, rows of `width`, that `fill` writes; returns the length
    /// of step that they allow, NaN if they are not finite or too small to be told from zero.
    #[inline(always)]
    pub fn expand(
        &mut self,
        width: usize,
        y: &[f64],
        scale: &ErrorScale,
        fill: impl FnOnce(&mut [f64]),
    ) -> f64 {
        self.width = width;
        let size = (self.order + 1) * width;
        if self.rows.len() < size {
            self.rows.resize(size, 0.0);
        }
        fill(&mut self.rows[..size]);
        self.is_expanded = true;
        self.longest_step(y, scale)
    }

    /// Makes the derivative at the start the one that the coefficients tell.
    pub fn start_from_series(&mut self) {
        let row = self.width..self.width + self.n;
        self.step.start_derivative.copy_from_slice(&self.rows[row]);
    }

    /// The start of the step has changed.
    pub fn forget(&mut self) {
        self.is_expanded = false;
    }

    /// Coefficient k of column `place`, in powers of time.
    pub fn coefficient(&self, place: usize, k: usize) -> f64 {
        self.rows[k * self.width + place]
    }

    /// Writes column `place` of the coefficients, in powers of theta.
    pub fn column(&self, place: usize, to: &mut [f64]) {
        let dt = self.step.interpolant.dt;
        let mut power = 1.0;
        for (to, row) in to.iter_mut().zip(self.rows.chunks_exact(self.width)) {
            *to = row[place] * power;
            power *= dt;
        }
    }

    fn row(&self, k: usize) -> &[f64] {
        &self.rows[k * self.width..k * self.width + self.n]
    }

    fn longest_step(&self, y: &[f64], scale: &ErrorScale) -> f64 {
        // A coefficient that is not finite makes all of higher order so.
        let last = self.order * self.width;
        if self.rows[last..last + self.width]
            .iter()
            .any(|c| !c.is_finite())
        {
            return f64::NAN;
        }
        let size = |k: usize| ERRORS_OF_STEPS * scale.largest(self.row(k), y);
        let longest = reach([self.order, self.order - 1].map(|k| (size(k), k)));
        let longest = longest.min(self.wary.unwrap_or(f64::INFINITY));
        match longest.is_infinite() && (0..self.n).any(|place| self.has_underflow(place)) {
            true => f64::NAN,
            false => longest,
        }
    }

    /// May the last terms of a column be zero only because they are smaller than all numbers, as in huge units of time?
    pub(super) fn has_underflow(&self, place: usize) -> bool {
        let rows = self.rows[self.width..].chunks_exact(self.width);
        let mut sizes = rows.take(self.order - 1).map(|row| row[place].abs());
        sizes.any(|c| c > 0.0 && c < TAYLOR_UNDERFLOW)
    }

    /// Attempts a step of length `dt` with the coefficients taken last; the field is evaluated at its end.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn attempt_along(
        &mut self,
        field: &mut impl SmoothField,
        t: f64,
        y: &[f64],
        dt: f64,
        scale: &ErrorScale,
    ) -> Result<Attempt, FieldError> {
        (self.step.interpolant.t0, self.step.interpolant.dt) = (t, dt);
        match self.n {
            1 => self.sum_few::<1>(y),
            2 => self.sum_few::<2>(y),
            3 => self.sum_few::<3>(y),
            4 => self.sum_few::<4>(y),
            _ => self.sum(y),
        }
        let inner = match self.wary {
            Some(_) => self.inner_error(field, t, scale)?,
            None => 0.0,
        };
        field.eval(t + dt, &mut self.step.end, &mut self.step.end_derivative)?;
        // The defect is the derivative of the first term left out: order + 1 times that term over the step.
        let share = 1.0 / (self.order + 1) as f64;
        for (defect, rate) in self.defect.iter_mut().zip(&self.step.end_derivative) {
            *defect = share * (*defect - dt * rate);
        }
        self.error = scale.norm(&self.defect, &self.step.end).max(inner);
        if let Some(longest) = &mut self.wary {
            *longest = match self.error <= 1.0 {
                true => longest.max(WARY_GROWTH * dt),
                false => longest.min(dt),
            };
        }
        let is_finite = self.error.is_finite() && self.step.end.iter().all(|y| y.is_finite());
        Ok(if is_finite {
            Attempt::Error(self.error)
        } else {
            Attempt::NotFinite
        })
    }

    /// What the field adds to the state that the series does not know of, as far as some points in the step tell.
    fn inner_error(
        &mut self,
        field: &mut impl SmoothField,
        t: f64,
        scale: &ErrorScale,
    ) -> Result<f64, FieldError> {
        let dt = self.step.interpolant.dt;
        let [x, rate] = &mut self.inner;
        let mut largest = 0.0_f64;
        for theta in WARY_POINTS {
            self.step.interpolant.at(theta, x);
            field.eval(t + theta * dt, x, rate)?;
            rate.iter_mut().for_each(|rate| *rate *= dt);
            let rows = self.step.interpolant.coefficients().chunks_exact(self.n);
            let mut power = 1.0;
            for (k, row) in rows.enumerate().skip(1) {
                let pairs = rate.iter_mut().zip(row);
                pairs.for_each(|(rate, c)| *rate -= k as f64 * power * c);
                power *= theta;
            }
            let share = 1.0 / WARY_POINTS.len() as f64;
            largest = largest.max(share * scale.norm(rate, x));
        }
        Ok(largest)
    }

    /// Writes the coefficients in powers of theta, their sum, which is the end of the step, and the derivative in
    /// theta there; some states at a time.
    fn sum(&mut self, y: &[f64]) {
        let mut first = 0;
        while first < self.n {
            first += match self.n - first {
                8.. if !IS_PAGE => self.sum_columns::<8>(y, first),
                4.. if !IS_PAGE => self.sum_columns::<4>(y, first),
                _ => self.sum_columns::<1>(y, first),
            };
        }
    }

    /// The same for `N` states from this one on; returns their number.
    fn sum_columns<const N: usize>(&mut self, y: &[f64], first: usize) -> usize {
        let (n, dt, own) = (self.n, self.step.interpolant.dt, first..first + N);
        let scaled = self.step.interpolant.coefficients_mut();
        scaled[own.clone()].copy_from_slice(&y[own.clone()]);
        let mut power = dt;
        let rows = self.rows[self.width..].chunks_exact(self.width);
        for (to, from) in scaled[n..].chunks_exact_mut(n).zip(rows) {
            let columns = to[first..].first_chunk_mut::<N>();
            if let (Some(to), Some(from)) = (columns, from[first..].first_chunk::<N>()) {
                *to = from.map(|c| c * power);
            }
            power *= dt;
        }
        let (mut y1, mut slope) = ([0.0; N], [0.0; N]);
        for (k, row) in scaled.chunks_exact(n).enumerate().rev() {
            if let Some(row) = row[first..].first_chunk::<N>() {
                for i in 0..N {
                    y1[i] += row[i];
                    slope[i] += k as f64 * row[i];
                }
            }
        }
        self.step.end[own.clone()].copy_from_slice(&y1);
        self.defect[own].copy_from_slice(&slope);
        N
    }

    /// As [`sum`](Self::sum), for few states: they stay in registers.
    fn sum_few<const N: usize>(&mut self, y: &[f64]) {
        let dt = self.step.interpolant.dt;
        let (scaled, _) = self
            .step
            .interpolant
            .coefficients_mut()
            .as_chunks_mut::<N>();
        let Some((first, scaled)) = scaled.split_first_mut() else {
            return;
        };
        first.copy_from_slice(y);
        let mut power = dt;
        let rows = self.rows[self.width..].chunks_exact(self.width);
        for (to, from) in scaled.iter_mut().zip(rows) {
            if let Some(from) = from.first_chunk::<N>() {
                *to = from.map(|c| c * power);
            }
            power *= dt;
        }
        let (mut y1, mut slope, mut k) = ([0.0; N], [0.0; N], self.order as f64);
        for row in scaled.iter().rev() {
            for i in 0..N {
                y1[i] += row[i];
                slope[i] += k * row[i];
            }
            k -= 1.0;
        }
        for (y1, y) in y1.iter_mut().zip(first) {
            *y1 += *y;
        }
        self.step.end.copy_from_slice(&y1);
        self.defect.copy_from_slice(&slope);
    }

    /// The end of the step without the last term of the series, if the velocity hardly changes over the step, however
    /// many terms there are: an analytic motion would allow a far longer one.
    pub fn slow_end_without_last(
        &self,
        y: &[f64],
        scale: &ErrorScale,
    ) -> Option<SmallVec<[f64; 16]>> {
        let mut rows = self.step.interpolant.coefficients().chunks_exact(self.n);
        let velocity = scale.norm(rows.nth(1)?, y);
        let change: f64 = rows
            .zip(2..)
            .map(|(row, k)| f64::from(k) * scale.norm(row, y))
            .sum();
        let last = &self.step.interpolant.coefficients()[self.order * self.n..];
        let is_slow = change < TAYLOR_SLOW * velocity + TAYLOR_NOISE;
        (is_slow && scale.norm(last, y) > 0.0)
            .then(|| self.step.end.iter().zip(last).map(|(y, c)| y - c).collect())
    }

    /// The factor for another attempt after one with this error was rejected.
    pub fn reject(&self, error: f64) -> f64 {
        let exponent = -1.0 / (self.order + 1) as f64;
        (0.9 * power(error, exponent)).clamp(0.1, 0.9)
    }

    /// The error of the series at theta > 1 in units of the tolerance.
    pub fn error_beyond(&self, theta: f64) -> f64 {
        self.error * theta.powi(self.order as i32 + 1)
    }
}

/// The time after which the first of two terms c t^k reaches 1: the least |c|^(-1/k), to three digits.
pub(crate) fn reach(terms: [(f64, usize); 2]) -> f64 {
    let exponents = terms.map(|(c, k)| match c < f64::MIN_POSITIVE {
        true => f64::INFINITY,
        false => -rough_log2(c) / k as f64,
    });
    match exponents[0].min(exponents[1]) {
        f64::INFINITY => f64::INFINITY,
        least => rough_exp2(least),
    }
}
