//! The one way from a point to the motion that follows: [`decide`], and the rules where surfaces vanish, in their order.

use super::apart::decide_apart;
use super::coinciding::{decide_without_kinks, leave_coinciding};
use super::contact::{cross_beside_triggers, decide_in_contact};
use super::event::{arrival_at_surface, touch, vanishing_surfaces};
use super::leave_by_rule::leave_by_rule;
use super::limits::stay_at_limit;
use super::look_ahead::decide_where_two_touch;
use super::meeting::{decide_with_kinetic_friction, resolve_first_order, too_many};
use super::nested::{
    decide_where_others_jump, leave_along_bends, leave_at_bends, reject_if_not_attracting,
};
use super::placement::{one_surface, place};
use super::point::{Cause, Decided, Lefts, Next, Notes, Point};
use super::relay::decide_by_relay;
use super::vanishing_jump::decide_where_jump_vanishes;
use smallvec::SmallVec;

use crate::error::FieldError;
use crate::field::ModeField;
use crate::mode::Mode;
use crate::switching::Arrival as SurfaceArrival;

/// The rule that made a decision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rule {
    /// No surface that matters vanishes.
    Region,
    /// The motion touches a surface.
    Touch,
    /// Other switching functions jump where surfaces are reached.
    OthersJump,
    /// The first derivatives that do not vanish on both sides of one surface.
    OneSurface,
    /// Surfaces bend at one another; one motion leads away from all.
    Bends,
    /// Surfaces in one place: one decides.
    Coinciding,
    /// Switches accumulate, and the motion stays on all surfaces.
    Limit,
    /// Surfaces that are decided one by one.
    Apart,
    /// Two surfaces that touch one another: the modes are tried for a moment.
    Trial,
    /// The rule of sliding that the caller chose ends.
    SlidingRule,
    /// The jump of the field across one surface vanishes while the motion slides on several.
    VanishingJump,
    /// The relay problem of a field that is affine in the signs.
    Relay,
    /// The signs of too many surfaces multiply one another.
    TooMany,
    /// First-order data at an intersection: trees, hidden dynamics, spirals; higher derivatives where those vanish.
    FirstOrder,
    /// Bodies in contact: the forces that push.
    Contact,
    /// Triggers of actions are crossed together with other surfaces.
    Triggers,
}

impl Rule {
    /// A stable name.
    pub fn name(self) -> &'static str {
        match self {
            Rule::Region => "region",
            Rule::Touch => "touch",
            Rule::OthersJump => "others_jump",
            Rule::OneSurface => "one_surface",
            Rule::Bends => "bends",
            Rule::Coinciding => "coinciding",
            Rule::Limit => "limit",
            Rule::Apart => "apart",
            Rule::Trial => "trial",
            Rule::SlidingRule => "sliding_rule",
            Rule::VanishingJump => "vanishing_jump",
            Rule::Relay => "relay",
            Rule::TooMany => "too_many",
            Rule::FirstOrder => "first_order",
            Rule::Contact => "contact",
            Rule::Triggers => "triggers",
        }
    }
}

/// What a rule is asked about: surfaces that vanish together.
#[derive(Clone, Copy)]
pub(crate) struct Meeting<'m> {
    /// The mode before, or at a start the sides of the point.
    pub mode: &'m Mode,
    /// All surfaces that vanish, in increasing order.
    pub surfaces: &'m [usize],
    /// Those among them that were reached now.
    pub fresh: &'m [usize],
    pub how: How,
}

/// How the motion comes to the surfaces of a meeting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum How {
    /// The motion starts there, or on one surface as it says.
    Start(SurfaceArrival),
    /// It arrives; in this way, if one surface alone decides.
    Event(Option<SurfaceArrival>),
    /// Infinitely many switches end there.
    Limit,
}

impl How {
    /// A start on surface `j` where a motion in this mode came from.
    pub fn on_one_surface(mode: &Mode, j: usize) -> Self {
        How::Start(SurfaceArrival::from_side(mode.entries()[j]))
    }
}

impl Meeting<'_> {
    /// The full mode with these entries on the surfaces.
    pub fn on_all(&self, entries: &Mode) -> Mode {
        let mut full = self.mode.clone();
        for (&j, &entry) in self.surfaces.iter().zip(entries.entries()) {
            full.set(j, entry);
        }
        full
    }

    /// Does sliding on all surfaces end here, and none is reached?
    pub fn is_exit(&self) -> bool {
        matches!(self.how, How::Event(_)) && self.fresh.is_empty()
    }
}

/// A rule: the motion that follows, or why the run ends; `None` where the rule does not apply.
type Apply = fn(&Point, &mut Notes, &Meeting) -> Result<Option<Decided>, FieldError>;

/// The rules where surfaces vanish: the first that applies decides. Where none does, first-order data do
/// ([`Rule::FirstOrder`]).
const RULES: [(Rule, Apply); 14] = [
    (Rule::Region, region),
    (Rule::Touch, touch),
    (Rule::OthersJump, decide_where_others_jump),
    (Rule::OneSurface, one_surface),
    (Rule::Bends, leave_at_bends),
    (Rule::Bends, leave_along_bends),
    (Rule::Coinciding, decide_without_kinks),
    (Rule::Limit, stay_at_limit),
    (Rule::Apart, decide_apart),
    (Rule::Trial, decide_where_two_touch),
    (Rule::SlidingRule, leave_by_rule),
    (Rule::VanishingJump, decide_where_jump_vanishes),
    (Rule::Relay, decide_by_relay),
    (Rule::TooMany, too_many),
];

