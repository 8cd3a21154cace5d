//! The decision at an intersection, whatever came before and however many surfaces meet.

use super::after_exit;
use super::hidden::{attracting, limit_within, Outcome};
use super::incoming::{ExitKind, HiddenStart, Incoming};
use super::resolution::{Continuation, Resolution};
use crate::cube::{has_one_mode_only, is_stable_for, newton, stable_roots_within};
use crate::cube::{Bilinear, NormalFields};
use crate::error::Undecided;
use crate::patience::Patience;
use crate::tolerances::{DOUBTFUL, MOST_MEETING, UNSTABLE_START};

/// The leaf of decisions with one attracting continuation.
const ONLY: &str = "only";

/// Decides what follows at an intersection of m surfaces, scaled by `kappa`.
///
/// All attracting continuations are listed; a single one follows. Among several, and of more than six surfaces, the hidden
/// dynamics at `kappa` selects. If a quantity whose sign decided is doubtful (`tolerances/`), the list is made again
/// for perturbed fields, and the hidden dynamics asked once for each list: if they agree, theirs counts, and if not,
/// [`Resolution::degenerate`] is set.
///
/// # Example
/// ```
/// use filippov::switching::{resolve, Incoming, NormalFields};
/// use filippov::Mode;
///
/// // Sliding on the first surface reaches the second one; both attract.
/// let fields = NormalFields::new(2, vec![1.75, 0.25, -0.25, 1.25, 1.25, -1.75, -0.75, -0.75])?;
/// let incoming = Incoming::Face { mode: vec![0, -1], multipliers: vec![0.75] };
/// let resolution = resolve(&fields, &incoming, &[1.0, 1.0])?;
/// assert_eq!(resolution.leaf, "only");
/// assert_eq!(resolution.mode(), Some(&Mode::new(vec![0, 0])));
/// assert!((resolution.multipliers[0] - 0.5).abs() < 1e-15);
/// assert!(resolution.unique);
/// # Ok::<(), filippov::switching::Undecided>(())
/// ```
///
/// # Errors
/// If the data do not determine an outcome; each variant of [`Undecided`] says why.
pub fn resolve(
    fields: &NormalFields,
    incoming: &Incoming,
    kappa: &[f64],
) -> Result<Resolution, Undecided> {
    resolve_within(fields, incoming, kappa, Patience::endless())
}

/// As [`resolve`], as long as the caller waits.
///
/// # Errors
/// As [`resolve`]; [`Undecided::Interrupted`] when the caller has waited long enough.
pub fn resolve_within(
    fields: &NormalFields,
    incoming: &Incoming,
    kappa: &[f64],
    patience: Patience,
) -> Result<Resolution, Undecided> {
    if kappa.len() != fields.m() || kappa.iter().any(|k| !(k.is_finite() && *k > 0.0)) {
        return Err(Undecided::Scaling { m: fields.m() });
    }
    check_lengths(fields.m(), incoming)?;
    let mut selections = Selections::new();
    let mut resolution = decide(fields, incoming, kappa, patience, &mut selections)?;
    let is_doubtful = resolution.margin <= DOUBTFUL;
    let is_of_these_fields = !is_doubtful && !matches!(incoming, Incoming::Exit { .. });
    if is_doubtful {
        let others = perturbations(fields)
            .map(|other| decide(&other, incoming, kappa, patience, &mut selections));
        resolution = agreed(resolution, &others.collect::<Vec<_>>());
    }
    complete(&mut resolution, is_of_these_fields, fields, kappa, patience);
    match patience.is_over() {
        true => Err(Undecided::Interrupted),
        false => Ok(resolution),
    }
}

/// What the hidden dynamics selected among these continuations.
type Selections = Vec<(Vec<Continuation>, Result<Resolution, Undecided>)>;

