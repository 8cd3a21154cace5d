//! The law of sliding on a few surfaces by another rule than the canopy.

use filippov_expr::sort_few;

use super::weights::{self, multipliers_of, RuleFailure};
use super::MeetingFields;
use crate::cube::Lap;
use crate::cube::NormalFields;
use crate::error::FieldError;
use crate::error_scale::Units;
use crate::mode::Mode;
use crate::options::SlidingRule;
use crate::system::{PiecewiseSystem, Place};

/// The combination of the 2^m fields that a rule chooses, with lambda_j = sum over k of w_k k_j.
///
/// Its exit functions differ from those of the canopy. Two per surface, for the sides -1 and +1, measure how clearly the
/// motions on that side approach the intersection. The next one measures the premise of the rule. The last one, for two
/// surfaces, is 1 - gamma, which is negative if the fields wind outwards. A function without such a condition is 1.
#[derive(Clone)]
pub struct RuleLaw {
    rule: SlidingRule,
    fields: MeetingFields,
    weights: Vec<f64>,
    exits: Vec<f64>,
    /// Why the rule gave no field at the last evaluation.
    failure: Option<RuleFailure>,
}

impl RuleLaw {
    /// The law of a rule on the surfaces of `set`.
    pub fn new(system: &dyn PiecewiseSystem, set: &[usize], rule: SlidingRule) -> Self {
        RuleLaw {
            rule,
            fields: MeetingFields::of_all_patterns(system, set),
            weights: vec![0.0; 1 << set.len()],
            exits: vec![f64::NAN; 2 * set.len() + 2],
            failure: None,
        }
    }

    /// The rule.
    pub fn rule(&self) -> SlidingRule {
        self.rule
    }

    /// The exit functions at the last evaluation.
    pub fn exits(&self) -> &[f64] {
        &self.exits
    }

    /// Finds the multipliers at a place and writes the field; leaves no multipliers where the rule gives none.
    /// Returns the number of evaluations of the right-hand side.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn eval(
        &mut self,
        system: &dyn PiecewiseSystem,
        (place, units): (&Place<'_>, Units<'_>),
        lambda: &mut Vec<f64>,
        dx: &mut [f64],
    ) -> Result<u64, FieldError> {
        let evaluations = self.fields.evaluate(system, place, units)?;
        match self.solve() {
            Some(found) => {
                *lambda = found;
                self.fields.combine(&self.weights, dx);
                if self.rule == SlidingRule::DieciLopez {
                    self.fields.make_tangent(&self.weights, dx);
                }
            }
            None => {
                lambda.clear();
                self.exits.fill(f64::NAN);
                dx.fill(f64::NAN);
            }
        }
        Ok(evaluations)
    }

    fn solve(&mut self) -> Option<Vec<f64>> {
        let fields = self.fields.unit_normal_fields().ok()?;
        let m = fields.m();
        let found = if self.fields.telling().len() < m {
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
        self.fill_approaches(&fields);
        self.exits[2 * m] = self.premise(&fields);
        let lap = (m == 2).then(|| Lap::around(&fields, [-1, -1])).flatten();
        self.exits[2 * m + 1] = lap.map_or(1.0, |lap| 1.0 - lap.gamma);
        Some(multipliers_of(&self.weights, m))
    }

    /// How clearly the motions on each side of each surface come to the intersection.
    fn fill_approaches(&mut self, fields: &NormalFields) {
        let neighbours = match self.rule {
            SlidingRule::DieciLopez => Vec::new(),
            rule => weights::neighbours(rule, fields),
        };
        for index in 0..2 * fields.m() {
            let (i, end) = (index / 2, if index.is_multiple_of(2) { -1 } else { 1 });
            self.exits[index] = if neighbours.is_empty() {
                weights::smallest_approach(fields, i, end)
            } else {
                let beside = neighbours.iter().filter(|n| n.mode.entries()[i] == end);
                beside.map(|n| n.margin).fold(1.0, f64::min)
            };
        }
    }

    fn premise(&self, fields: &NormalFields) -> f64 {
        match self.rule {
            SlidingRule::Moments => self.weights.iter().fold(1.0, |m, w| w.min(m)),
            SlidingRule::MinimumNorm if fields.m() == 2 => {
                weights::Segment::of(fields).map_or(1.0, |segment| segment.length())
            }
            _ => 1.0,
        }
    }

    /// Why the rule does not give the field here, at the last evaluation: a premise that fails by more than
    /// `tolerance`.
    pub fn refusal(&self, tolerance: f64) -> Option<RuleFailure> {
        if self.failure.is_some() {
            return self.failure.clone();
        }
        let m = self.fields.set().len();
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
        let Ok(fields) = self.fields.unit_normal_fields() else {
            return Vec::new();
        };
        let mut found = weights::neighbours(self.rule, &fields);
        found.retain(|neighbour| neighbour.margin <= tolerance);
        sort_few(&mut found, |a, b| a.margin.total_cmp(&b.margin).is_lt());
        found.into_iter().map(|neighbour| neighbour.mode).collect()
    }
}