/// The whole result of a decision.
pub(crate) struct Decision {
    pub decided: Decided,
    pub rule: Rule,
    /// After an event, the surfaces that vanish there, those slid on left out.
    pub surfaces: SmallVec<[usize; 4]>,
    /// The mode before; after an event surfaces that do not matter have the signs of the place.
    pub before: Mode,
}

/// Decides which motion follows at a point.
pub(crate) fn decide(at: &Point, notes: &mut Notes) -> Result<Decision, FieldError> {
    let (mut surfaces, mut before) = (SmallVec::new(), None);
    let (rule, decided) = match at.arrival.cause {
        Cause::Start => place(at, notes, None)?,
        Cause::Anew(memory) => place(at, notes, Some(memory))?,
        Cause::Limit(meeting) => {
            let meeting = Meeting {
                mode: at.arrival.mode,
                surfaces: meeting,
                fresh: meeting,
                how: How::Limit,
            };
            settle(at, notes, &meeting)?
        }
        Cause::Event { .. } => {
            let (found, mode) = vanishing_surfaces(at, notes)?;
            let decided = after_event(at, notes, &found, &mode)?;
            (surfaces, before) = (found, Some(mode));
            decided
        }
    };
    for warning in &mut notes.warnings {
        warning.rule = rule.name();
    }
    Ok(Decision {
        decided,
        rule,
        surfaces,
        before: before.unwrap_or_else(|| at.arrival.mode.clone()),
    })
}

/// The motion after an event at which `surfaces` vanish beside those slid on.
fn after_event(
    at: &Point,
    notes: &mut Notes,
    fresh: &[usize],
    mode: &Mode,
) -> Result<(Rule, Decided), FieldError> {
    if matches!(&**at.arrival.field.borrow(), ModeField::Contact(_)) {
        return Ok((Rule::Contact, decide_in_contact(at, notes, fresh)?));
    }
    if fresh.len() > 1 && fresh.iter().any(|&j| at.triggers().is_only_trigger(j)) {
        return Ok((Rule::Triggers, cross_beside_triggers(at, notes, fresh)?));
    }
    let mut both = SmallVec::<[usize; 4]>::new();
    let surfaces = match (fresh, at.arrival.sliding) {
        (fresh, []) => fresh,
        ([], sliding) => sliding,
        (fresh, sliding) => {
            both.extend_from_slice(fresh);
            both.extend_from_slice(sliding);
            both.sort_unstable();
            both.dedup();
            &both
        }
    };
    let how = How::Event(arrival_at_surface(at.arrival, fresh));
    let meeting = Meeting {
        mode,
        surfaces,
        fresh,
        how,
    };
    let (rule, decided) = settle(at, notes, &meeting)?;
    let decided = match decided {
        Ok(next) if rule != Rule::Touch => Ok(leave_coinciding(at, notes, next)?),
        decided => decided,
    };
    Ok((rule, decided))
}

/// The answer of the first rule that applies, with its name.
pub(super) fn settle(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<(Rule, Decided), FieldError> {
    for (rule, apply) in RULES {
        if let Some(decided) = apply(at, notes, meeting)? {
            return match meeting.surfaces {
                [] | [_] => Ok((rule, decided)),
                _ => check(at, notes, meeting, rule, decided),
            };
        }
    }
    let decided = resolve_first_order(at, notes, meeting)?;
    check(at, notes, meeting, Rule::FirstOrder, decided)
}

/// What holds for the answers of several rules: friction that has become kinetic is decided once more, and sliding on one
/// surface needs fields that point to it.
fn check(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
    rule: Rule,
    mut decided: Decided,
) -> Result<(Rule, Decided), FieldError> {
    use Rule::{
        Apart, Coinciding, FirstOrder, Limit, Relay, SlidingRule, TooMany, Trial, VanishingJump,
    };
    let is_event = matches!(meeting.how, How::Event(_));
    if is_event
        && matches!(
            rule,
            SlidingRule | VanishingJump | Relay | TooMany | FirstOrder
        )
    {
        decided = decide_with_kinetic_friction(at, notes, decided, meeting)?;
    }
    let is_intersection = matches!(
        rule,
        Apart
            | Coinciding
            | FirstOrder
            | Limit
            | Relay
            | SlidingRule
            | TooMany
            | Trial
            | VanishingJump
    );
    if is_intersection {
        decided = reject_if_not_attracting(at, decided, meeting.surfaces)?;
    }
    Ok((rule, decided))
}

/// Rule: the region that the point is in.
fn region(_: &Point, _: &mut Notes, meeting: &Meeting) -> Result<Option<Decided>, FieldError> {
    let is_region = meeting.surfaces.is_empty();
    Ok(is_region.then(|| Ok(Next::new(meeting.mode.clone(), Lefts::new()))))
}
