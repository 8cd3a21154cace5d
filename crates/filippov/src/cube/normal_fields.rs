//! The normal components of all fields at an intersection, and their multilinear interpolant.

use std::borrow::Cow;

use smallvec::SmallVec;

use super::small_matrix::{Matrix, Vector};
use crate::error::Undecided;
use crate::tolerances::{MOST_MEETING, PROPORTIONAL};

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
/// assert_eq!(fields.interpolate(&[0.5])[..], [0.0]);
/// # Ok::<(), filippov::switching::Undecided>(())
/// ```
///
/// Where only some signs multiply one another, g is a sum of functions of one *group* of multipliers each, and
/// is kept so ([`NormalFields::of_groups`]): the cost is the sum of 2^|group|, and only a group is limited in size.
///
/// Reference: N. Guglielmi, E. Hairer (2022), formula (2.3); `docs/theory/intersections.md`.
#[derive(Clone, Debug, PartialEq)]
pub struct NormalFields {
    m: usize,
    /// Of one or two surfaces there is one group.
    groups: SmallVec<[SignGroup; 1]>,
}

/// A term of g: a function of the multipliers of some surfaces whose signs multiply one another.
#[derive(Clone, Debug, PartialEq)]
pub struct SignGroup {
    /// The surfaces, increasing.
    pub members: SmallVec<[usize; 2]>,
    /// Its share of all m components at the patterns of the members' signs, `[pattern * m + j]`; bit b of a
    /// pattern belongs to `members[b]`.
    pub values: PatternValues,
}

/// As many numbers as two surfaces need.
pub type PatternValues = SmallVec<[f64; 8]>;

impl NormalFields {
    /// Normal components from their values, `m * 2^m` of them.
    ///
    /// # Errors
    /// [`Undecided::Shape`] if the number of values does not fit, [`Undecided::NotFinite`] if one
    /// of them is not finite.
    pub fn new(m: usize, values: Vec<f64>) -> Result<Self, Undecided> {
        let group = SignGroup {
            members: (0..m).collect(),
            values: values.into(),
        };
        NormalFields::of_groups(m, vec![group])
    }

    /// Normal components of m surfaces as a sum over groups that hold each surface once.
    ///
    /// # Example
    /// ```
    /// use filippov::cube::{NormalFields, SignGroup};
    ///
    /// // g = (1 - 2 x, 3 - y, -z): three surfaces that do not know of each other.
    /// let group = |i: usize, minus: f64, plus: f64| {
    ///     let mut values = vec![0.0; 6];
    ///     (values[i], values[3 + i]) = (minus, plus);
    ///     SignGroup::new(&[i], &values)
    /// };
    /// let groups = vec![group(0, 3.0, -1.0), group(1, 4.0, 2.0), group(2, 1.0, -1.0)];
    /// let fields = NormalFields::of_groups(3, groups)?;
    /// assert_eq!(fields.interpolate(&[0.5, 1.0, 0.25])[..], [0.0, 2.0, -0.25]);
    /// # Ok::<(), filippov::switching::Undecided>(())
    /// ```
    ///
    /// # Errors
    /// [`Undecided::Shape`] if the groups do not fit, or one has more than 6 surfaces; [`Undecided::NotFinite`]
    /// if a value is not finite.
    pub fn of_groups(m: usize, groups: Vec<SignGroup>) -> Result<Self, Undecided> {
        let mut held: Vec<usize> = groups.iter().flat_map(|g| g.members.clone()).collect();
        held.sort_unstable();
        let fits = |g: &SignGroup| {
            g.members.len() <= MOST_MEETING && g.values.len() == m << g.members.len()
        };
        if m == 0 || !held.into_iter().eq(0..m) || !groups.iter().all(fits) {
            return Err(Undecided::Shape {
                m,
                found: groups.iter().map(|g| g.values.len()).sum(),
            });
        }
        if groups
            .iter()
            .flat_map(|g| &g.values)
            .any(|v| !v.is_finite())
        {
            return Err(Undecided::NotFinite);
        }
        let groups = groups.into();
        Ok(NormalFields { m, groups }.with_few_joined())
    }

    /// Number of surfaces.
    pub fn m(&self) -> usize {
        self.m
    }

    /// The groups of surfaces whose signs multiply one another.
    pub fn groups(&self) -> &[SignGroup] {
        &self.groups
    }

