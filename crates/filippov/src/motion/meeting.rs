//! All fields that meet at an intersection, with their normal components.

use super::weights::product_weights;
use smallvec::SmallVec;

use super::{parallel, sense_of, Tie};
use crate::cube::{Matrix, NormalFields, SignGroup};
use crate::error::FieldError;
use crate::error::Undecided;
use crate::error_scale::Units;
use crate::system::{dot, dot_magnitude, eval_on_side, PiecewiseSystem, Place};
use crate::tolerances::{DOUBTFUL, MOST_MEETING, TANGENT};

/// The fields around an intersection of m surfaces, and the gradients of the switching functions.
///
/// Where the field is a sum of functions of groups of signs ([`known_groups`](crate::SignStructure::known_groups)),
/// 2^|group| fields of each group are evaluated, with the signs of the other groups at -1, and kept as differences to the field with
/// all signs at -1; only the first group is kept as it is. Then sums over all groups are those of the fields.
///
/// Of the regions around two surfaces in one place two exist. The others get the mean of these two fields, so that the
/// combination of all is that of the two, as Filippov has it; and the second row gets a term that vanishes where both
/// multipliers agree, and leads there.
#[derive(Clone, Debug)]
pub struct MeetingFields {
    set: Vec<usize>,
    n: usize,
    /// So many of the states are those of the model.
    n_own: usize,
    /// Positions within the set.
    groups: Vec<Vec<usize>>,
    /// The fields of all groups, one group after the other. Pattern p of a group has sign +1 at its member b where
    /// bit b of p is set.
    fields: Vec<f64>,
    /// Normal components, `[row * m + i]`.
    components: Vec<f64>,
    gradients: Vec<f64>,
    time_derivatives: Vec<f64>,
    signs: Vec<f64>,
    /// The sizes of the states.
    sizes: Vec<f64>,
    /// Surfaces in one place, since the first evaluation.
    ties: Option<Vec<Tie>>,
}

impl MeetingFields {
    /// Room for the fields around the surfaces of `set`, in the groups of the system.
    pub fn new(system: &dyn PiecewiseSystem, set: &[usize]) -> Self {
        let place = |j: usize| set.binary_search(&j).ok();
        let groups = system.sign_groups(set).into_iter();
        let groups = groups.map(|group| group.into_iter().filter_map(place).collect());
        MeetingFields::of_groups(system, set, groups.collect())
    }

    /// Room for the fields of all 2^m patterns. Pattern p has sign +1 at surface i of the set where bit i of p
    /// is set.
    pub fn of_all_patterns(system: &dyn PiecewiseSystem, set: &[usize]) -> Self {
        MeetingFields::of_groups(system, set, vec![(0..set.len()).collect()])
    }

    fn of_groups(system: &dyn PiecewiseSystem, set: &[usize], groups: Vec<Vec<usize>>) -> Self {
        let (n, m) = (system.n_states(), set.len());
        // One and two surfaces have closed forms, for all of their patterns.
        let groups = if m <= 2 {
            vec![(0..m).collect()]
        } else {
            groups
        };
        let rows: usize = groups.iter().map(|group| 1 << group.len()).sum();
        MeetingFields {
            set: set.to_vec(),
            n,
            n_own: system.n_own_states(),
            groups,
            fields: vec![0.0; n * rows],
            components: vec![0.0; m * rows],
            gradients: vec![0.0; n * m],
            time_derivatives: vec![0.0; m],
            signs: Vec::new(),
            sizes: vec![1.0; n],
            ties: None,
        }
    }

    /// The pairs of surfaces that lie in one place.
    pub fn ties(&self) -> &[Tie] {
        self.ties.as_deref().unwrap_or_default()
    }

    /// The surfaces.
    pub fn set(&self) -> &[usize] {
        &self.set
    }

    /// Are the fields of all patterns of all surfaces held one by one?
    pub fn has_all_patterns(&self) -> bool {
        self.groups.len() == 1
    }

