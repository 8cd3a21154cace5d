//! Switching: what follows when the motion reaches a surface.
//!
//! Decisions are pure functions of the system, the point, the previous mode and the set of
//! functions that vanish there; they return data. First-order data decide; where they vanish, the
//! first Lie derivative that does not.

mod bilinear;
mod codim1;
mod enclosed_root;
mod fold;
mod hidden;
mod incoming;
mod intersection;
mod lap;
mod lie;
mod normal_fields;
mod p_matrix;
mod parts;
mod patience;
mod redundant;
mod relay;
mod relay_at;
mod resolution;
mod resolve;
mod roots;
mod shared_load;
mod small_matrix;
mod stability;
mod stick;

pub use bilinear::{Bilinear, Root};
pub use codim1::{decide, weight_at_two_fold, Arrival, Decision, TwoFoldMotion};
pub use enclosed_root::{enclose_root, EnclosedRoot, IntervalVector, RootBounds};
pub use fold::{merged_root, MergedRoot};
pub use hidden::{
    admissible, admissible_within, limit as limit_of_hidden_dynamics, Admissible,
    Outcome as HiddenOutcome,
};
pub use incoming::{ExitKind, Incoming};
pub use intersection::{decide_intersection, region_at_rest, IntersectionDecision};
pub use lap::Lap;
pub use lie::{first_nonzero, normal_component, Leading};
pub use normal_fields::{NormalFields, SignGroup};
pub use p_matrix::is_p_matrix;
pub use parts::{independent_parts, of_part};
pub use patience::Patience;
pub use redundant::least_multipliers;
pub use relay::{
    all_relay_modes, solve_relay, solve_relay_within, RelayError, RelayProblem, RelaySolution,
    Uniqueness,
};
pub use relay_at::relay_at;
pub use resolution::{Continuation, Resolution, Undecided};
pub use resolve::{has_one_mode_only, resolve, resolve_within};
pub use roots::{
    is_undetermined, multiplier_rates, newton, roots_in_cube, stable_roots,
    stable_roots_with_border, stable_roots_within, Roots,
};
pub use shared_load::{SharedLoad, SharedLoads};
pub(crate) use small_matrix::invert;
pub use small_matrix::{Matrix, Vector};
pub use stability::{
    is_negative_p_matrix, is_scaling_stable, is_stable, is_stable_for, scaling_margin,
    stability_margins,
};

/// The word for what happened, as the field uses it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// From one region to the next, or across a further surface while sliding.
    Crossing,
    /// From a region, or from sliding on fewer surfaces, onto a surface.
    EnterSliding,
    /// Off the surface.
    ExitSliding,
    /// From sliding on one surface to sliding on another.
    SwitchSliding,
    /// The surface is touched and the mode stays.
    Grazing,
    /// Infinitely many switches in finite time, up to their limit.
    Accumulation,
    /// An action at a surface.
    Reset,
    /// An action at a known time.
    Clock,
}

impl Kind {
    /// The name used in tables.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Crossing => "crossing",
            Kind::EnterSliding => "enter_sliding",
            Kind::ExitSliding => "exit_sliding",
            Kind::SwitchSliding => "switch_sliding",
            Kind::Grazing => "grazing",
            Kind::Accumulation => "accumulation",
            Kind::Reset => "reset",
            Kind::Clock => "clock",
        }
    }

    /// The kind that leads from one mode to another.
    pub fn between(before: &crate::Mode, after: &crate::Mode) -> Kind {
        use std::cmp::Ordering::{Equal, Greater, Less};
        match after.codimension().cmp(&before.codimension()) {
            _ if before == after => Kind::Grazing,
            Greater => Kind::EnterSliding,
            Less => Kind::ExitSliding,
            Equal if before.sliding_set().eq(after.sliding_set()) => Kind::Crossing,
            Equal => Kind::SwitchSliding,
        }
    }
}

#[cfg(test)]
mod tests;
