//! Bounds of the multipliers of many surfaces along a piece of motion.

use std::cell::RefCell;

use filippov_expr::{Enclosure, Interval, Motion};
use smallvec::SmallVec;

use crate::cube::{IntervalVector, PartsTaken, SharedLoads};
use crate::mode::Signs;
use crate::page::IS_PAGE;
use crate::sparse::{SparseRows, SparseSolver};
use crate::system::{AffineSigns, Setting};

/// Rates of some contacts.
type Rates = SmallVec<[f64; 16]>;

/// What bounds the multipliers of a mode where gradients and N = grad h B are constant.
///
/// With g(lambda_0) the rates of the switching functions at fixed multipliers, lambda = lambda_0 - N^-1 g(lambda_0). For
/// all g within m +- r
///
///   |N^-1 g - N^-1 m| <= `<N>`^-1 r,
///
/// where `<N>` has |N_ii| on the diagonal and -|N_ij| beside it, if that is an M-matrix: a sparse system again. The rate
/// of lambda is bounded as lambda is, from that of g.
///
/// Reference: A. Ostrowski, Über die Determinanten mit überwiegender Hauptdiagonale, *Comment. Math. Helv.* 10
/// (1937); A. Neumaier, *Interval Methods for Systems of Equations* (1990), section 3.7.
#[derive(Clone)]
pub struct AffineBounds {
    matrix: SparseRows,
    /// Contacts whose sign acts on no other rate, and whose rate no other sign acts on.
    is_uncoupled: Vec<bool>,
    /// The contacts that have multipliers of their own.
    regular: Vec<usize>,
    /// The other contacts, which share loads.
    loops: Vec<PartsTaken>,
    normal: RefCell<SparseSolver>,
    /// None where N is diagonal, as `<N>` is N then but for signs.
    comparison: Option<RefCell<SparseSolver>>,
}

/// The multipliers along a piece of motion, and their rates.
pub struct EnclosedMultipliers {
    /// The multipliers.
    pub values: IntervalVector,
    /// Their derivatives in time; empty if they are not known to be finite.
    pub rates: IntervalVector,
    /// For contacts that share a load what is left of their strength, with its rate; empty if there are none. Their multipliers have
    /// no bounds.
    pub reserves: Vec<Option<Enclosure>>,
}

/// What is known of the multipliers.
#[derive(Clone, Copy, Default)]
pub struct KnownMultipliers<'k> {
    /// Numbers near to them.
    pub near: &'k [f64],
    /// Those at the start of the piece of motion, if they are known.
    pub start: Option<&'k [f64]>,
    /// Those that are far from their ends, and not asked for; none if it is empty.
    pub far: &'k [bool],
}

impl AffineBounds {
    /// The bounds where N is this matrix; `None` if it is singular and its contacts do not share loads, or if its comparison matrix is
    /// no M-matrix.
    pub fn new(matrix: &SparseRows) -> Option<Self> {
        let mut normal = SparseSolver::default();
        let (mut regular, mut loops) = ((0..matrix.n_rows()).collect(), Vec::new());
        if normal.factor(matrix).is_err() {
            let shared = SharedLoads::new(matrix).filter(|shared| shared.idle().is_empty())?;
            regular = shared.regular().to_vec();
            loops = shared.parts_taken()?;
            normal.factor(&matrix.principal(&regular)).ok()?;
        }
        let block = matrix.principal(&regular);
        let mut comparison = None;
        if !block.is_diagonal() {
            let mut solver = SparseSolver::default();
            solver.factor(&block.comparison()).ok()?;
            let mut positive = vec![1.0; block.n_rows()];
            solver.solve(&mut positive);
            // A matrix with this pattern of signs that maps a positive vector to a positive one is an M-matrix.
            if !positive.iter().all(|v| v.is_finite() && *v > 0.0) {
                return None;
            }
            comparison = Some(RefCell::new(solver));
        }
        Some(AffineBounds {
            matrix: matrix.clone(),
            is_uncoupled: uncoupled(matrix),
            regular,
            loops,
            normal: RefCell::new(normal),
            comparison,
        })
    }

