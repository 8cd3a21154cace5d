//! Meetings of surfaces where the field is affine in their signs: one relay problem, whatever their number.

use super::choice::choose;
use super::consistency::agreeing_with_own_signs;
use super::germ::{evaluate, surfaces_left, Found};
use super::germs::decide_undecided;
use super::point::{Decided, Left, Lefts, Next, Notes, Point};
use super::rule::{How, Meeting};
use super::surroundings::Surroundings;
use super::touching::Parallels;
use crate::cube::{solve_relay_within, stay_together, RelayProblem, RelaySolution, Uniqueness};
use crate::error::{FieldError, Undecided};
use crate::mode::Mode;
use crate::motion::SmoothField;
use crate::page::IS_PAGE;
use crate::sparse::SparseRows;
use crate::status::Stop;
use crate::system::{dot, AffineParts};
use crate::tolerances::{AT_SIDE, MOST_IN_LOOP, MOST_MEETING};

/// What follows where the surfaces of `meeting` vanish, if the field is affine in their signs and the relay
/// problem has certainly one solution; for many surfaces that act on one another also if that is not known, with a warning.
/// `None` otherwise.
///
/// Several surfaces may be reached and left at one instant. The problem is posed a moment later along the motion that ends
/// where that matters: at the exit of a multiplier, where rates are zero whose multipliers are at their ends, and where
/// contacts share a load, as surfaces may be parallel at a point only.
pub(super) fn decide_by_relay(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Option<Decided>, FieldError> {
    let (mode, surfaces) = (meeting.mode, meeting.surfaces);
    let is_event = matches!(meeting.how, How::Event(_));
    // From a start on two surfaces the motion may also spiral outwards: their trees know. Between parallel ones it cannot.
    if !is_event && surfaces.len() == 2 && !Parallels::of(at, surfaces, mode)?.are_any() {
        return Ok(None);
    }
    let Some(affine) = at.system.affine_signs() else {
        return Ok(None);
    };
    // A decision that another one asks for has its own.
    let (mut space, mut own) = (at.space.try_borrow_mut(), None);
    let parts = match &mut space {
        Ok(space) => &mut **space,
        Err(_) => own.insert(AffineParts::default()),
    };
    if !affine.refit_affine_parts(surfaces, parts) {
        return Ok(None);
    }
    let mut found = relay_at(at, notes, meeting, parts, false)?;
    let is_open = |posed: &Posed| {
        let found = &posed.solution;
        !found.degenerate.is_empty() || !found.loops.is_empty()
    };
    let is_late = is_event && found.as_ref().is_some_and(is_open);
    if is_late {
        found = relay_at(at, notes, meeting, parts, true)?;
    }
    let Some(Posed {
        solution: mut found,
        may_be_tangent,
    }) = found
    else {
        return Ok(None);
    };
    let is_silent = |around: &Surroundings| around.has_silent(at);
    if may_be_tangent && meeting.surroundings(at, notes)?.is_ok_and(is_silent) {
        return decide_undecided(at, notes, meeting, None).map(Some);
    }
    let n_sharing = found.loops.iter().map(Vec::len).max().unwrap_or(0);
    if n_sharing > MOST_IN_LOOP {
        return Ok(Some(Err(Stop::Intersection {
            surfaces: surfaces.to_vec(),
            failing: Vec::new(),
            reason: Undecided::TooRedundant { n: n_sharing },
        })));
    }
    let is_certain = found.uniqueness != Uniqueness::Unknown;
    let is_few = surfaces.len() <= MOST_MEETING;
    // A multiplier that starts at its end may go beyond it: germs tell. Contacts with a common reserve pass their load on.
    let shares = |i: &usize| found.loops.iter().any(|contacts| contacts.contains(i));
    let is_at_end = |i: usize| found.modes[i] == 0 && 1.0 - found.signs[i].abs() <= AT_SIDE;
    let starts_at_end = (0..surfaces.len()).any(|i| is_at_end(i) && !shares(&i));
    let is_open = !found.degenerate.is_empty() || is_few && starts_at_end;
    let in_small_groups =
        || !IS_PAGE && parts.normal().in_small_blocks(MOST_MEETING).len() == surfaces.len();
    // Other rules list what a few surfaces may do, and what each small group of many may do.
    if !is_certain && (is_few || in_small_groups()) || !is_event && is_open {
        return Ok(None);
    }
    let_go(at, mode, surfaces, &mut found);
    let mut after = meeting.on_all(&Mode::new(found.modes.clone()));
    after = match agreeing_with_own_signs(at, notes, meeting, after)? {
        Ok(mode) => mode,
        Err(stop) => return Ok(Some(Err(stop))),
    };
    if !is_certain {
        match choose(at, notes, surfaces, after.clone(), vec![after.clone()]) {
            Ok(chosen) => after = chosen,
            Err(stop) => return Ok(Some(Err(stop))),
        }
    }
    let signs = found.signs.iter().zip(&found.modes);
    let sliding = signs.filter(|(_, &mode)| mode == 0);
    let multipliers: Vec<f64> = sliding.map(|(&sign, _)| sign).collect();
    // Where other signs have changed with it, the fields are others.
    let is_as_posed = after == meeting.on_all(&Mode::new(found.modes.clone()));
    if is_late && is_as_posed {
        evaluate(at, notes, parts, &mode.signs())?;
    }
    let found = Found {
        multipliers: &multipliers,
        parts: is_as_posed.then_some(parts),
    };
    let left = surfaces_left_or_caught(at, notes, &mut after, surfaces, found)?;
    Ok(Some(Ok(Next::new(after, left))))
}

/// What the motion in `after` leaves; surfaces that it would pass to the wrong side are slid on instead.
fn surfaces_left_or_caught(
    at: &Point,
    notes: &mut Notes,
    after: &mut Mode,
    meeting: &[usize],
    found: Found<'_>,
) -> Result<Lefts, FieldError> {
    let mut left = surfaces_left(at, notes, after, meeting, found)?;
    for _ in meeting {
        let is_wrong = |left: &&Left| {
            let entry = left.surface().map_or(0, |j| after.entries()[j]);
            left.leading.value * f64::from(entry) <= 0.0
        };
        let wrong = left.iter().filter(is_wrong);
        let wrong: Vec<usize> = wrong.filter_map(Left::surface).collect();
        if wrong.is_empty() {
            break;
        }
        wrong.iter().for_each(|&j| after.set(j, 0));
        left = surfaces_left(at, notes, after, meeting, Found::default())?;
    }
    Ok(left)
}

/// Multipliers at their ends with rates that vanish: loads passed on from a contact that begins to slip. Those
/// that slid until now and are at the same end let go too; if the load does not grow they are caught at
/// once. All others stay as they are.
fn let_go(at: &Point, mode: &Mode, meeting: &[usize], found: &mut RelaySolution) {
    let multipliers = at.arrival.multipliers();
    for &k in &found.degenerate {
        let (j, end) = (meeting[k], found.signs[k]);
        let position = at.arrival.sliding.binary_search(&j);
        let lambda = position.ok().and_then(|place| multipliers.get(place));
        let is_at_end = lambda.is_some_and(|lambda| (lambda - end).abs() <= AT_SIDE);
        found.modes[k] = match mode.entries()[j] {
            0 if is_at_end => end.signum() as i8,
            other => other,
        };
    }
}

/// A relay problem that was solved.
struct Posed {
    solution: RelaySolution,
    /// All fields around may be tangent to a surface: they cross it at a small part of their speed.
    may_be_tangent: bool,
}

/// The relay problem of a meeting at the point, or a moment later along the motion that ends. `None` if the field is not
/// affine in the signs, or if no solution was found. `parts` are evaluated there.
fn relay_at(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
    parts: &mut AffineParts,
    is_late: bool,
) -> Result<Option<Posed>, FieldError> {
    let (mut t, mut x, signs) = (at.t, at.x.to_vec(), meeting.mode.signs());
    if is_late {
        let mut velocity = vec![0.0; x.len()];
        let mut field = at.arrival.field.borrow_mut();
        field.eval(t, &mut x, &mut velocity)?;
        let dt = at.moment(notes, &signs, &velocity)?;
        (t, x) = (t + dt, at.moved(t, &x).along(&velocity, dt));
    }
    evaluate(&at.moved(t, &x), notes, parts, &signs)?;
    let entries = meeting.mode.entries();
    let before: Vec<i8> = meeting.surfaces.iter().map(|&j| entries[j]).collect();
    let (gradients, noise) = (&parts.gradients, at.system.lie_tolerance(1));
    let nu = parts.nu();
    let problem = RelayProblem {
        nu: &nu,
        n: parts.normal(),
        noise,
    };
    let known = &mut at.known.borrow_mut();
    let Ok(mut solution) = solve_relay_within(&problem, &before, at.patience, known) else {
        return Ok(None);
    };
    if !stay_together(problem.n, gradients, &solution.loops) {
        solution.uniqueness = Uniqueness::Unknown;
    }
    let speed = 1.0 + dot(&parts.field, &parts.field).sqrt();
    let sum = |rows: &SparseRows, i: usize| rows.row(i).map(|(_, v)| v.abs()).sum::<f64>();
    let may_be_tangent = (0..before.len()).any(|i| {
        let size = problem.nu[i].abs() + sum(problem.n, i);
        size <= AT_SIDE * (parts.time_rates[i].abs() + sum(gradients, i)) * speed
    });
    Ok(Some(Posed {
        solution,
        may_be_tangent,
    }))
}
