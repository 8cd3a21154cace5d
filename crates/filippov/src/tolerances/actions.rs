//! Thresholds of actions: ticks, impacts, contact, sticking.

use super::EPS;

/// A tick of a clock counts as at a time within this multiple of the size of both in periods: a few roundings.
pub const SAME_TICK: f64 = 8.0 * EPS;

/// A map changes a velocity if the derivative is above this fraction of the sizes that make it up: differences
/// of black boxes have an error of 1e-10.
pub const NO_IMPULSE: f64 = 1e-8;

/// Actions in one instant at most. A chain of bodies that pass an impulse on needs about the square of their number.
pub const MOST_ACTIONS_AT_ONE_TIME: usize = 1000;

/// Impacts whose flights rise less than this multiple of the rounding of the surface are not resolved.
pub const UNRESOLVED_FLIGHT: f64 = 64.0;

/// Largest number of surfaces in contact and slid on at once, whose combinations are all looked at.
pub const MOST_IN_CONTACT: usize = 6;

/// An expression of whole numbers is one itself within this: a few roundings.
pub const WHOLE_NUMBER: f64 = 1e-12;

/// A function beyond zero by more than this on one side of what is slid on has another sign there: steps end before.
pub const BETWEEN_SIDES: f64 = 1e-8;

/// Static friction above the kinetic one by less than this fraction makes no jump of the acceleration that could be told
/// from the error of the time at which the motion breaks away.
pub const NO_GAP: f64 = 1e-6;

/// A body that touches another is in contact if the force exceeds this fraction of the accelerations around.
pub const NO_FORCE: f64 = 1e-10;

/// A body touches without speed if that is below this fraction of the tolerance.
pub const SLOW: f64 = 0.1;

/// A point beyond a surface at which bodies touch by less than this multiple of the tolerance is on it.
pub const SLIPPED: f64 = 10.0;

/// Bodies that overlap by less than this fraction of their positions touch; an action that moves them changes h by more
/// than this fraction.
pub const PENETRATION: f64 = 1e-6;

/// By this part of the size of the state velocities are changed to see whether an impulse depends on them; the approach is slower by
/// the same factor again.
pub const TANGENTIAL_SPEED: f64 = 1e-5;

/// Impulses that differ by more than this part are those of friction.
pub const FRICTION_IN_MAP: f64 = 1e-3;

/// A switching function above this share of the terms that it is made of is no zero by any rounding: where an action changes
/// discrete states only, and all functions are, the motion stays in its region.
pub const CLEAR_OF_SURFACE: f64 = 1e-9;
