//! Why a run ended, in words.

use super::not_finite::{not_finite, state_text};
use crate::record::Solution;
use crate::status::Stop;
use crate::system::PiecewiseSystem;

/// Why a run ended, where, and what to try. `n_visible` is the number of surfaces that a user sees.
pub fn message_of(system: &dyn PiecewiseSystem, solution: &Solution, n_visible: usize) -> String {
    let mode = solution.mode.first(n_visible);
    let (t, x) = (solution.t_last, solution.last_state());
    let name = |j| system.surface_name(j);
    let stop = &solution.stop;
    let went_on = stop.what_went_on(&solution.stats, &solution.last_switched, name);
    let message = stop.message(t, &mode, name) + &went_on;
    match stop {
        Stop::NotFinite => match not_finite(system, t, x, &solution.discrete, &solution.mode) {
            Some(place) => format!("{message} {}", place.text(name)),
            None => message,
        },
        Stop::FieldRaised(_) => format!("{message} The last good state is {}.", state_text(x)),
        _ => message,
    }
}
