//! Switching: what follows when the motion reaches a surface.
//!
//! Decisions are pure functions of the system, the point, the previous mode and the set of
//! functions that vanish there; they return data. First-order data decide; where they vanish, the
//! first Lie derivative that does not.

mod codim1;
mod exits;
mod hidden;
mod incoming;
mod lap;
mod lie;
mod relay;
mod resolution;
mod resolve;
mod shared_load;
mod stick;
mod two_fold_motion;

pub(crate) use crate::cube::invert;
pub use crate::cube::{
    enclose_root, has_one_mode_only, is_p_matrix, is_scaling_stable, is_stable, is_stable_for,
    is_undetermined, least_multipliers, merged_root, multiplier_rates, newton, roots_in_cube,
    scaling_margin, stability_margins, stable_roots, stable_roots_with_border, stable_roots_within,
    Bilinear, EnclosedRoot, IntervalVector, Matrix, MergedRoot, NormalFields, Root, RootBounds,
    Roots, SignGroup, Vector,
};
pub use crate::error::Undecided;
pub use crate::patience::Patience;
pub use codim1::{decide, Arrival, Decision};
pub use hidden::{
    admissible, admissible_within, limit as limit_of_hidden_dynamics, Admissible,
    Outcome as HiddenOutcome,
};
pub use incoming::{ExitKind, Incoming};
pub use lap::Lap;
pub use lie::{first_nonzero, normal_component, Leading};
pub use relay::{solve_relay, solve_relay_within, RelayError, RelayProblem, RelaySolution};
pub use resolution::{Continuation, Resolution};
pub use resolve::{resolve, resolve_within};
pub use shared_load::{stay_together, SharedLoad, SharedLoads, Uniqueness};
pub use two_fold_motion::{TwoFold, TwoFoldMotion};

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
