//! Where a motion starts: the mode at a given point, at the start of a run and after actions.

use super::contact::{add_reached_at_rest, place_in_contact};
use super::point::{Decided, Left, Notes, Point};
use super::rule::{Decision, Rule};
use super::settle::place_on;

use crate::error::FieldError;
use crate::mode::{Mode, Signs};
use crate::motion::{first_nonzero, Leading};
use crate::motion::{ContactField, SmoothField};
use crate::status::Stop;
use crate::system::{dot, surfaces_that_matter};
use crate::tolerances::{AT_SIDE, ERRORS_OF_STEPS, FRICTION_IN_MAP, MOMENT, ROUNDING, SLOW};
use smallvec::SmallVec;

/// The sides that a point is on.
pub(crate) struct Sides {
    /// No entry is 0.
    pub mode: Mode,
    /// Which surfaces the point lies on, to rounding.
    pub on_surface: Vec<bool>,
}

/// Decides which motion starts at the current point, without the functions of an event: for example at the start of a run,
/// or after an action. If the point lies on a surface, `memory` (usually the previous mode) gives its side there.
pub(crate) fn place(
    at: &Point,
    notes: &mut Notes,
    memory: Option<&Mode>,
) -> Result<Decision, FieldError> {
    let Some(Sides { mode, on_surface }) = sides(at, notes, memory)? else {
        return Ok(Decision::by(Rule::Region, Err(Stop::NotFinite)));
    };
    // What only a law of the system sees has the side that is known: its action has been done, or will be.
    let zeros = (0..on_surface.len()).filter(|&j| on_surface[j]);
    let (internal, zeros): (Vec<usize>, Vec<usize>) =
        zeros.partition(|&j| at.triggers().is_internal(j));
    let (smooth, zeros): (Vec<usize>, Vec<usize>) = zeros
        .into_iter()
        .partition(|&j| at.triggers().is_only_trigger(j));
    let switching = zeros.iter().copied().filter(|&j| at.system.switches_at(j));
    let meeting = surfaces_that_matter(at.system, &mode, switching.collect());
    if !smooth.is_empty() {
        let placed = place_on_triggers(at, notes, mode, &smooth, meeting, memory)?;
        return leave_internal(at, placed, &internal);
    }
    let Decision { rule, decided } = place_on(at, notes, &mode, &meeting, memory)?;
    let is_new = |j: &usize| memory.is_none_or(|memory| memory.entries()[*j] == 0);
    let inactive = zeros.into_iter().filter(|j| !meeting.contains(j));
    let decided = take_sides(at, decided, inactive.filter(is_new))?;
    leave_internal(at, Decision::by(rule, decided), &internal)
}

/// Adds the surfaces of laws that the motion leaves at a multiple zero, as it does where a table begins to be read at rest on one
/// of its knots.
fn leave_internal(
    at: &Point,
    mut decision: Decision,
    internal: &[usize],
) -> Result<Decision, FieldError> {
    if let Ok(next) = &mut decision.decided {
        for &j in internal {
            let (side, signs) = (next.mode.entries()[j], next.mode.signs());
            let leading = first_nonzero(at.system, j, side, 0, &at.place(&signs))?;
            if leading.order > 1 && leading.sign() == side {
                next.left.push(Left::beside(j, leading));
            }
        }
    }
    Ok(decision)
}

/// Gives surfaces that do not matter the sides that a motion in a region moves to.
fn take_sides(
    at: &Point,
    decided: Decided,
    inactive: impl Iterator<Item = usize>,
) -> Result<Decided, FieldError> {
    let mut next = match decided {
        Ok(next) => next,
        Err(stop) => return Ok(Err(stop)),
    };
    if next.mode.codimension() == 0 {
        let signs = next.mode.signs();
        for j in inactive {
            let side = next.mode.entries()[j];
            let leading = first_nonzero(at.system, j, side, 0, &at.place(&signs))?;
            if leading.order > 0 {
                next.mode.set(j, leading.sign());
            }
        }
    }
    Ok(Ok(next))
}

