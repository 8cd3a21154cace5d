//! The decision at an intersection, whatever came before and however many surfaces meet.

use super::hidden::{attracting, limit_within, Outcome};
use super::incoming::{ExitKind, Incoming};
use super::parts::{independent_parts, resolve_parts};
use super::resolution::{Continuation, Resolution};
use crate::cube::Bilinear;
use crate::cube::NormalFields;
use crate::cube::{is_negative_p_matrix, is_stable_for};
use crate::cube::{newton, stable_roots_within};
use crate::error::Undecided;
use crate::patience::Patience;
use crate::tolerances::{
    AFTER_THE_EXIT, DOUBTFUL, MOST_MEETING, MOST_SCALED_SINGLY, UNSTABLE_START,
};

/// Decides what follows at an intersection of m surfaces, scaled by `kappa`.
///
/// Of one and two surfaces, and at a start, all attracting continuations are listed: a single one follows. Among
/// several, and for three and more surfaces, the hidden dynamics at `kappa` selects. If a quantity whose sign decided is doubtful (`tolerances/`), the decision is
/// repeated with perturbed fields: if they agree, theirs counts, and if not,
/// [`Resolution::degenerate`] says so. Surfaces in parts that do not know of each other are decided part by part.
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
    let parts = independent_parts(fields);
    if parts.len() > 1 && fields.m() > 2 {
        return resolve_parts(fields, &parts, incoming, kappa, patience);
    }
    let resolution = match decide(fields, incoming, kappa, patience) {
        Ok(doubtful) if doubtful.margin <= DOUBTFUL => {
            Ok(in_doubt(doubtful, fields, incoming, kappa, patience))
        }
        resolution => resolution,
    };
    match patience.is_over() {
        true => Err(Undecided::Interrupted),
        false => resolution,
    }
}

