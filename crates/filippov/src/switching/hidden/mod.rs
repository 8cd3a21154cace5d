//! Hidden dynamics: what the regularised motion does within the transition at an intersection.
//!
//! With u_i = h_i/eps, a transition function of slope 1 and the state frozen, the regularised motion is
//!
//! ```text
//! u_i' = kappa_i g_i(pi(u_1), ..., pi(u_m)),     pi(u) = clip(u, -1, 1),
//! ```
//!
//! where kappa_i > 0 scales surface i. What this motion tends to is what follows at the
//! intersection. In each *cell*, a box of the grid u_i = -1, u_i = 1, it is multilinear; it is
//! followed from cell to cell.

mod admissible;
mod around;
mod cell;
mod exact;
mod first_zero;
mod motion;
mod watch;

pub(super) use admissible::attracting;
pub use admissible::{admissible, admissible_within, Admissible};

use super::resolution::Continuation;
use crate::cube::NormalFields;
use crate::error::Undecided;
use crate::mode::Mode;
use crate::patience::Patience;

/// What the hidden dynamics tends to.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// All components of u grow without bound.
    Region(Mode),
    /// The components with a zero in the mode stay bounded, the others grow.
    Sliding {
        /// The mode.
        mode: Mode,
        /// lambda of the bounded components; empty if they go around no root that could be found.
        multipliers: Vec<f64>,
        /// Do they go around the root for ever?
        oscillates: bool,
    },
    /// u grows without bound and without limit, by the factor gamma with each lap around the
    /// intersection.
    OutwardSpiral {
        /// Growth per lap.
        gamma: f64,
    },
    /// It rests at a point that does not attract.
    AtRest,
    /// No certain outcome within the work that is allowed.
    Unknown,
}

impl Outcome {
    /// The continuation to which it leads.
    pub(super) fn continuation(&self) -> Result<Continuation, Undecided> {
        match self {
            Outcome::Sliding { multipliers, .. } if multipliers.is_empty() => Err(Undecided::Cycle),
            Outcome::Region(mode) | Outcome::Sliding { mode, .. } => {
                Ok(Continuation::Mode(mode.clone()))
            }
            Outcome::OutwardSpiral { .. } => Ok(Continuation::OutwardSpiral),
            Outcome::AtRest => Err(Undecided::AtRest),
            Outcome::Unknown => Err(Undecided::NoOutcome),
        }
    }

    /// Does it go around a root for ever?
    pub(super) fn oscillates(&self) -> bool {
        matches!(self, Outcome::Sliding { oscillates, .. } if *oscillates)
    }

    /// Its name as that of a decision.
    pub(super) fn leaf(&self) -> &'static str {
        match self {
            Outcome::Region(_) => "hidden/classical",
            Outcome::Sliding { .. } if self.oscillates() => "hidden/oscillation",
            Outcome::Sliding { .. } => "hidden/sliding",
            Outcome::OutwardSpiral { .. } => "hidden/spiral",
            Outcome::AtRest | Outcome::Unknown => "hidden/unknown",
        }
    }
}

/// Follows the hidden dynamics from the state `u` to its limit, with the surfaces scaled by `kappa`.
///
/// It is followed in closed form where one component at most is within the transition, and by Taylor series elsewhere. Of one
/// and two surfaces each outcome has a proof. For more the outcomes "region" and "sliding at rest" are certain, an
/// oscillation is one that was watched for a long time.
///
/// # Example
/// ```
/// use filippov::switching::{limit_of_hidden_dynamics, HiddenOutcome, NormalFields};
///
/// // Two surfaces, both attractive: g = (-(x - 1/2) - y/4, (x - 1/2)/2 - y).
/// let f = vec![1.75, 0.25, -0.25, 1.25, 1.25, -1.75, -0.75, -0.75];
/// let outcome = limit_of_hidden_dynamics(&NormalFields::new(2, f)?, &[0.0, -1.0], &[1.0, 1.0]);
/// let HiddenOutcome::Sliding { multipliers, .. } = outcome else { panic!() };
/// assert!((multipliers[0] - 0.5).abs() < 1e-15 && multipliers[1].abs() < 1e-15);
/// # Ok::<(), filippov::switching::Undecided>(())
/// ```
///
/// Reference: N. Guglielmi, E. Hairer (2015), SIAM J. Appl. Dyn. Syst. 14, 1454-1477.
pub fn limit(fields: &NormalFields, u: &[f64], kappa: &[f64]) -> Outcome {
    limit_within(fields, u, kappa, Patience::endless())
}

/// As [`limit`]; [`Outcome::Unknown`] when the caller has waited long enough.
pub(super) fn limit_within(
    fields: &NormalFields,
    u: &[f64],
    kappa: &[f64],
    patience: Patience,
) -> Outcome {
    let scaled = fields.scaled(kappa);
    let size = scaled.size();
    if !(size > 0.0 && size.is_finite()) {
        return Outcome::AtRest;
    }
    let unit = scaled.scaled(&vec![1.0 / size; fields.m()]);
    motion::limit(&unit, u, patience)
}

#[cfg(test)]
mod tests;