/// Finds the side of every surface at the current point. A surface that the point lies on keeps the side that it has in `memory`;
/// without one, rounding decides. Returns `None` if a switching function is NaN and its sign matters.
pub(crate) fn sides(
    at: &Point,
    notes: &mut Notes,
    memory: Option<&Mode>,
) -> Result<Option<Sides>, FieldError> {
    let d = at.system.n_surfaces();
    let mut mode = Mode::new(vec![1; d]);
    // Switching functions may contain signs of others: repeat until nothing changes.
    let mut on_surface = vec![false; d];
    let mut undefined: Vec<usize> = Vec::new();
    for _ in 0..=d {
        let before = mode.clone();
        let signs = mode.signs();
        let h = at.surface_values(notes, &signs)?;
        undefined.clear();
        for j in 0..d {
            // Beyond a surface inside of it a function need not exist.
            if h[j].is_nan() {
                undefined.push(j);
                continue;
            }
            let size = at.system.surface_size(j, &at.place(&signs))?;
            let residual = at.arrival.residuals.get(j).copied().unwrap_or(0.0);
            let noise = (ROUNDING * size).max(2.0 * residual);
            on_surface[j] = h[j].abs() <= noise;
            let known = memory.map_or(0, |memory| memory.entries()[j]);
            if let Some(side) = slipped_through(at, j, h[j], &signs, memory)? {
                on_surface[j] = true;
                mode.set(j, side);
                continue;
            }
            let entry = match known {
                side if on_surface[j] && side != 0 => side,
                _ if h[j] < 0.0 => -1,
                _ => 1,
            };
            mode.set(j, entry);
        }
        if mode == before {
            break;
        }
    }
    if !undefined.is_empty() {
        let mut active = vec![false; d];
        at.system.active(&mode.signs(), &[], &mut active);
        if undefined.iter().any(|&j| active[j]) {
            return Ok(None);
        }
    }
    Ok(Some(Sides { mode, on_surface }))
}

/// The free side of a trigger that the motion came from and that the point lies beyond by less than the
/// tolerance: errors of jumps to a limit, and of impacts at nearly the same time. It counts as there.
fn slipped_through(
    at: &Point,
    j: usize,
    h: f64,
    signs: &[f64],
    memory: Option<&Mode>,
) -> Result<Option<i8>, FieldError> {
    let is_solid = at.triggers().is_only_trigger(j) && !at.triggers().is_internal(j);
    let Some(memory) = memory.filter(|_| is_solid) else {
        return Ok(None);
    };
    let side = at.triggers().side(j, Some(memory));
    let came_from = memory.entries()[j] == side || memory.entries()[j] == 0;
    if !came_from || h * f64::from(side) >= 0.0 {
        return Ok(None);
    }
    let tolerance = at.system.tolerance(j, &at.place(signs), at.scale)?;
    let is_near = h.abs() <= ERRORS_OF_STEPS * tolerance;
    Ok((is_near && leaves_point_alone(at, j, signs)?).then_some(side))
}

/// Do the actions at surface `j` leave h_j as it is, as an impact does? It does not move bodies, but their velocities.
pub(super) fn leaves_point_alone(at: &Point, j: usize, signs: &[f64]) -> Result<bool, FieldError> {
    if at.actions.at_surface(j).is_none() {
        return Ok(false);
    }
    let mut moved = at.x.to_vec();
    act_from_side(at, j, signs, &mut moved)?;
    let mut h = [(); 2].map(|()| vec![0.0; signs.len()]);
    at.system
        .surfaces(&at.place_at(at.t, at.x, signs), &mut h[0])?;
    at.system
        .surfaces(&at.place_at(at.t, &moved, signs), &mut h[1])?;
    let size = at.system.surface_size(j, &at.place(signs))?;
    Ok((h[0][j] - h[1][j]).abs() <= ROUNDING * size)
}

/// What the actions at surface `j` make of a state, for a motion on the side of these signs.
pub(super) fn act_from_side(
    at: &Point,
    j: usize,
    signs: &[f64],
    x: &mut [f64],
) -> Result<(), FieldError> {
    let mut q = at.q.to_vec();
    for action in at.actions.from_side(j, if signs[j] < 0.0 { -1 } else { 1 }) {
        action.map.apply(at.t, x, signs, &mut q)?;
    }
    Ok(())
}