    /// Evaluates everything at a place, whose signs hold the sides of the other surfaces. Returns the number
    /// of evaluations of the right-hand side.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn evaluate(
        &mut self,
        system: &dyn PiecewiseSystem,
        place: &Place<'_>,
        units: Units<'_>,
    ) -> Result<u64, FieldError> {
        let (n, m) = (self.n, self.set.len());
        let units = units.at(place.x);
        let sizes = self.sizes.iter_mut().enumerate();
        sizes.for_each(|(k, size)| *size = units.of_state(k));
        self.signs.clear();
        self.signs.extend_from_slice(place.signs);
        for (i, &j) in self.set.iter().enumerate() {
            let gradient = &mut self.gradients[i * n..(i + 1) * n];
            self.time_derivatives[i] = system.gradient(j, place, gradient)?;
        }
        for &j in &self.set {
            self.signs[j] = -1.0;
        }
        let (mut evaluations, mut row) = (0, 0);
        for index in 0..self.groups.len() {
            for pattern in 0..1_usize << self.groups[index].len() {
                if index > 0 && pattern == 0 {
                    self.fields[row * n..(row + 1) * n].fill(0.0);
                    self.components[row * m..(row + 1) * m].fill(0.0);
                } else {
                    for (bit, &i) in self.groups[index].iter().enumerate() {
                        let up = pattern >> bit & 1 == 1;
                        self.signs[self.set[i]] = if up { 1.0 } else { -1.0 };
                    }
                    evaluations += self.evaluate_row(system, place, row, index > 0)?;
                }
                row += 1;
            }
            for &i in &self.groups[index] {
                self.signs[self.set[i]] = -1.0;
            }
        }
        let mut first = 0;
        for group in &self.groups {
            let rows = first..first + (1 << group.len());
            first = rows.end;
            for (bit, &i) in group.iter().enumerate() {
                if system.sticks_at(self.set[i]) {
                    let ratio = system.stick_ratio(self.set[i], place);
                    let fields = &mut self.fields[rows.start * n..rows.end * n];
                    stretch(fields, 1 << bit, n, ratio);
                    let components = &mut self.components[rows.start * m..rows.end * m];
                    stretch(components, 1 << bit, m, ratio);
                }
            }
        }
        if self.ties.is_none() {
            let ties = self.find_ties(system, place, units)?;
            let is_split = !ties.is_empty() && !self.has_all_patterns();
            if is_split {
                *self = MeetingFields::of_all_patterns(system, &self.set);
            }
            self.ties = Some(ties);
            if is_split {
                return Ok(evaluations + self.evaluate(system, place, units)?);
            }
        }
        self.tie();
        Ok(evaluations)
    }

    fn find_ties(
        &self,
        system: &dyn PiecewiseSystem,
        place: &Place<'_>,
        units: Units<'_>,
    ) -> Result<Vec<Tie>, FieldError> {
        let mut ties: Vec<Tie> = Vec::new();
        let m = self.set.len();
        if m > MOST_MEETING {
            return Ok(ties);
        }
        let units = units.with_pace(self.pace(&|k| self.sizes[k]));
        for (leader, follower) in (0..m).flat_map(|i| (i + 1..m).map(move |k| (i, k))) {
            let is_tied = |tie: &Tie| tie.follower == follower || tie.follower == leader;
            if ties.iter().any(is_tied) || !self.has_parallel([leader, follower], place, units) {
                continue;
            }
            let pair = [self.set[leader], self.set[follower]];
            // Functions contain signs of surfaces before them only.
            let own = ties.iter().filter(|tie| tie.leader == leader);
            let tied: SmallVec<[_; 2]> =
                own.map(|tie| (self.set[tie.follower], tie.sense)).collect();
            if let Some(sense) = sense_of(system, (place, units), pair, &tied)? {
                ties.push(Tie {
                    leader,
                    follower,
                    sense,
                });
            }
        }
        Ok(ties)
    }

    /// Have two surfaces of the set the same normal?
    fn has_parallel(&self, pair: [usize; 2], place: &Place<'_>, units: Units<'_>) -> bool {
        let [one, other] = pair.map(|i| {
            let mut row = self.gradients[i * self.n..(i + 1) * self.n].to_vec();
            row.push(self.time_derivatives[i]);
            row
        });
        parallel(&one, &other, place, units)
    }

    /// Fills in what stands for the regions that do not exist.
    fn tie(&mut self) {
        let (n, m) = (self.n, self.set.len());
        for tie in self.ties.iter().flatten() {
            let row = self.components.iter().skip(tie.follower).step_by(m);
            let size = row.fold(0.0_f64, |size, v| size.max(v.abs()));
            for pattern in (0..1_usize << m).filter(|pattern| !tie.holds(*pattern)) {
                let (one, other) = (pattern ^ 1 << tie.leader, pattern ^ 1 << tie.follower);
                let mean = |rows: &mut [f64], width: usize| {
                    for k in 0..width {
                        let sum = rows[one * width + k] + rows[other * width + k];
                        rows[pattern * width + k] = 0.5 * sum;
                    }
                };
                mean(&mut self.fields, n);
                mean(&mut self.components, m);
                let is_up = pattern >> tie.follower & 1 == 1;
                let push = if is_up { -2.0 * size } else { 2.0 * size };
                self.components[pattern * m + tie.follower] += push;
            }
        }
    }

    /// Takes another normal, its derivative in time last, for surface `i` of the set.
    pub fn set_normal(&mut self, i: usize, normal: &[f64]) {
        let (n, m) = (self.n, self.set.len());
        self.gradients[i * n..(i + 1) * n].copy_from_slice(&normal[..n]);
        self.time_derivatives[i] = normal[n];
        let first = 1_usize << self.groups[0].len();
        for (row, field) in self.fields.chunks_exact(n).enumerate() {
            let of_time = if row < first { normal[n] } else { 0.0 };
            self.components[row * m + i] = of_time + dot(&normal[..n], field);
        }
    }

    /// Evaluates the field at the present signs, as a difference to the first one if so asked.
    fn evaluate_row(
        &mut self,
        system: &dyn PiecewiseSystem,
        place: &Place<'_>,
        row: usize,
        as_difference: bool,
    ) -> Result<u64, FieldError> {
        let (n, m) = (self.n, self.set.len());
        let (first, rest) = self.fields.split_at_mut(if row == 0 { 0 } else { n });
        let start = row * n - first.len();
        let field = &mut rest[start..start + n];
        let evaluations = eval_on_side(system, &place.with_signs(&self.signs), field)?;
        if as_difference {
            field
                .iter_mut()
                .zip(first.iter())
                .for_each(|(f, base)| *f -= base);
        }
        for i in 0..m {
            let gradient = &self.gradients[i * n..(i + 1) * n];
            let of_time = if as_difference {
                0.0
            } else {
                self.time_derivatives[i]
            };
            self.components[row * m + i] = of_time + dot(gradient, field);
        }
        Ok(evaluations)
    }

    /// The normal components as data for a decision.
    ///
    /// # Errors
    /// If one is not finite, or the signs of too many surfaces multiply one another.
    pub fn normal_fields(&self) -> Result<NormalFields, Undecided> {
        let m = self.set.len();
        let mut start = 0;
        let groups = self.groups.iter().map(|members| {
            let end = start + (m << members.len());
            let group = SignGroup::new(members, &self.components[start..end]);
            start = end;
            group
        });
        NormalFields::of_groups(m, groups.collect())
    }

    /// The normal components in units of the gradients: those along unit normals.
    ///
    /// # Errors
    /// As [`normal_fields`](Self::normal_fields).
    pub fn unit_normal_fields(&self) -> Result<NormalFields, Undecided> {
        let lengths = (0..self.set.len()).map(|i| self.normal(i));
        let factors: Vec<f64> = lengths.map(|g| 1.0 / dot(g, g).sqrt()).collect();
        Ok(self.normal_fields()?.scaled(&factors))
    }

    /// The gradient of a switching function by the states of the model.
    fn normal(&self, i: usize) -> &[f64] {
        &self.gradients[i * self.n..][..self.n_own]
    }

    /// Does the field depend on the sign of surface `i`, by more than rounding? Asked where all patterns are held one by one.
    pub fn depends_on(&self, i: usize) -> bool {
        let differs = |up: usize, k: usize| {
            let [one, other] = [up, up ^ 1 << i].map(|pattern| self.field(pattern)[k]);
            // In its own unit: states differ in size.
            let fields = self.fields.iter().skip(k).step_by(self.n);
            let largest = fields.fold(0.0_f64, |size, v| v.abs().max(size));
            (one - other).abs() > TANGENT * largest
        };
        let mut up = (0..1_usize << self.set.len()).filter(|pattern| pattern >> i & 1 == 1);
        !self.has_all_patterns() || up.any(|up| (0..self.n).any(|k| differs(up, k)))
    }

    /// The surfaces, counted within the set, whose equation says anything about the multipliers. The others are crossed by
    /// all fields at one speed, which is zero: up to rounding of the terms that it is made of, and in the sizes of the states.
    pub fn telling(&self) -> Vec<usize> {
        let (m, n) = (self.set.len(), self.n);
        let pace = self.pace(&|k| self.sizes[k]);
        let is_telling = |&i: &usize| {
            let gradient = &self.gradients[i * n..(i + 1) * n];
            let reach = dot_magnitude(gradient, &self.sizes) * pace;
            let (mut spread, mut largest, mut row) = (0.0, 0.0, 0);
            let mut size = self.time_derivatives[i].abs();
            for group in &self.groups {
                let [mut low, mut high, mut terms] = [f64::INFINITY, f64::NEG_INFINITY, 0.0];
                for _ in 0..1 << group.len() {
                    let component = self.components[row * m + i];
                    (low, high) = (component.min(low), component.max(high));
                    let field = &self.fields[row * n..(row + 1) * n];
                    terms = dot_magnitude(gradient, field).max(terms);
                    row += 1;
                }
                spread += high - low;
                largest += high.max(-low);
                size += terms;
            }
            spread > DOUBTFUL * size || largest > DOUBTFUL * reach
        };
        (0..m).filter(is_telling).collect()
    }

    /// The largest rate at which the fields change components of the state, in units of these sizes.
    pub fn pace(&self, size: &dyn Fn(usize) -> f64) -> f64 {
        let mut row = 0;
        let groups = self.groups.iter().map(|group| {
            let rows = row * self.n..(row + (1 << group.len())) * self.n;
            row += 1 << group.len();
            let rates = self.fields[rows].iter().enumerate();
            let rates = rates.map(|(i, v)| v.abs() / size(i % self.n));
            rates.fold(0.0, f64::max)
        });
        groups.sum()
    }

    /// Has a normal component one sign in all fields where it is not zero, so that no mixture of all of them stays on its
    /// surface? Asked where all patterns are held one by one.
    pub fn lead_to_one_side(&self) -> bool {
        let m = self.set.len();
        let components = |i: usize| self.components.iter().skip(i).step_by(m);
        self.has_all_patterns()
            && (0..m).any(|i| {
                let largest = components(i).fold(0.0_f64, |most, v| most.max(v.abs()));
                let clear = |sign: f64| components(i).any(|v| sign * v > DOUBTFUL * largest);
                !(clear(1.0) && clear(-1.0))
            })
    }

    /// Writes the weights prod_i (1 + k_i lambda_i)/2 of the canopy, those of each group after the other.
    pub fn fill_product_weights(&self, lambda: &[f64], weights: &mut Vec<f64>) {
        weights.clear();
        for group in &self.groups {
            let own: Vec<f64> = group.iter().map(|&i| lambda[i]).collect();
            weights.extend(product_weights(&own));
        }
    }

    /// The field of one pattern of the first group: of two surfaces, or of all patterns, any field.
    pub fn field(&self, pattern: usize) -> &[f64] {
        &self.fields[pattern * self.n..(pattern + 1) * self.n]
    }

    /// Writes the combination of the fields with these weights, one per pattern of each group.
    pub fn combine(&self, weights: &[f64], dx: &mut [f64]) {
        dx.fill(0.0);
        for (weight, field) in weights.iter().zip(self.fields.chunks_exact(self.n)) {
            if *weight != 0.0 {
                dx.iter_mut()
                    .zip(field)
                    .for_each(|(dx, f)| *dx += weight * f);
            }
        }
    }

    /// Projects the combination `dx` with these weights onto the intersection: dx - N^T (N N^T)^-1 r with the
    /// gradients as the rows of N and r the normal components of the combination.
    pub fn make_tangent(&self, weights: &[f64], dx: &mut [f64]) {
        let m = self.set.len();
        let row = |i: usize| self.normal(i);
        let mut gram = Matrix::zeros(m);
        for i in 0..m {
            for j in 0..m {
                gram[(i, j)] = dot(row(i), row(j));
            }
        }
        let component = |i: usize| {
            let components = self.components.iter().skip(i).step_by(m);
            weights.iter().zip(components).map(|(w, c)| w * c).sum()
        };
        let residuals: Vec<f64> = (0..m).map(component).collect();
        match gram.solve(&residuals) {
            Some(shifts) => {
                for (i, shift) in shifts.iter().enumerate() {
                    dx.iter_mut().zip(row(i)).for_each(|(v, g)| *v -= shift * g);
                }
            }
            None => dx.fill(f64::NAN),
        }
    }
}

/// Moves rows of `width` numbers, one per pattern, from the signs -1 and +1 of one surface to -ratio and +ratio; `bit` is
/// that of the surface in the pattern.
fn stretch(rows: &mut [f64], bit: usize, width: usize, ratio: f64) {
    let (near, far) = (0.5 * (1.0 + ratio), 0.5 * (1.0 - ratio));
    let patterns = rows.len() / width;
    for pattern in (0..patterns).filter(|pattern| pattern & bit == 0) {
        for k in 0..width {
            let (minus, plus) = (pattern * width + k, (pattern | bit) * width + k);
            let (a, b) = (rows[minus], rows[plus]);
            (rows[minus], rows[plus]) = (near * a + far * b, far * a + near * b);
        }
    }
}
