//! Programs that become native code once they have been called often enough.

use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::OnceLock;

use filippov_expr::{Backend, Graph, NodeId, Program};

/// Native code takes about as long to compile as that many interpreted calls waste.
const CALLS_BEFORE_NATIVE: u32 = 2000;

/// An interpreted program that is compiled to native code after [`CALLS_BEFORE_NATIVE`] calls. Both give
/// the same bits, so the moment of the change does not show in any result.
pub(super) struct TieredProgram {
    graph: Graph,
    outputs: Vec<NodeId>,
    backend: Backend,
    interpreted: Program,
    native: OnceLock<Program>,
    calls: AtomicU32,
}

impl TieredProgram {
    /// Takes the graph that the outputs were just made in.
    pub fn new(graph: Graph, outputs: Vec<NodeId>, backend: Backend) -> Self {
        TieredProgram {
            interpreted: compile(&graph, &outputs, Backend::Interpreter),
            graph,
            outputs,
            backend,
            native: OnceLock::new(),
            calls: AtomicU32::new(0),
        }
    }

    /// The program to call now.
    #[inline]
    pub fn program(&self) -> &Program {
        if let Some(native) = self.native.get() {
            return native;
        }
        if self.calls.fetch_add(1, Ordering::Relaxed) < CALLS_BEFORE_NATIVE {
            return &self.interpreted;
        }
        self.native
            .get_or_init(|| compile(&self.graph, &self.outputs, self.backend))
    }
}

/// Compiles nodes that were just made in this graph, falling back to the interpreter.
pub(super) fn compile(graph: &Graph, outputs: &[NodeId], backend: Backend) -> Program {
    Program::compile(graph, outputs, backend)
        .or_else(|_| Program::compile(graph, outputs, Backend::Interpreter))
        .expect("the interpreter refuses only nodes of another graph")
}
