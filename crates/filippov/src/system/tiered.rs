//! Programs that become native code once they have been called often enough.

use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, OnceLock};

use filippov_expr::{has_native_code, Backend, ExprError, Graph, NodeId, Program};

use super::compiler::{compile_later, Late};

/// Native code takes about as long to compile as four times that many interpreted calls waste. It is compiled beside the run, which
/// waits for nothing: a processor that is idle does it.
const CALLS_BEFORE_NATIVE: u32 = 500;

/// An interpreted program that is compiled to native code after [`CALLS_BEFORE_NATIVE`] calls, by another thread. Both give
/// the same bits, so the moment of the change does not show in any result.
pub(crate) struct Tiered<P> {
    /// Compiles for a backend, falling back to the interpreter.
    compile: Option<Arc<dyn Fn(Backend) -> P + Send + Sync>>,
    backend: Backend,
    interpreted: P,
    native: OnceLock<P>,
    /// The native code that another thread is to compile.
    late: Mutex<Option<Late<P>>>,
    calls: AtomicU32,
}

pub(super) type TieredProgram = Tiered<Program>;

impl<P: Send + 'static> Tiered<P> {
    /// A program that `compile` makes.
    pub fn from(compile: impl Fn(Backend) -> P + Send + Sync + 'static, backend: Backend) -> Self {
        Tiered::beside(compile(Backend::Interpreter), compile, backend)
    }

    /// A program that is there already as the interpreter runs it.
    fn beside(
        interpreted: P,
        compile: impl Fn(Backend) -> P + Send + Sync + 'static,
        backend: Backend,
    ) -> Self {
        let is_compiled = backend != Backend::Interpreter && has_native_code();
        Tiered {
            interpreted,
            compile: is_compiled.then(|| Arc::new(compile) as _),
            backend,
            native: OnceLock::new(),
            late: Mutex::new(None),
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
            late: Mutex::new(None),
            calls: AtomicU32::new(0),
        }
    }

    /// The program to call now.
    #[inline]
    pub fn program(&self) -> &P {
        if let Some(native) = self.native.get() {
            return native;
        }
        if self.compile.is_none()
            || self.calls.fetch_add(1, Ordering::Relaxed) < CALLS_BEFORE_NATIVE
        {
            return &self.interpreted;
        }
        self.adopt()
    }

    /// The native code, if it is there.
    #[inline(always)]
    pub fn native(&self) -> Option<&P> {
        self.native.get()
    }

    /// Has its native code compiled from now on.
    #[must_use]
    pub fn soon(self) -> Self {
        self.calls.store(CALLS_BEFORE_NATIVE, Ordering::Relaxed);
        self.adopt();
        self
    }

    /// The native code if it is there by now; asks for it the first time.
    #[cold]
    #[inline(never)]
    fn adopt(&self) -> &P {
        // Another thread that looks at the same moment is enough.
        if let (Ok(mut late), Some(compile)) = (self.late.try_lock(), &self.compile) {
            if late.as_ref().is_some_and(Late::is_lost) {
                *late = None;
            }
            let late = late.get_or_insert_with(|| {
                let (compile, backend) = (Arc::clone(compile), self.backend);
                compile_later(move || compile(backend))
            });
            if let Some(native) = late.take() {
                return self.native.get_or_init(|| native);
            }
        }
        self.native.get().unwrap_or(&self.interpreted)
    }
}

impl TieredProgram {
    /// Takes the graph that the outputs were just made in.
    pub fn new(graph: Graph, outputs: Vec<NodeId>, backend: Backend) -> Self {
        Tiered::from(move |backend| compile(&graph, &outputs, backend), backend)
    }

    /// The same for outputs that may not be of the graph.
    ///
    /// # Errors
    /// If they cannot be compiled; for [`Backend::Native`], if there is no native code.
    pub fn checked(
        graph: Graph,
        outputs: Vec<NodeId>,
        backend: Backend,
    ) -> Result<Self, ExprError> {
        if backend == Backend::Native && !has_native_code() {
            Program::compile(&graph, &outputs, backend)?;
        }
        let interpreted = Program::compile(&graph, &outputs, Backend::Interpreter)?;
        let make = move |backend| compile(&graph, &outputs, backend);
        Ok(Tiered::beside(interpreted, make, backend))
    }
}

/// Compiles nodes that were just made in this graph, falling back to the interpreter.
pub(super) fn compile(graph: &Graph, outputs: &[NodeId], backend: Backend) -> Program {
    Program::compile(graph, outputs, backend)
        .or_else(|_| Program::compile(graph, outputs, Backend::Interpreter))
        .expect("the interpreter refuses only nodes of another graph")
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::{Backend, Graph, Tiered, CALLS_BEFORE_NATIVE};

    /// The native code is there some time after the calls that ask for it, and is asked for once.
    #[test]
    fn native_code_comes_beside_the_calls() {
        let mut graph = Graph::new();
        let (x, t) = (graph.state(0), graph.time());
        let sum = graph.add(x, t);
        let tiered = Tiered::new(graph, vec![sum], Backend::Auto);
        for _ in 0..CALLS_BEFORE_NATIVE {
            assert!(!tiered.program().is_native());
        }
        let is_there = std::iter::repeat_with(|| tiered.program().is_native());
        // Not a limit of time but a net for what hangs.
        let start = Instant::now();
        let mut waited = is_there.take_while(|_| start.elapsed() < Duration::from_secs(600));
        assert!(waited.any(|is_native| is_native));
        let mut out = [0.0];
        tiered.program().eval(1.0, &[2.0], &[], &[], &[], &mut out);
        assert_eq!(out, [3.0]);
    }

    #[test]
    fn what_stays_interpreted_is_never_compiled() {
        let mut graph = Graph::new();
        let x = graph.state(0);
        let program = super::compile(&graph, &[x], Backend::Interpreter);
        let tiered = Tiered::interpreted(program);
        for _ in 0..10 * CALLS_BEFORE_NATIVE {
            assert!(!tiered.program().is_native());
        }
    }
}