    /// Number of sign patterns, 2^m; for as many surfaces as a group may have.
    pub fn n_patterns(&self) -> usize {
        1 << self.m
    }

    /// The values of all patterns, `[pattern * m + j]`; for as many surfaces as a group may have.
    pub fn values(&self) -> Cow<'_, [f64]> {
        match self.groups.as_slice() {
            [only] => Cow::Borrowed(&only.values),
            _ => Cow::Owned(
                (0..self.n_patterns())
                    .flat_map(|p| self.at(p).into_owned())
                    .collect(),
            ),
        }
    }

    /// The components of one pattern; for as many surfaces as a group may have.
    pub fn at(&self, pattern: usize) -> Cow<'_, [f64]> {
        match self.groups.as_slice() {
            [only] => Cow::Borrowed(only.at(pattern, self.m)),
            _ => {
                let sign = |i: usize| if pattern >> i & 1 == 1 { 1 } else { -1 };
                let signs: Vec<i8> = (0..self.m).map(sign).collect();
                self.in_region(&signs)
            }
        }
    }

    /// The components of the region with these signs.
    pub fn in_region(&self, signs: &[i8]) -> Cow<'_, [f64]> {
        if let [only] = self.groups.as_slice() {
            return Cow::Borrowed(only.at(only.pattern_of(signs), self.m));
        }
        let mut sum = vec![0.0; self.m];
        for group in &self.groups {
            let share = group.at(group.pattern_of(signs), self.m);
            sum.iter_mut().zip(share).for_each(|(s, v)| *s += v);
        }
        Cow::Owned(sum)
    }

    /// The components of the regions with these signs on both sides of surface i, that where h_i < 0 first.
    pub fn on_both_sides(&self, signs: &[i8], i: usize) -> [Cow<'_, [f64]>; 2] {
        let mut signs = SmallVec::<[i8; 4]>::from_slice(signs);
        [-1, 1].map(|side| {
            signs[i] = side;
            self.in_region(&signs)
        })
    }

    /// The largest magnitude of all components.
    pub fn size(&self) -> f64 {
        (0..self.m).fold(0.0, |size, j| self.row_size(j).max(size))
    }

    /// The surfaces in parts of which none acts on another one's rates.
    pub fn independent_parts(&self) -> Vec<Vec<usize>> {
        let mut acts = Matrix::zeros(self.m());
        let sizes: Vec<f64> = (0..self.m()).map(|j| self.row_size(j)).collect();
        for p in 0..self.m() {
            for (j, value) in self.columns(p).flat_map(|c| c.into_iter().enumerate()) {
                // An entry that is rounding of its row does not act.
                if value.abs() > PROPORTIONAL * sizes[j] {
                    (acts[(j, p)], acts[(p, j)]) = (1.0, 1.0);
                }
            }
        }
        acts.strong_parts()
    }

    /// The largest magnitude of the component normal to surface j.
    pub fn row_size(&self, j: usize) -> f64 {
        let [low, high] = self.row_range(j);
        high.abs().max(low.abs())
    }

    /// Does this hold for the component normal to some surface in some pattern? Of several groups only the least and the
    /// largest components are looked at.
    pub fn any_component(&self, holds: impl Fn(usize, f64) -> bool) -> bool {
        match &self.groups[..] {
            [group] => {
                let values = group.values.iter().enumerate();
                values.into_iter().any(|(k, v)| holds(k % self.m, *v))
            }
            _ => (0..self.m).any(|j| self.row_range(j).iter().any(|v| holds(j, *v))),
        }
    }

    /// The least and the largest component normal to surface j, over all patterns, and so over the cube.
    pub fn row_range(&self, j: usize) -> [f64; 2] {
        let ranges = self.groups.iter().map(|group| {
            let row = group.values.iter().skip(j).step_by(self.m);
            row.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &v| {
                [low.min(v), high.max(v)]
            })
        });
        ranges.fold([0.0; 2], |[low, high], [l, h]| [low + l, high + h])
    }

    /// g(lambda).
    pub fn interpolate(&self, lambda: &[f64]) -> Vector {
        let mut g = Vector::from_elem(0.0, self.m);
        for group in &self.groups {
            for (pattern, weight) in group.weights(lambda, None).into_iter().enumerate() {
                for (g, f) in g.iter_mut().zip(group.at(pattern, self.m)) {
                    *g += weight * f;
                }
            }
        }
        g
    }

    /// G(lambda), with entry (j, p) the derivative of g_j by lambda_p.
    pub fn jacobian(&self, lambda: &[f64]) -> Matrix {
        let mut jacobian = Matrix::zeros(self.m);
        for p in 0..self.m {
            for (j, derivative) in self.derivative(lambda, p).into_iter().enumerate() {
                jacobian[(j, p)] = derivative;
            }
        }
        jacobian
    }

    /// The derivative of g by lambda_p: a column of G.
    pub(crate) fn derivative(&self, lambda: &[f64], p: usize) -> Vector {
        let mut column = Vector::from_elem(0.0, self.m);
        let own = self.groups.iter().find(|group| group.members.contains(&p));
        if let Some(group) = own {
            for (pattern, weight) in group.weights(lambda, Some(p)).into_iter().enumerate() {
                for (entry, f) in column.iter_mut().zip(group.at(pattern, self.m)) {
                    *entry += weight * f;
                }
            }
        }
        column
    }

    /// The fields on a face of the cube: the non-zero entries of `mode` are held, the zero entries are
    /// the surfaces that are left, in their order.
    pub fn restrict(&self, mode: &[i8]) -> NormalFields {
        let free: SmallVec<[usize; 4]> = (0..self.m).filter(|&i| mode[i] == 0).collect();
        let mut held = Vector::from_elem(0.0, free.len());
        let mut groups = SmallVec::<[SignGroup; 1]>::new();
        for group in &self.groups {
            let bits: SmallVec<[usize; 4]> = (0..group.members.len())
                .filter(|&bit| mode[group.members[bit]] == 0)
                .collect();
            let fixed = group.pattern_of(mode);
            let mut values = PatternValues::with_capacity(free.len() << bits.len());
            for pattern in 0..1_usize << bits.len() {
                let bits = bits.iter().enumerate();
                let full = bits.fold(fixed, |full, (bit, &i)| full | (pattern >> bit & 1) << i);
                values.extend(free.iter().map(|&j| group.at(full, self.m)[j]));
            }
            if bits.is_empty() {
                held.iter_mut().zip(&values).for_each(|(h, v)| *h += v);
                continue;
            }
            let place = |bit: usize| free.binary_search(&group.members[bit]).unwrap_or(0);
            let members = bits.into_iter().map(place).collect();
            groups.push(SignGroup { members, values });
        }
        let m = free.len();
        if let Some(first) = groups.first_mut() {
            for at in first.values.chunks_exact_mut(m) {
                at.iter_mut().zip(&held).for_each(|(v, h)| *v += h);
            }
        }
        NormalFields { m, groups }.with_few_joined()
    }

    /// The fields with the components of surface j multiplied by `factors[j]`: another scaling of h_j.
    #[must_use]
    pub fn scaled(&self, factors: &[f64]) -> NormalFields {
        self.map(|_, _, j, value| factors[j] * value)
    }

    /// The fields with `by[j]` added to all components of surface j: what a short time makes of them.
    #[must_use]
    pub fn shifted(&self, by: &[f64]) -> NormalFields {
        self.map(|group, _, j, value| if group == 0 { value + by[j] } else { value })
    }

    /// The columns p of G at the vertices of the cube, each once; it depends on the other multipliers of one group only.
    pub(crate) fn columns(&self, p: usize) -> impl Iterator<Item = Vector> + '_ {
        let own = self.groups.iter().find_map(|group| {
            let bit = group.members.iter().position(|&i| i == p)?;
            Some((group, 1 << bit))
        });
        own.into_iter().flat_map(move |(group, bit)| {
            let patterns = (0..1_usize << group.members.len()).filter(move |k| k & bit == 0);
            patterns.map(move |k| {
                let pairs = group.at(k | bit, self.m).iter().zip(group.at(k, self.m));
                pairs.map(|(plus, minus)| 0.5 * (plus - minus)).collect()
            })
        })
    }

    /// Is g affine in lambda, up to rounding? So it is where each sign enters the field by a term of
    /// its own, as friction does.
    pub fn is_affine(&self) -> bool {
        let rounding: Vec<f64> = (0..self.m)
            .map(|j| 16.0 * f64::EPSILON * self.row_size(j))
            .collect();
        (0..self.m).all(|p| {
            let mut columns = self.columns(p);
            let first = columns.next().unwrap_or_default();
            columns.all(|column| {
                let pairs = column.iter().zip(&first).zip(&rounding);
                pairs
                    .into_iter()
                    .all(|((a, b), rounding)| (a - b).abs() <= *rounding)
            })
        })
    }

    /// The fields whose canopy on the whole cube is that of these where lambda_axis runs from `low` to `high`.
    #[must_use]
    pub fn on_range(&self, axis: usize, [low, high]: [f64; 2]) -> NormalFields {
        let mut other = self.clone();
        for group in &mut other.groups {
            let Some(bit) = group.members.iter().position(|&i| i == axis) else {
                continue;
            };
            let bit = 1 << bit;
            for pattern in (0..1_usize << group.members.len()).filter(|k| k & bit == 0) {
                for j in 0..self.m {
                    let places = [pattern * self.m + j, (pattern | bit) * self.m + j];
                    let [minus, plus] = places.map(|place| group.values[place]);
                    let (mean, half) = (0.5 * (plus + minus), 0.5 * (plus - minus));
                    for (place, at) in places.into_iter().zip([low, high]) {
                        group.values[place] = match at {
                            -1.0 => minus,
                            1.0 => plus,
                            // Exact where the values do not depend on this multiplier.
                            _ => mean + at * half,
                        };
                    }
                }
            }
        }
        other
    }

    /// Changes every value: `change(group, pattern, surface, value)`.
    pub(crate) fn map(
        &self,
        mut change: impl FnMut(usize, usize, usize, f64) -> f64,
    ) -> NormalFields {
        let mut mapped = self.clone();
        for (index, group) in mapped.groups.iter_mut().enumerate() {
            for (i, value) in group.values.iter_mut().enumerate() {
                *value = change(index, i / self.m, i % self.m, *value);
            }
        }
        mapped
    }

    /// One or two surfaces have closed forms, for all of their patterns: their groups joined.
    fn with_few_joined(self) -> NormalFields {
        if self.m > 2 || self.groups.len() <= 1 {
            return self;
        }
        let group = SignGroup {
            members: (0..self.m).collect(),
            values: self.values().into_owned().into(),
        };
        NormalFields {
            m: self.m,
            groups: smallvec::smallvec![group],
        }
    }
}

