//! Hidden dynamics within one cell, by Taylor series.

use super::first_zero::{first_loss, largest_change, value};
use crate::cube::{NormalFields, SignGroup, Vector};
use crate::powers::power;
use crate::tolerances::SAME_NUMBER;

/// Order of the series. By Jorba and Zou (2005) the best order is about -ln(error)/2 + 1 = 15, if each order costs as much
/// as all that it is made of; most of a step costs the same for every order.
const ORDER: usize = 19;

/// The coefficients of a component over time.
type Series = [f64; ORDER + 1];

/// The field in a cell: a polynomial in the components within the transition, linear in each.
pub(super) struct Cell {
    /// Which components are clipped, and where: -1, 0 (within the transition), +1.
    pub sides: Vec<i8>,
    /// What does not depend on the components within the transition.
    constant: Vec<f64>,
    terms: Vec<Term>,
    /// Series of the state.
    state: Vec<Series>,
}

/// The part of the field with the components of one group.
struct Term {
    active: Vec<usize>,
    /// Coefficient of the product of a subset of the active components, by subset and component of the field.
    coefficients: Vec<f64>,
    /// Series of these products; the empty one is not used.
    products: Vec<Series>,
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
        let mut constant = vec![0.0; m];
        let mut terms = Vec::new();
        for group in fields.groups() {
            let term = Term::new(group, sides, m);
            constant
                .iter_mut()
                .zip(&term.coefficients)
                .for_each(|(sum, c)| *sum += c);
            if !term.active.is_empty() {
                terms.push(term);
            }
        }
        Cell {
            sides: sides.to_vec(),
            constant,
            terms,
            state: vec![[0.0; ORDER + 1]; m],
        }
    }

    /// Advances `u` by one step at most, to the border of the cell or to u_i = level for the
    /// watched (i, level), whichever comes first. Returns the time taken; `tests` counts the intervals that were searched for
    /// zeros.
    pub fn advance(
        &mut self,
        u: &mut [f64],
        watched: Option<(usize, f64)>,
        tests: &mut usize,
    ) -> (f64, StepEnd) {
        self.expand(u);
        let mut end = self.step();
        let mut stop: Option<(StepEnd, usize, f64)> = None;
        for (i, &start) in u.iter().enumerate() {
            let change = largest_change(&self.state[i], end);
            // Each border with the direction into the cell.
            let borders: &[(f64, f64)] = match self.sides[i] {
                0 => &[(-1.0, 1.0), (1.0, -1.0)],
                side if side > 0 => &[(1.0, 1.0)],
                _ => &[(-1.0, -1.0)],
            };
            for &(border, inwards) in borders {
                // Most motions do not come near.
                if inwards * (start - border) > change {
                    continue;
                }
                let distance = self.distance(i, border, inwards);
                if let Some(t) = first_loss(&distance, end, tests) {
                    (end, stop) = (t, Some((StepEnd::Border, i, border)));
                }
            }
        }
        if let Some((i, level)) = watched {
            let distance = self.distance(i, level, self.direction(i, level));
            if let Some(t) = first_loss(&distance, end, tests) {
                (end, stop) = (t, Some((StepEnd::Level, i, level)));
            }
        }
        for (u, series) in u.iter_mut().zip(&self.state) {
            *u = value(series, end);
        }
        if let Some((_, i, exactly)) = stop {
            u[i] = exactly;
        }
        (end, stop.map_or(StepEnd::Full, |stop| stop.0))
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
        for (series, u) in self.state.iter_mut().zip(u) {
            series[0] = *u;
        }
        if let ([x, y], [term]) = (&mut self.state[..], &self.terms[..]) {
            if term.active.len() == 2 {
                return term.expand_pair(&self.constant, x, y);
            }
        }
        let mut rates = Vector::from_slice(&self.constant);
        for order in 0..ORDER {
            for term in &mut self.terms {
                term.add_rates(&self.state, order, &mut rates);
            }
            for (series, rate) in self.state.iter_mut().zip(&mut rates) {
                series[order + 1] = *rate / (order + 1) as f64;
                *rate = 0.0;
            }
        }
    }

    /// The length over which the last terms of the series stay small.
    fn step(&self) -> f64 {
        let largest = |k: usize| {
            let at_order = self.state.iter().map(|series| series[k].abs());
            at_order.fold(f64::MIN_POSITIVE, f64::max)
        };
        let length = |k: usize| power(SAME_NUMBER / largest(k), 1.0 / k as f64);
        length(ORDER).min(length(ORDER - 1))
    }
}

impl Term {
    fn new(group: &SignGroup, sides: &[i8], m: usize) -> Self {
        let bits: Vec<usize> = (0..group.members.len())
            .filter(|&bit| sides[group.members[bit]] == 0)
            .collect();
        let held = group.pattern_of(sides);
        let mut coefficients = Vec::with_capacity(m << bits.len());
        for subset in 0..1_usize << bits.len() {
            let bits = bits.iter().enumerate();
            let corner = bits.fold(held, |c, (bit, &i)| c | (subset >> bit & 1) << i);
            coefficients.extend_from_slice(group.at(corner, m));
        }
        for bit in 0..bits.len() {
            for subset in (0..1_usize << bits.len()).filter(|s| s >> bit & 1 == 1) {
                for j in 0..m {
                    let (low, high) = ((subset & !(1 << bit)) * m + j, subset * m + j);
                    let (minus, plus) = (coefficients[low], coefficients[high]);
                    coefficients[low] = 0.5 * (plus + minus);
                    coefficients[high] = 0.5 * (plus - minus);
                }
            }
        }
        Term {
            products: vec![[0.0; ORDER + 1]; 1 << bits.len()],
            active: bits.into_iter().map(|bit| group.members[bit]).collect(),
            coefficients,
        }
    }

    /// The series of two components that multiply one another, which most cells have.
    fn expand_pair(&self, constant: &[f64], x: &mut Series, y: &mut Series) {
        let row = |j: usize| [1, 2, 3].map(|subset| self.coefficients[2 * subset + j]);
        let (rows, mut held) = ([row(0), row(1)], [constant[0], constant[1]]);
        for order in 0..ORDER {
            let product = of_product(x, y, order);
            let next = |[b, c, d]: [f64; 3], held: f64| {
                (held + b * x[order] + c * y[order] + d * product) / (order + 1) as f64
            };
            (x[order + 1], y[order + 1]) = (next(rows[0], held[0]), next(rows[1], held[1]));
            held = [0.0; 2];
        }
    }

    /// Adds its share of the rates at this order, from the products at this order.
    fn add_rates(&mut self, state: &[Series], order: usize, rates: &mut [f64]) {
        let rows = self.coefficients.chunks_exact(rates.len());
        for (subset, row) in rows.enumerate().skip(1) {
            let last = subset.ilog2();
            let factor = &state[self.active[last as usize]];
            let (smaller, own) = self.products.split_at_mut(subset);
            own[0][order] = match subset & !(1 << last) {
                0 => factor[order],
                rest => of_product(&smaller[rest], factor, order),
            };
            let pairs = rates.iter_mut().zip(row);
            pairs.for_each(|(rate, c)| *rate += c * own[0][order]);
        }
    }
}

/// The coefficient of a product at this order.
fn of_product(a: &Series, b: &Series, order: usize) -> f64 {
    let pairs = a.iter().zip(b[..=order].iter().rev());
    pairs.fold(0.0, |sum, (a, b)| sum + a * b)
}
