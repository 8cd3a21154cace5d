//! How a run ends, and what it warns of.

use crate::error::FieldError;
use crate::error::Undecided;
use crate::mode::Mode;
use crate::motion::weights::RuleFailure;
use crate::motion::TwoFoldMotion;
use crate::motion::{Guard, RootEnd};
use crate::options::SlidingRule;
use crate::stats::Stats;
use crate::tolerances::CHATTER_STEPS;

/// Why a run ended. Whatever the reason, the solution up to that time is kept.
#[derive(Debug)]
#[non_exhaustive]
pub enum Stop {
    /// The end of the time span was reached.
    End,
    /// A terminal event (its index) occurred.
    TerminalEvent(usize),
    /// The section was met as often as asked for.
    Returned,
    /// The returns to the section became periodic.
    Periodic,
    /// `max_steps` was reached.
    MaxSteps,
    /// `max_events` was reached.
    MaxEvents,
    /// `max_wall_time` was reached.
    MaxWallTime,
    /// The caller asked to stop.
    Interrupted,
    /// The step would have to be shorter than the rounding of time.
    StepTooSmall,
    /// Switches follow one another without any progress of time.
    NoProgress {
        /// The surfaces they happen on.
        surfaces: Vec<usize>,
    },
    /// The motion chatters along a jump of the field that no surface declares.
    Chatter {
        /// When it began.
        since: f64,
    },
    /// Actions trigger one another without end in one instant.
    ActionsDoNotEnd {
        /// Their names.
        actions: Vec<String>,
    },
    /// The map of an action gave a state that is not finite.
    ActionNotFinite {
        /// Its name.
        action: String,
    },
    /// Bodies touch, and no combination of contact and separation has admissible forces.
    Contact {
        /// The surfaces.
        surfaces: Vec<usize>,
    },
    /// Contact lasts from here, and the impulse of the reset there depends on the tangential velocity: the friction of an
    /// impact is not that of a contact.
    FrictionInMap {
        /// The surface of the contact.
        surface: usize,
        /// The reset.
        action: String,
    },
    /// The field, or a switching function, is not finite.
    NotFinite,
    /// A function of the user raised.
    FieldRaised(FieldError),
    /// Several surfaces meet, and what follows is not a motion in a region or on one surface.
    Intersection {
        /// The surfaces.
        surfaces: Vec<usize>,
        /// Where the guards were looked at: for each mode one that fails.
        failing: Vec<(Mode, Guard)>,
        /// Why the decision failed.
        reason: Undecided,
    },
    /// The motion would slide between fields that differ in the sign of another function too, which jumps there.
    SlidesAcrossJump {
        /// The surfaces that it would slide on.
        surfaces: Vec<usize>,
        /// Those whose functions contain a sign of these, and jump.
        jumping: Vec<usize>,
    },
    /// Several surfaces meet, and the chosen combination of their fields does not slide there.
    SlidingRule {
        /// The surfaces.
        surfaces: Vec<usize>,
        /// The chosen combination.
        rule: SlidingRule,
        /// Which of its premises fails.
        reason: RuleFailure,
    },
    /// The fields on both sides of a surface turn back to it, and no sliding that attracts starts here.
    InvisibleTwoFold {
        /// The surface.
        surface: usize,
        /// The motion that slides on from here, if derivatives give one.
        sliding: Option<Box<TwoFoldMotion>>,
    },
    /// The continuation is not unique, and `NonUnique::Error` was asked for, or a choice is not among the
    /// candidates.
    NonUnique {
        /// The surfaces.
        surfaces: Vec<usize>,
        /// The modes that are Filippov continuations.
        candidates: Vec<Mode>,
    },
}

impl Stop {
    /// Did the run do what was asked?
    pub fn is_success(&self) -> bool {
        matches!(
            self,
            Stop::End | Stop::TerminalEvent(_) | Stop::Returned | Stop::Periodic
        )
    }

    /// 0 at the end of the span, 1 where the run was to stop, -1 where it failed.
    pub fn status(&self) -> i32 {
        match self {
            Stop::End => 0,
            stop if stop.is_success() => 1,
            _ => -1,
        }
    }

