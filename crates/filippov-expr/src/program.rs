//! A compiled function (t, x, s, p, v) -> out.

use crate::error::ExprError;
use crate::graph::Graph;
#[cfg(feature = "native")]
use crate::native::{Compiled, NativeChain, NativeCode};
use crate::node::NodeId;
use crate::schedule::{Lengths, Schedule};
use crate::tape::{Arguments, Tape};

/// How a program is run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Backend {
    /// Native code if this build has it and the platform passes a self-test (once per process); else the
    /// interpreter. Both give the same bits.
    #[default]
    Auto,
    /// Native code, or an error.
    Native,
    /// The portable interpreter.
    Interpreter,
}

/// A compiled function (t, x, s, p, v) -> out. Values shared by several outputs are computed once.
///
/// Immutable and free of locks: any number of threads may evaluate it at the same time.
#[derive(Debug)]
pub struct Program {
    code: Code,
    n_outputs: usize,
    lengths: Lengths,
}

#[derive(Debug)]
enum Code {
    #[cfg(feature = "native")]
    Native(NativeCode),
    #[cfg(feature = "native")]
    Chain(NativeChain),
    Interpreted(Tape),
}

/// Does this build have native code on this platform?
pub fn has_native_code() -> bool {
    #[cfg(feature = "native")]
    let is_there = NativeCode::is_available();
    #[cfg(not(feature = "native"))]
    let is_there = false;
    is_there
}

impl Program {
    /// Compiles the values of some nodes.
    ///
    /// # Errors
    /// [`ExprError::UnknownNode`], [`ExprError::IndexTooLarge`]; with [`Backend::Native`] also
    /// [`ExprError::NativeUnavailable`].
    ///
    /// # Example
    /// ```
    /// use filippov_expr::{Backend, Graph, Program};
    /// let mut g = Graph::new();
    /// let (x, t) = (g.state(0), g.time());
    /// let sum = g.add(x, t);
    /// let program = Program::compile(&g, &[sum], Backend::Auto)?;
    /// let mut out = [0.0];
    /// program.eval(1.0, &[2.0], &[], &[], &[], &mut out);
    /// assert_eq!(out, [3.0]);
    /// # Ok::<(), filippov_expr::ExprError>(())
    /// ```
    pub fn compile(
        graph: &Graph,
        outputs: &[NodeId],
        backend: Backend,
    ) -> Result<Program, ExprError> {
        let schedule = Schedule::new(graph, outputs)?;
        let code = Code::new(graph, &schedule, backend)?;
        Ok(Program {
            code,
            n_outputs: outputs.len(),
            lengths: schedule.lengths,
        })
    }

    /// Whether this is native code.
    pub fn is_native(&self) -> bool {
        !matches!(self.code, Code::Interpreted(_))
    }

    /// How many values are computed.
    pub fn n_outputs(&self) -> usize {
        self.n_outputs
    }

    /// How long the arguments of [`Program::eval`] have to be at least.
    pub fn lengths(&self) -> Lengths {
        self.lengths
    }

    /// Evaluates at time `t`, states `x`, signs `s`, parameters `p`, extra vector `v`; writes the first
    /// [`Program::n_outputs`] entries of `out`.
    ///
    /// If an argument is too short (see [`Program::lengths`]) `out` is filled with NaN instead, as much of
    /// it as there is; in builds with debug assertions that panics.
    #[inline]
    pub fn eval(&self, t: f64, x: &[f64], s: &[f64], p: &[f64], v: &[f64], out: &mut [f64]) {
        if !self.fits(x, s, p, v, out) {
            return self.refuse(out);
        }
        // Built in each arm: the native code takes registers, and nothing is written to memory for it.
        match &self.code {
            #[cfg(feature = "native")]
            Code::Native(code) => code.run(Arguments { t, x, s, p, v }, out),
            code => code.run_apart(Arguments { t, x, s, p, v }, out),
        }
    }

    /// An argument is too short.
    #[cold]
    #[inline(never)]
    fn refuse(&self, out: &mut [f64]) {
        out.fill(f64::NAN);
        debug_assert!(
            false,
            "an argument is shorter than {:?}, {} outputs",
            self.lengths, self.n_outputs
        );
    }

    /// As [`Program::eval`], if this is one function of native code and no argument is too short; else it does nothing and returns
    /// `false`. For a caller that keeps everything else away from its fastest way.
    #[inline]
    #[cfg_attr(not(feature = "native"), allow(unused_variables))]
    pub fn eval_native(
        &self,
        t: f64,
        x: &[f64],
        s: &[f64],
        p: &[f64],
        v: &[f64],
        out: &mut [f64],
    ) -> bool {
        match &self.code {
            #[cfg(feature = "native")]
            Code::Native(code) if self.fits(x, s, p, v, out) => {
                code.run(Arguments { t, x, s, p, v }, out);
                true
            }
            _ => false,
        }
    }

    /// Are these arguments long enough?
    #[inline(always)]
    fn fits(&self, x: &[f64], s: &[f64], p: &[f64], v: &[f64], out: &[f64]) -> bool {
        let needed = &self.lengths;
        x.len() >= needed.states
            && s.len() >= needed.signs
            && p.len() >= needed.parameters
            && v.len() >= needed.inputs
            && out.len() >= self.n_outputs
    }
}

impl Code {
    /// Runs whatever it is: apart, so that the way to one native function is short.
    #[inline(never)]
    fn run_apart(&self, arguments: Arguments<'_>, out: &mut [f64]) {
        match self {
            #[cfg(feature = "native")]
            Code::Native(code) => code.run(arguments, out),
            #[cfg(feature = "native")]
            Code::Chain(chain) => chain.run(arguments, out),
            Code::Interpreted(tape) => tape.run(arguments, out),
        }
    }

    #[cfg(feature = "native")]
    fn new(graph: &Graph, schedule: &Schedule, backend: Backend) -> Result<Self, ExprError> {
        match backend {
            Backend::Interpreter => Ok(Code::Interpreted(Tape::new(graph, schedule))),
            Backend::Native => Compiled::new(graph, schedule).map(Code::from),
            Backend::Auto => Ok(match Compiled::new(graph, schedule) {
                Ok(compiled) => Code::from(compiled),
                Err(_) => Code::Interpreted(Tape::new(graph, schedule)),
            }),
        }
    }

    #[cfg(not(feature = "native"))]
    fn new(graph: &Graph, schedule: &Schedule, backend: Backend) -> Result<Self, ExprError> {
        match backend {
            Backend::Native => Err(ExprError::NativeUnavailable {
                reason: "this build is without the feature `native`".into(),
            }),
            Backend::Auto | Backend::Interpreter => {
                Ok(Code::Interpreted(Tape::new(graph, schedule)))
            }
        }
    }
}

#[cfg(feature = "native")]
impl From<Compiled> for Code {
    fn from(compiled: Compiled) -> Self {
        match compiled {
            Compiled::Whole(code) => Code::Native(code),
            Compiled::Chain(chain) => Code::Chain(chain),
        }
    }
}

#[cfg(test)]
mod tests;
