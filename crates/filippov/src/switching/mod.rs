//! Switching: what follows when the motion reaches a surface.
//!
//! Decisions are pure functions of the system, the point, the previous mode and the set of
//! functions that vanish there; they return data. First-order data decide; where they vanish, the
//! first Lie derivative that does not.

mod codim1;
mod intersection;
mod lie;
mod p_matrix;
mod relay;

pub use codim1::{decide, Arrival, Decision};
pub use intersection::{decide_intersection, IntersectionDecision};
pub use lie::{first_nonzero, normal_component, Leading};
pub use p_matrix::is_p_matrix;
pub use relay::{
    all_relay_modes, solve_relay, RelayError, RelayProblem, RelaySolution, Uniqueness,
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
        }
    }

    /// The kind that leads from one mode to another.
    pub fn between(before: &crate::Mode, after: &crate::Mode) -> Kind {
        use std::cmp::Ordering::{Equal, Greater, Less};
        match after.codimension().cmp(&before.codimension()) {
            _ if before == after => Kind::Grazing,
            Greater => Kind::EnterSliding,
            Less => Kind::ExitSliding,
            Equal if before.sliding() == after.sliding() => Kind::Crossing,
            Equal => Kind::SwitchSliding,
        }
    }
}

#[cfg(test)]
mod tests;