    /// A stable name of the reason.
    pub fn name(&self) -> &'static str {
        match self {
            Stop::End => "end",
            Stop::TerminalEvent(_) => "terminal_event",
            Stop::Returned => "returned",
            Stop::Periodic => "periodic",
            Stop::MaxSteps => "max_steps",
            Stop::MaxEvents => "max_events",
            Stop::MaxWallTime => "max_wall_time",
            Stop::Interrupted => "interrupted",
            Stop::StepTooSmall => "step_too_small",
            Stop::NoProgress { .. } => "no_progress",
            Stop::Chatter { .. } => "chatter",
            Stop::ActionsDoNotEnd { .. } => "resets_do_not_end",
            Stop::ActionNotFinite { .. } => "reset_not_finite",
            Stop::Contact { .. } => "contact",
            Stop::FrictionInMap { .. } => "friction_in_map",
            Stop::NotFinite => "field_not_finite",
            Stop::FieldRaised(_) => "field_raised",
            Stop::Intersection { .. } | Stop::SlidesAcrossJump { .. } => "intersection",
            Stop::SlidingRule { .. } => "sliding_rule",
            Stop::NonUnique { .. } | Stop::InvisibleTwoFold { .. } => "non_unique",
        }
    }

    /// What a run that was cut off was doing, if it made very many switches in one place at its end; empty else. `surfaces` are those
    /// of its last switches.
    pub fn what_went_on(
        &self,
        stats: &Stats,
        surfaces: &[usize],
        surface_name: impl Fn(usize) -> String,
    ) -> String {
        let is_cut_off = matches!(
            self,
            Stop::MaxEvents | Stop::MaxSteps | Stop::MaxWallTime | Stop::Interrupted
        );
        let since = stats.here_since.filter(|_| is_cut_off);
        since.map_or_else(String::new, |since| {
            let names: Vec<String> = surfaces.iter().map(|&j| surface_name(j) + " = 0").collect();
            format!(
                " {} switches since t = {since:.10} were in one place, at {}: the motion goes to and fro there. If its rounds \
                 shrink without end, looser rtol and atol let their mean take over earlier.",
                stats.n_switches_here,
                names.join(", ")
            )
        })
    }

    /// What happened, where, and what to try.
    pub fn message(&self, t: f64, mode: &Mode, surface_name: impl Fn(usize) -> String) -> String {
        let names = |surfaces: &[usize]| {
            surfaces
                .iter()
                .map(|&j| format!("{} = 0", surface_name(j)))
                .collect::<Vec<_>>()
                .join(", ")
        };
        let modes = |modes: &[Mode]| {
            modes
                .iter()
                .map(|m| format!("({m})"))
                .collect::<Vec<_>>()
                .join(", ")
        };
        match self {
            Stop::End => "The solver successfully reached the end of the integration interval.".into(),
            Stop::TerminalEvent(_) => "A termination event occurred.".into(),
            Stop::Returned => "The section was met as often as asked for.".into(),
            Stop::Periodic => "The returns to the section became periodic.".into(),
            Stop::MaxSteps => format!(
                "Stopped at t = {t:.10} in mode ({mode}): max_steps was reached. Raise max_steps, or loosen rtol and atol; \
                 for a stiff system use method=\"Rodas5P\"."
            ),
            Stop::MaxEvents => format!(
                "Stopped at t = {t:.10} in mode ({mode}): max_events was reached. The switches may accumulate; look at the last ones."
            ),
            Stop::MaxWallTime => {
                format!("Stopped at t = {t:.10} in mode ({mode}): max_wall_time was reached.")
            }
            Stop::Interrupted => format!("Interrupted at t = {t:.10} in mode ({mode})."),
            Stop::StepTooSmall => format!(
                "Stopped at t = {t:.10} in mode ({mode}): the step became shorter than the rounding of time. \
                 The field may be singular here, stiff (method=\"Rodas5P\"), or jump without a declared surface."
            ),
            Stop::NoProgress { surfaces } => format!(
                "Stopped at t = {t:.10} in mode ({mode}): switches{} follow one another without any progress of \
                 time. They accumulate here, or the field on one side is not defined up to its surface.",
                match surfaces.is_empty() {
                    true => String::new(),
                    false => format!(" at {}", names(surfaces)),
                }
            ),
            Stop::Chatter { since } => format!(
                "Stopped at t = {t:.10} in mode ({mode}): since t = {since:.10} the motion chatters along a jump of the \
                 right-hand side for which no surface is declared; {CHATTER_STEPS} steps have led no further. Give its \
                 switching function in surfaces=, or write it with np.sign or np.where. A force like -v/|v| in several \
                 directions jumps at a point and not at a surface: make it -v/max(|v|, small)."
            ),
            Stop::ActionsDoNotEnd { actions } => format!(
                "Stopped at t = {t:.10} in mode ({mode}): resets trigger one another without end in one instant: {}. \
                 Look at where their maps lead.",
                actions.join(", ")
            ),
            Stop::ActionNotFinite { action } => format!(
                "Stopped at t = {t:.10} in mode ({mode}): the map of the reset {action} gave NaN or infinity."
            ),
            Stop::Contact { surfaces } => format!(
                "Stopped at t = {t:.10} in mode ({mode}): bodies touch at {}, and no combination of contact and \
                 separation has forces that push. The reset may not act in the direction of the surface.",
                names(surfaces)
            ),
            Stop::FrictionInMap { surface, action } => format!(
                "Stopped at t = {t:.10} in mode ({mode}): contact at {} lasts from here, and the reset {action} changes \
                 tangential velocities, as friction does. Its impulse is not the force of lasting contact: it would push a \
                 body at rest. A law for contact with friction (fl.Contact) is planned. Until then go on from here with a \
                 second run along the surface, with -friction*np.sign(v) in its right-hand side; or let the reset change \
                 the normal velocity alone, for contact without friction.",
                names(&[*surface])
            ),
            Stop::NotFinite => format!(
                "Stopped at t = {t:.10} in mode ({mode}): the right-hand side, or a switching function, is not finite (NaN or infinity) here."
            ),
            Stop::FieldRaised(_) => {
                format!("Stopped at t = {t:.10} in mode ({mode}): the right-hand side raised an exception.")
            }
            Stop::Intersection {
                surfaces,
                failing,
                reason,
            } => format!(
                "Stopped at t = {t:.10}: the motion arrived at the intersection of {} from mode ({mode}), and what \
                 follows is not decided: {}{}.",
                names(surfaces),
                reason.named(|place| names(&surfaces[place..=place])),
                what_fails(failing, surface_name)
            ),
            Stop::SlidesAcrossJump { surfaces, jumping } => format!(
                "Stopped at t = {t:.10}: from mode ({mode}) the motion would slide on {}, between fields that differ in the \
                 sign of {} too, which jumps there; such sliding is not followed. Write a sign inside of another one out: \
                 sign(g + c*sign(h)) as where(h > 0, sign(g + c), sign(g - c)).",
                names(surfaces),
                jumping.iter().map(|&j| surface_name(j)).collect::<Vec<_>>().join(", ")
            ),
            Stop::SlidingRule {
                surfaces,
                rule,
                reason,
            } => format!(
                "Stopped at t = {t:.10}: sliding=\"{}\" does not say how the motion goes on at the intersection of {}: \
                 {reason}.",
                rule.name(),
                names(surfaces)
            ),
            Stop::InvisibleTwoFold { surface, sliding } => format!(
                "Stopped at t = {t:.10}: neither side can be followed from {}, where the fields on both sides turn back to \
                 it (an invisible two-fold). {}",
                names(&[*surface]),
                match sliding {
                    Some(motion) if motion.repels() =>
                        "Sliding goes on from here where both fields point away, so that it may leave to either side at \
                         any time: the solution is not unique, and none is chosen.",
                    Some(_) =>
                        "To keep to the points where both fields are tangent is a solution; whether others wind around \
                         them and away is not decided.",
                    None => "The derivatives of the fields do not decide which motion follows.",
                }
            ),
            Stop::NonUnique {
                surfaces,
                candidates,
            } => format!(
                "Stopped at t = {t:.10}: the continuation at {} is not unique; candidates: {}. \
                 nonunique=\"regularize\" chooses one.",
                names(surfaces),
                modes(candidates)
            ),
        }
    }
}