    /// The multipliers along a piece of motion. Where nothing moves that a rate reads, it is what it is at the start; those that are far
    /// from their ends have no bounds if no other depends on them. `None` if a rate of a switching function has no bounds.
    pub fn enclose(
        &self,
        affine: &dyn AffineSigns,
        set: &[usize],
        motion: &dyn Motion,
        setting: Setting<'_>,
        known: KnownMultipliers<'_>,
    ) -> Option<EnclosedMultipliers> {
        let KnownMultipliers { near, start, far } = known;
        let is_left_out = |row: usize| far.get(row) == Some(&true) && self.is_uncoupled[row];
        let mut signs = Signs::from_slice(setting.signs);
        for (&j, &lambda) in set.iter().zip(near) {
            signs[j] = lambda;
        }
        let (mut values, mut rates) = (IntervalVector::new(), IntervalVector::new());
        for (row, &j) in set.iter().enumerate() {
            if is_left_out(row) {
                values.push(Interval::ZERO);
                rates.push(Interval::ZERO);
                continue;
            }
            let still = start.filter(|_| !IS_PAGE && !affine.rate_moves(j, motion));
            let enclosure = match still {
                Some(start) => {
                    // Sliding makes it zero with the multipliers at the start.
                    let entries = self.matrix.row(row);
                    let changes = entries.map(|(k, n)| n * (near[k] - start[k]));
                    Enclosure::constant(changes.sum())
                }
                None => affine.enclose_rate(j, motion, setting.with_signs(&signs))?,
            };
            values.push(enclosure.value);
            rates.push(enclosure.rate);
        }
        let reserves = self.reserves(&values, &rates, near);
        let mut values = self.changes(&values)?;
        for (value, &lambda) in values.iter_mut().zip(near) {
            *value = *value + Interval::point(lambda);
        }
        let mut rates = self.changes(&rates).unwrap_or_default();
        for row in (0..set.len()).filter(|&row| is_left_out(row)) {
            values[row] = Interval::ALL;
            if let Some(rate) = rates.get_mut(row) {
                *rate = Interval::ALL;
            }
        }
        Some(EnclosedMultipliers {
            values,
            rates,
            reserves,
        })
    }

    /// Bounds of the reserves of contacts that share a load, with their rates of change. `values` bounds the rates of the switching
    /// functions at the multipliers `near`, and `rates` bounds the time derivatives of these.
    fn reserves(
        &self,
        values: &[Interval],
        rates: &[Interval],
        near: &[f64],
    ) -> Vec<Option<Enclosure>> {
        if self.loops.is_empty() {
            return Vec::new();
        }
        let mut found = vec![None; values.len()];
        let sum = |factors: &[f64], of: &dyn Fn(usize) -> Interval, rows: &[usize]| {
            let terms = factors.iter().zip(rows);
            terms.fold(Interval::ZERO, |sum, (&a, &row)| sum + of(row).scaled(a))
        };
        let nu = |row: usize| {
            let entries = self.matrix.row(row);
            let at_signs: f64 = entries.map(|(k, n)| n * near[k]).sum();
            values[row] + Interval::point(-at_signs)
        };
        for (rows, parts) in &self.loops {
            let taken = parts.iter().map(|factors| {
                let part = sum(factors, &nu, rows);
                (part, sum(factors, &|row| rates[row], rows))
            });
            let taken: Vec<(Interval, Interval)> = taken.collect();
            // The largest part lies between `least` and `most`.
            let least = taken.iter().map(|(part, _)| {
                let is_around_zero = part.lo <= 0.0 && part.hi >= 0.0;
                match is_around_zero {
                    true => 0.0,
                    false => part.lo.abs().min(part.hi.abs()),
                }
            });
            let least = least.fold(0.0, f64::max);
            let size = |part: &Interval| part.lo.abs().max(part.hi.abs());
            let most = taken.iter().map(|(part, _)| size(part)).fold(0.0, f64::max);
            // Any part that may reach `least` may be the largest one.
            let mut rate: Option<Interval> = None;
            for (part, change) in taken.iter().filter(|(part, _)| size(part) >= least) {
                for (is_there, way) in [(part.hi >= 0.0, -1.0), (part.lo <= 0.0, 1.0)] {
                    if is_there {
                        let own = change.scaled(way);
                        rate = Some(rate.map_or(own, |known| known.joined(own)));
                    }
                }
            }
            let rounding = rounding_beside(most);
            let value = Interval::hull(1.0 - most - rounding, 1.0 - least + rounding);
            let rate = rate.unwrap_or(Interval::ALL);
            for &row in rows {
                found[row] = Some(Enclosure { value, rate });
            }
        }
        found
    }

