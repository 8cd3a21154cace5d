//! Actions: resets, impacts and ticks of clocks, and the contact that they end in.

pub(super) mod contact;
pub(super) mod impacts;
pub(super) mod instant;
pub(super) mod passage;
pub(super) mod sides;
pub(super) mod timetable;