/// The decision for the fields next to these. If all of them agree, theirs counts: a tie, as between
/// surfaces that do not know of each other, is then no obstacle. Otherwise the decision is
/// degenerate.
fn agreed(mut resolution: Resolution, others: &[Result<Resolution, Undecided>]) -> Resolution {
    let agreed: Vec<&Resolution> = others.iter().flatten().collect();
    let agree = agreed.len() == others.len() && agreed.iter().all(|o| o.chosen == agreed[0].chosen);
    if agree {
        let margin = resolution.margin;
        resolution = agreed[0].clone();
        resolution.margin = margin;
    }
    for other in agreed {
        resolution.add_candidates(&other.candidates);
    }
    resolution.degenerate |= !agree;
    resolution.unique &= resolution.candidates.len() == 1 && !resolution.degenerate;
    resolution
}

fn check_lengths(m: usize, incoming: &Incoming) -> Result<(), Undecided> {
    let fits = match incoming {
        Incoming::Corner { region } => region.len() == m && !region.contains(&0),
        Incoming::Face { mode, .. } => mode.len() == m,
        Incoming::Exit { lambda, drift, .. } => {
            lambda.len() == m && drift.as_ref().is_none_or(|drift| drift.len() == m)
        }
        Incoming::Start => true,
    };
    fits.then_some(()).ok_or(Undecided::IncomingShape { m })
}

/// The decision for these very fields. What was selected before, for fields next to them, is not selected again: of a motion
/// that arrives, only what is listed is in doubt.
fn decide(
    fields: &NormalFields,
    incoming: &Incoming,
    kappa: &[f64],
    patience: Patience,
    selections: &mut Selections,
) -> Result<Resolution, Undecided> {
    let m = fields.m();
    let is_undetermined = match m {
        1 => fields.size() == 0.0,
        2 => Bilinear::of_fields(fields).is_undetermined(),
        _ => false,
    };
    if is_undetermined {
        let tangent = (0..m).find(|&surface| fields.row_size(surface) == 0.0);
        return Err(match tangent {
            Some(surface) => Undecided::Tangent { surface },
            None => Undecided::Proportional,
        });
    }
    if let (
        Incoming::Exit {
            kind,
            lambda,
            drift,
        },
        true,
    ) = (incoming, m <= 2)
    {
        if m == 1 || *kind != ExitKind::Stability {
            return after_exit::leave(fields, *kind, lambda, drift.as_deref());
        }
    }
    let is_start = *incoming == Incoming::Start;
    let start = incoming.hidden_start(fields, kappa, patience)?;
    let listed = attracting(&start.fields, patience);
    let are_listed = listed.is_some();
    let (mut found, margin) = listed.unwrap_or((Vec::new(), f64::INFINITY));
    let mut resolution = match found.pop() {
        Some(only) if found.is_empty() => {
            let mut resolution = Resolution::sure(ONLY, only.continuation);
            resolution.multipliers = only.multipliers;
            resolution
        }
        last => {
            found.extend(last);
            let found: Vec<Continuation> = found.into_iter().map(|one| one.continuation).collect();
            let known = selections.iter().find(|(among, _)| *among == found);
            let mut resolution = match known.filter(|_| !is_start) {
                Some((_, selection)) => selection.clone()?,
                None => {
                    let selection = selected(&start, &found, incoming, kappa, patience);
                    selections.push((found, selection.clone()));
                    selection?
                }
            };
            resolution.unique &=
                are_listed || incoming.is_followed() || has_one_mode_only(&start.fields);
            resolution
        }
    };
    // A mode that is left at no speed at first is none in which a motion starts.
    resolution.margin = match is_start {
        true => smallest_component(fields),
        false => margin,
    };
    Ok(resolution)
}