impl SignGroup {
    /// A group from its members and the values of its patterns.
    pub fn new(members: &[usize], values: &[f64]) -> Self {
        SignGroup {
            members: members.into(),
            values: values.into(),
        }
    }

    /// The share of the m components at one pattern.
    pub(crate) fn at(&self, pattern: usize, m: usize) -> &[f64] {
        &self.values[pattern * m..(pattern + 1) * m]
    }

    /// The number of the pattern with these signs of all surfaces; a zero entry leaves its bit unset.
    pub(crate) fn pattern_of(&self, signs: &[i8]) -> usize {
        let bits = self.members.iter().enumerate();
        bits.fold(0, |pattern, (bit, &i)| {
            pattern | usize::from(signs[i] > 0) << bit
        })
    }

    /// The weights prod_i (1 + k_i lambda_i)/2 of all patterns, or their derivatives by one multiplier.
    fn weights(&self, lambda: &[f64], derivative: Option<usize>) -> PatternValues {
        let mut weights = PatternValues::from_elem(1.0, 1 << self.members.len());
        for (bit, &i) in self.members.iter().enumerate() {
            let (minus, plus) = match derivative {
                Some(p) if p == i => (-0.5, 0.5),
                _ => (0.5 * (1.0 - lambda[i]), 0.5 * (1.0 + lambda[i])),
            };
            for pattern in 0..1 << bit {
                weights[pattern | 1 << bit] = plus * weights[pattern];
                weights[pattern] *= minus;
            }
        }
        weights
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::{NormalFields, SignGroup};

    #[test]
    fn ranges_are_those_of_the_patterns() {
        let group = |members: &[usize], seed: usize| SignGroup {
            members: members.into(),
            values: (0..3 << members.len())
                .map(|k| ((7 * k + seed) as f64).sin())
                .collect(),
        };
        let fields = NormalFields::of_groups(3, vec![group(&[0, 2], 1), group(&[1], 2)]).unwrap();
        for j in 0..3 {
            let values = || (0..8).map(|k| fields.at(k)[j]);
            let [low, high] = fields.row_range(j);
            assert!((low - values().fold(f64::INFINITY, f64::min)).abs() < 1e-15);
            assert!((high - values().fold(f64::NEG_INFINITY, f64::max)).abs() < 1e-15);
        }
    }
}
