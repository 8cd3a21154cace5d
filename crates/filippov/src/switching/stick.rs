//! The decision at a surface with static friction above kinetic.
//!
//! Not Filippov's law: while the motion sticks, the sign may be any number in [-r, r], r the ratio of static to
//! kinetic friction, and while it slips it is -1 or +1. With F- and F+ the fields at the signs -r and +r, sticking is
//! sliding between F- and F+, which [`crate::PiecewiseSystem::both_sides`] gives for such a surface. Where the motion
//! can stick and slip, as at a force between the two limits, it sticks: it has come to rest. It breaks away where the
//! force reaches the static limit, and then slips under the fields f- and f+ of the regions.

use super::surface_decision::{Arrival, Decision};
use crate::error::FieldError;
use crate::motion::{first_nonzero, Leading};
use crate::system::{BothSides, PiecewiseSystem, Place};
use crate::tolerances::AT_SIDE;

/// What follows where the motion is on such a surface.
pub(super) fn decide_sticking(
    system: &dyn PiecewiseSystem,
    j: usize,
    arrival: Arrival,
    place: &Place<'_>,
) -> Result<Decision, FieldError> {
    let mut sides = BothSides::new(place.x.len(), place.signs.len());
    system.both_sides(j, place, &mut sides)?;
    let holds = sides.normal_minus > 0.0 && sides.normal_plus < 0.0;
    let entry = match arrival {
        Arrival::ExitMinus => -1,
        Arrival::ExitPlus => 1,
        _ if holds => 0,
        // The force is beyond the static limit, to one side.
        _ if sides.normal_plus + sides.normal_minus < 0.0 => -1,
        _ => 1,
    };
    let (minus, plus) = if entry == 0 {
        let first = |value: f64| Leading { order: 1, value };
        (first(sides.normal_minus), first(sides.normal_plus))
    } else {
        // Without a gap between static and kinetic friction the component vanishes where the motion breaks away.
        let has_gap = system.stick_ratio(j, place) > 1.0 + AT_SIDE;
        let along = |side: i8, exit: Arrival| {
            let vanishing = usize::from(arrival == exit && !has_gap);
            first_nonzero(system, j, side, vanishing, place)
        };
        (along(-1, Arrival::ExitMinus)?, along(1, Arrival::ExitPlus)?)
    };
    Ok(Decision {
        entry,
        candidates: smallvec::smallvec![entry],
        two_fold: None,
        minus,
        plus,
    })
}
