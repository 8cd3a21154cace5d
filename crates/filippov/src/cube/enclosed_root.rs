//! Bounds of the multipliers while the normal components move within intervals.

use filippov_expr::{Enclosure, Interval};
use smallvec::SmallVec;

use super::small_matrix::Matrix;

/// Boxes tried.
const WIDENINGS: usize = 4;
/// A box wider than this says nothing about multipliers in [-1, 1].
const WIDEST: f64 = 8.0;

/// As many intervals as a few surfaces need.
pub type IntervalVector = SmallVec<[Interval; 8]>;

/// What is known of the multipliers of sliding on m surfaces over a piece of motion.
#[derive(Clone, Debug)]
pub struct EnclosedRoot {
    /// The multipliers.
    pub multipliers: IntervalVector,
    /// Their derivatives in time; empty if there are no bounds of them.
    pub rates: IntervalVector,
    /// The diagonal of G in a box around them, where G is invertible; empty if G is constant.
    pub diagonal: IntervalVector,
    /// For multipliers of contacts that share a load what is left of their strength, with its rate; empty if there are none.
    pub reserves: Vec<Option<Enclosure>>,
}

/// What could be said of the multipliers. A box would be an allocation in every step.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Debug)]
pub enum RootBounds {
    /// They are proved to lie there.
    Proved(EnclosedRoot),
    /// The bounds are too wide to prove anything; shorter pieces may do.
    Unproved,
    /// The equations do not determine the multipliers.
    Singular,
}

/// Encloses the root of the canopy equations for all normal components within `components`
/// (`[pattern * m + j]`, as in [`super::NormalFields`]): proved to exist, and to be the only one, in a box
/// around `guess`, which is widened a few times.
///
/// Krawczyk's operator: with lambda_0 the middle of the box L and C an approximate inverse of G(lambda_0),
///
///   K = lambda_0 - C g(lambda_0) + (I - C G(L)) (L - lambda_0)
///
/// lies in L only if every g within the bounds has exactly one root in L, which is in K.
///
/// Reference: R. Krawczyk, Newton-Algorithmen zur Bestimmung von Nullstellen mit Fehlerschranken, *Computing* 4
/// (1969); Moore, Kearfott, Cloud (2009), chapter 8.
pub fn enclose_root(components: &[Interval], guess: &[Interval]) -> RootBounds {
    let mut guess = guess.to_vec();
    for _ in 0..WIDENINGS {
        let Some((image, diagonal)) = krawczyk(components, &guess) else {
            return RootBounds::Singular;
        };
        let mut pairs = image.iter().zip(&guess);
        if pairs.all(|(k, l)| k.lo > l.lo && k.hi < l.hi) {
            return RootBounds::Proved(EnclosedRoot {
                multipliers: image,
                rates: IntervalVector::new(),
                diagonal,
                reserves: Vec::new(),
            });
        }
        for (l, k) in guess.iter_mut().zip(&image) {
            let (lo, hi) = (l.lo.min(k.lo), l.hi.max(k.hi));
            let more = 0.1 * (hi - lo);
            *l = Interval::hull(lo - more, hi + more);
        }
        if guess
            .iter()
            .any(|l| !l.is_bounded() || l.hi - l.lo > WIDEST)
        {
            break;
        }
    }
    RootBounds::Unproved
}

/// The image of a box, and the diagonal of G in it; `None` if G is singular.
fn krawczyk(
    components: &[Interval],
    guess: &[Interval],
) -> Option<(IntervalVector, IntervalVector)> {
    let m = guess.len();
    let middle: IntervalVector = guess
        .iter()
        .map(|l| Interval::point(0.5 * (l.lo + l.hi)))
        .collect();
    let row =
        |j: usize| -> IntervalVector { components.iter().skip(j).step_by(m).copied().collect() };
    let places = (0..m).flat_map(|j| (0..m).map(move |p| (j, p)));
    let jacobian: IntervalVector = places
        .map(|(j, p)| interpolate(differences(&row(j), p), guess, Some(p)))
        .collect();
    let middle_of = |l: &Interval| 0.5 * (l.lo + l.hi);
    let inverse = Matrix::of(m, |j, p| middle_of(&jacobian[j * m + p])).inverse()?;
    let g: IntervalVector = (0..m).map(|j| interpolate(row(j), &middle, None)).collect();
    let mut multipliers = IntervalVector::with_capacity(m);
    for i in 0..m {
        let mut k = middle[i];
        for j in 0..m {
            k = k - g[j].scaled(inverse[(i, j)]);
        }
        for p in 0..m {
            let mut defect = Interval::point(if i == p { 1.0 } else { 0.0 });
            for j in 0..m {
                defect = defect - jacobian[j * m + p].scaled(inverse[(i, j)]);
            }
            k = k + defect * (guess[p] - middle[p]);
        }
        multipliers.push(k);
    }
    let diagonal = (0..m).map(|i| jacobian[i * m + i]).collect();
    Some((multipliers, diagonal))
}

