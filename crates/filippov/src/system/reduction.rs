//! Systems on surfaces of higher relative degree. Both fields cross such a surface h = 0 at the same rate g: a motion that stays on
//! it has g = 0 too. It slides on g = 0, as on any surface, with the field that there is on h = 0.
//!
//! The relative degree of a surface is the order of the first derivative of h that jumps on it; it is 1 where the fields
//! themselves do. Reference: Levant, Higher-order sliding modes, Int. J. Control 76 (2003) 924.

use std::sync::OnceLock;

use filippov_expr::{Graph, NodeId, RateOnSurface};
use smallvec::SmallVec;

/// The graph and the field in which the rate of each surface of higher relative degree replaces its function. None if no surface
/// has a higher degree, or if a rate would replace two of these surfaces.
pub(super) fn reduced(
    graph: &Graph,
    field: &[NodeId],
    surfaces: &[usize],
) -> Option<(Graph, Vec<NodeId>)> {
    let (mut graph, mut field) = (graph.clone(), field.to_vec());
    let mut is_reduced = false;
    for &j in surfaces {
        if relative_degree(&graph, &field, j) == 1 {
            continue;
        }
        let RateOnSurface::Same(rate, on_surface) = graph.rate_on_surface(&field, j as u32) else {
            return None;
        };
        let mut others = surfaces.iter().filter(|k| **k != j);
        if others.any(|&k| graph.is_multiple_of_surface(rate, k as u32)) {
            return None;
        }
        (graph, field) = (graph.with_surface(j as u32, rate), on_surface);
        is_reduced = true;
    }
    is_reduced.then_some((graph, field))
}

/// The relative degree of a surface; 1 also if no derivative of its function jumps.
pub(super) fn relative_degree(graph: &Graph, field: &[NodeId], j: usize) -> usize {
    let (mut graph, mut field) = (graph.clone(), field.to_vec());
    for degree in 1..=field.len() {
        match graph.rate_on_surface(&field, j as u32) {
            RateOnSurface::Jumps => return degree,
            RateOnSurface::Other => break,
            RateOnSurface::Same(rate, on_surface) => {
                (graph, field) = (graph.with_surface(j as u32, rate), on_surface);
            }
        }
    }
    1
}

/// Reduced systems of one system, by the surfaces slid on: a list that grows at its end.
#[derive(Clone)]
pub(super) struct Reductions<S>(OnceLock<Box<Reduction<S>>>);

#[derive(Clone)]
struct Reduction<S> {
    surfaces: SmallVec<[usize; 4]>,
    system: Option<S>,
    next: Reductions<S>,
}

impl<S> Default for Reductions<S> {
    fn default() -> Self {
        Reductions(OnceLock::new())
    }
}

impl<S> Reductions<S> {
    /// The system for these surfaces, made if it is not known.
    pub fn get_or_make(&self, surfaces: &[usize], make: impl FnOnce() -> Option<S>) -> Option<&S> {
        let mut make = Some(make);
        let mut list = self;
        loop {
            let entry = list.0.get_or_init(|| {
                Box::new(Reduction {
                    surfaces: SmallVec::from_slice(surfaces),
                    system: make.take().and_then(|make| make()),
                    next: Reductions::default(),
                })
            });
            if entry.surfaces.as_slice() == surfaces {
                return entry.system.as_ref();
            }
            list = &entry.next;
        }
    }
}
