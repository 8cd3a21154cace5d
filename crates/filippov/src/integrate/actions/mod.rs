//! Actions: resets, impacts and ticks of clocks, and the contact that they end in.

pub(super) mod instant;
pub(super) mod timetable;
