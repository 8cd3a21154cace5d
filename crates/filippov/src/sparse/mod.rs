//! Sparse linear systems of sliding: rows, an ordering, a factorisation.
//!
//! The systems have one row per surface slid on. What couples them is mechanical: nothing (friction of each
//! mass with the ground: diagonal), neighbours in a chain (tridiagonal), a few separate machines (blocks), a
//! common carriage (dense). One method fits all: connected components, each ordered for small bandwidth and
//! factored as a band. Steps for stiff motions keep unknowns that are coupled with very many others apart, as a border. See `docs/decisions/0010-band-solver.md`.

mod band;
mod bordered;
mod order;
mod rows;
mod solver;

pub use bordered::BorderedSolver;
pub use order::{components, coupled_blocks, Component};
pub use rows::{SparseProduct, SparseRows};
pub use solver::{is_positive_definite, Pattern, Singular, SparseSolver};

#[cfg(test)]
mod tests;