    /// -N^-1 g for all g within these bounds; `None` if one of them is not finite. Those of contacts that share loads are not known.
    fn changes(&self, g: &[Interval]) -> Option<IntervalVector> {
        if !g.iter().all(|g| g.is_bounded()) {
            return None;
        }
        if self.regular.len() < g.len() {
            let own: IntervalVector = self.regular.iter().map(|&row| g[row]).collect();
            let mut all = IntervalVector::from_elem(Interval::ALL, g.len());
            let found = self.own_changes(&own);
            self.regular
                .iter()
                .zip(found)
                .for_each(|(&row, found)| all[row] = found);
            return Some(all);
        }
        Some(self.own_changes(g))
    }

    fn own_changes(&self, g: &[Interval]) -> IntervalVector {
        if g.is_empty() {
            return IntervalVector::new();
        }
        let mut middles: Rates = g.iter().map(|g| 0.5 * (g.lo + g.hi)).collect();
        let mut radii: Rates = g.iter().map(|g| 0.5 * (g.hi - g.lo)).collect();
        self.normal.borrow_mut().solve(&mut middles);
        let comparison = self.comparison.as_ref().unwrap_or(&self.normal);
        comparison.borrow_mut().solve(&mut radii);
        let largest = middles.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let rounding = rounding_beside(largest);
        let pairs = middles.iter().zip(&radii);
        let around =
            |(m, r): (&f64, &f64)| Interval::around(-m, r.abs() * (1.0 + 1e-10) + rounding);
        pairs.map(around).collect()
    }
}

/// A rounding error per unknown and operation, many times over, of numbers up to this size.
fn rounding_beside(largest: f64) -> f64 {
    1e-12 + 1e-10 * largest
}