/// The point moved back onto the triggers that it slipped through, if there are any.
pub(crate) fn pushed_back(
    at: &Point,
    notes: &mut Notes,
    memory: &Mode,
) -> Result<Option<Vec<f64>>, FieldError> {
    let signs = memory.signs();
    let h = at.surface_values(notes, &signs)?;
    let mut beyond = Vec::new();
    for (j, h) in h.iter().enumerate() {
        if slipped_through(at, j, *h, &signs, Some(memory))?.is_some() {
            beyond.push(j);
        }
    }
    if beyond.is_empty() {
        return Ok(None);
    }
    let mut x = at.x.to_vec();
    let mut projector = at.projector();
    projector.project_onto(at.system, &beyond, at.t, &mut x, at.setting(&signs))?;
    Ok(Some(x))
}

/// The mode on surfaces of which some trigger actions and switch nothing: contact, where the impact has no
/// velocity left and the motion would go through; else the side that the motion leads to.
fn place_on_triggers(
    at: &Point,
    notes: &mut Notes,
    mut mode: Mode,
    smooth: &[usize],
    meeting: Vec<usize>,
    memory: Option<&Mode>,
) -> Result<Decision, FieldError> {
    let mut touched = Vec::with_capacity(smooth.len());
    let mut contacts = Vec::new();
    for &j in smooth {
        if at.patience.is_over() {
            return Ok(Decision::by(Rule::Triggers, Err(Stop::Interrupted)));
        }
        let side = at.triggers().side(j, memory);
        mode.set(j, side);
        let leading = leading_along(at, notes, j, &mode, &meeting, memory)?;
        let is_slow = leading.order == 1 && is_slow(at, j, leading.value, &mode)?;
        let is_still = leading.order != 1 || is_slow;
        // What slides beside it may press or lift it.
        let stays = leading.sign() != side || is_slow || !meeting.is_empty();
        if is_still && stays {
            match contact_at(at, j, &mode)? {
                Touching::Stays => {
                    contacts.push(j);
                    continue;
                }
                Touching::WithFriction(action) => {
                    let stop = Stop::FrictionInMap { surface: j, action };
                    return Ok(Decision::by(Rule::Contact, Err(stop)));
                }
                Touching::NoContact => {}
            }
        }
        let came_from = memory.map_or(side, |memory| memory.entries()[j]);
        let crosses = at.arrival.passing.contains(&j) || came_from == -side;
        if leading.sign() == -side && !crosses {
            // Its action comes first: the next event is here.
            continue;
        }
        if leading.order > 0 {
            mode.set(j, leading.sign());
        }
        touched.push((j, side, leading));
    }
    let Decision { rule, decided } = if contacts.is_empty() {
        place_on(at, notes, &mode, &meeting, memory)?
    } else {
        let meeting = add_reached_at_rest(at, notes, &mode, &contacts, meeting)?;
        let decided = place_in_contact(at, notes, mode, &contacts, &meeting)?;
        Decision::by(Rule::Contact, decided)
    };
    let decided = decided.map(|mut next| {
        let departing = touched.into_iter().filter(|(j, side, leading)| {
            let entry = next.mode.entries()[*j];
            leading.sign() == entry || *side == entry
        });
        let departing = departing.map(|(j, _, leading)| Left::beside(j, leading));
        next.left.extend(departing);
        next
    });
    Ok(Decision::by(rule, decided))
}

/// Does the motion lead from this side through a surface that the point lies on? A body that is pressed on
/// without velocity does not: it stays.
pub(crate) fn goes_through(
    at: &Point,
    notes: &mut Notes,
    j: usize,
    side: i8,
    mode: &Mode,
    on_surface: &[bool],
) -> Result<bool, FieldError> {
    let mode = mode.with(j, side);
    let others = (0..on_surface.len()).filter(|&k| {
        k != j
            && on_surface[k]
            && !at.triggers().is_internal(k)
            && !at.triggers().is_only_trigger(k)
    });
    let meeting = surfaces_that_matter(at.system, &mode, others.collect());
    let leading = leading_along(at, notes, j, &mode, &meeting, None)?;
    if leading.sign() != -side {
        return Ok(false);
    }
    let is_still = leading.order != 1 || is_slow(at, j, leading.value, &mode)?;
    Ok(!is_still || contact_at(at, j, &mode)? == Touching::NoContact)
}

