//! The Python binding: converts arguments, calls the core, converts results. No mathematics.

mod black_boxes;
mod boxes;
mod builder;
mod callbacks;
mod clock;
mod conversion;
mod decisions;
mod derivatives;
mod exponents;
mod inspect;
mod itineraries;
mod laws;
mod memory;
mod page;
mod prepared_run;
mod regions;
mod run;
mod runs;
mod saved;
mod solve;
mod sweep;
mod systems;
mod threads;

use pyo3::prelude::*;

#[global_allocator]
static MEMORY: memory::BySize = memory::BySize;

/// The compiled core of `filippov`.
#[pymodule]
mod _core {
    #[pymodule_export]
    use super::black_boxes::{OpaqueSystem, SignedSystem};
    #[pymodule_export]
    use super::boxes::ModeBounds;
    #[pymodule_export]
    use super::builder::Builder;
    #[pymodule_export]
    use super::callbacks::TracedEvent;
    #[pymodule_export]
    use super::clock::ManualClock;
    #[pymodule_export]
    use super::decisions::replay_decision;
    #[pymodule_export]
    use super::exponents::growth_many;
    #[pymodule_export]
    use super::inspect::{classify, hidden_dynamics, intersection_field};
    #[pymodule_export]
    use super::itineraries::{HeldItinerary, HeldMotions};
    #[pymodule_export]
    use super::page::{answer_page, pack_page, page_of, PageModel};
    #[pymodule_export]
    use super::regions::Regions;
    #[pymodule_export]
    use super::run::Run;
    #[pymodule_export]
    use super::runs::Runs;
    #[pymodule_export]
    use super::saved::{load_system, save_system};
    #[pymodule_export]
    use super::solve::{solve, solve_many, RunOptions};
    #[pymodule_export]
    use super::sweep::{solve_points, warning_codes};
    #[pymodule_export]
    use super::systems::TracedSystem;

    #[pymodule_export]
    #[allow(non_upper_case_globals)]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
