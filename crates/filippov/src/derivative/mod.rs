//! Derivatives of runs by the start, the initial time and parameters: an observer of accepted steps and instants.
//!
//! Between instants the derivative M of the state solves M' = Df M + D_p f along the motion ([`Tangents`], `piece.rs`). At an
//! instant fixed by a guard g the saltation matrix S = DR + (F+ - DR F-) dg / (dg . F-) maps a change before to the change after
//! (`instant.rs`). Both are those of the extended state (t, x, p): parameters by which is differentiated are states that rest
//! (`extended.rs`).
//!
//! References: P. C. Mueller, Calculation of Lyapunov exponents for dynamic systems with discontinuities, *Chaos, Solitons &
//! Fractals* 5 (1995) 1671; E. Hairer, G. Wanner, *Solving Ordinary Differential Equations II* (1996), section IV.5.

mod adjoint;
mod between;
mod borders;
mod change;
mod collocation;
mod event_gradient;
mod exponents;
mod extended;
mod forms;
mod held;
mod instant;
mod lengths;
mod limit;
mod one_sided;
mod orthonormal;
mod parts;
mod passing;
mod piece;
mod radau;
mod second;
mod series;
mod tangents;
mod weights;

pub use adjoint::{CostGradient, Stretch, Term, TermPoint, Trail, Walk, WayBack, When};
pub use between::{Differentiated, DifferentiatedRun};
pub use borders::Borders;
pub use event_gradient::EventGradient;
pub use exponents::{Exponents, Growth};
pub use extended::{Column, Extended, Extension};
pub use held::{ActionAt, GuardAt, HeldMotion};
pub use instant::Lost;
pub use one_sided::OneSided;
pub use passing::InstantDerivative;
pub use tangents::{Derivatives, LostSecond, SecondLost, Tangents};
