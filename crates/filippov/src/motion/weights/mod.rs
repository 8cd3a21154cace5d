//! Which combination of the fields around an intersection is taken: the weights of the 2^m fields.
//!
//! Every rule is a pure function of the normal components. For one surface all of them give Filippov's
//! combination; for more they differ, unless the fields are affine in the signs (`docs/theory/sliding_rules.md`).

mod canopy;
mod dieci_lopez;
mod minimum_norm;
mod moments;
mod neighbours;

pub use canopy::product_weights;
pub use dieci_lopez::{dieci_lopez, smallest_approach};
pub use minimum_norm::{minimum_norm, Segment};
pub use moments::moments;
pub use neighbours::{neighbours, Neighbour};

use crate::cube::{stable_roots, NormalFields};
use crate::mode::Mode;
use crate::options::SlidingRule;

/// Why a rule gives no sliding field at a point: one variant per premise.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RuleFailure {
    /// The equations of the moments are those of two surfaces.
    #[error("the moments are defined where two surfaces meet, here {m} do; sliding=\"canopy\" slides on any number")]
    NotTwoSurfaces {
        /// The number of surfaces.
        m: usize,
    },
    /// The rules look at the fields of all sign patterns.
    #[error("this rule looks at all 2^m fields of up to 6 surfaces, here {m} meet; sliding=\"canopy\" slides on any number")]
    TooManySurfaces {
        /// The number of surfaces.
        m: usize,
    },
    /// All fields are tangent to one of the surfaces, or the equations of the weights are singular.
    #[error("the fields do not determine the weights; sliding=\"canopy\" may")]
    Undetermined,
    /// No convex combination is tangent to all surfaces.
    #[error("no combination of the fields is tangent to all surfaces")]
    NoTangentCombination,
    /// A weight of the moments is negative.
    #[error("a weight of the moments is negative: the fields do not attract as they should; sliding=\"canopy\" may do")]
    NegativeWeight,
    /// The rule of Dieci and Lopez needs all fields to point towards the intersection.
    #[error("not all fields point towards the intersection, as the rule of Dieci and Lopez needs; sliding=\"canopy\" may do")]
    NotAllTowards,
    /// A motion of lower codimension leaves the intersection.
    #[error(
        "the intersection does not attract: the motion in ({mode}), on its surfaces, leaves it"
    )]
    NotAttracting {
        /// That motion, one entry per surface of the intersection.
        mode: Mode,
    },
    /// The fields wind around the intersection, further out with each lap.
    #[error("the fields wind around the intersection, further out with each lap")]
    WindsOutwards,
}

/// The weights of the 2^m fields, one per pattern, with sum 1.
///
/// Where the premises of the rule fail only a little, the weights are continued beyond: [`neighbours`] and
/// [`smallest_approach`] tell where.
///
/// # Example
/// ```
/// use filippov::motion::weights::weights;
/// use filippov::switching::NormalFields;
/// use filippov::SlidingRule;
///
/// // Four fields that all point towards the intersection, at the same speeds.
/// let fields = NormalFields::new(2, vec![1.0, 1.0, -1.0, 1.0, 1.0, -1.0, -1.0, -1.0])?;
/// for rule in [SlidingRule::Canopy, SlidingRule::Moments, SlidingRule::DieciLopez, SlidingRule::MinimumNorm] {
///     assert_eq!(weights(rule, &fields).unwrap(), [0.25; 4]);
/// }
/// # Ok::<(), filippov::switching::Undecided>(())
/// ```
///
/// # Errors
/// If the rule does not apply; each variant of [`RuleFailure`] says why.
pub fn weights(rule: SlidingRule, fields: &NormalFields) -> Result<Vec<f64>, RuleFailure> {
    if let (1, [minus, plus]) = (fields.m(), &*fields.values()) {
        let weight_plus = minus / (minus - plus);
        return Ok(vec![1.0 - weight_plus, weight_plus]);
    }
    match rule {
        SlidingRule::Canopy => {
            let root = stable_roots(fields).into_iter().next();
            let root = root.ok_or(RuleFailure::NoTangentCombination)?;
            Ok(product_weights(&root))
        }
        SlidingRule::Moments => moments(fields),
        SlidingRule::DieciLopez => dieci_lopez(fields),
        SlidingRule::MinimumNorm => minimum_norm(fields),
    }
}

/// The multipliers lambda_j = sum over k of w_k k_j.
pub fn multipliers_of(weights: &[f64], m: usize) -> Vec<f64> {
    let signed = |j: usize| {
        let terms = weights.iter().enumerate();
        terms.map(move |(k, w)| sign_of(k, j) * w).sum()
    };
    (0..m).map(signed).collect()
}

/// The sign of surface j in a pattern.
fn sign_of(pattern: usize, j: usize) -> f64 {
    if pattern >> j & 1 == 1 {
        1.0
    } else {
        -1.0
    }
}

#[cfg(test)]
mod tests;
