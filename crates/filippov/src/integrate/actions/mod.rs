//! Actions: resets, impacts and ticks of clocks, and the contact that they end in.

pub(super) mod impacts;
pub(super) mod instant;
pub(super) mod sides;
pub(super) mod timetable;