/// The kinds of warning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum WarningCode {
    /// Several continuations exist; one was chosen.
    NonUnique,
    /// The field seems to jump where no surface is declared.
    UndeclaredJump,
    /// Taylor series were asked for, and a motion has none.
    NoSeries,
    /// Stability and not accuracy limits the steps of an explicit method.
    Stiff,
    /// Sliding goes on at a root that is not stable for the scaling of the surfaces.
    Oscillation,
    /// A switching function is zero all along a motion.
    ZeroSurface,
    /// A surface that triggers an action was crossed against its direction.
    AgainstDirection,
    /// A start on a surface whose action is triggered from both sides, with no velocity that leads off to the side that is taken.
    UnknownSide,
    /// The motion rests at a point where the fields are not regular.
    AtRest,
    /// Rounds that do not end are left to their mean.
    Averaged,
}

impl WarningCode {
    /// All kinds, in an order that is part of the format of sweeps: only added to at the end.
    pub const ALL: [WarningCode; 10] = [
        WarningCode::NonUnique,
        WarningCode::UndeclaredJump,
        WarningCode::NoSeries,
        WarningCode::Stiff,
        WarningCode::Oscillation,
        WarningCode::ZeroSurface,
        WarningCode::AgainstDirection,
        WarningCode::UnknownSide,
        WarningCode::AtRest,
        WarningCode::Averaged,
    ];

