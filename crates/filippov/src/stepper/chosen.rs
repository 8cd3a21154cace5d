//! The methods that a run may use beside DOPRI5: the table at the end of this file has a line for each.

use super::duties::{Attempt, ExitSeries, Ready, Stepper};
use super::{Controller, Dop853, ErrorScale, Midpoint, Rodas5p, Step, Taylor};
use crate::error::FieldError;
use crate::motion::{Run, SmoothField};
use crate::options::Method;
use crate::status::Warning;

/// Makes the enumeration of the methods beside DOPRI5 from their table, and what builds the one that a run asks for.
macro_rules! methods {
    (|$start:ident, $span:ident| $($name:ident: $asked:pat $(if $may:expr)? => $built:expr,)*) => {
        /// The method that is asked before DOPRI5.
        #[derive(Clone)]
        pub(super) enum Chosen {
            $($name(Box<$name>)),*
        }

        impl Chosen {
            /// What the options of the run stand for, which starts here; `None` is DOPRI5 alone. `span` is the length of the interval
            /// of integration.
            pub fn of_run($start: &Run, $span: f64) -> Option<Self> {
                match $start.options.method {
                    $($asked $(if $may)? => Some(Chosen::$name(Box::new($built))),)*
                    Method::Auto | Method::Taylor | Method::Dopri5 => None,
                }
            }

            /// About how many numbers its coefficients and matrices are.
            pub fn n_numbers(&self) -> usize {
                let matrices = match self {
                    Chosen::Rodas5p(method) => method.n_in_matrices(),
                    Chosen::Taylor(method) => method.n_in_rows(),
                    _ => 0,
                };
                2 * self.step().interpolant.coefficients().len() + matrices
            }

            /// Which one it is.
            pub fn method(&self) -> Method {
                match self { $(Chosen::$name(_) => Method::$name),* }
            }
        }

        // The compiler knows all methods: a step of few states costs little more than these calls.
        impl Stepper for Chosen {
            #[inline(always)]
            fn step(&self) -> &Step {
                match self { $(Chosen::$name(method) => method.step()),* }
            }

            #[inline(always)]
            fn step_mut(&mut self) -> &mut Step {
                match self { $(Chosen::$name(method) => method.step_mut()),* }
            }

            #[inline(always)]
            fn attempt(&mut self, at: &mut Run, dt: f64) -> Result<Option<Attempt>, FieldError> {
                match self { $(Chosen::$name(method) => method.attempt(at, dt)),* }
            }

            #[inline(always)]
            fn extrapolation_error(&self, theta: f64, scale: &ErrorScale) -> f64 {
                match self { $(Chosen::$name(method) => method.extrapolation_error(theta, scale)),* }
            }

            #[inline(always)]
            fn begin(&mut self, at: &mut Run) -> Ready {
                match self { $(Chosen::$name(method) => method.begin(at)),* }
            }

            #[inline(always)]
            fn start(&mut self, at: &mut Run) -> Result<bool, FieldError> {
                match self { $(Chosen::$name(method) => method.start(at)),* }
            }

            #[inline(always)]
            fn started(&mut self, at: &mut Run) -> Ready {
                match self { $(Chosen::$name(method) => method.started(at)),* }
            }

            fn refusal(&mut self, at: &Run) -> Option<Box<Warning>> {
                match self { $(Chosen::$name(method) => method.refusal(at)),* }
            }

            #[inline(always)]
            fn start_derivative_mut(&mut self) -> &mut [f64] {
                match self { $(Chosen::$name(method) => method.start_derivative_mut()),* }
            }

            #[inline(always)]
            fn prepare(&mut self, at: &mut Run) -> Result<Ready, FieldError> {
                match self { $(Chosen::$name(method) => method.prepare(at)),* }
            }

            #[inline(always)]
            fn accept(&mut self, y: &mut [f64]) {
                match self { $(Chosen::$name(method) => method.accept(y)),* }
            }

            #[inline(always)]
            fn after_acceptance(&self, controller: &mut Controller, dt: f64, error: f64) -> f64 {
                match self { $(Chosen::$name(method) => method.after_acceptance(controller, dt, error)),* }
            }

            #[inline(always)]
            fn after_rejection(&self, controller: &mut Controller, error: f64) -> f64 {
                match self { $(Chosen::$name(method) => method.after_rejection(controller, error)),* }
            }

            #[inline(always)]
            fn extends_freely(&self) -> bool {
                match self { $(Chosen::$name(method) => method.extends_freely()),* }
            }

            #[inline(always)]
            fn is_extended(&self) -> bool {
                match self { $(Chosen::$name(method) => method.is_extended()),* }
            }

            #[inline(always)]
            fn extend_cheaply(&mut self, y: &[f64]) {
                match self { $(Chosen::$name(method) => method.extend_cheaply(y)),* }
            }

            #[inline(always)]
            fn extend(&mut self, field: &mut dyn SmoothField, y: &[f64]) -> Result<(), FieldError> {
                match self { $(Chosen::$name(method) => method.extend(field, y)),* }
            }

            #[inline(always)]
            fn is_series(&self) -> bool {
                match self { $(Chosen::$name(method) => method.is_series()),* }
            }

            #[inline(always)]
            fn exit_series(&self, index: usize, rows: &mut [f64]) -> Option<ExitSeries> {
                match self { $(Chosen::$name(method) => method.exit_series(index, rows)),* }
            }

            #[inline(always)]
            fn ends_at_events(&self) -> bool {
                match self { $(Chosen::$name(method) => method.ends_at_events()),* }
            }

            #[inline(always)]
            fn field_jumps(&self) -> bool {
                match self { $(Chosen::$name(method) => method.field_jumps()),* }
            }

            #[inline(always)]
            fn is_limited_by_stability(&mut self, at: &mut Run) -> Result<Option<bool>, FieldError> {
                match self { $(Chosen::$name(method) => method.is_limited_by_stability(at)),* }
            }
        }
    };
}

/// Does the run use Taylor series?
fn uses_series(run: &Run) -> bool {
    run.options.method == Method::Taylor || run.system.is_analytic()
}

methods! { |start, span|
    Taylor: Method::Taylor | Method::Auto if uses_series(start) => Taylor::of_run(start, span),
    Dop853: Method::Dop853 => Dop853::new(start.system.n_states()),
    Midpoint: Method::Midpoint => Midpoint::new(start.system.n_states()),
    Rodas5p: Method::Rodas5p => Rodas5p::new(start.system.n_states()),
}
