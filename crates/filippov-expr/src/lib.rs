//! Expressions of piecewise-smooth right-hand sides: kept once each, differentiated, compiled.
//!
//! A traced function becomes a [`Graph`] of expressions in the time t, the states x, the parameters p and
//! the *signs* s: for every switching function h_j the data s_j = +-1 says on which side of the surface
//! h_j = 0 the value is taken. The field of every mode is thus one expression, smooth in (t, x) for fixed
//! signs, and can be evaluated also slightly beyond a surface.
//!
//! ```
//! use filippov_expr::{Backend, Graph, Names, Program, Switching};
//!
//! // dry friction: v' = -y - 0.4 sign(v)
//! let mut g = Graph::new();
//! let (y, v) = (g.state(0), g.state(1));
//! let sign = g.sign(v);
//! let force = g.constant(0.4);
//! let friction = g.mul(force, sign);
//! let minus_y = g.neg(y);
//! let acceleration = g.sub(minus_y, friction);
//! assert_eq!(g.text(acceleration, &Names::default()), "-x[0] - 0.4*sign(x[1])");
//!
//! // one surface, however it is spelled
//! let twice = g.add(v, v);
//! assert_eq!(g.switch(twice), Switching::Surface { index: 0, orientation: 1.0 });
//!
//! // the rate of h = v on its positive side, compiled
//! let rate = g.directional(v, &[v, acceleration]);
//! let program = Program::compile(&g, &[rate], Backend::Auto)?;
//! let mut out = [0.0];
//! program.eval(0.0, &[1.0, 0.0], &[1.0], &[], &[], &mut out);
//! assert_eq!(out, [-1.4]);
//! # Ok::<(), filippov_expr::ExprError>(())
//! ```
//!
//! The crate knows nothing of time stepping. Modules: [`graph`] (construction, with `simplify`),
//! [`switching`] (surfaces found and merged), `partition` (what depends on which sign), [`region`] (what an
//! expression is under each combination of its signs), [`regularized`] (smooth functions for signs), [`derivative`],
//! `print`, `serial`, [`program`] (native code by Cranelift, or a portable interpreter), [`enclosure`]
//! (rigorous bounds along pieces of motions) and [`jet`] (Taylor coefficients of motions).

#![warn(unnameable_types)]

pub mod arcs;
mod blend;
mod constant_of_motion;
pub mod container;
pub mod derivative;
pub mod enclosure;
mod error;
mod few;
pub mod graph;
pub mod interval;
mod inverses;
pub mod jet;
mod linear;
#[cfg(feature = "native")]
mod native;
mod node;
mod on_surface;
mod op;
mod partition;
mod poles;
mod print;
pub mod program;
mod range;
pub mod region;
pub mod regularized;
mod relative_degree;
pub mod roots;
mod schedule;
mod serial;
mod settled;
mod sign_gradient;
mod simplify;
mod spelling;
mod surface_order;
pub mod switching;
mod tape;

pub use arcs::legs_of_arc;
pub use blend::SignDependence;
pub use constant_of_motion::RateTerms;
pub use derivative::{Gradient, Wrt};
pub use enclosure::{Enclosure, EnclosureProgram, Motion};
pub use error::ExprError;
pub use few::sort_few;
pub use graph::Graph;
pub use interval::Interval;
pub use jet::{JetProgram, Multipliers};
pub use node::{Node, NodeId};
pub use op::{BinaryOp, UnaryOp};
pub use print::Names;
pub use program::{has_native_code, Backend, Program};
pub use region::{Discrete, Edge, Kind, PartSign, Pieces, Region, Regions, Split};
pub use relative_degree::RateOnSurface;
pub use schedule::Lengths;
pub use settled::Settled;
pub use switching::Switching;