/// The first derivative of h_j that does not vanish along the motion that follows on the surfaces of `meeting`.
fn leading_along(
    at: &Point,
    notes: &mut Notes,
    j: usize,
    mode: &Mode,
    meeting: &[usize],
    memory: Option<&Mode>,
) -> Result<Leading, FieldError> {
    let (side, mut after) = (mode.entries()[j], mode.clone());
    let mut multipliers = Vec::new();
    if !meeting.is_empty() {
        // A trial: what is not unique is warned of when it is decided.
        let mut trial = notes.of_trial();
        let decision = place_on(at, &mut trial, mode, meeting, memory)?;
        notes.add_costs(&trial);
        if let Ok(next) = decision.decided {
            multipliers = next.multipliers().to_vec();
            after = next.mode;
        }
        if after.codimension() > 0 {
            let velocity = at.velocity(notes, &after, &multipliers)?;
            let (value, size) = at.rate_of(j, &after.signs(), &velocity)?;
            if value.abs() > AT_SIDE * size {
                return Ok(Leading { order: 1, value });
            }
        }
    }
    first_nonzero(at.system, j, side, 0, &at.place(&after.signs()))
}

/// Is this speed at surface j below the tolerance?
pub(super) fn is_slow(at: &Point, j: usize, speed: f64, mode: &Mode) -> Result<bool, FieldError> {
    let mut row = vec![0.0; at.x.len()];
    at.system
        .rate_gradient(j, &at.place(&mode.signs()), &mut row)?;
    let tolerance = at.scale.along(&row, at.x);
    Ok(speed.abs() <= SLOW * tolerance)
}

/// What becomes of a body that touches h_j = 0 without velocity.
#[derive(PartialEq)]
enum Touching {
    /// The action there is no impact, or nothing is known of the contact: the motion goes on through the surface.
    NoContact,
    /// The body may stay.
    Stays,
    /// This action is an impact whose impulse depends on tangential velocities, so that it is no force of contact.
    WithFriction(String),
}

fn contact_at(at: &Point, j: usize, mode: &Mode) -> Result<Touching, FieldError> {
    let side = mode.entries()[j];
    let Some(first) = at.actions.from_side(j, side).next() else {
        return Ok(Touching::NoContact);
    };
    let impact = Impact::new(at, j, mode)?;
    let moved = impact.applied(at.x)?;
    let size = dot(at.x, at.x).sqrt();
    let shift: Vec<f64> = moved.iter().zip(at.x).map(|(m, x)| m - x).collect();
    let moves = dot(&shift, &shift).sqrt() > 1e-9 * (1.0 + size);
    if moves && !leaves_point_alone(at, j, &mode.signs())? {
        return Ok(Touching::NoContact);
    }
    let usual = impact.impulse(at.x)?;
    if moves {
        let leaves_speed = dot(&shift, &impact.normal).abs()
            <= FRICTION_IN_MAP * (dot(&shift, &shift) * dot(&impact.normal, &impact.normal)).sqrt();
        return Ok(
            match leaves_speed && impact.changes_normal_velocity(&usual) {
                true => Touching::WithFriction(first.name.clone()),
                false => Touching::NoContact,
            },
        );
    }
    let resting = mode.with(j, 0);
    let mut sides = at.arrival.sides.to_vec();
    sides[j] = side;
    let Some(mut field) = ContactField::new(at.system, at.actions, &resting, &sides, at.q) else {
        return Ok(Touching::NoContact);
    };
    let (mut x, mut dx) = (at.x.to_vec(), vec![0.0; at.x.len()]);
    field.eval(at.t, &mut x, &mut dx)?;
    if dx.iter().any(|v| !v.is_finite()) {
        return Ok(Touching::NoContact);
    }
    Ok(match impact.depends_on_tangential_velocity(at.x, &usual)? {
        true => Touching::WithFriction(first.name.clone()),
        false => Touching::Stays,
    })
}

