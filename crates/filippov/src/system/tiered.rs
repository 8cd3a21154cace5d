//! Programs that become native code once they have been called often enough.

use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::OnceLock;

use filippov_expr::{Backend, Graph, NodeId, Program};

/// Native code takes about as long to compile as that many interpreted calls waste.
const CALLS_BEFORE_NATIVE: u32 = 2000;

/// An interpreted program that is compiled to native code after [`CALLS_BEFORE_NATIVE`] calls. Both give
/// the same bits, so the moment of the change does not show in any result.
pub(crate) struct Tiered<P> {
    /// Compiles for a backend, falling back to the interpreter.
    compile: Option<Box<dyn Fn(Backend) -> P + Send + Sync>>,
    backend: Backend,
    interpreted: P,
    native: OnceLock<P>,
    calls: AtomicU32,
}

pub(super) type TieredProgram = Tiered<Program>;

impl<P> Tiered<P> {
    /// A program that `compile` makes.
    pub fn from(compile: impl Fn(Backend) -> P + Send + Sync + 'static, backend: Backend) -> Self {
        Tiered {
            interpreted: compile(Backend::Interpreter),
            compile: Some(Box::new(compile)),
            backend,
            native: OnceLock::new(),
            calls: AtomicU32::new(0),
        }
    }

    /// A program that stays interpreted.
    pub fn interpreted(program: P) -> Self {
        Tiered {
            interpreted: program,
            compile: None,
            backend: Backend::Interpreter,
            native: OnceLock::new(),
            calls: AtomicU32::new(0),
        }
    }

    /// The program to call now.
    #[inline]
    pub fn program(&self) -> &P {
        if let Some(native) = self.native.get() {
            return native;
        }
        let Some(compile) = &self.compile else {
            return &self.interpreted;
        };
        if self.calls.fetch_add(1, Ordering::Relaxed) < CALLS_BEFORE_NATIVE {
            return &self.interpreted;
        }
        self.native.get_or_init(|| compile(self.backend))
    }
}

impl TieredProgram {
    /// Takes the graph that the outputs were just made in.
    pub fn new(graph: Graph, outputs: Vec<NodeId>, backend: Backend) -> Self {
        Tiered::from(move |backend| compile(&graph, &outputs, backend), backend)
    }
}

/// Compiles nodes that were just made in this graph, falling back to the interpreter.
pub(super) fn compile(graph: &Graph, outputs: &[NodeId], backend: Backend) -> Program {
    Program::compile(graph, outputs, backend)
        .or_else(|_| Program::compile(graph, outputs, Backend::Interpreter))
        .expect("the interpreter refuses only nodes of another graph")
}