fn uncoupled(matrix: &SparseRows) -> Vec<bool> {
    let mut is_uncoupled = vec![true; matrix.n_rows()];
    for i in 0..matrix.n_rows() {
        for &j in matrix.columns(i).iter().filter(|&&j| j != i) {
            (is_uncoupled[i], is_uncoupled[j]) = (false, false);
        }
    }
    is_uncoupled
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use filippov_expr::{Backend, Enclosure, Graph, Interval, Motion, Names};

    use super::{AffineBounds, KnownMultipliers};
    use crate::system::{AffineSigns, PiecewiseSystem, Place, Setting, TracedSystem};

    fn near_to(near: &[f64]) -> KnownMultipliers<'_> {
        KnownMultipliers {
            near,
            ..KnownMultipliers::default()
        }
    }

    /// Three belts that pull at one another: v_i' = sin(t + i) + x_i^2 - sign(v_i) - 0.3 sum of the other signs.
    fn belts() -> TracedSystem {
        let mut g = Graph::new();
        let (time, share) = (g.time(), g.constant(0.3));
        let signs = [3, 4, 5].map(|i| {
            let v = g.state(i);
            g.sign(v)
        });
        let mut field = vec![g.constant(0.5), g.constant(-0.2), g.constant(0.1)];
        for i in 0..3_u32 {
            let (x, phase) = (g.state(i), g.constant(f64::from(i)));
            let angle = g.add(time, phase);
            let (wave, square) = (g.unary(filippov_expr::UnaryOp::Sin, angle), g.mul(x, x));
            let mut rate = g.add(wave, square);
            for (k, &sign) in signs.iter().enumerate() {
                let hold = if k == i as usize {
                    sign
                } else {
                    g.mul(share, sign)
                };
                rate = g.sub(rate, hold);
            }
            field.push(rate);
        }
        TracedSystem::new(g, field, Vec::new(), Names::default(), Backend::Auto).unwrap()
    }

    /// x from 0.1, 0.2, 0.3 at their constant speeds, v = 0.
    struct Straight(f64, f64);

    const SPEEDS: [f64; 3] = [0.5, -0.2, 0.1];

    fn state(t: f64) -> [f64; 6] {
        let x = |i: usize| 0.1 * (i + 1) as f64 + SPEEDS[i] * t;
        [x(0), x(1), x(2), 0.0, 0.0, 0.0]
    }

    impl Motion for Straight {
        fn time(&self) -> Interval {
            Interval::hull(self.0, self.1)
        }
        fn state(&self, index: usize) -> Enclosure {
            let ends = [state(self.0)[index], state(self.1)[index]];
            Enclosure {
                value: Interval::hull(ends[0].min(ends[1]), ends[0].max(ends[1])),
                rate: Interval::point(SPEEDS.get(index).copied().unwrap_or(0.0)),
            }
        }
    }

    fn multipliers(affine: &dyn AffineSigns, t: f64) -> Vec<f64> {
        let mut parts = affine.affine_parts(&[0, 1, 2]).unwrap();
        parts
            .evaluate(affine, &Place::new(t, &state(t), &[0.0; 3]))
            .unwrap();
        assert!(parts.is_settled());
        parts.slide(&mut [0.0; 6]).unwrap();
        parts.multipliers().to_vec()
    }

    #[test]
    fn multipliers_and_their_rates_lie_in_their_bounds() {
        let system = belts();
        let affine = system.affine_signs().unwrap();
        let mut parts = affine.affine_parts(&[0, 1, 2]).unwrap();
        parts
            .evaluate(affine, &Place::new(0.0, &state(0.0), &[0.0; 3]))
            .unwrap();
        let bounds = AffineBounds::new(parts.normal()).unwrap();
        let (set, signs) = ([0, 1, 2], [1.0; 3]);
        for (from, to) in [(0.0, 0.4), (0.3, 0.31), (1.0, 1.7)] {
            let near = multipliers(affine, 0.5 * (from + to));
            let motion = Straight(from, to);
            let found = bounds
                .enclose(
                    affine,
                    &set,
                    &motion,
                    Setting::of_signs(&signs),
                    near_to(&near),
                )
                .unwrap();
            for k in 0..=20 {
                let t = from + (to - from) * f64::from(k) / 20.0;
                let d = 1e-6;
                let (lambda, before, after) = (
                    multipliers(affine, t),
                    multipliers(affine, t - d),
                    multipliers(affine, t + d),
                );
                for i in 0..3 {
                    let (value, rate) = (found.values[i], found.rates[i]);
                    assert!(value.lo <= lambda[i] && lambda[i] <= value.hi);
                    let slope = (after[i] - before[i]) / (2.0 * d);
                    assert!(rate.lo - 1e-8 <= slope && slope <= rate.hi + 1e-8);
                    // No wider than what the motion changes, but for the sums of intervals.
                    assert!(value.hi - value.lo < 8.0 * (to - from));
                }
            }
        }
    }

    /// v_i' = x_i^2 - sign(v_i) - 0.3 sum of the other signs; x moves or not.
    struct Still<'a>(&'a [f64]);

    impl Motion for Still<'_> {
        fn time(&self) -> Interval {
            Interval::hull(0.0, 1.0)
        }
        fn state(&self, index: usize) -> Enclosure {
            Enclosure::constant(self.0[index])
        }
    }

    #[test]
    fn a_rate_that_reads_nothing_that_moves_gives_the_multipliers_at_the_start() {
        let mut g = Graph::new();
        let share = g.constant(0.3);
        let signs = [2, 3].map(|i| {
            let v = g.state(i);
            g.sign(v)
        });
        let zero = g.constant(0.0);
        let mut field = vec![zero, zero];
        for i in 0..2_usize {
            let x = g.state(i as u32);
            let (square, other) = (g.mul(x, x), g.mul(share, signs[1 - i]));
            let held = g.sub(square, signs[i]);
            field.push(g.sub(held, other));
        }
        let system =
            TracedSystem::new(g, field, Vec::new(), Names::default(), Backend::Auto).unwrap();
        let affine = system.affine_signs().unwrap();
        let mut parts = affine.affine_parts(&[0, 1]).unwrap();
        let x = [0.5, 0.8, 0.0, 0.0];
        parts
            .evaluate(affine, &Place::new(0.0, &x, &[0.0; 2]))
            .unwrap();
        parts.slide(&mut [0.0; 4]).unwrap();
        let lambda = parts.multipliers();
        let bounds = AffineBounds::new(parts.normal()).unwrap();
        let signs = [1.0; 2];
        let setting = Setting::of_signs(&signs);
        let enclose = |start| {
            let known = KnownMultipliers {
                start,
                ..near_to(&[0.1, 0.2])
            };
            let found = bounds.enclose(affine, &[0, 1], &Still(&x), setting, known);
            found.unwrap().values
        };
        assert!((0..2).all(|i| !affine.rate_moves(i, &Still(&x))));
        for (known, computed) in enclose(Some(lambda)).iter().zip(enclose(None)) {
            assert!((known.lo - computed.lo).abs() < 1e-11);
            assert!((known.hi - computed.hi).abs() < 1e-11);
        }
        for (known, lambda) in enclose(Some(lambda)).iter().zip(lambda) {
            assert!(known.lo <= *lambda && *lambda <= known.hi);
        }
    }
}
