//! The options of a run, with their defaults.

use crate::clock::Clock;
use crate::mode::Mode;

/// What happens at a point where several continuations are Filippov solutions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum NonUnique {
    /// Keep to the continuation chosen by regularisation (the motion that arrived goes on) and
    /// list the others in the warnings.
    Regularize,
    /// Stop with [`crate::Stop::NonUnique`].
    Error,
}

/// Which combination of the 2^m fields slides where m >= 2 surfaces meet. On one surface all are Filippov's, and
/// for fields that are affine in the signs all but [`SlidingRule::DieciLopez`] give the same field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum SlidingRule {
    /// Products of one multiplier per surface: the limit of regularised systems.
    #[default]
    Canopy,
    /// The moments of Dieci and Difonzo; two surfaces only.
    Moments,
    /// Projected fields with the rational weights of Dieci and Lopez; all fields must point towards the
    /// intersection.
    DieciLopez,
    /// The combination of least norm.
    MinimumNorm,
}

impl SlidingRule {
    /// The name used in options.
    pub fn name(self) -> &'static str {
        match self {
            SlidingRule::Canopy => "canopy",
            SlidingRule::Moments => "moments",
            SlidingRule::DieciLopez => "dieci-lopez",
            SlidingRule::MinimumNorm => "minimum-norm",
        }
    }
}

/// What is kept of a run. Zeros of the user's events are kept in any case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Keep {
    /// Every step, and with [`Options::dense_output`] the continuous extensions.
    #[default]
    Steps,
    /// The switches, and the segments between them.
    Switches,
    /// The last state: the memory does not grow with the run.
    Last,
}

/// What keeps a sliding motion on its surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Stabilization {
    /// Stages, ends of steps and points of the continuous extension are projected.
    #[default]
    Projection,
    /// Nothing is projected; the field gets the term -C sum h_j grad h_j, which draws the motion back (Piiroinen and
    /// Kuznetsov 2008, equation 50).
    Restoring(f64),
}

impl Stabilization {
    /// The factor C, if the motion is drawn back.
    pub fn restoring(self) -> Option<f64> {
        match self {
            Stabilization::Projection => None,
            Stabilization::Restoring(factor) => Some(factor),
        }
    }
}

/// How a motion is integrated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Method {
    /// Taylor series where the system has them and they pay; else DOPRI5.
    #[default]
    Auto,
    /// The Runge-Kutta pair of Dormand and Prince.
    Dopri5,
    /// Taylor series wherever the system has them; else DOPRI5.
    Taylor,
    /// The Runge-Kutta method of Dormand and Prince of order 8.
    Dop853,
    /// The explicit midpoint rule of Dieci and Lopez: one-sided, projected.
    Midpoint,
    /// The Rosenbrock-Wanner method of Steinebach, for stiff motions.
    Rodas5p,
}

impl Method {
    /// All of them, as they are declared.
    pub const ALL: [Method; 6] = [
        Method::Auto,
        Method::Dopri5,
        Method::Taylor,
        Method::Dop853,
        Method::Midpoint,
        Method::Rodas5p,
    ];

    /// The name that users write.
    pub fn name(self) -> &'static str {
        match self {
            Method::Auto => "auto",
            Method::Dopri5 => "DOPRI5",
            Method::Taylor => "Taylor",
            Method::Dop853 => "DOP853",
            Method::Midpoint => "Midpoint",
            Method::Rodas5p => "Rodas5P",
        }
    }
}

/// Options of [`crate::Problem::solve`].
#[derive(Clone, Debug)]
pub struct Options {
    /// How motions are integrated.
    pub method: Method,
    /// Relative tolerance per component.
    pub rtol: f64,
    /// Absolute tolerance, one entry for all components or one per component.
    pub atol: Vec<f64>,
    /// First step size; chosen by Hairer's rule if `None`.
    pub first_step: Option<f64>,
    /// Largest step size.
    pub max_step: f64,
    /// Stop after that many accepted and rejected steps.
    pub max_steps: u64,
    /// Stop after that many switches.
    pub max_events: u64,
    /// Stop after that many seconds.
    pub max_wall_time: Option<f64>,
    /// The clock by which that time is measured.
    pub clock: Clock,
    /// Policy at non-unique points.
    pub nonunique: NonUnique,
    /// The modes to take at the first non-unique points, in order; later points follow the policy. A mode that is
    /// not among the candidates ends the run with [`crate::Stop::NonUnique`]. The last entries may be left out: any
    /// candidate that begins so is meant.
    pub choices: Vec<Mode>,
    /// The sliding field where several surfaces meet.
    pub sliding: SlidingRule,
    /// What keeps a sliding motion on its surfaces.
    pub stabilization: Stabilization,
    /// Scaling of every surface in the regularisation that decides where the Filippov solution is not
    /// unique; 1 for all if empty.
    pub kappa: Vec<f64>,
    /// Times at which the state is wanted; every step end if `None`.
    pub t_eval: Option<Vec<f64>>,
    /// What is kept.
    pub keep: Keep,
    /// Keep the interpolants of all steps, so that the solution can be evaluated anywhere.
    pub dense_output: bool,
    /// Keep of so many decisions, the first ones, what was asked and what was decided, in
    /// [`crate::Solution::decisions`].
    pub keep_decisions: usize,
}

impl Options {
    /// The relative tolerance where none is given.
    pub(crate) const RTOL: f64 = 1e-6;

    /// The absolute tolerance where none is given, for states of size 1.
    pub(crate) const ATOL: f64 = 1e-9;
}

impl Default for Options {
    fn default() -> Self {
        Options {
            method: Method::default(),
            rtol: Options::RTOL,
            atol: vec![Options::ATOL],
            first_step: None,
            max_step: f64::INFINITY,
            max_steps: 100_000_000,
            max_events: 10_000_000,
            max_wall_time: None,
            clock: Clock::Computer,
            nonunique: NonUnique::Regularize,
            choices: Vec::new(),
            sliding: SlidingRule::default(),
            stabilization: Stabilization::default(),
            kappa: Vec::new(),
            t_eval: None,
            keep: Keep::default(),
            dense_output: true,
            keep_decisions: 0,
        }
    }
}
