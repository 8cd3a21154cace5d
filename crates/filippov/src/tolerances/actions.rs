//! Thresholds of actions: ticks, impacts, contact, sticking.

use super::EPS;

/// A tick of a clock counts as at a time within this multiple of the size of both in periods: a few roundings.
pub const SAME_TICK: f64 = 8.0 * EPS;

/// Actions in one instant at most. A chain of bodies that pass an impulse on needs about the square of their number.
pub const MOST_ACTIONS_AT_ONE_TIME: usize = 1000;

/// Impacts whose flights rise less than this multiple of the rounding of the surface are not resolved.
pub const UNRESOLVED_FLIGHT: f64 = 64.0;

/// A body touches without speed if that is below this fraction of the tolerance.
pub const SLOW: f64 = 0.1;

/// Impulses that differ by more than this part are those of friction.
pub const FRICTION_IN_MAP: f64 = 1e-3;

/// A switching function above this share of the terms that it is made of is no zero by any rounding: where an action changes
/// discrete states only, and all functions are, the motion stays in its region.
pub const CLEAR_OF_SURFACE: f64 = 1e-9;
