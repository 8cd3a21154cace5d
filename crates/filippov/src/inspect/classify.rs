//! What happens at a point: the decision of a run that starts or arrives there.

use std::cell::RefCell;

use smallvec::SmallVec;

use crate::decisions::{
    decide, sides, Arrival, Cause, Decision, Notes, Point, Policy, Reached, Sides,
};
use crate::error::FieldError;
use crate::error_scale::{ErrorScale, Units};
use crate::mode::Mode;
use crate::motion::Leading;
use crate::motion::{ActiveSurfaces, Guard, Law, MeetingFields, ModeField, SmoothField};
use crate::options::{NonUnique, Options};
use crate::patience::Patience;
use crate::status::Stop;
use crate::switching::{decide as decide_at_surface, Arrival as SurfaceArrival};
use crate::system::eval_on_side;
use crate::system::Actions;
use crate::system::{dot, surfaces_that_matter, PiecewiseSystem, Place, Setting};
use crate::tolerances::{AT_SIDE, MOST_MEETING, ROUNDING};

/// The kinds of point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointKind {
    /// No surface that matters vanishes.
    Region,
    /// One surface; both fields lead to the same side.
    Crossing,
    /// One surface; both fields lead to it.
    Sliding,
    /// One surface; both fields lead away from it (repulsive sliding).
    Escaping,
    /// One surface; one of the fields is tangent to it.
    Tangency,
    /// One surface; both fields are tangent to it.
    TwoFold,
    /// Several surfaces.
    Intersection,
}

impl PointKind {
    /// The name used in results.
    pub fn name(self) -> &'static str {
        match self {
            PointKind::Region => "region",
            PointKind::Crossing => "crossing",
            PointKind::Sliding => "sliding",
            PointKind::Escaping => "escaping",
            PointKind::Tangency => "tangency",
            PointKind::TwoFold => "two_fold",
            PointKind::Intersection => "intersection",
        }
    }

    fn of(minus: Leading, plus: Leading) -> Self {
        match (minus.order, plus.order) {
            (1, 1) => match (minus.sign(), plus.sign()) {
                (1, -1) => PointKind::Sliding,
                (-1, 1) => PointKind::Escaping,
                _ => PointKind::Crossing,
            },
            (1, _) | (_, 1) => PointKind::Tangency,
            _ => PointKind::TwoFold,
        }
    }
}

/// What happens at a point.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Classification {
    /// Which kind of point it is.
    pub kind: PointKind,
    /// The surfaces that vanish here, to rounding, and matter.
    pub surfaces: Vec<usize>,
    /// The mode that follows; `None` if that is not decided, or an outward spiral.
    pub mode: Option<Mode>,
    /// lambda of the surfaces that `mode` slides on, in their order.
    pub multipliers: Vec<f64>,
    /// All modes in which a motion can follow.
    pub candidates: Vec<Mode>,
    /// Can one motion only follow?
    pub unique: bool,
    /// May the motion spiral outwards around the intersection?
    pub spirals: bool,
    /// The rule that decided.
    pub rule: &'static str,
    /// At an intersection, the leaf of that rule, if it has several; otherwise empty.
    pub leaf: &'static str,
    /// Why there is no decision; empty if there is one.
    pub reason: String,
    /// Normal components of all fields around the point, `[pattern * m + i]` as in
    /// [`crate::cube::NormalFields`].
    pub components: Vec<f64>,
    /// On one surface, the first non-vanishing derivatives of h along f- and f+.
    pub leading: Option<[Leading; 2]>,
}

/// How a point is looked at.
#[derive(Clone, Copy, Debug, Default)]
pub struct Inspection<'a> {
    /// A surface that is nearer than this counts as met, and one that vanishes to rounding in any case.
    pub reach: f64,
    /// The scaling of all surfaces of the system; empty means 1.
    pub kappa: &'a [f64],
    /// The mode of the motion that arrives at the point; `None` for a start.
    pub before: Option<&'a Mode>,
    /// The discrete states; empty if the system has none.
    pub q: &'a [f64],
}

