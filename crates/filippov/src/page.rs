//! The interactive page: its module is to be small, as a visitor loads it.

/// Is this the module of the page? It does without what only makes long runs, and those of many surfaces or states,
/// cheaper, without the rules for groups of more than six surfaces that meet, without a look at switching functions that change
/// by many orders of magnitude in a step, and has no functions of a user.
pub(crate) const IS_PAGE: bool = cfg!(target_family = "wasm");