/// The decision for fields next to these. If all of them agree, theirs counts: a tie, as between
/// surfaces that do not know of each other, is then no obstacle. Otherwise the decision is
/// degenerate.
fn in_doubt(
    mut resolution: Resolution,
    fields: &NormalFields,
    incoming: &Incoming,
    kappa: &[f64],
    patience: Patience,
) -> Resolution {
    let perturbed = perturbations(fields).map(|other| decide(&other, incoming, kappa, patience));
    let others: Vec<Result<Resolution, Undecided>> = perturbed.collect();
    let agreed: Vec<&Resolution> = others.iter().flatten().collect();
    let agree = agreed.len() == others.len() && agreed.iter().all(|o| o.chosen == agreed[0].chosen);
    let margin = resolution.margin;
    let n_motions =
        agreed.iter().map(|other| other.n_motions).sum::<usize>() + resolution.n_motions;
    if agree {
        resolution = agreed[0].clone();
        resolution.margin = margin;
    }
    resolution.n_motions = n_motions;
    for other in agreed {
        resolution.add_candidates(&other.candidates);
    }
    resolution.degenerate |= !agree;
    resolution.unique &= resolution.candidates.len() == 1 && !resolution.degenerate;
    complete(&mut resolution, fields, kappa, patience);
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

fn decide(
    fields: &NormalFields,
    incoming: &Incoming,
    kappa: &[f64],
    patience: Patience,
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
    let mut resolution = match incoming {
        Incoming::Start if m <= MOST_MEETING => among_attracting(fields, incoming, kappa, patience),
        _ if m <= 2 => among_attracting(fields, incoming, kappa, patience),
        // Not all 3^m modes can be looked at.
        _ => by_trial(fields, incoming, kappa, patience),
    }?;
    complete(&mut resolution, fields, kappa, patience);
    Ok(resolution)
}

/// The only attracting continuation, or that of several to which the hidden dynamics tends.
///
/// Where sliding on both of two surfaces ends at a side or at a fold, it tends to the same one for every scaling for which the
/// root was stable before: the others are no candidates.
fn among_attracting(
    fields: &NormalFields,
    incoming: &Incoming,
    kappa: &[f64],
    patience: Patience,
) -> Result<Resolution, Undecided> {
    let is_start = *incoming == Incoming::Start;
    let starts = incoming.starts(fields, kappa, patience)?;
    let (found, margin) = attracting(&starts.fields, patience);
    let mut resolution = if let [only] = found.as_slice() {
        let mut resolution = Resolution::sure("only", only.continuation.clone());
        if fields.m() > 2 {
            resolution.multipliers.clone_from(&only.multipliers);
        }
        resolution
    } else {
        let found: Vec<Continuation> = found.into_iter().map(|one| one.continuation).collect();
        let from = |u: &[f64]| limit_within(&starts.fields, u, kappa, patience);
        let is_lost = |outcome: &Outcome| {
            continuation(outcome).is_ok_and(|limit| !oscillates(outcome) && !found.contains(&limit))
        };
        let mut outcome = from(&starts.states[0]);
        // u = 0 may be at rest in some directions, or on the border of two basins.
        if is_start && is_lost(&outcome) && !found.is_empty() {
            outcome = from(&vec![UNSTABLE_START; fields.m()]);
        }
        let chosen = match (continuation(&outcome), found.last()) {
            // Fields in balance: as good as any other is the last one, that of the most entries +1.
            (Err(Undecided::AtRest), Some(last)) if is_start => last.clone(),
            (chosen, _) => chosen?,
        };
        let mut resolution = Resolution::sure(leaf_of(&outcome), chosen);
        resolution.degenerate = !is_start && is_lost(&outcome);
        resolution.oscillates = oscillates(&outcome);
        resolution.n_motions = 1;
        let kind = match incoming {
            Incoming::Exit { kind, .. } => Some(*kind),
            _ => None,
        };
        if !matches!(kind, Some(ExitKind::Side | ExitKind::Fold)) {
            resolution.add_candidates(&found);
        }
        resolution.unique = resolution.candidates.len() == 1;
        resolution
    };
    // A mode that is left at no speed at first is none in which a motion starts.
    resolution.margin = match is_start {
        true => smallest_component(fields),
        false => margin,
    };
    Ok(resolution)
}

/// The hidden dynamics from all start states and for several scalings; the first of each decides.
fn by_trial(
    fields: &NormalFields,
    incoming: &Incoming,
    kappa: &[f64],
    patience: Patience,
) -> Result<Resolution, Undecided> {
    let scalings = comparable_scalings(fields, incoming, kappa);
    let starts = incoming.starts(fields, &scalings[0], patience)?;
    let outcome = limit_within(&starts.fields, &starts.states[0], &scalings[0], patience);
    let chosen = continuation(&outcome)?;
    let mut resolution = Resolution::sure(leaf_of(&outcome), chosen.clone());
    resolution.oscillates = oscillates(&outcome);
    resolution.margin = smallest_component(fields);
    resolution.n_motions = 1;
    if let Outcome::Sliding { multipliers, .. } = outcome {
        resolution.multipliers = multipliers;
    }
    if has_one_mode_only(fields) && !resolution.oscillates {
        return Ok(resolution);
    }
    // Other offsets with the scaling asked for, other scalings without an offset.
    let offsets = starts.states.iter().map(|state| (state, &scalings[0]));
    let scaled = scalings.iter().map(|kappa| (&starts.states[0], kappa));
    let others = offsets.chain(scaled.skip(1));
    let others = others.map(|(state, kappa)| limit_within(&starts.fields, state, kappa, patience));
    for other in others.skip(1) {
        resolution.n_motions += 1;
        match continuation(&other) {
            Ok(other) => resolution.add_candidates(&[other]),
            Err(_) => resolution.unique = false,
        }
    }
    // Without a past many more modes are possible than the trial looks at.
    resolution.unique &= resolution.candidates.len() == 1 && *incoming != Incoming::Start;
    Ok(resolution)
}

/// Adds the multipliers of the chosen mode, and whether the regularised motion oscillates in it.
fn complete(resolution: &mut Resolution, fields: &NormalFields, kappa: &[f64], patience: Patience) {
    let Some(mode) = resolution.mode() else {
        return;
    };
    let face = fields.restrict(mode.entries());
    let both = || {
        Bilinear::of_fields(&face)
            .root()
            .map(|root| root.point.to_vec())
    };
    let root = match face.m() {
        0 => None,
        _ if resolution.multipliers.len() == face.m() => {
            let known = &resolution.multipliers;
            newton(&face, known).or_else(|| Some(known.clone()))
        }
        2 => both(),
        _ => stable_roots_within(&face, patience).into_iter().next(),
    };
    let Some(root) = root else {
        return;
    };
    let free = kappa.iter().zip(mode.entries()).filter(|(_, &k)| k == 0);
    let free: Vec<f64> = free.map(|(&kappa, _)| kappa).collect();
    resolution.oscillates |= !is_stable_for(&face.jacobian(&root), &free);
    resolution.multipliers = root;
}

fn continuation(outcome: &Outcome) -> Result<Continuation, Undecided> {
    match outcome {
        Outcome::Region(mode) => Ok(Continuation::Mode(mode.clone())),
        Outcome::Sliding {
            mode, multipliers, ..
        } if !multipliers.is_empty() => Ok(Continuation::Mode(mode.clone())),
        Outcome::Sliding { .. } => Err(Undecided::Cycle),
        Outcome::Unknown => Err(Undecided::NoOutcome),
        Outcome::OutwardSpiral { .. } => Ok(Continuation::OutwardSpiral),
        Outcome::AtRest => Err(Undecided::AtRest),
    }
}

fn oscillates(outcome: &Outcome) -> bool {
    matches!(
        outcome,
        Outcome::Sliding {
            oscillates: true,
            ..
        }
    )
}

fn leaf_of(outcome: &Outcome) -> &'static str {
    match outcome {
        Outcome::Region(_) => "hidden/classical",
        Outcome::Sliding {
            oscillates: true, ..
        } => "hidden/oscillation",
        Outcome::Sliding { .. } => "hidden/sliding",
        Outcome::OutwardSpiral { .. } => "hidden/spiral",
        Outcome::AtRest | Outcome::Unknown => "hidden/unknown",
    }
}

