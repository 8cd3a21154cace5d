//! Decisions as data: kept during a run on request, and asked for anew later.

use std::cell::RefCell;

use smallvec::SmallVec;

use crate::decisions::{
    decide, Arrival, Cause, Decision, Left, Next, Notes, Point, Policy, Reached,
};
use crate::error::FieldError;
use crate::error_scale::ErrorScale;
use crate::mode::Mode;
use crate::motion::{ActiveSurfaces, ContactField, Guard, Law, ModeField, SlidingSet, SmoothField};
use crate::options::Options;
use crate::patience::Patience;
use crate::system::Actions;
use crate::system::PiecewiseSystem;

/// Why a decision was asked for.
#[derive(Clone, Debug, PartialEq)]
pub enum DecisionCause {
    /// The run started.
    Start,
    /// The state had jumped, or an event was none: this mode came before.
    Anew(Mode),
    /// Functions of the motion vanished.
    Event {
        /// Which.
        functions: Vec<Guard>,
        /// They came to zero without a change of sign.
        touch: bool,
        /// How many derivatives along f- and f+ vanished at a multiple zero.
        vanishing: [usize; 2],
        /// Sliding on one surface had reached a two-fold.
        at_two_fold: bool,
    },
    /// Infinitely many switches on these surfaces ended.
    Limit(Vec<usize>),
}

/// What a decision was asked about: the place and the motion that ended there. The problem and the policy are those of the
/// run.
#[derive(Clone, Debug, PartialEq)]
pub struct DecisionPoint {
    /// Time.
    pub t: f64,
    /// State.
    pub x: Vec<f64>,
    /// Discrete states.
    pub q: Vec<f64>,
    /// Why a decision was asked for.
    pub cause: DecisionCause,
    /// The mode before.
    pub mode: Mode,
    /// The multipliers of the surfaces that the motion slid on.
    pub multipliers: Vec<f64>,
    /// The regularised motion oscillated around them.
    pub oscillates: bool,
    /// The velocity of the motion a little before.
    pub velocity: Vec<f64>,
    /// The side of every surface on which the motion was; where its entry is 0, that on which it was last.
    pub sides: Vec<i8>,
    /// The surfaces whose functions were zero all along the motion.
    pub resting: Vec<usize>,
    /// The surfaces that the motion was still leaving tangentially.
    pub departing: Vec<usize>,
    /// How far the point lay off each surface by rounding; empty: not at all.
    pub residuals: Vec<f64>,
    /// Triggers that the motion crosses.
    pub passing: Vec<usize>,
    /// How many non-unique points the run had met before.
    pub n_choices: usize,
}

/// A function that vanishes at the start of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StartingZero {
    /// The function.
    pub guard: Guard,
    /// The order of its first derivative that does not vanish.
    pub order: usize,
    /// The sign of that derivative.
    pub sign: i8,
}

/// What was decided.
#[derive(Clone, Debug, PartialEq)]
pub struct DecisionOutcome {
    /// The mode that follows; `None` if the run ends.
    pub mode: Option<Mode>,
    /// Why the run ends ([`crate::Stop::name`]); empty if it goes on.
    pub stop: &'static str,
    /// The rule that decided.
    pub rule: &'static str,
    /// At an intersection, the leaf of that rule, if it has several; otherwise empty.
    pub leaf: &'static str,
    /// At a non-unique point, all modes among which one was chosen.
    pub candidates: Vec<Mode>,
    /// The multipliers at the start of the motion, if the decision found them.
    pub multipliers: Vec<f64>,
    /// The motion starts with the laps of an outward spiral.
    pub spirals: bool,
    /// What vanishes at its start.
    pub zeros: Vec<StartingZero>,
}

/// A decision of a run ([`Options::keep_decisions`]); [`replay_decision`] asks for it once more.
#[derive(Clone, Debug, PartialEq)]
pub struct DecisionRecord {
    /// What it was asked about.
    pub point: DecisionPoint,
    /// What it was.
    pub outcome: DecisionOutcome,
}

/// Decides, and keeps what was asked and decided.
pub(crate) fn decide_and_record(
    at: &Point,
    notes: &mut Notes,
    reached: &mut Reached,
) -> Result<(Decision, DecisionRecord), FieldError> {
    // Before the decision: it evaluates the field of the motion elsewhere.
    let point = DecisionPoint::of(at, notes.n_choices);
    let decision = decide(at, notes, reached)?;
    let outcome = DecisionOutcome::of(&decision, notes);
    Ok((decision, DecisionRecord { point, outcome }))
}