/// Says what happens at a point: which surfaces vanish there, and in which modes a motion can follow. The decision is that of
/// a run ([`crate::Problem::solve`]) that starts there or, with [`Inspection::before`], arrives there in a mode.
///
/// A surface vanishes if |h| is below the rounding of the terms that it is made of; it matters if the field depends on its
/// sign. `None` if the field or a switching function is not finite.
///
/// # Example
/// ```
/// use filippov::{classify, ClosureSystem, Inspection, PointKind};
///
/// let relay = ClosureSystem::new(1, 1, |_, _, s, dx| dx[0] = 0.3 - s[0], |_, x, h| h[0] = x[0]);
/// let point = classify(&relay, 0.0, &[0.0], Inspection::default())?.expect("finite");
/// assert_eq!(point.kind, PointKind::Sliding);
/// assert!((point.multipliers[0] - 0.3).abs() < 1e-15);
/// # Ok::<(), filippov::FieldError>(())
/// ```
///
/// # Errors
/// If a function of the user raises.
pub fn classify(
    system: &dyn PiecewiseSystem,
    t: f64,
    x: &[f64],
    how: Inspection,
) -> Result<Option<Classification>, FieldError> {
    let options = Options::default();
    let law = Law {
        kappa: how.kappa,
        ..Law::from(&options)
    };
    let scale = ErrorScale::new(options.rtol, &options.atol, x.len());
    let start = Mode::new(vec![1; system.n_surfaces()]);
    let mode = how.before.unwrap_or(&start);
    let (signs, sliding): (_, Vec<usize>) = (mode.signs(), mode.sliding_set().collect());
    let active = ActiveSurfaces::new(system, &signs, &sliding);
    let place = Setting::new(&signs, how.q).at(t, x);
    let residuals = residuals_within(system, &place, how.reach)?;
    let mut field = ModeField::of(system, law, mode, how.q);
    let mut velocity = vec![0.0; x.len()];
    let functions = match how.before {
        Some(_) => vanishing_functions(system, &place, mode, &mut field, &residuals)?,
        None => SmallVec::new(),
    };
    field.eval(t, &mut x.to_vec(), &mut velocity)?;
    let actions = Actions::none();
    let sides_of = |entry: &i8| if *entry < 0 { -1 } else { 1 };
    let sides_before: Vec<i8> = mode.entries().iter().map(sides_of).collect();
    let arrival = |cause, field| Arrival {
        cause,
        mode,
        signs: &signs,
        sliding: &sliding,
        sides: &sides_before,
        active: &active,
        resting: &[],
        departing: SmallVec::new(),
        switches: &[],
        residuals: &residuals,
        passing: &[],
        velocity: &velocity,
        field: RefCell::new(field),
    };
    let policy = Policy {
        law,
        nonunique: NonUnique::Regularize,
        choices: &[],
    };
    let (known, space) = (RefCell::default(), RefCell::default());
    let point = |arrival| Point {
        known: &known,
        space: &space,
        system,
        actions: &actions,
        scale: &scale,
        t,
        x,
        q: how.q,
        arrival,
        policy,
        patience: Patience::endless(),
    };
    let event = Cause::Event {
        functions: &functions,
        touch: false,
        vanishing: [0; 2],
        at_two_fold: false,
    };
    let (mut notes, mut reached) = (Notes::default(), Reached::default());
    let (surfaces, around, decision) = match how.before {
        None => {
            let arrival = arrival(Cause::Start, &mut field);
            let at = point(&arrival);
            let Some(Sides { mode, on_surface }) = sides(&at, &mut Notes::default(), None)? else {
                return Ok(None);
            };
            // What only triggers an action changes nothing here.
            let zeros = (0..on_surface.len()).filter(|&j| on_surface[j] && system.switches_at(j));
            let surfaces = surfaces_that_matter(system, &mode, zeros.collect());
            (surfaces, mode, decide(&at, &mut notes, &mut reached)?)
        }
        Some(_) => {
            let arrival = arrival(event, &mut field);
            let decision = decide(&point(&arrival), &mut notes, &mut reached)?;
            let mut surfaces = [&reached.surfaces[..], &sliding[..]].concat();
            surfaces.sort_unstable();
            (surfaces, reached.before.clone(), decision)
        }
    };
    let around_signs = around.signs();
    let around = place.with_signs(&around_signs);
    let Some(components) = components_around(system, (&around, law.units), &surfaces)? else {
        return Ok(None);
    };
    let mut found = describe(system, &place, law, decision, notes)?;
    found.kind = match *surfaces {
        [] => PointKind::Region,
        [j] => {
            let sides = decide_at_surface(system, j, SurfaceArrival::Start, &around)?;
            found.leading = Some([sides.minus, sides.plus]);
            PointKind::of(sides.minus, sides.plus)
        }
        _ => PointKind::Intersection,
    };
    (found.components, found.surfaces) = (components, surfaces);
    Ok(Some(found))
}

/// The first surface whose entry in the mode [`Inspection::before`] contradicts the place: the mode slides on it and the place
/// is not on it, or the place is on its other side.
///
/// # Errors
/// If a function of the user raises.
pub fn contradicts(
    system: &dyn PiecewiseSystem,
    t: f64,
    x: &[f64],
    how: Inspection,
) -> Result<Option<usize>, FieldError> {
    let Some(mode) = how.before else {
        return Ok(None);
    };
    let (signs, sliding): (_, Vec<usize>) = (mode.signs(), mode.sliding_set().collect());
    let mut active = vec![false; signs.len()];
    system.active(&signs, &sliding, &mut active);
    let mut h = vec![0.0; signs.len()];
    let place = Setting::new(&signs, how.q).at(t, x);
    system.surfaces(&place, &mut h)?;
    let residuals = residuals_within(system, &place, how.reach)?;
    for (j, &entry) in mode.entries().iter().enumerate() {
        let noise = ROUNDING * system.surface_size(j, &place)?;
        let reach = residuals.get(j).map_or(0.0, |residual| 2.0 * residual);
        let is_beyond = match entry {
            0 => h[j].abs() > noise.max(reach),
            side => active[j] && h[j] * f64::from(side) < -noise.max(reach),
        };
        if is_beyond {
            return Ok(Some(j));
        }
    }
    Ok(None)
}

