//! What happens at a point.

use crate::error::FieldError;
use crate::field::{eval_on_side, MeetingFields};
use crate::mode::Mode;
use crate::switching::{
    decide, decide_intersection, region_at_rest, relay_at, resolve, Arrival, Continuation,
    Incoming, Leading, Resolution, Undecided, Uniqueness,
};
use crate::system::{dot, dot_magnitude, surfaces_that_matter, PiecewiseSystem};
use crate::tolerances::{MOST_MEETING, SURFACE_NOISE};

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

/// What happens at a point, seen as the start of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Classification {
    /// Which kind of point it is.
    pub kind: PointKind,
    /// The surfaces that vanish here, to rounding, and matter.
    pub surfaces: Vec<usize>,
    /// The mode in which a run goes on; `None` if that is not decided, or an outward spiral.
    pub mode: Option<Mode>,
    /// lambda of the surfaces that `mode` slides on, in their order.
    pub multipliers: Vec<f64>,
    /// All modes in which a motion can go on.
    pub candidates: Vec<Mode>,
    /// Is there one way only?
    pub unique: bool,
    /// May the motion spiral outwards around the intersection?
    pub spirals: bool,
    /// At an intersection, the rule that decided; otherwise empty.
    pub leaf: &'static str,
    /// Why there is no decision.
    pub undecided: Option<Undecided>,
    /// Normal components of all fields around the point, `[pattern * m + i]` as in
    /// [`crate::switching::NormalFields`].
    pub components: Vec<f64>,
    /// On one surface, the first non-vanishing derivatives of h along f- and f+.
    pub leading: Option<[Leading; 2]>,
}

/// Says what happens at a point: which surfaces vanish there, and in which modes a motion can go on.
///
/// A surface vanishes if |h| is below the rounding of the terms that it is made of, or nearer than `reach`
/// by its gradient; it matters if the field depends on its sign. `kappa` scales all surfaces of the system; empty means 1. `None` if the field or
/// a switching function is not finite.
///
/// # Example
/// ```
/// use filippov::{classify, ClosureSystem, PointKind};
///
/// let relay = ClosureSystem::new(1, 1, |_, _, s, dx| dx[0] = 0.3 - s[0], |_, x, h| h[0] = x[0]);
/// let point = classify(&relay, 0.0, &[0.0], 0.0, &[])?.expect("finite");
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
    reach: f64,
    kappa: &[f64],
) -> Result<Option<Classification>, FieldError> {
    let Some((mode, zeros)) = place(system, t, x, reach)? else {
        return Ok(None);
    };
    // What only triggers an action changes nothing here.
    let zeros = zeros
        .into_iter()
        .filter(|&j| system.switches_at(j))
        .collect();
    let surfaces = surfaces_that_matter(system, &mode, zeros);
    match surfaces.as_slice() {
        [] => in_region(system, t, x, mode),
        &[j] => on_surface(system, t, x, &mode, j),
        _ => at_intersection(system, t, x, &mode, surfaces, kappa),
    }
}

/// The sides of all surfaces, and which of them vanish. Switching functions may contain signs of others: they
/// are evaluated again until nothing changes.
fn place(
    system: &dyn PiecewiseSystem,
    t: f64,
    x: &[f64],
    reach: f64,
) -> Result<Option<(Mode, Vec<usize>)>, FieldError> {
    let d = system.n_surfaces();
    let mut mode = Mode::new(vec![1; d]);
    let mut zeros = Vec::new();
    let (mut h, mut gradient) = (vec![0.0; d], vec![0.0; x.len()]);
    for _ in 0..=d {
        let (before, signs) = (mode.clone(), mode.signs());
        system.surfaces(t, x, &signs, &mut h)?;
        if h.iter().any(|h| h.is_nan()) {
            return Ok(None);
        }
        zeros.clear();
        for (j, h) in h.iter().enumerate() {
            let ht = system.gradient(j, t, x, &signs, &mut gradient)?;
            let noise = SURFACE_NOISE * (dot_magnitude(&gradient, x) + (ht * t).abs());
            if h.abs() <= noise.max(reach * dot(&gradient, &gradient).sqrt()) {
                zeros.push(j);
            }
            mode.set(j, if *h < 0.0 { -1 } else { 1 });
        }
        if mode == before {
            break;
        }
    }
    Ok(Some((mode, zeros)))
}

impl Classification {
    /// A point of this kind at which nothing is decided.
    fn open(kind: PointKind, surfaces: Vec<usize>) -> Self {
        Classification {
            kind,
            surfaces,
            mode: None,
            multipliers: Vec::new(),
            candidates: Vec::new(),
            unique: false,
            spirals: false,
            leaf: "",
            undecided: None,
            components: Vec::new(),
            leading: None,
        }
    }
}

fn in_region(
    system: &dyn PiecewiseSystem,
    t: f64,
    x: &[f64],
    mode: Mode,
) -> Result<Option<Classification>, FieldError> {
    let mut dx = vec![0.0; x.len()];
    eval_on_side(system, t, x, &mode.signs(), &mut dx)?;
    let is_finite = dx.iter().all(|v| v.is_finite());
    Ok(is_finite.then(|| Classification {
        candidates: vec![mode.clone()],
        mode: Some(mode),
        unique: true,
        ..Classification::open(PointKind::Region, Vec::new())
    }))
}

