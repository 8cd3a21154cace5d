//! The sliding field on an intersection of surfaces.

use super::weights::{self, fill_product_weights, multipliers_of, RuleFailure};
use super::{MeetingFields, Projector, SmoothField};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::options::SlidingRule;
use crate::switching::codim2::{Bilinear, Lap};
use crate::switching::{least_multipliers, newton, stable_roots, Matrix, NormalFields};
use crate::system::PiecewiseSystem;

/// What ends sliding on an intersection of m surfaces: functions that are positive until then.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IntersectionExit {
    /// A multiplier reaches -1 or +1: 1 + lambda_i and 1 - lambda_i, i counted within the set. For a rule other
    /// than the canopy: a motion on that side of surface i begins to leave the intersection.
    Side {
        /// Which multiplier.
        position: usize,
        /// The end, -1 or +1.
        end: i8,
    },
    /// Two roots meet: (-1)^m det G, for two surfaces the discriminant. For a rule other than the canopy: a
    /// premise of the rule fails.
    Fold,
    /// No scaling of the surfaces makes the root stable any longer: -min(G11, G22), or the last Hurwitz
    /// determinant. For a rule other than the canopy: the fields begin to wind outwards.
    Stability,
}

/// Filippov's field on an intersection of m >= 2 surfaces: the multilinear combination ("canopy") of the
/// 2^m fields with the multipliers lambda in [-1, 1]^m that make it tangent to all surfaces,
///
///   f_s = sum over k of prod_i (1 + k_i lambda_i)/2 * f^k,   grad h_j . f_s + d_t h_j = 0,
///
/// evaluated at the projection of the point onto the intersection. For two surfaces lambda is the root with
/// det G > 0 in closed form; for more it is tracked by Newton's method. Other combinations are made
/// [by choice](Self::with_rule), with lambda_j = sum over k of w_k k_j.
///
/// Reference: Guglielmi, Hairer (2022), sections 2 and 4; `docs/theory/intersections.md`.
pub struct IntersectionField<'a> {
    system: &'a dyn PiecewiseSystem,
    rule: SlidingRule,
    /// Why the rule gave no field at the last evaluation.
    failure: Option<RuleFailure>,
    signs: Vec<f64>,
    corners: MeetingFields,
    weights: Vec<f64>,
    lambda: Vec<f64>,
    exits: Vec<f64>,
    projector: Projector,
    n_evaluations: u64,
}

impl<'a> IntersectionField<'a> {
    /// Sliding on the surfaces of `set`, the others with the given signs; the multipliers are tracked from
    /// `lambda`, or found anew if that is empty.
    pub fn new(
        system: &'a dyn PiecewiseSystem,
        set: &[usize],
        signs: &[f64],
        lambda: &[f64],
    ) -> Self {
        IntersectionField {
            system,
            rule: SlidingRule::Canopy,
            failure: None,
            signs: signs.to_vec(),
            corners: MeetingFields::new(system, set),
            weights: vec![0.0; 1 << set.len()],
            lambda: lambda.to_vec(),
            exits: vec![f64::NAN; Self::n_exits_of(set.len())],
            projector: Projector::new(system.n_states(), system.n_surfaces()),
            n_evaluations: 0,
        }
    }

    /// The same with another combination of the fields.
    #[must_use]
    pub fn with_rule(mut self, rule: SlidingRule) -> Self {
        self.rule = rule;
        self
    }

    /// The combination of the fields.
    pub fn rule(&self) -> SlidingRule {
        self.rule
    }

    /// The surfaces slid on.
    pub fn set(&self) -> &[usize] {
        self.corners.set()
    }

    /// Number of functions that end the motion.
    pub fn n_exits(&self) -> usize {
        self.exits.len()
    }

    fn n_exits_of(m: usize) -> usize {
        2 * m + 2
    }

    /// What exit function `index` is.
    pub fn exit(&self, index: usize) -> IntersectionExit {
        let m = self.set().len();
        match index {
            _ if index < 2 * m => IntersectionExit::Side {
                position: index / 2,
                end: if index % 2 == 0 { -1 } else { 1 },
            },
            _ if index == 2 * m => IntersectionExit::Fold,
            _ => IntersectionExit::Stability,
        }
    }

