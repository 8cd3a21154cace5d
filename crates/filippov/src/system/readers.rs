//! Who reads the discrete states of a system, and so which laws a run follows.

use filippov_expr::{Graph, NodeId};

use super::{Law, Rules};

/// Who reads the discrete state of a law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reader {
    /// The field, or a switching function.
    System,
    /// At most functions beside the field. A law with a memory is followed for these in any case.
    Beside,
    /// Nobody. The discrete state is a function of the point, so that a run need not change it.
    Nobody,
}

impl Rules {
    /// Who reads the discrete state of each law, in a system with this field and `n_parameters` parameters.
    pub(super) fn readers(
        &self,
        graph: &Graph,
        field: &[NodeId],
        n_parameters: usize,
    ) -> Vec<Reader> {
        let n_moving = graph.n_surfaces() - self.n_hidden;
        let surfaces = (0..n_moving).map(|j| graph.surface(j as u32));
        let ratios = self.sticking.iter().map(|&(_, ratio)| ratio);
        let mut roots: Vec<NodeId> = field
            .iter()
            .copied()
            .chain(surfaces)
            .chain(ratios)
            .collect();
        let mut readers = vec![Reader::Nobody; self.laws.len()];
        self.mark(
            graph,
            &mut roots,
            n_parameters,
            &mut readers,
            Reader::System,
        );
        for (index, law) in self.laws.iter().enumerate() {
            let is_kept = law.has_memory() || self.beside.contains(&index);
            if is_kept && readers[index] == Reader::Nobody {
                readers[index] = Reader::Beside;
                self.add_expressions(graph, law, &mut roots);
            }
        }
        self.mark(
            graph,
            &mut roots,
            n_parameters,
            &mut readers,
            Reader::Beside,
        );
        readers
    }

    /// Marks the laws whose discrete states some expressions read, and those that these laws read.
    fn mark(
        &self,
        graph: &Graph,
        roots: &mut Vec<NodeId>,
        n_parameters: usize,
        readers: &mut [Reader],
        reader: Reader,
    ) {
        loop {
            let n_before = roots.len();
            for parameter in graph.parameters_read_at(roots, &[]) {
                let Some(index) = (parameter as usize).checked_sub(n_parameters) else {
                    continue;
                };
                if readers[index] == Reader::Nobody {
                    readers[index] = reader;
                    self.add_expressions(graph, &self.laws[index], roots);
                }
            }
            if roots.len() == n_before {
                return;
            }
        }
    }

    /// Adds the expressions that a law follows, and the function of the surface at which it changes.
    fn add_expressions(&self, graph: &Graph, law: &Law, roots: &mut Vec<NodeId>) {
        roots.extend(law.nodes());
        roots.extend(law.guard().map(|guard| graph.surface(guard as u32)));
    }
}
