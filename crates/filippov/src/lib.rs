//! Piecewise-smooth (Filippov) dynamical systems, simulated exactly: events located to rounding,
//! sliding motion computed instead of chattered through.
//!
//! A system is x' = f(t, x, s) with s_j the sign of a switching function h_j(t, x). Between
//! switches a smooth field is integrated; where a trajectory reaches h_j = 0 it crosses, or slides
//! along the surface under Filippov's field until that field leaves it.
//!
//! # Example: a mass on a spring with dry friction
//!
//! ```
//! use filippov::{solve, ClosureSystem, Kind, Options};
//!
//! // y'' = -y + sin(t/3) - 0.4 sign(y'), the oscillator of Piiroinen and Kuznetsov (2008).
//! let oscillator = ClosureSystem::new(
//!     2,
//!     1,
//!     |t, x, s, dx| {
//!         dx[0] = x[1];
//!         dx[1] = -x[0] + (t / 3.0).sin() - 0.4 * s[0];
//!     },
//!     |_t, x, h| h[0] = x[1],
//! );
//! let options = Options { rtol: 1e-9, atol: vec![1e-9], ..Options::default() };
//! let t_end = 60.0 * std::f64::consts::PI;
//! let solution = solve(&oscillator, (0.0, t_end), &[1.0, 2.0], &options, &[])?;
//!
//! assert!(solution.stop.is_success());
//! assert_eq!(solution.switches.len(), 42);
//! let sticks = solution.switches.iter().filter(|s| s.kind == Kind::EnterSliding).count();
//! assert_eq!(sticks, 20);
//! # Ok::<(), filippov::Error>(())
//! ```

pub mod action;
mod clock;
pub mod cube;
mod decisions;
mod error;
mod error_scale;
pub mod event;
mod inspect;
mod integrate;
mod locate;
mod mode;
pub mod motion;
mod options;
mod patience;
mod record;
mod saved;
pub mod sparse;
mod stats;
mod status;
pub mod stepper;
mod switch;
pub mod switching;
mod system;
mod tolerances;
mod vectors;

pub use clock::{Clock, ManualClock};
pub use error::{Error, FieldError};
pub use event::{UserEvent, UserFunction, UserZero};
pub use inspect::{
    classify, contradicts, hidden_dynamics, intersection_field, not_finite, state_text,
    Classification, HiddenDynamics, HiddenRoot, Inspection, IntersectionValue, NotFinitePlace,
    PointKind,
};
pub use integrate::{solve, solve_interruptible, solve_to_section, solve_with_actions, Integrator};
pub use mode::{Mode, Signs};
pub use options::{Keep, Method, NonUnique, Options, SlidingRule, Stabilization};
pub use record::{
    as_multiplier, replay_decision, section, DecisionCause, DecisionOutcome, DecisionPoint,
    DecisionRecord, Segment, Side, Solution, StartingZero,
};
pub use saved::{RunnableSystem, SavedAction, SavedSystem};
pub use stats::Stats;
pub use status::{Stop, Warning, WarningCode};
pub use switch::{Kind, Switch};
pub use system::{
    AffineParts, AffineSigns, BothSides, ClosureSystem, Definition, Law, LawAction, LawMap, Laws,
    LieValue, MotionJacobian, PiecewiseSystem, Rules, SingularSliding, TracedMap, TracedSystem,
    Word,
};
