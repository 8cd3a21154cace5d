//! How a motion comes to an intersection, and where its hidden dynamics starts.

use std::borrow::Cow;

use smallvec::SmallVec;

use crate::cube::NormalFields;
use crate::cube::{merged_root, multiplier_rates, newton, stable_roots_within, zero_between};
use crate::error::Undecided;
use crate::patience::Patience;
use crate::tolerances::{AFTER_THE_EXIT, UNSTABLE_START};

/// What the motion did before.
#[derive(Clone, Debug, PartialEq)]
pub enum Incoming {
    /// It was in this region, and reached all surfaces at once.
    Corner {
        /// The region.
        region: Vec<i8>,
    },
    /// It slid on the surfaces with a zero entry, and reached the others from the sides of their
    /// entries.
    Face {
        /// The mode.
        mode: Vec<i8>,
        /// lambda of the surfaces slid on, in their order; may be left empty if there is only one
        /// stable root.
        multipliers: Vec<f64>,
    },
    /// It slid on all surfaces, and cannot go on so.
    Exit {
        /// What happened to the root.
        kind: ExitKind,
        /// The root.
        lambda: Vec<f64>,
        /// The rate at which g changes with time at fixed lambda. For two surfaces it serves where stability is
        /// lost; more surfaces need it.
        drift: Option<Vec<f64>>,
    },
    /// The run starts here.
    Start,
}

/// What happened to the root of sliding on all surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExitKind {
    /// It leaves the cube: type (a).
    Side,
    /// It meets another root: type (b).
    Fold,
    /// It is no longer stable for any scaling: type (c).
    Stability,
}

/// The state from which the hidden dynamics starts, and the fields in which it moves.
pub(super) struct HiddenStart<'a> {
    pub fields: Cow<'a, NormalFields>,
    pub state: Vec<f64>,
}

impl Incoming {
    /// Does the hidden dynamics follow the root that is lost? Where sliding on all surfaces ends at a side or at a fold it
    /// tends to the same continuation for every scaling for which the root was stable before (proved for two surfaces): other
    /// attracting ones are no candidates.
    pub(super) fn is_followed(&self) -> bool {
        matches!(self, Incoming::Exit { kind, .. } if *kind != ExitKind::Stability)
    }

    /// Where the hidden dynamics starts.
    ///
    /// | before | state |
    /// |---|---|
    /// | region k | on the line u = tau f^k, where it leaves the corner |
    /// | face | (lambda, e): e the sides from which the other surfaces are reached |
    /// | exit | the root, in fields that have drifted a little |
    /// | start | u = 0 |
    pub(super) fn hidden_start<'a>(
        &self,
        fields: &'a NormalFields,
        kappa: &[f64],
        patience: Patience,
    ) -> Result<HiddenStart<'a>, Undecided> {
        let state = match self {
            Incoming::Corner { region } => corner_state(fields, region, kappa)?,
            Incoming::Face { mode, multipliers } => {
                let multipliers = polished(fields, mode, multipliers, patience)?;
                face_state(fields, mode, &multipliers)?
            }
            Incoming::Exit {
                kind,
                lambda,
                drift,
            } => {
                let drift = drift.as_deref();
                let (moved, state) = match fields.m() > 2 {
                    true => exit_state(fields, *kind, lambda, drift)?,
                    false => where_unstable(fields, lambda, drift),
                };
                return Ok(HiddenStart {
                    fields: Cow::Owned(moved),
                    state,
                });
            }
            Incoming::Start => vec![0.0; fields.m()],
        };
        Ok(HiddenStart {
            fields: Cow::Borrowed(fields),
            state,
        })
    }
}

fn corner_state(
    fields: &NormalFields,
    region: &[i8],
    kappa: &[f64],
) -> Result<Vec<f64>, Undecided> {
    let components = fields.in_region(region);
    let f = components.iter().zip(kappa).map(|(f, k)| f * k);
    let speeds: Vec<f64> = region
        .iter()
        .zip(f)
        .map(|(&k, f)| -f64::from(k) * f)
        .collect();
    if let Some(surface) = speeds.iter().position(|&v| v <= 0.0) {
        return Err(Undecided::NotArriving { surface });
    }
    let slowest = speeds.iter().copied().fold(f64::INFINITY, f64::min);
    let pairs = speeds.iter().zip(region);
    Ok(pairs.map(|(v, &k)| f64::from(k) * v / slowest).collect())
}

fn face_state(
    fields: &NormalFields,
    mode: &[i8],
    multipliers: &[f64],
) -> Result<Vec<f64>, Undecided> {
    let state = with_multipliers(mode, multipliers);
    let g = fields.interpolate(&state);
    let surface = match mode.iter().all(|&k| k == 0) {
        true => Some(0),
        false => (0..mode.len()).find(|&i| mode[i] != 0 && state[i] * g[i] >= 0.0),
    };
    surface.map_or(Ok(state), |surface| Err(Undecided::NotArriving { surface }))
}

