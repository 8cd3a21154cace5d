//! Linear inequalities: is there a point that fulfils all of them? By Fourier-Motzkin elimination.
//!
//! Schrijver, Theory of Linear and Integer Programming (1986), section 12.2.

use rustc_hash::FxHashMap;

use crate::few::sort_few;
use crate::linear::LinearForm;
use crate::node::NodeId;

/// Constants below this share of what they were made of are rounding errors.
const ROUNDING: f64 = 1e-13;

/// With more inequalities than this the elimination is given up.
const MOST_INEQUALITIES: usize = 2_000;

/// `sum_k c_k a_k + constant > 0`, or `>= 0`.
#[derive(Debug, Clone)]
pub(super) struct Inequality {
    terms: Vec<(NodeId, f64)>,
    constant: f64,
    /// The magnitudes that the constant was made of.
    size: f64,
    is_strict: bool,
}

impl Inequality {
    /// `side * form > 0` (`>= 0` unless strict).
    pub fn new(form: &LinearForm, side: f64, is_strict: bool) -> Self {
        Inequality {
            terms: form.terms.iter().map(|&(a, c)| (a, side * c)).collect(),
            constant: side * form.constant,
            size: form.constant.abs(),
            is_strict,
        }
    }

    /// `bound + side * atom >= 0`.
    pub fn bound(atom: NodeId, side: f64, bound: f64) -> Self {
        Inequality {
            terms: vec![(atom, side)],
            constant: bound,
            size: bound.abs(),
            is_strict: false,
        }
    }

    /// The atoms whose values are free.
    pub fn atoms(&self) -> impl Iterator<Item = NodeId> + '_ {
        self.terms.iter().map(|term| term.0)
    }

    fn coefficient(&self, atom: NodeId) -> f64 {
        let found = self.terms.binary_search_by_key(&atom, |term| term.0);
        found.map_or(0.0, |k| self.terms[k].1)
    }

    /// Whether it holds, where nothing is free.
    fn holds(&self) -> bool {
        let rounding = ROUNDING * self.size;
        if self.is_strict {
            self.constant > rounding
        } else {
            self.constant >= -rounding
        }
    }

    /// Divided by its largest coefficient.
    fn normalised(mut self) -> Self {
        let largest = self
            .terms
            .iter()
            .fold(0.0_f64, |m, term| m.max(term.1.abs()));
        if largest > 0.0 {
            self.terms.iter_mut().for_each(|term| term.1 /= largest);
            self.constant /= largest;
            self.size /= largest;
        }
        self
    }

    /// `self / |a| + other / |b|` with the coefficients a > 0 and b < 0 of an atom, which it does not contain.
    fn without(&self, atom: NodeId, other: &Inequality) -> Inequality {
        let (a, b) = (self.coefficient(atom).abs(), other.coefficient(atom).abs());
        let mut sums: FxHashMap<NodeId, (f64, f64)> = FxHashMap::default();
        let parts = [(self, a), (other, b)];
        for (part, divisor) in parts {
            for &(id, c) in part.terms.iter().filter(|term| term.0 != atom) {
                let sum = sums.entry(id).or_default();
                sum.0 += c / divisor;
                sum.1 += (c / divisor).abs();
            }
        }
        let mut terms: Vec<(NodeId, f64)> = sums
            .into_iter()
            .filter(|(_, (value, size))| value.abs() > ROUNDING * size)
            .map(|(id, (value, _))| (id, value))
            .collect();
        sort_few(&mut terms, |a, b| a.0 < b.0);
        Inequality {
            terms,
            constant: self.constant / a + other.constant / b,
            size: self.size / a + other.size / b,
            is_strict: self.is_strict || other.is_strict,
        }
    }
}

