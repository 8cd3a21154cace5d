//! The engine of the page, by its requests and replies alone.

#![allow(clippy::unwrap_used)]

#[path = "engine/basins.rs"]
mod basins;
#[path = "engine/diagrams.rs"]
mod diagrams;
#[path = "engine/models.rs"]
mod models;
#[path = "engine/planes.rs"]
mod planes;
#[path = "engine/refusals.rs"]
mod refusals;
#[path = "engine/runs.rs"]
mod runs;