/// The normal components of all fields around a place, if they are few; `None` if one is not finite.
fn components_around(
    system: &dyn PiecewiseSystem,
    (place, units): (&Place<'_>, Units<'_>),
    surfaces: &[usize],
) -> Result<Option<Vec<f64>>, FieldError> {
    if surfaces.is_empty() {
        let mut field = vec![0.0; place.x.len()];
        eval_on_side(system, place, &mut field)?;
        let is_finite = field.iter().all(|v| v.is_finite());
        return Ok(is_finite.then(Vec::new));
    }
    if surfaces.len() > MOST_MEETING {
        return Ok(Some(Vec::new()));
    }
    let mut corners = MeetingFields::new(system, surfaces);
    corners.evaluate(system, place, units)?;
    let fields = corners.normal_fields();
    Ok(fields.ok().map(|fields| fields.values().into_owned()))
}

/// Half of what each switching function amounts to at this distance from its surface; a point counts as on the surface up to
/// twice as much.
fn residuals_within(
    system: &dyn PiecewiseSystem,
    place: &Place<'_>,
    reach: f64,
) -> Result<Vec<f64>, FieldError> {
    if reach == 0.0 {
        return Ok(Vec::new());
    }
    let mut gradient = vec![0.0; place.x.len()];
    let residuals = (0..place.signs.len()).map(|j| {
        system.gradient(j, place, &mut gradient)?;
        Ok(0.5 * reach * dot(&gradient, &gradient).sqrt())
    });
    residuals.collect()
}

/// The functions of a motion in this mode that vanish at a place: switching functions, and exit functions.
fn vanishing_functions(
    system: &dyn PiecewiseSystem,
    place: &Place<'_>,
    mode: &Mode,
    field: &mut ModeField,
    residuals: &[f64],
) -> Result<SmallVec<[Guard; 4]>, FieldError> {
    let mut h = vec![0.0; place.signs.len()];
    system.surfaces(place, &mut h)?;
    let mut found = SmallVec::new();
    for (j, residual) in residuals.iter().enumerate() {
        if mode.entries()[j] != 0 && h[j].abs() <= 2.0 * residual {
            found.push(Guard::Surface(j));
        }
    }
    let exits = field.exits(place.t, &mut place.x.to_vec())?;
    let size = exits
        .iter()
        .fold(0.0_f64, |size, exit| size.max(exit.abs()));
    let ends = field.guards().into_iter().zip(&exits);
    let vanishing = ends.filter(|(_, exit)| exit.abs() <= AT_SIDE * size);
    found.extend(vanishing.map(|(guard, _)| guard));
    Ok(found)
}

/// A decision in the words of a classification.
fn describe(
    system: &dyn PiecewiseSystem,
    place: &Place<'_>,
    law: Law,
    decision: Decision,
    notes: Notes,
) -> Result<Classification, FieldError> {
    let Decision { decided, rule } = decision;
    let mut found = Classification {
        kind: PointKind::Region,
        surfaces: Vec::new(),
        mode: None,
        multipliers: Vec::new(),
        candidates: notes.candidates,
        unique: false,
        spirals: notes.spirals,
        rule: rule.name(),
        leaf: notes.leaf,
        reason: String::new(),
        components: Vec::new(),
        leading: None,
    };
    let next = match decided {
        Ok(next) => next,
        Err(stop) => {
            found.reason = reason_of(&stop);
            return Ok(found);
        }
    };
    found.unique = notes.n_choices == 0 && !notes.spirals;
    if found.candidates.is_empty() && !next.leaps() {
        found.candidates = vec![next.mode.clone()];
    }
    if next.leaps() {
        return Ok(found);
    }
    found.multipliers = match next.mode.codimension() {
        0 => Vec::new(),
        m if m == next.multipliers().len() => next.multipliers().to_vec(),
        _ => {
            let mut field = ModeField::of(system, law, &next.mode, place.q);
            field.exits_at(place.t, &mut place.x.to_vec())?;
            field.multipliers().into_vec()
        }
    };
    found.mode = Some(next.mode);
    Ok(found)
}

/// Why there is no decision.
fn reason_of(stop: &Stop) -> String {
    match stop {
        Stop::Intersection { reason, .. } => reason.to_string(),
        Stop::SlidesAcrossJump { .. } => {
            "the motion would slide between fields that differ in the sign of another function too, which jumps here".into()
        }
        Stop::InvisibleTwoFold { .. } => {
            "the fields on both sides turn back to the surface (an invisible two-fold)".into()
        }
        Stop::SlidingRule { reason, .. } => reason.to_string(),
        other => other.name().replace('_', " "),
    }
}
