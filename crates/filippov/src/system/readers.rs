//! Which laws of a system a run follows: those whose discrete states something reads.

use filippov_expr::{Graph, NodeId};

use super::laws::{Law, Reader};

/// Who reads the discrete state of each law, where the field, the switching functions and the ratios of friction are `roots`, and
/// other functions read the laws in `beside`.
pub(super) fn readers(
    graph: &Graph,
    roots: Vec<NodeId>,
    laws: &[Law],
    beside: &[usize],
    n_parameters: usize,
) -> Vec<Reader> {
    let mut search = Search {
        graph,
        roots,
        laws,
        n_parameters,
        readers: vec![Reader::Nobody; laws.len()],
    };
    search.mark(Reader::System);
    for (index, law) in laws.iter().enumerate() {
        if law.has_memory() || beside.contains(&index) {
            search.add(index, Reader::Beside);
        }
    }
    search.mark(Reader::Beside);
    search.readers
}

/// Expressions whose discrete states are looked for, and the laws found so far.
struct Search<'a> {
    graph: &'a Graph,
    roots: Vec<NodeId>,
    laws: &'a [Law],
    n_parameters: usize,
    readers: Vec<Reader>,
}

impl Search<'_> {
    /// Marks the laws whose discrete states the expressions read, and those that these laws read.
    fn mark(&mut self, reader: Reader) {
        loop {
            let n_before = self.roots.len();
            for parameter in self.graph.parameters_read_at(&self.roots, &[]) {
                if let Some(index) = (parameter as usize).checked_sub(self.n_parameters) {
                    self.add(index, reader);
                }
            }
            if self.roots.len() == n_before {
                return;
            }
        }
    }

    /// Marks a law that is not marked yet, and adds the expressions that it follows and the function of the surface at which it
    /// changes.
    fn add(&mut self, index: usize, reader: Reader) {
        if self.readers[index] != Reader::Nobody {
            return;
        }
        let law = &self.laws[index];
        self.readers[index] = reader;
        self.roots.extend(law.nodes());
        let guard = law.guard().map(|guard| self.graph.surface(guard as u32));
        self.roots.extend(guard);
    }
}