    /// The bit that stands for this kind in a set of kinds: that of its place among [`ALL`](Self::ALL).
    pub fn bit(self) -> i32 {
        1 << self as i32
    }

    /// A stable name.
    pub fn name(self) -> &'static str {
        match self {
            WarningCode::NonUnique => "non_unique",
            WarningCode::UndeclaredJump => "undeclared_jump",
            WarningCode::NoSeries => "no_series",
            WarningCode::Stiff => "stiff",
            WarningCode::Oscillation => "oscillation",
            WarningCode::ZeroSurface => "zero_surface",
            WarningCode::AgainstDirection => "against_direction",
            WarningCode::UnknownSide => "unknown_side",
            WarningCode::AtRest => "at_rest",
            WarningCode::Averaged => "averaged",
        }
    }
}

/// A warning of a run.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Warning {
    /// Its time.
    pub t: f64,
    /// Its kind.
    pub code: WarningCode,
    /// The surfaces that it is about, if any.
    pub surfaces: Vec<usize>,
    /// What happened.
    pub text: String,
    /// At a non-unique point: all continuations, the chosen one first.
    pub candidates: Vec<Mode>,
    /// The rule of the decision that it comes from; empty for others.
    pub rule: &'static str,
}

/// So many modes are named in a message.
const MOST_NAMED: usize = 9;

/// What ends each mode at once, in words; of many modes the first ones.
fn what_fails(failing: &[(Mode, Guard)], surface_name: impl Fn(usize) -> String) -> String {
    let word = |(mode, guard): &(Mode, Guard)| {
        let what = match *guard {
            Guard::Surface(j) => surface_name(j),
            Guard::Multiplier { surface, end } => {
                format!("the multiplier of {} at {end:+}", surface_name(surface))
            }
            Guard::Force(j) => format!("the force at {}", surface_name(j)),
            Guard::Root(RootEnd::Fold) => "its multipliers".into(),
            Guard::Root(RootEnd::Stability) => "its stability".into(),
        };
        format!("({mode}) {what}")
    };
    let words: Vec<String> = failing.iter().take(MOST_NAMED).map(word).collect();
    match (failing.len(), words.join(", ")) {
        (0, _) => String::new(),
        (n, words) if n > MOST_NAMED => {
            format!(
                "; the guard that fails in each mode: {words}, and {} more",
                n - MOST_NAMED
            )
        }
        (_, words) => format!("; the guard that fails in each mode: {words}"),
    }
}

/// Was a warning given about this surface alone: its function is zero along a motion, or the solution is not unique there?
pub(crate) fn is_named(warnings: &[Warning], j: usize) -> bool {
    let is_about = |code| matches!(code, WarningCode::ZeroSurface | WarningCode::NonUnique);
    let mut warnings = warnings.iter();
    warnings.any(|warning| is_about(warning.code) && warning.surfaces == [j])
}