/// Repeats the decision at a recorded point of a run with these actions and options.
///
/// The field of the motion before starts from the recorded multipliers. What it remembered beside them (earlier multipliers,
/// how far they may go beyond their ends) is not recorded: where a decision depends on that, it may differ.
///
/// # Errors
/// If a function of the user raises.
pub fn replay_decision(
    system: &dyn PiecewiseSystem,
    actions: &Actions,
    options: &Options,
    point: &DecisionPoint,
) -> Result<DecisionOutcome, FieldError> {
    let (t, mode, law) = (point.t, &point.mode, Law::from(options));
    let (signs, sliding): (_, SlidingSet) = (mode.signs(), mode.sliding_set().collect());
    let active = ActiveSurfaces::new(system, &signs, &sliding);
    let contact = if actions.list.is_empty() || sliding.is_empty() {
        None
    } else {
        ContactField::new(system, actions, mode, &point.sides, &point.q)
    };
    let mut field = match contact {
        Some(contact) => ModeField::Contact(Box::new(contact)),
        None => ModeField::of(system, law, mode, &point.q),
    };
    if let ModeField::Intersection(field) = &mut field {
        field.begin(&point.multipliers, point.oscillates);
    }
    field.eval(t, &mut point.x.clone(), &mut vec![0.0; point.x.len()])?;
    let arrival = Arrival {
        cause: point.cause.as_asked(),
        mode,
        signs: &signs,
        sliding: &sliding,
        sides: &point.sides,
        active: &active,
        resting: &point.resting,
        departing: SmallVec::from_slice(&point.departing),
        switches: &[],
        residuals: &point.residuals,
        passing: &point.passing,
        velocity: &point.velocity,
        field: RefCell::new(&mut field),
    };
    let at = Point {
        system,
        actions,
        scale: &ErrorScale::new(options.rtol, &options.atol, point.x.len()),
        t,
        x: &point.x,
        q: &point.q,
        arrival: &arrival,
        policy: Policy::from(options),
        known: &RefCell::default(),
        space: &RefCell::default(),
        patience: Patience::endless(),
    };
    let mut notes = Notes {
        n_choices: point.n_choices,
        ..Notes::default()
    };
    let decision = decide(&at, &mut notes, &mut Reached::default())?;
    Ok(DecisionOutcome::of(&decision, &notes))
}

impl DecisionCause {
    fn of(cause: Cause) -> Self {
        match cause {
            Cause::Start => DecisionCause::Start,
            Cause::Anew(mode) => DecisionCause::Anew(mode.clone()),
            Cause::Event {
                functions,
                touch,
                vanishing,
                at_two_fold,
            } => DecisionCause::Event {
                functions: functions.to_vec(),
                touch,
                vanishing,
                at_two_fold,
            },
            Cause::Limit(surfaces) => DecisionCause::Limit(surfaces.to_vec()),
        }
    }

    fn as_asked(&self) -> Cause<'_> {
        match self {
            DecisionCause::Start => Cause::Start,
            DecisionCause::Anew(mode) => Cause::Anew(mode),
            &DecisionCause::Event {
                ref functions,
                touch,
                vanishing,
                at_two_fold,
            } => Cause::Event {
                functions,
                touch,
                vanishing,
                at_two_fold,
            },
            DecisionCause::Limit(surfaces) => Cause::Limit(surfaces),
        }
    }
}

impl DecisionPoint {
    fn of(at: &Point, n_choices: usize) -> Self {
        let arrival = at.arrival;
        let (multipliers, oscillates) = match &**arrival.field.borrow() {
            ModeField::Intersection(field) => (field.tracked(at.t).to_vec(), field.oscillates()),
            other => (other.multipliers().to_vec(), false),
        };
        DecisionPoint {
            t: at.t,
            x: at.x.to_vec(),
            q: at.q.to_vec(),
            cause: DecisionCause::of(arrival.cause),
            mode: arrival.mode.clone(),
            multipliers,
            oscillates,
            velocity: arrival.velocity.to_vec(),
            sides: arrival.sides.to_vec(),
            resting: arrival.resting.to_vec(),
            departing: arrival.departing.to_vec(),
            residuals: arrival.residuals.to_vec(),
            passing: arrival.passing.to_vec(),
            n_choices,
        }
    }
}

impl DecisionOutcome {
    fn of(decision: &Decision, notes: &Notes) -> Self {
        let (next, stop) = match &decision.decided {
            Ok(next) => (Some(next), ""),
            Err(stop) => (None, stop.name()),
        };
        let multipliers = next.map_or_else(Vec::new, |next| next.multipliers().to_vec());
        DecisionOutcome {
            mode: next.map(|next| next.mode.clone()),
            stop,
            rule: decision.rule.name(),
            leaf: notes.leaf,
            candidates: notes.candidates.clone(),
            multipliers,
            spirals: next.is_some_and(Next::leaps),
            zeros: next.map_or_else(Vec::new, |next| {
                next.left.iter().map(|&left| left.into()).collect()
            }),
        }
    }
}

impl From<Left> for StartingZero {
    fn from(left: Left) -> Self {
        let Left { guard, leading } = left;
        StartingZero {
            guard,
            order: leading.order,
            sign: leading.sign(),
        }
    }
}
