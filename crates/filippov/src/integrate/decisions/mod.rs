//! The switching stage: from a located event, or a start, to the motion that follows.

pub(super) mod accumulation;
pub(super) mod apart;
pub(super) mod between_sides;
pub(super) mod choice;
pub(super) mod coinciding;
pub(super) mod departures;
pub(super) mod leave_by_rule;
pub(super) mod look_ahead;
pub(super) mod meeting;
pub(super) mod nested;
pub(super) mod placement;
pub(super) mod relay;
pub(super) mod resting;
pub(super) mod root_ends;
pub(super) mod spiral;
pub(super) mod transition;
pub(super) mod two_fold;
pub(super) mod vanishing_jump;