/// The actions at a surface that is touched without velocity, as an impact.
struct Impact<'p, 'm, 'a> {
    at: &'p Point<'p, 'm, 'a>,
    j: usize,
    signs: Signs,
    /// The gradient of h_j' by the state: the direction of the normal velocity.
    normal: Vec<f64>,
    /// A small velocity.
    slow: f64,
    /// One that is small beside it, towards the surface.
    approach: f64,
}

impl<'p, 'm, 'a> Impact<'p, 'm, 'a> {
    fn new(at: &'p Point<'p, 'm, 'a>, j: usize, mode: &Mode) -> Result<Self, FieldError> {
        let signs = mode.signs();
        let mut normal = vec![0.0; at.x.len()];
        at.system.rate_gradient(j, &at.place(&signs), &mut normal)?;
        let slow = MOMENT * (1.0 + dot(at.x, at.x).sqrt());
        let size = dot(&normal, &normal).sqrt();
        let approach = -f64::from(mode.entries()[j]) * MOMENT * slow / size;
        Ok(Impact {
            at,
            j,
            signs,
            normal,
            slow,
            approach,
        })
    }

    /// The state after the actions.
    fn applied(&self, x: &[f64]) -> Result<Vec<f64>, FieldError> {
        let mut moved = x.to_vec();
        act_from_side(self.at, self.j, &self.signs, &mut moved)?;
        Ok(moved)
    }

    /// What an approach at these velocities adds to the change of the state, per normal velocity.
    fn impulse(&self, x: &[f64]) -> Result<Vec<f64>, FieldError> {
        let pairs = x.iter().zip(&self.normal);
        let hits: Vec<f64> = pairs.map(|(x, n)| x + self.approach * n).collect();
        let (stays, after) = (self.applied(x)?, self.applied(&hits)?);
        let change = |i: usize| ((after[i] - hits[i]) - (stays[i] - x[i])) / self.approach;
        Ok((0..x.len()).map(change).collect())
    }

    /// Is it an impact, and not an action that leaves the velocity towards the surface as it is?
    fn changes_normal_velocity(&self, impulse: &[f64]) -> bool {
        dot(impulse, &self.normal).abs() > FRICTION_IN_MAP * dot(&self.normal, &self.normal)
    }

    /// Does its impulse depend on a tangential velocity, as that of friction does?
    ///
    /// Approaches are compared that differ in one component of the state: by little, and by the sign of a component that the
    /// impulse changes. A smooth law hardly differs between states so close, and a linear one not at all between mirrored
    /// ones; friction points the other way.
    fn depends_on_tangential_velocity(&self, x: &[f64], usual: &[f64]) -> Result<bool, FieldError> {
        let mut other = x.to_vec();
        for i in (0..x.len()).filter(|&i| self.normal[i] == 0.0) {
            let mut values =
                SmallVec::<[f64; 3]>::from_slice(&[x[i] + self.slow, x[i] - self.slow]);
            if usual[i] != 0.0 {
                values.push(-x[i]);
            }
            for value in values {
                other[i] = value;
                let impulse = self.impulse(&other)?;
                let pairs = || impulse.iter().zip(usual);
                let largest = pairs().fold(0.0_f64, |most, (a, b)| most.max(a.abs()).max(b.abs()));
                if pairs().any(|(a, b)| (a - b).abs() > FRICTION_IN_MAP * largest) {
                    return Ok(true);
                }
            }
            other[i] = x[i];
        }
        Ok(false)
    }
}

/// The triggers that the motion reaches here up to rounding.
pub(crate) fn triggers_reached(at: &Point, h: &[f64]) -> Result<Vec<usize>, FieldError> {
    let rates = at.rates_here()?;
    let mut reached = Vec::new();
    for j in (0..h.len()).filter(|&j| at.actions.at_surface(j).is_some()) {
        let size = at.system.surface_size(j, &at.place(at.arrival.signs))?;
        let approaches = rates[j] * f64::from(at.arrival.mode.entries()[j]) < 0.0;
        if approaches && h[j].abs() <= ROUNDING * size {
            reached.push(j);
        }
    }
    Ok(reached)
}