/// That of several attracting continuations to which the hidden dynamics tends.
fn selected(
    start: &HiddenStart,
    found: &[Continuation],
    incoming: &Incoming,
    kappa: &[f64],
    patience: Patience,
) -> Result<Resolution, Undecided> {
    let (m, is_start) = (start.fields.m(), *incoming == Incoming::Start);
    let is_lost = |outcome: &Outcome| {
        let limit = outcome.continuation();
        m <= 2 && !outcome.oscillates() && limit.is_ok_and(|limit| !found.contains(&limit))
    };
    let from = |u: &[f64]| limit_within(&start.fields, u, kappa, patience);
    let mut outcome = from(&start.state);
    // u = 0 may be at rest in some directions, or on the border of two basins.
    if is_start && is_lost(&outcome) && !found.is_empty() {
        outcome = from(&vec![UNSTABLE_START; m]);
    }
    let chosen = match (outcome.continuation(), found.last()) {
        // Fields in balance: as good as any other is the last one, that of the most entries +1.
        (Err(Undecided::AtRest), Some(last)) if is_start => last.clone(),
        (chosen, _) => chosen?,
    };
    let mut resolution = Resolution::sure(outcome.leaf(), chosen);
    resolution.degenerate = !is_start && is_lost(&outcome);
    resolution.oscillates = outcome.oscillates();
    if let Outcome::Sliding { multipliers, .. } = outcome {
        resolution.multipliers = multipliers;
    }
    if !incoming.is_followed() {
        resolution.add_candidates(found);
    }
    resolution.unique = resolution.candidates.len() == 1;
    Ok(resolution)
}

/// Adds the multipliers of the chosen mode, and whether the regularised motion oscillates in it. Those that were listed for
/// these very fields are known to rounding where they have a closed form.
fn complete(
    resolution: &mut Resolution,
    is_of_these_fields: bool,
    fields: &NormalFields,
    kappa: &[f64],
    patience: Patience,
) {
    let Some(mode) = resolution.mode().filter(|mode| mode.codimension() > 0) else {
        return;
    };
    let is_polished = is_of_these_fields && resolution.leaf == ONLY && fields.m() <= 2;
    if is_polished && mode.codimension() == 1 {
        return;
    }
    let face = fields.restrict(mode.entries());
    let known = &resolution.multipliers;
    let root = match known.len() == face.m() {
        true if is_polished => Some(known.clone()),
        true => newton(&face, known).or_else(|| Some(known.clone())),
        false => stable_roots_within(&face, patience).into_iter().next(),
    };
    let Some(root) = root else {
        return;
    };
    let free = kappa.iter().zip(mode.entries()).filter(|(_, &k)| k == 0);
    let free: Vec<f64> = free.map(|(&kappa, _)| kappa).collect();
    resolution.oscillates |= !is_stable_for(&face.jacobian(&root), &free);
    resolution.multipliers = root;
}

/// The smallest normal component as a fraction of the largest one of its surface: of all patterns, or of the ends
/// of its range where there are too many of them.
fn smallest_component(fields: &NormalFields) -> f64 {
    let m = fields.m();
    let relative = |j: usize, v: f64| v.abs() / fields.row_size(j);
    // A surface to which all fields are tangent gives NaN, which counts as doubtful.
    let smaller = |least: f64, v: f64| {
        if v < least {
            v
        } else if v.is_nan() {
            0.0
        } else {
            least
        }
    };
    if m > MOST_MEETING {
        let ends = (0..m).flat_map(|j| fields.row_range(j).map(|v| relative(j, v)));
        return ends.fold(f64::INFINITY, smaller);
    }
    let values = fields.values();
    let values = values.iter().enumerate();
    values
        .map(|(i, v)| relative(i % m, *v))
        .fold(f64::INFINITY, smaller)
}

/// The fields moved by up to twice the doubtful amount in four directions and their opposites. The
/// directions are fractional parts of multiples of square roots: without any relation that could
/// keep a tie.
fn perturbations(fields: &NormalFields) -> impl Iterator<Item = NormalFields> + '_ {
    let roots = [2.0_f64, 3.0, 5.0, 7.0].map(f64::sqrt);
    let directions = roots
        .into_iter()
        .flat_map(|root| [(root, 1.0), (root, -1.0)]);
    let sizes: Vec<f64> = (0..fields.m()).map(|j| fields.row_size(j)).collect();
    directions.map(move |(root, sign)| {
        let mut count = 0;
        fields.map(|_, _, j, value| {
            count += 1;
            let direction = 2.0 * (root * f64::from(count)).fract() - 1.0;
            value + 2.0 * DOUBTFUL * sign * direction * sizes[j]
        })
    })
}
