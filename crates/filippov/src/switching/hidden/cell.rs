//! Hidden dynamics within one cell, by Taylor series.

use super::first_zero::{first_loss, value};
use crate::switching::normal_fields::{pattern_of, NormalFields};

/// Order of the series. By Jorba and Zou (2005) the best order for double precision is about
/// -ln(eps)/2 + 1 = 19, with steps of 1/e^2 of the radius of convergence.
const ORDER: usize = 19;

/// The coefficients of a component over time.
type Series = [f64; ORDER + 1];

/// The field in a cell: a polynomial in the components within the transition, linear in each.
pub(super) struct Cell {
    /// Which components are clipped, and where: -1, 0 (within the transition), +1.
    pub sides: Vec<i8>,
    active: Vec<usize>,
    /// Coefficient of the product of a subset of the active components, by subset and component.
    coefficients: Vec<f64>,
    /// Series of these products.
    products: Vec<Series>,
    /// Series of the state.
    state: Vec<Series>,
}

/// Why a step within a cell ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum StepEnd {
    /// The series is not good for more.
    Full,
    /// A component reached the border of the cell.
    Border,
    /// The watched component reached its level.
    Level,
}

impl Cell {
    /// The cell with these sides.
    pub fn new(fields: &NormalFields, sides: &[i8]) -> Self {
        let m = fields.m();
        let active: Vec<usize> = (0..m).filter(|&i| sides[i] == 0).collect();
        let held = pattern_of(sides);
        let mut coefficients = Vec::with_capacity(m << active.len());
        for subset in 0..1_usize << active.len() {
            let bits = active.iter().enumerate();
            let corner = bits.fold(held, |c, (bit, &i)| c | (subset >> bit & 1) << i);
            coefficients.extend_from_slice(fields.at(corner));
        }
        for bit in 0..active.len() {
            for subset in (0..1_usize << active.len()).filter(|s| s >> bit & 1 == 1) {
                for j in 0..m {
                    let (low, high) = ((subset & !(1 << bit)) * m + j, subset * m + j);
                    let (minus, plus) = (coefficients[low], coefficients[high]);
                    coefficients[low] = 0.5 * (plus + minus);
                    coefficients[high] = 0.5 * (plus - minus);
                }
            }
        }
        Cell {
            sides: sides.to_vec(),
            products: vec![[0.0; ORDER + 1]; 1 << active.len()],
            state: vec![[0.0; ORDER + 1]; m],
            active,
            coefficients,
        }
    }

    /// Advances `u` by one step at most, to the border of the cell or to u_i = level for the
    /// watched (i, level), whichever comes first. Returns the time taken.
    pub fn advance(&mut self, u: &mut [f64], watched: Option<(usize, f64)>) -> (f64, StepEnd) {
        self.expand(u);
        let mut end = self.step();
        let mut reason = StepEnd::Full;
        let mut stop: Option<(usize, f64)> = None;
        for i in 0..u.len() {
            let borders = if self.sides[i] == 0 {
                [-1, 1]
            } else {
                [self.sides[i], 0]
            };
            for border in borders.into_iter().filter(|&b| b != 0) {
                // Positive within the cell.
                let inwards = f64::from(if self.sides[i] == 0 { -border } else { border });
                if let Some(t) = first_loss(&self.distance(i, f64::from(border), inwards), end) {
                    (end, reason, stop) = (t, StepEnd::Border, Some((i, f64::from(border))));
                }
            }
        }
        if let Some((i, level)) = watched {
            let away = self.direction(i, level);
            if let Some(t) = first_loss(&self.distance(i, level, away), end) {
                (end, reason, stop) = (t, StepEnd::Level, Some((i, level)));
            }
        }
        for (u, series) in u.iter_mut().zip(&self.state) {
            *u = value(series, end);
        }
        if let Some((i, exactly)) = stop {
            u[i] = exactly;
        }
        (end, reason)
    }

    /// direction * (u_i - level) over time.
    fn distance(&self, i: usize, level: f64, direction: f64) -> Series {
        let mut series = self.state[i].map(|c| direction * c);
        series[0] -= direction * level;
        series
    }

    /// The side of the level on which component i is, or to which it goes if it is on it.
    fn direction(&self, i: usize, level: f64) -> f64 {
        let offset = self.state[i][0] - level;
        let sign = if offset != 0.0 {
            offset
        } else {
            self.state[i][1]
        };
        1.0_f64.copysign(sign)
    }

    /// The series of the motion from u.
    fn expand(&mut self, u: &[f64]) {
        let m = u.len();
        for (series, u) in self.state.iter_mut().zip(u) {
            series[0] = *u;
        }
        for order in 0..ORDER {
            self.expand_products(order);
            for i in 0..m {
                let terms = self.products.iter().enumerate();
                let rate: f64 = terms
                    .map(|(s, p)| self.coefficients[s * m + i] * p[order])
                    .sum();
                self.state[i][order + 1] = rate / (order + 1) as f64;
            }
        }
    }

    fn expand_products(&mut self, order: usize) {
        self.products[0][order] = if order == 0 { 1.0 } else { 0.0 };
        for subset in 1..self.products.len() {
            let last = subset.ilog2();
            let factor = &self.state[self.active[last as usize]];
            let rest = subset & !(1 << last);
            let entry = if rest == 0 {
                factor[order]
            } else {
                let pairs = self.products[rest][..=order]
                    .iter()
                    .zip(factor[..=order].iter().rev());
                pairs.map(|(a, b)| a * b).sum()
            };
            self.products[subset][order] = entry;
        }
    }

    /// The length over which the series is exact to rounding.
    fn step(&self) -> f64 {
        let largest = |k: usize| {
            let at_order = self.state.iter().map(|series| series[k].abs());
            at_order.fold(f64::MIN_POSITIVE, f64::max)
        };
        let radius = |k: usize| largest(k).powf(-1.0 / k as f64);
        radius(ORDER).min(radius(ORDER - 1)) * (-2.0_f64).exp()
    }
}
