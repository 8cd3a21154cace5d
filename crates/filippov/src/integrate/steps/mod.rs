//! Steps: their lengths, the methods that take them, what is sampled from them.

pub(super) mod chatter;
pub(super) mod edge;
pub(super) mod pace;
pub(super) mod sampling;
pub(super) mod series;
pub(super) mod stiff;
pub(super) mod stiffness;