    /// The multipliers at the last evaluation, in the order of the set.
    pub fn multipliers(&self) -> &[f64] {
        &self.lambda
    }

    /// The exit functions at the last evaluation.
    pub fn exits(&self) -> &[f64] {
        &self.exits
    }

    /// The fields around the intersection at the last evaluation.
    pub fn corners(&self) -> &MeetingFields {
        &self.corners
    }

    /// Moves `x` onto the intersection.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn project(&mut self, t: f64, x: &mut [f64]) -> Result<(), FieldError> {
        self.projector
            .project_onto(self.system, self.corners.set(), t, x, &self.signs)
    }

    /// Evaluates multipliers and exit functions at (t, x), after projection. Where there is no root they are
    /// NaN.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn solve(&mut self, t: f64, x: &mut [f64]) -> Result<(), FieldError> {
        self.project(t, x)?;
        self.n_evaluations += self.corners.evaluate(self.system, t, x, &self.signs)?;
        let Ok(fields) = self.corners.normal_fields() else {
            self.lose_root();
            return Ok(());
        };
        let telling = self.corners.telling();
        let found = if self.rule != SlidingRule::Canopy {
            self.solve_by_rule(&telling)
        } else if telling.len() < fields.m() {
            self.solve_telling(&fields, &telling)
        } else if fields.m() == 2 {
            self.solve_two(&fields)
        } else {
            self.solve_many(&fields)
        };
        if found.is_none() {
            self.lose_root();
        }
        Ok(())
    }

    fn lose_root(&mut self) {
        self.exits.fill(f64::NAN);
        self.lambda.clear();
    }

    /// Two surfaces: the root with det G > 0 in closed form, extended slightly beyond a fold.
    fn solve_two(&mut self, fields: &NormalFields) -> Option<()> {
        let canopy = Bilinear::of_fields(fields);
        let lambda = canopy.extended_root()?;
        let jacobian = canopy.jacobian(lambda);
        self.lambda.clear();
        self.lambda.extend(lambda);
        let sizes = [fields.row_size(0), fields.row_size(1)];
        let stability = -(jacobian[0][0] / sizes[0]).min(jacobian[1][1] / sizes[1]);
        self.fill_exits(canopy.discriminant(), stability);
        Some(())
    }

    /// More surfaces: Newton's method from the last multipliers; at the start from the only stable root.
    fn solve_many(&mut self, fields: &NormalFields) -> Option<()> {
        if self.lambda.len() != fields.m() {
            self.lambda = stable_roots(fields).into_iter().next()?;
        }
        self.lambda = newton(fields, &self.lambda)?;
        let mut jacobian = fields.jacobian(&self.lambda);
        normalise(&mut jacobian, fields);
        let sign = if fields.m() % 2 == 0 { 1.0 } else { -1.0 };
        self.fill_exits(
            sign * jacobian.determinant(),
            jacobian.last_hurwitz_determinant(),
        );
        Some(())
    }

    /// Sliding of higher order: some equations hold for all multipliers, and only their ends end the motion.
    fn solve_telling(&mut self, fields: &NormalFields, telling: &[usize]) -> Option<()> {
        self.lambda = least_multipliers(fields, telling)?;
        self.fill_exits(1.0, 1.0);
        Some(())
    }

    /// The weights of another rule than the canopy, and where they end.
    fn solve_by_rule(&mut self, telling: &[usize]) -> Option<()> {
        let fields = self.corners.unit_normal_fields().ok()?;
        let found = if telling.len() < fields.m() {
            Err(RuleFailure::Undetermined)
        } else {
            weights::weights(self.rule, &fields)
        };
        match found {
            Ok(weights) => self.weights = weights,
            Err(failure) => {
                self.failure = Some(failure);
                return None;
            }
        }
        self.failure = None;
        self.lambda = multipliers_of(&self.weights, fields.m());
        let neighbours = match self.rule {
            SlidingRule::DieciLopez => Vec::new(),
            rule => weights::neighbours(rule, &fields),
        };
        for index in 0..2 * fields.m() {
            let (i, end) = (index / 2, if index % 2 == 0 { -1 } else { 1 });
            self.exits[index] = if neighbours.is_empty() {
                weights::smallest_approach(&fields, i, end)
            } else {
                let beside = neighbours.iter().filter(|n| n.mode.entries()[i] == end);
                beside.map(|n| n.margin).fold(1.0, f64::min)
            };
        }
        let premise = match self.rule {
            SlidingRule::Moments => self.weights.iter().fold(1.0, |m, w| w.min(m)),
            SlidingRule::MinimumNorm if fields.m() == 2 => {
                weights::Segment::of(&fields).map_or(1.0, |segment| segment.length())
            }
            _ => 1.0,
        };
        let lap = if fields.m() == 2 {
            Lap::around(&fields, [-1, -1])
        } else {
            None
        };
        let m = fields.m();
        self.exits[2 * m] = premise;
        self.exits[2 * m + 1] = lap.map_or(1.0, |lap| 1.0 - lap.gamma);
        Some(())
    }

    /// Why the rule does not give the field here, at the last evaluation: a premise that fails by more than
    /// `tolerance`. The canopy has its own decisions.
    pub fn refusal(&self, tolerance: f64) -> Option<RuleFailure> {
        if self.rule == SlidingRule::Canopy || self.failure.is_some() {
            return self.failure.clone();
        }
        let m = self.set().len();
        if self.exits[..2 * m].iter().any(|exit| *exit < -tolerance) {
            return Some(match self.leaving(-tolerance).into_iter().next() {
                Some(mode) if self.rule != SlidingRule::DieciLopez => {
                    RuleFailure::NotAttracting { mode }
                }
                _ => RuleFailure::NotAllTowards,
            });
        }
        match self.rule {
            SlidingRule::Moments if self.exits[2 * m] < -tolerance => {
                Some(RuleFailure::NegativeWeight)
            }
            _ if self.exits[2 * m] < -tolerance => Some(RuleFailure::NoTangentCombination),
            _ if self.exits[2 * m + 1] < -tolerance => Some(RuleFailure::WindsOutwards),
            _ => None,
        }
    }

    /// The motions of lower codimension that leave the intersection, or are about to, at the last evaluation; one
    /// entry per surface of the set, those that leave most clearly first.
    pub fn leaving(&self, tolerance: f64) -> Vec<Mode> {
        let Ok(fields) = self.corners.unit_normal_fields() else {
            return Vec::new();
        };
        let mut found = weights::neighbours(self.rule, &fields);
        found.retain(|neighbour| neighbour.margin <= tolerance);
        found.sort_by(|a, b| a.margin.total_cmp(&b.margin));
        found.into_iter().map(|neighbour| neighbour.mode).collect()
    }

    fn fill_exits(&mut self, fold: f64, stability: f64) {
        for (pair, lambda) in self.exits.chunks_exact_mut(2).zip(&self.lambda) {
            (pair[0], pair[1]) = (1.0 + lambda, 1.0 - lambda);
        }
        let m = self.lambda.len();
        (self.exits[2 * m], self.exits[2 * m + 1]) = (fold, stability);
    }
}

/// Divides every row by the size of its normal components, so that the scaling of a surface does not matter.
fn normalise(jacobian: &mut Matrix, fields: &NormalFields) {
    for i in 0..fields.m() {
        let size = fields.row_size(i);
        for j in 0..fields.m() {
            jacobian[(i, j)] /= size;
        }
    }
}

impl SmoothField for IntersectionField<'_> {
    fn eval(&mut self, t: f64, x: &mut [f64], dx: &mut [f64]) -> Result<(), FieldError> {
        self.solve(t, x)?;
        if self.lambda.is_empty() {
            dx.fill(f64::NAN);
            return Ok(());
        }
        if self.rule == SlidingRule::Canopy {
            fill_product_weights(&self.lambda, &mut self.weights);
        }
        self.corners.combine(&self.weights, dx);
        if self.rule == SlidingRule::DieciLopez {
            self.corners.make_tangent(&self.weights, dx);
        }
        Ok(())
    }

    fn n_evaluations(&self) -> u64 {
        self.n_evaluations
    }
}
