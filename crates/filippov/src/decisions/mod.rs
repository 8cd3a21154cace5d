//! Decisions: which motion follows at a point. The one way in is [`decide`].
//!
//! A decision is a pure function of the problem, the place, the arrival and the policy, bundled as a [`Point`]. It returns
//! its whole result, a [`Decision`]: the motion that follows, or why the run ends; the rule that decided; warnings; what it
//! cost. No integrator is in sight: neither the end of the run nor the length of a step is known here. Where a rule has to
//! look at the motion a moment later, the moment is [`Point::moment`].

mod blow_up;
mod candidate;
mod choice;
mod clinging;
mod consistency;
mod contact;
mod decide;
mod end_of_sliding;
mod event;
mod first_order;
mod germ;
mod germs;
mod groups;
mod leave_by_rule;
pub(crate) mod limits;
mod meeting;
mod one_surface;
mod placement;
mod point;
mod reduction;
mod relay;
mod rest;
mod rounds;
mod rule;
mod scene;
mod settle;
mod sides;
mod singular_points;
mod spiral;
mod surroundings;
mod touching;
mod trial;
mod viable;
mod zero_surfaces;

pub(crate) use clinging::{cling, side_of_rest, Clinging};
pub(crate) use consistency::differs_between_sides;
pub(crate) use decide::decide;
pub(crate) use end_of_sliding::{end_of_sliding, lost_guards, EndOfSliding};
pub(crate) use event::{add_vanishing_surfaces, located_surfaces, Reached};
pub(crate) use leave_by_rule::refusal;
pub(crate) use meeting::warn_oscillation;
pub(crate) use placement::{goes_through, pushed_back, sides, triggers_reached, Sides};
pub(crate) use point::{Arrival, Cause, Leap, Left, Lefts, Next, Notes, Point, Policy, Values};
pub(crate) use rest::{rest_within_tolerance, RestingPlace};
pub(crate) use rounds::{mean_of_rounds, Rounds};
pub(crate) use rule::{Decision, Rule};
pub(crate) use scene::Scene;
pub(crate) use sides::{warn_against_direction, warn_unknown_side};
pub(crate) use spiral::landing;
pub(crate) use zero_surfaces::{has_left_zero_surface, warn_zero_surface, zero_surfaces};
