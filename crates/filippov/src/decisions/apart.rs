//! Decide intersecting surfaces one by one if first-order data are doubtful.
//!
//! If a normal component vanishes, as it does when an integrator leaves its limit, rounding hides what the fields around the
//! point decide. Higher derivatives of one surface may decide. If the signs of the other surfaces do not change those
//! derivatives, the other surfaces need not be known.

use super::leave_by_rule::slides_by_rule;
use super::point::{Decided, Left, Lefts, Next, Notes, Point};
use super::rule::Meeting;
use crate::error::FieldError;
use crate::mode::Mode;
use crate::switching::{decide, Arrival as SurfaceArrival, Decision, Leading, NormalFields};
use crate::system::dot_magnitude;
use crate::tolerances::{DOUBTFUL, MOST_MEETING, PATTERNS_PER_LOOK, TANGENT};

/// What follows where the surfaces of `meeting` vanish, if first-order data are doubtful and each surface is decided
/// whatever the signs of those that are not; `None` if not. One that is left has its sign for those decided later.
pub(super) fn decide_apart(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Option<Decided>, FieldError> {
    let (mode, meeting) = (meeting.mode, meeting.surfaces);
    let is_few = (2..=MOST_MEETING).contains(&meeting.len());
    let sticks = meeting.iter().any(|&j| at.system.sticks_at(j));
    if !is_few || sticks || slides_by_rule(at.arrival) {
        return Ok(None);
    }
    let corners = at.corners(notes, meeting, mode)?;
    let Ok(fields) = corners.normal_fields() else {
        return Ok(None);
    };
    if !is_doubtful(at, &fields, mode, meeting)? {
        return Ok(None);
    }
    let (mut after, mut open, mut slid) = (mode.clone(), Vec::new(), Vec::new());
    for (i, &j) in meeting.iter().enumerate() {
        // Such a surface is slid on, whatever the others do: the usual case, and cheaper so.
        let is_rounding = is_rounding(at, j, fields.row_size(i), mode)?;
        if clearly_attracts(&fields, i) && !is_rounding {
            after.set(j, 0);
            slid.push(j);
        } else {
            open.push(j);
        }
    }
    let doubtful = open.clone();
    while !open.is_empty() {
        let free = [&open[..], &slid[..]].concat();
        let mut settled = None;
        for (place, &j) in open.iter().enumerate() {
            if let Some(decision) = decide_alone(at, j, mode, &after, &free)? {
                settled = Some((place, decision.entry));
                break;
            }
        }
        let Some((place, entry)) = settled else {
            return Ok(None);
        };
        let j = open.remove(place);
        after.set(j, entry);
        if entry == 0 {
            slid.push(j);
        }
    }
    let mut left = Lefts::new();
    let slides_alone = slid.len() == 1;
    for &j in if slides_alone { meeting } else { &doubtful[..] } {
        // Once more, as the signs of others are known by now.
        let Some(decision) = decide_alone(at, j, mode, &after, &slid)? else {
            return Ok(None);
        };
        let of_one = Left::after(j, &decision).into_iter();
        // The exit functions of sliding on several surfaces are others.
        left.extend(of_one.filter(|l| slides_alone || matches!(l, Left::Surface(..))));
    }
    Ok(Some(Ok(Next::new(after, left))))
}

/// The only way on at surface `j`, if it is the same for all signs of the others among `free`; those not among them
/// have the signs of `after`. `mode` is the one before.
fn decide_alone(
    at: &Point,
    j: usize,
    mode: &Mode,
    after: &Mode,
    free: &[usize],
) -> Result<Option<Decision>, FieldError> {
    let others: Vec<usize> = free.iter().copied().filter(|&k| k != j).collect();
    let arrival = SurfaceArrival::from_side(mode.entries()[j]);
    let mut found: Option<Decision> = None;
    for pattern in 0..1_usize << others.len() {
        if (pattern + 1).is_multiple_of(PATTERNS_PER_LOOK) && at.patience.is_over() {
            return Ok(None);
        }
        let signs = after.on_sides(&others, pattern).signs();
        let decision = decide(at.system, j, arrival, at.t, at.x, &signs)?;
        let is_clear = decision.candidates.len() == 1
            && !decision.turns_back()
            && decision.starts_at_two_fold().is_none();
        if !is_clear || found.as_ref().is_some_and(|found| !agree(found, &decision)) {
            return Ok(None);
        }
        found = Some(decision);
    }
    Ok(found)
}

/// Does a normal component vanish at some surface, or are all of one no more than what the rounding of time and state
/// makes of zero?
fn is_doubtful(
    at: &Point,
    fields: &NormalFields,
    mode: &Mode,
    meeting: &[usize],
) -> Result<bool, FieldError> {
    for (i, &j) in meeting.iter().enumerate() {
        let [least, most] = fields.row_range(i);
        let largest = fields.row_size(i);
        let vanishes = |v: f64| v.abs() <= DOUBTFUL * largest;
        if vanishes(least) || vanishes(most) || is_rounding(at, j, largest, mode)? {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Is a rate of h_j of this size no more than rounding of time and state makes of zero?
pub(super) fn is_rounding(
    at: &Point,
    j: usize,
    rate: f64,
    mode: &Mode,
) -> Result<bool, FieldError> {
    let (mut gradient, signs) = (vec![0.0; at.x.len()], mode.signs());
    let partials = at
        .system
        .rate_gradient(j, at.t, at.x, &signs, &mut gradient)?;
    let size = dot_magnitude(&gradient, at.x) + (partials.time * at.t).abs();
    Ok(rate <= TANGENT * size)
}

/// Do the fields of either side of surface `i`, counted within the set, push to it, all of one side alike and none of them
/// within rounding?
fn clearly_attracts(fields: &NormalFields, i: usize) -> bool {
    let rounding = DOUBTFUL * fields.row_size(i);
    let [minus, plus] = [-1, 1].map(|side| fields.side_range(i, side));
    let is_alike = |[least, most]: [f64; 2]| most - least <= rounding;
    minus[0] > rounding && plus[1] < -rounding && is_alike(minus) && is_alike(plus)
}

/// Do two decisions say the same, up to rounding?
fn agree(one: &Decision, other: &Decision) -> bool {
    let same = |a: Leading, b: Leading| {
        a.order == b.order && (a.value - b.value).abs() <= DOUBTFUL * a.value.abs()
    };
    one.entry == other.entry && same(one.minus, other.minus) && same(one.plus, other.plus)
}