/// Is there exactly one consistent mode, by the constant matrix G of affine fields?
pub fn has_one_mode_only(fields: &NormalFields) -> bool {
    fields.is_affine() && is_negative_p_matrix(&fields.jacobian(&vec![0.0; fields.m()]))
}

/// The scalings to compare. After an exit only those count for which the root was stable before.
fn comparable_scalings(fields: &NormalFields, incoming: &Incoming, kappa: &[f64]) -> Vec<Vec<f64>> {
    let mut scalings = scalings(kappa);
    if let Incoming::Exit { kind, lambda, .. } = incoming {
        if *kind != ExitKind::Stability {
            let mut jacobian = fields.jacobian(lambda);
            for i in 0..lambda.len() {
                // At a fold one eigenvalue vanishes.
                jacobian[(i, i)] -= AFTER_THE_EXIT * fields.size();
            }
            let others = scalings.split_off(1);
            let stable = others
                .into_iter()
                .filter(|kappa| is_stable_for(&jacobian, kappa));
            scalings.extend(stable);
        }
    }
    scalings
}

/// The scaling itself, each surface ten times larger and smaller, and all in rising and falling order.
fn scalings(kappa: &[f64]) -> Vec<Vec<f64>> {
    let m = kappa.len();
    let changed = |factor: &dyn Fn(usize) -> f64| -> Vec<f64> {
        kappa
            .iter()
            .enumerate()
            .map(|(i, k)| factor(i) * k)
            .collect()
    };
    let mut scalings = vec![kappa.to_vec()];
    let singly = if m <= MOST_SCALED_SINGLY { m } else { 0 };
    for j in 0..singly {
        for factor in [0.1, 10.0] {
            scalings.push(changed(&|i| if i == j { factor } else { 1.0 }));
        }
    }
    let factor = |i: usize| 3.0_f64.powf((i * m.min(6)) as f64 / m as f64);
    scalings.push(changed(&factor));
    scalings.push(changed(&|i| factor(m - i)));
    scalings
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
