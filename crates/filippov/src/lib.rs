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
//! use filippov::{ClosureSystem, Kind, Options, Problem};
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
//! let problem = Problem::new(&oscillator, (0.0, t_end), &[1.0, 2.0]).options(&options);
//! let solution = problem.solve()?;
//!
//! assert!(solution.stop.is_success());
//! assert_eq!(solution.switches.len(), 42);
//! let sticks = solution.switches.iter().filter(|s| s.kind == Kind::EnterSliding).count();
//! assert_eq!(sticks, 20);
//! # Ok::<(), filippov::Error>(())
//! ```
//!
//! # Example: a traced system
//!
//! A system given by expressions has exact derivatives, bounds and Taylor series. Here x' = 0.3 - sign(x - 1/2).
//!
//! ```
//! use filippov::{Problem, TracedSystem};
//! use filippov_expr::{Backend, Graph, Names};
//!
//! let mut g = Graph::new();
//! let (x, half, drive) = (g.state(0), g.constant(0.5), g.constant(0.3));
//! let h = g.sub(x, half);
//! let sign = g.sign(h);
//! let rate = g.sub(drive, sign);
//! let relay = TracedSystem::new(g, vec![rate], vec![], Names::default(), Backend::Auto)?;
//! let solution = Problem::new(&relay, (0.0, 2.0), &[0.0]).solve()?;
//!
//! // It rises with 1.3, reaches the surface at t = 0.5 / 1.3, and slides.
//! assert!((solution.switches.at(0).t - 0.5 / 1.3).abs() < 1e-15);
//! assert_eq!(solution.mode.entries(), [0]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Example: step by step
//!
//! ```
//! use filippov::{ClosureSystem, Integrator, Problem};
//!
//! let falls = ClosureSystem::new(1, 1, |_, _, s, dx| dx[0] = -s[0], |_, x, h| h[0] = x[0]);
//! let mut integrator = Integrator::new(Problem::new(&falls, (0.0, 3.0), &[1.0]))?;
//! let stop = loop {
//!     if let Some(stop) = integrator.step()? {
//!         break stop;
//!     }
//!     println!("{:.3} {:?} {}", integrator.t(), integrator.x(), integrator.mode());
//! };
//! assert_eq!(integrator.mode().entries(), [0]);
//! let solution = integrator.finish(stop);
//! assert_eq!(solution.switches.len(), 1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![warn(unnameable_types)]

pub mod action;
mod clock;
pub mod cube;
mod decisions;
pub mod derivative;
mod error;
mod error_scale;
pub mod event;
mod inspect;
mod integrate;
mod locate;
mod mode;
pub mod motion;
mod options;
mod page;
mod patience;
mod powers;
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
pub use error_scale::Units;
pub use event::{AffinePart, SmoothParts, UserEvent, UserFunction, UserZero};
pub use inspect::{
    classify, contradicts, equations, field_off_surfaces, hidden_dynamics, intersection_field,
    message_of, not_finite, state_after, state_text, surfaces_of_rounding, Classification, Dip,
    Equations, GuardRates, HiddenDynamics, HiddenRoot, Inspection, IntersectionValue, ItineraryLeg,
    Leg, LegEnd, LegError, NotFinitePlace, OffSurfaces, Passage, PointKind, Unknowns,
};
pub use integrate::{Integrator, Problem, Reached, ReplayError};
pub use mode::{Mode, Signs};
pub use motion::{as_multiplier, Held, Piece};
pub use options::{Keep, Method, NonUnique, Options, SlidingRule, Stabilization};
pub use record::{
    replay_decision, section, Columns, DecisionCause, DecisionOutcome, DecisionPoint,
    DecisionRecord, EndOnly, Gradient, InstantRecord, ObservedStep, Observer, Rows, Segment,
    SegmentColumns, Segments, Side, Solution, StartingZero, SwitchColumns, Switches,
};
pub use saved::{ReadySystem, RunnableSystem, SavedAction, SavedSystem};
pub use stats::Stats;
pub use status::{Stop, Warning, WarningCode};
pub use switch::{Kind, Switch};
pub use system::{
    AffineParts, AffineSigns, BothSides, ClosureSystem, Definition, Enclosures, Law, LawAction,
    LawMap, Laws, LieDerivatives, LieValue, Linearisation, Linearisations, MotionJacobian,
    MotionJets, PiecewiseSystem, Place, RatePartials, RegionFields, Rules, Setting, SignStructure,
    SingularSliding, Step, TaylorSeries, TracedMap, TracedSystem, Word,
};