/// The multipliers of all surfaces: those of the surfaces slid on in their order, and the sides of the others.
pub(super) fn with_multipliers(mode: &[i8], multipliers: &[f64]) -> Vec<f64> {
    let mut next = multipliers.iter();
    let value = |&k: &i8| match k {
        0 => next.next().copied(),
        side => Some(f64::from(side)),
    };
    mode.iter().filter_map(value).collect()
}

fn polished(
    fields: &NormalFields,
    mode: &[i8],
    multipliers: &[f64],
    patience: Patience,
) -> Result<Vec<f64>, Undecided> {
    let slid_on: SmallVec<[usize; 4]> = (0..mode.len()).filter(|&i| mode[i] == 0).collect();
    let not_sliding = Undecided::NotArriving {
        surface: slid_on.first().copied().unwrap_or(0),
    };
    let is_known = multipliers.len() == slid_on.len();
    let root = match slid_on[..] {
        [i] if is_known => {
            let [below, above] = fields.on_both_sides(mode, i);
            let root = zero_between(below[i], above[i]);
            root.is_finite().then(|| vec![root])
        }
        _ if is_known => newton(&fields.restrict(mode), multipliers),
        _ => {
            let roots = stable_roots_within(&fields.restrict(mode), patience);
            roots.into_iter().next()
        }
    };
    root.ok_or(not_sliding)
}

/// Two surfaces whose root is stable for no scaling any more: fields moved so that no diagonal entry of G is negative, and a
/// state beside the root, in the direction in which it moves.
fn where_unstable(
    fields: &NormalFields,
    lambda: &[f64],
    drift: Option<&[f64]>,
) -> (NormalFields, Vec<f64>) {
    let jacobian = fields.jacobian(lambda);
    let slopes: Vec<f64> = (0..2)
        .map(|j| (AFTER_THE_EXIT * fields.row_size(j) - jacobian[(j, j)]).max(0.0))
        .collect();
    let moved = fields.map(|_, pattern, j, value| {
        let side = if pattern >> j & 1 == 1 { 1.0 } else { -1.0 };
        value + slopes[j] * (side - lambda[j])
    });
    (moved, beside(fields, lambda, drift))
}

/// Three and more surfaces: the root itself, in fields that have drifted for a short time. Where two roots meet, in fields that
/// have been moved to the point where they do; where stability is lost, a little beside it.
fn exit_state(
    fields: &NormalFields,
    kind: ExitKind,
    lambda: &[f64],
    drift: Option<&[f64]>,
) -> Result<(NormalFields, Vec<f64>), Undecided> {
    let drift = drift.ok_or(Undecided::NoDrift { m: fields.m() })?;
    let largest = drift.iter().fold(0.0_f64, |m, d| m.max(d.abs()));
    let factor = match kind {
        // Stability may be lost while the normal components at the root stay zero.
        ExitKind::Stability if largest == 0.0 => 0.0,
        _ => AFTER_THE_EXIT * fields.size() / largest,
    };
    if !factor.is_finite() {
        return Err(Undecided::NoDrift { m: fields.m() });
    }
    let mut shift: Vec<f64> = drift.iter().map(|d| factor * d).collect();
    let state = match kind {
        ExitKind::Fold => {
            let merged = merged_root(fields, lambda).ok_or(Undecided::NotAnExit)?;
            let pairs = shift.iter_mut().zip(&merged.residual);
            pairs.for_each(|(shift, g)| *shift -= g);
            merged.lambda
        }
        ExitKind::Stability => beside(fields, lambda, Some(drift)),
        ExitKind::Side => lambda.to_vec(),
    };
    Ok((fields.shifted(&shift), state))
}

/// The root, displaced in the direction in which it moves; along the diagonal if that is not known.
fn beside(fields: &NormalFields, lambda: &[f64], drift: Option<&[f64]>) -> Vec<f64> {
    let rates = drift.and_then(|drift| multiplier_rates(fields, lambda, drift));
    let rates = rates.filter(|rates| rates.iter().any(|&r| r != 0.0));
    let direction = rates.unwrap_or_else(|| vec![1.0; lambda.len()]);
    displaced(lambda, &direction)
}

/// A point beside a root in the cube, away from the border.
fn displaced(lambda: &[f64], direction: &[f64]) -> Vec<f64> {
    let size = |v: &[f64]| v.iter().fold(0.0_f64, |size, v| size.max(v.abs()));
    let length = UNSTABLE_START.min(0.5 * (1.0 - size(lambda))) / size(direction);
    let pairs = lambda.iter().zip(direction);
    pairs.map(|(l, d)| l + length * d).collect()
}