fn on_surface(
    system: &dyn PiecewiseSystem,
    t: f64,
    x: &[f64],
    mode: &Mode,
    j: usize,
) -> Result<Option<Classification>, FieldError> {
    let corners = corners_around(system, t, x, mode, &[j])?;
    let Ok(fields) = corners.normal_fields() else {
        return Ok(None);
    };
    let decision = decide(system, j, Arrival::Start, t, x, &mode.signs())?;
    let candidates = decision.candidates.iter().map(|&e| mode.with(j, e));
    let mut candidates: Vec<Mode> = candidates.collect();
    if decision.turns_back() {
        candidates.clear();
    }
    let (minus, plus) = (fields.at(0)[0], fields.at(1)[0]);
    let slides = decision.entry == 0;
    Ok(Some(Classification {
        mode: (!candidates.is_empty()).then(|| mode.with(j, decision.entry)),
        multipliers: slides
            .then(|| ((minus + plus) / (minus - plus)).clamp(-1.0, 1.0))
            .into_iter()
            .collect(),
        unique: candidates.len() == 1,
        candidates,
        components: fields.values().into_owned(),
        leading: Some([decision.minus, decision.plus]),
        ..Classification::open(PointKind::of(decision.minus, decision.plus), vec![j])
    }))
}

fn at_intersection(
    system: &dyn PiecewiseSystem,
    t: f64,
    x: &[f64],
    mode: &Mode,
    surfaces: Vec<usize>,
    kappa: &[f64],
) -> Result<Option<Classification>, FieldError> {
    let mut point = Classification::open(PointKind::Intersection, surfaces);
    let meeting = point.surfaces.clone();
    if meeting.len() > MOST_MEETING && decided_by_relay(system, (t, x), mode, &mut point)? {
        return Ok(Some(point));
    }
    let groups = system.sign_groups(&meeting).into_iter();
    let largest = groups.map(|group| group.len()).max().unwrap_or(0);
    if largest > MOST_MEETING {
        point.undecided = Some(Undecided::TooMany { n: largest });
        return Ok(Some(point));
    }
    let corners = corners_around(system, t, x, mode, &meeting)?;
    let Ok(fields) = corners.normal_fields() else {
        return Ok(None);
    };
    let scaling = meeting
        .iter()
        .map(|&j| kappa.get(j).copied().unwrap_or(1.0));
    let scaling: Vec<f64> = scaling.collect();
    if meeting.len() <= MOST_MEETING {
        point.components = fields.values().into_owned();
    }
    let on_all = |k: &Mode| {
        let mut full = mode.clone();
        for (&j, &entry) in meeting.iter().zip(k.entries()) {
            full.set(j, entry);
        }
        full
    };
    match resolve(&fields, &Incoming::Start, &scaling) {
        Ok(resolution) if !resolution.degenerate => point.take(resolution, on_all),
        other => {
            let decision = decide_intersection(system, &meeting, mode, false, (t, x))?;
            if let Some((only, _)) = decision.unique() {
                point.mode = Some(only.clone());
                point.unique = true;
                point.leaf = "higher-order";
            } else {
                point.undecided = Some(other.err().unwrap_or(Undecided::NoOutcome));
            }
            point.candidates = decision.candidates;
        }
    }
    if let Some(rest) = region_at_rest(system, &corners, mode, t, x)? {
        point.add_rest(rest, x.len());
    }
    Ok(Some(point))
}

/// Many surfaces: the relay problem, if the field is affine in the signs and it has a solution that is clear.
fn decided_by_relay(
    system: &dyn PiecewiseSystem,
    at: (f64, &[f64]),
    mode: &Mode,
    point: &mut Classification,
) -> Result<bool, FieldError> {
    let (found, _) = relay_at(system, at, mode, &point.surfaces)?;
    let Some(found) = found.filter(|found| found.degenerate.is_empty()) else {
        return Ok(false);
    };
    let mut after = mode.clone();
    for ((&j, &entry), &sign) in point.surfaces.iter().zip(&found.modes).zip(&found.signs) {
        after.set(j, entry);
        if entry == 0 {
            point.multipliers.push(sign);
        }
    }
    point.unique = matches!(found.uniqueness, Uniqueness::Certain | Uniqueness::OfMotion);
    point.candidates = vec![after.clone()];
    point.mode = Some(after);
    point.leaf = "relay";
    Ok(true)
}

impl Classification {
    /// Adds a region whose field is at rest.
    fn add_rest(&mut self, rest: Mode, n: usize) {
        // What stays on as many surfaces as there are states stays at the point.
        let is_only = self.candidates.is_empty() && self.surfaces.len() == n;
        if is_only {
            self.mode = Some(rest.clone());
            self.leaf = "rest";
            self.undecided = None;
        }
        self.unique = is_only || self.unique && self.candidates.contains(&rest);
        if !self.candidates.contains(&rest) {
            self.candidates.push(rest);
        }
    }

    fn take(&mut self, resolution: Resolution, on_all: impl Fn(&Mode) -> Mode) {
        let candidates = &resolution.candidates;
        self.spirals = candidates.contains(&Continuation::OutwardSpiral);
        self.mode = resolution.mode().map(&on_all);
        let modes = candidates.iter().filter_map(Continuation::as_mode);
        self.candidates = modes.map(on_all).collect();
        self.unique = resolution.unique && !self.spirals;
        self.leaf = resolution.leaf;
        self.multipliers = resolution.multipliers;
    }
}

/// All fields around the point.
fn corners_around(
    system: &dyn PiecewiseSystem,
    t: f64,
    x: &[f64],
    mode: &Mode,
    surfaces: &[usize],
) -> Result<MeetingFields, FieldError> {
    let mut corners = MeetingFields::new(system, surfaces);
    corners.evaluate(system, t, x, &mode.signs())?;
    Ok(corners)
}
