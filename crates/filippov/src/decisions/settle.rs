//! Surfaces vanish together: the rules in their order, of which the first that applies answers.

use super::event::{touch, touches};
use super::germ::{surfaces_left, Found};
use super::germs::{decide_if_doubtful, decide_if_entangled, stay_at_limit};
use super::groups::Groups;
use super::leave_by_rule::leave_by_rule;
use super::meeting::resolve_first_order;
use super::one_surface::one_surface;
use super::point::{Decided, Left, Lefts, Next, Notes, Point};
use super::reduction::Reduced;
use super::relay::decide_by_relay;
use super::rule::{Decision, How, Meeting, Rule};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::motion::Leading;
use crate::status::Stop;
use crate::switching::Arrival as SurfaceArrival;
use crate::tolerances::DOUBTFUL;

/// A rule: the motion that follows, or why the run ends; `None` where the rule does not apply.
type Apply = fn(&Point, &mut Notes, &Meeting) -> Result<Option<Decided>, FieldError>;

const RULES: [(Rule, Apply); 8] = [
    (Rule::Region, region),
    (Rule::Touch, touch),
    (Rule::Limit, stay_at_limit),
    (Rule::Entangled, decide_if_entangled),
    (Rule::OneSurface, one_surface),
    (Rule::SlidingLaw, leave_by_rule),
    (Rule::Relay, decide_by_relay),
    (Rule::Germs, decide_if_doubtful),
];