/// Whether there are values of the atoms that fulfil all inequalities; also true if that is too much to find out.
pub(super) fn have_solution(inequalities: Vec<Inequality>) -> bool {
    let mut rows = tightest(inequalities);
    loop {
        if rows.iter().any(|row| row.terms.is_empty() && !row.holds()) {
            return false;
        }
        rows.retain(|row| !row.terms.is_empty());
        let Some((atom, n_new)) = cheapest(&rows) else {
            return true;
        };
        if n_new > MOST_INEQUALITIES {
            return true;
        }
        let (with, mut next): (Vec<_>, Vec<_>) = rows
            .into_iter()
            .partition(|row| row.coefficient(atom) != 0.0);
        let (above, below): (Vec<_>, Vec<_>) = with
            .into_iter()
            .partition(|row| row.coefficient(atom) > 0.0);
        for low in &above {
            next.extend(below.iter().map(|high| low.without(atom, high)));
        }
        rows = tightest(next);
    }
}

/// The atom whose elimination leaves the fewest inequalities, and how many it makes.
fn cheapest(rows: &[Inequality]) -> Option<(NodeId, usize)> {
    let mut counts: FxHashMap<NodeId, (usize, usize)> = FxHashMap::default();
    for &(atom, c) in rows.iter().flat_map(|row| &row.terms) {
        let count = counts.entry(atom).or_default();
        *(if c > 0.0 { &mut count.0 } else { &mut count.1 }) += 1;
    }
    let products = counts
        .into_iter()
        .map(|(atom, (up, down))| (atom, up * down));
    products.min_by_key(|&(atom, product)| (product, atom))
}

/// Of inequalities with the same left-hand side the one that implies the others.
fn tightest(rows: Vec<Inequality>) -> Vec<Inequality> {
    let mut kept: Vec<Inequality> = Vec::new();
    let mut known: FxHashMap<Vec<(NodeId, u64)>, usize> = FxHashMap::default();
    for row in rows {
        let row = row.normalised();
        let key = row.terms.iter().map(|&(a, c)| (a, c.to_bits())).collect();
        let position = *known.entry(key).or_insert(kept.len());
        match kept.get_mut(position) {
            None => kept.push(row),
            Some(old) => {
                let is_tighter = (row.constant, !row.is_strict) < (old.constant, !old.is_strict);
                if is_tighter {
                    *old = row;
                }
            }
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::Graph;

    fn rows(of: &[(f64, f64, f64, bool)]) -> Vec<Inequality> {
        let mut g = Graph::new();
        let (x, y) = (g.state(0), g.state(1));
        of.iter()
            .map(|&(a, b, c, is_strict)| Inequality {
                terms: [(x, a), (y, b)]
                    .into_iter()
                    .filter(|t| t.1 != 0.0)
                    .collect(),
                constant: c,
                size: c.abs(),
                is_strict,
            })
            .collect()
    }

    #[test]
    fn intervals() {
        assert!(have_solution(rows(&[
            (1.0, 0.0, -1.0, true),
            (-1.0, 0.0, 2.0, true)
        ])));
        assert!(!have_solution(rows(&[
            (1.0, 0.0, -2.0, true),
            (-1.0, 0.0, 1.0, true)
        ])));
        assert!(!have_solution(rows(&[
            (1.0, 0.0, -1.0, true),
            (-1.0, 0.0, 1.0, false)
        ])));
        assert!(have_solution(rows(&[
            (1.0, 0.0, -1.0, false),
            (-1.0, 0.0, 1.0, false)
        ])));
    }

    #[test]
    fn half_planes() {
        let triangle = [
            (1.0, 0.0, 0.0, true),
            (0.0, 1.0, 0.0, true),
            (-1.0, -1.0, 1.0, true),
        ];
        assert!(have_solution(rows(&triangle)));
        let empty = [
            (1.0, 0.0, 0.0, true),
            (0.0, 1.0, 0.0, true),
            (-1.0, -1.0, 0.0, true),
        ];
        assert!(!have_solution(rows(&empty)));
        assert!(have_solution(rows(&[(1.0, -2.0, -5.0, true)])));
    }

    #[test]
    fn of_two_bounds_the_tighter_one_counts() {
        assert!(!have_solution(rows(&[
            (1.0, 0.0, -1.0, true),
            (2.0, 0.0, -6.0, true),
            (-1.0, 0.0, 2.0, true),
        ])));
    }
}