/// Half the differences of the values in direction `axis`, for all patterns of the other bits (those with
/// bit `axis` hold the same number).
fn differences(values: &[Interval], axis: usize) -> IntervalVector {
    let bit = 1 << axis;
    let pairs = (0..values.len()).map(|pattern| (values[pattern | bit], values[pattern & !bit]));
    pairs
        .map(|(plus, minus)| (plus - minus).scaled(0.5))
        .collect()
}

/// The multilinear interpolant at a box, one axis after the other; `skip` is an axis that the values do not
/// depend on. It is linear along each axis, so that the ends of the box bound it.
fn interpolate(mut values: IntervalVector, at: &[Interval], skip: Option<usize>) -> Interval {
    for (axis, l) in at.iter().enumerate().rev() {
        let half = 1 << axis;
        for pattern in 0..half {
            let (minus, plus) = (values[pattern], values[pattern + half]);
            let blend = |l: f64| minus.scaled(0.5 * (1.0 - l)) + plus.scaled(0.5 * (1.0 + l));
            values[pattern] = if skip == Some(axis) {
                minus
            } else {
                let (low, high) = (blend(l.lo), blend(l.hi));
                Interval::hull(low.lo.min(high.lo), low.hi.max(high.hi))
            };
        }
    }
    values[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn around(value: f64, radius: f64) -> Interval {
        Interval::around(value, radius)
    }

    fn proved(components: &[Interval], guess: &[Interval]) -> IntervalVector {
        match enclose_root(components, guess) {
            RootBounds::Proved(root) => root.multipliers,
            other => panic!("{other:?}"),
        }
    }

    /// g_i = c_i - lambda_i, with c_i within 0.1 of (0.5, 0.2): the root is c, wherever the search begins.
    #[test]
    fn root_of_two_independent_equations() {
        let mut components = Vec::new();
        for pattern in 0..4 {
            for (i, c) in [0.5, 0.2].into_iter().enumerate() {
                let side = if pattern >> i & 1 == 1 { 1.0 } else { -1.0 };
                components.push(around(c - side, 0.1));
            }
        }
        for start in [[0.5, 0.2], [-0.5, 0.2], [0.9, -0.9]] {
            let found = proved(&components, &start.map(|l| around(l, 0.2)));
            assert!(found[0].lo <= 0.4 && found[0].hi >= 0.6);
            assert!(found[0].lo > -0.2 && found[0].hi < 1.2);
            assert!(found[1].lo <= 0.1 && found[1].hi >= 0.3);
        }
    }

    /// A surface to which all fields are tangent leaves its multiplier open.
    #[test]
    fn undetermined_multipliers_are_refused() {
        let components = [0.0, -1.0, 0.0, -1.0, 0.0, 1.0, 0.0, 1.0].map(Interval::point);
        let guess = [around(0.0, 0.2), around(0.0, 0.2)];
        assert!(matches!(
            enclose_root(&components, &guess),
            RootBounds::Singular
        ));
    }

    /// Equations with a product, moving within bounds: the roots of samples lie within the enclosure.
    #[test]
    fn roots_of_samples_are_enclosed() {
        let value = |pattern: usize, i: usize, shift: f64| {
            let [x, y] = [0, 1].map(|bit| if pattern >> bit & 1 == 1 { 1.0 } else { -1.0 });
            [0.3 - x + 0.4 * x * y + shift, -0.2 - y + 0.3 * x - shift][i]
        };
        let mut components = Vec::new();
        for pattern in 0..4 {
            components.extend([0, 1].map(|i| around(value(pattern, i, 0.0), 0.02)));
        }
        let root = |shift: f64| {
            let values = (0..4).flat_map(|pattern| [0, 1].map(|i| value(pattern, i, shift)));
            let fields = crate::cube::NormalFields::new(2, values.collect());
            let found = fields
                .ok()
                .and_then(|f| crate::cube::newton(&f, &[0.2, -0.1]));
            found.unwrap_or_default()
        };
        let centre = root(0.0);
        let guess: Vec<Interval> = centre.iter().map(|&l| around(l, 0.2)).collect();
        let found = proved(&components, &guess);
        for k in -10..=10 {
            for (bound, l) in found.iter().zip(root(0.002 * f64::from(k))) {
                assert!(bound.lo <= l && l <= bound.hi, "{l} not in {bound:?}");
            }
        }
    }
}