/// The answer of the first rule that applies, with its name; first-order data where none of the list does. Surfaces of higher
/// relative degree are crossed before, or replaced by their rates.
pub(super) fn settle(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Decision, FieldError> {
    if at.system.reduced(meeting.surfaces).is_some() && !touches(at, meeting)? {
        if let Some(next) = cross_alone(at, notes, meeting)? {
            return Ok(Decision::by(Rule::OneSurface, Ok(next)));
        }
        if let Some(left) = Reduced::of(at, notes, meeting)? {
            let point = Point {
                system: left.system,
                x: &left.x,
                ..*at
            };
            let Decision { rule, decided, .. } = settle_by_rules(&point, notes, &left.meeting())?;
            return Ok(Decision::by(rule, left.lifted(decided)));
        }
    }
    settle_by_rules(at, notes, meeting)
}

/// The motion after one surface of higher relative degree. The motion crosses it if h has a first derivative of the same sign along the
/// fields of both sides.
fn cross_alone(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Option<Next>, FieldError> {
    let (&[j], How::Event(Some(SurfaceArrival::Region(side)))) = (meeting.surfaces, meeting.how)
    else {
        return Ok(None);
    };
    if at.system.has_nested_signs() {
        // Other functions may jump with the sign that changes.
        return Ok(None);
    }
    let (_, size) = at.rate_of(j, at.arrival.signs, at.arrival.velocity)?;
    let is_clear = |left: &Left| {
        let Leading { order, value } = left.leading;
        left.surface() == Some(j) && order == 1 && value.abs() > DOUBTFUL * size
    };
    let crosses = |next: &Next| next.mode.entries()[j] == -side && next.left.iter().all(is_clear);
    let decided = one_surface(at, notes, meeting)?;
    Ok(decided.and_then(Result::ok).filter(crosses))
}

fn settle_by_rules(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Decision, FieldError> {
    for (rule, apply) in RULES {
        if let Some(decided) = apply(at, notes, meeting)? {
            let is_kinetic = matches!(rule, Rule::SlidingLaw | Rule::Relay);
            let decided = match is_kinetic {
                true => with_kinetic_friction(at, notes, decided, meeting)?,
                false => decided,
            };
            return Ok(Decision::by(rule, decided));
        }
    }
    // A rule of the list does not apply, or was interrupted. Of one or two surfaces none takes long.
    if meeting.surfaces.len() > 2 && at.patience.is_over() {
        return Ok(Decision::by(Rule::FirstOrder, Err(Stop::Interrupted)));
    }
    let groups = Groups::of(at, notes, meeting)?;
    if let Some(groups) = groups.as_ref().filter(|groups| groups.are_doubtful()) {
        if let Some(decided) = by_groups(at, notes, meeting, groups)? {
            return Ok(Decision::by(Rule::Groups, decided));
        }
    }
    let decided = resolve_first_order(at, notes, meeting)?;
    if let (Err(Stop::Intersection { .. }), Some(groups)) = (&decided, &groups) {
        if let Some(decided) = by_groups(at, notes, meeting, groups)? {
            return Ok(Decision::by(Rule::Groups, decided));
        }
    }
    let decided = with_kinetic_friction(at, notes, decided, meeting)?;
    Ok(Decision::by(Rule::FirstOrder, decided))
}

/// Rule: the region that the point is in.
fn region(_: &Point, _: &mut Notes, meeting: &Meeting) -> Result<Option<Decided>, FieldError> {
    let is_region = meeting.surfaces.is_empty();
    Ok(is_region.then(|| Ok(Next::new(meeting.mode.clone(), Lefts::new()))))
}

/// Decides each group of surfaces alone. If the rules do not decide some group, this returns `None` and leaves no warning.
fn by_groups(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
    groups: &Groups,
) -> Result<Option<Decided>, FieldError> {
    let settle_group = |notes: &mut Notes, own: &Meeting| Ok(settle(at, notes, own)?.decided);
    let mut own = notes.of_trial();
    let mut decided = groups.settle(at, &mut own, &settle_group)?;
    notes.add_costs(&own);
    if let Err(Stop::Intersection { .. }) = decided {
        return Ok(None);
    }
    notes.take_findings(own);
    if let Some(next) = decided.as_mut().ok().filter(|next| !next.leaps()) {
        let found = Found {
            multipliers: next.multipliers(),
            ..Found::default()
        };
        next.left = surfaces_left(at, notes, &next.mode, meeting.surfaces, found)?;
    }
    with_kinetic_friction(at, notes, decided, meeting).map(Some)
}

/// The motion from a place where these surfaces matter and vanish. The others have the signs of `mode`.
pub(super) fn place_on(
    at: &Point,
    notes: &mut Notes,
    mode: &Mode,
    surfaces: &[usize],
    memory: Option<&Mode>,
) -> Result<Decision, FieldError> {
    // If one surface has several continuations, prefer the one on the side of the previous mode.
    let entry = match (surfaces, memory) {
        (&[j], Some(memory)) => memory.entries()[j],
        _ => 0,
    };
    let how = How::Start(SurfaceArrival::from_side(entry));
    let meeting = Meeting::new(mode, surfaces, surfaces, how);
    settle(at, notes, &meeting)
}

/// Where a body has broken away, or has not been held, its friction is the kinetic one: what the other surfaces do
/// is decided once more.
fn with_kinetic_friction(
    at: &Point,
    notes: &mut Notes,
    decided: Decided,
    meeting: &Meeting,
) -> Result<Decided, FieldError> {
    let (Ok(next), How::Event(_)) = (&decided, meeting.how) else {
        return Ok(decided);
    };
    let slips = |j: &usize| at.system.sticks_at(*j) && next.mode.entries()[*j] != 0;
    if !meeting.surfaces.iter().any(slips) {
        return Ok(decided);
    }
    let others = meeting.surfaces.iter().copied().filter(|j| !slips(j));
    let others: Vec<usize> = others.collect();
    if others.is_empty() {
        return Ok(decided);
    }
    match place_on(at, notes, &next.mode, &others, Some(&next.mode))?.decided {
        Ok(again) if again.mode != next.mode => {
            let left = surfaces_left(at, notes, &again.mode, meeting.surfaces, Found::default())?;
            Ok(Ok(Next::new(again.mode, left)))
        }
        _ => Ok(decided),
    }
}
