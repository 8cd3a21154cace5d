//! Intersections of surfaces in parts that do not know of each other: each part is decided alone.
//!
//! Where the field is a sum over groups of signs, a group acts on the rates of some surfaces. Surfaces that no group
//! connects, directly or through others, have hidden dynamics of their own, so that the decision costs the sum over
//! the parts, and two surfaces among many still have their trees.

use super::incoming::{ExitKind, Incoming};
use super::resolution::{Continuation, Resolution};
use super::resolve::resolve_within;
use crate::cube::stability_margins;
use crate::cube::{newton, stable_roots_within};
use crate::cube::{NormalFields, SignGroup};
use crate::error::Undecided;
use crate::mode::Mode;
use crate::patience::Patience;
use crate::tolerances::{AT_SIDE, EPS, MOST_COMBINED};

/// The surfaces in parts that do not know of each other, each increasing.
pub fn independent_parts(fields: &NormalFields) -> Vec<Vec<usize>> {
    let m = fields.m();
    // The part of each surface, named by one of its members.
    let mut name: Vec<usize> = (0..m).collect();
    let mut join = |i: usize, j: usize| {
        let (kept, lost) = (name[i], name[j]);
        name.iter_mut()
            .filter(|name| **name == lost)
            .for_each(|name| *name = kept);
    };
    let sizes: Vec<f64> = (0..m).map(|j| fields.row_size(j)).collect();
    for group in fields.groups() {
        let first = group.members[0];
        group.members.iter().for_each(|&i| join(first, i));
        for (j, size) in sizes.iter().enumerate() {
            let values = || group.values.iter().skip(j).step_by(m);
            let low = values().fold(f64::INFINITY, |low, &v| low.min(v));
            let high = values().fold(f64::NEG_INFINITY, |high, &v| high.max(v));
            // What varies by rounding only says nothing.
            if high - low > 16.0 * EPS * size {
                join(first, j);
            }
        }
    }
    let leads = |i: &usize| (0..*i).all(|j| name[j] != name[*i]);
    let part = |i: usize| (0..m).filter(|&j| name[j] == name[i]).collect();
    (0..m).filter(leads).map(part).collect()
}

/// The normal components of one of the [`independent_parts`].
pub fn of_part(fields: &NormalFields, part: &[usize]) -> NormalFields {
    let m = fields.m();
    let mut held = vec![0.0; part.len()];
    let mut groups = Vec::new();
    for group in fields.groups() {
        if part.binary_search(&group.members[0]).is_err() {
            let at = group.at(0, m);
            held.iter_mut().zip(part).for_each(|(h, &j)| *h += at[j]);
            continue;
        }
        let rows = group.values.chunks_exact(m);
        groups.push(SignGroup {
            members: group
                .members
                .iter()
                .filter_map(|i| part.binary_search(i).ok())
                .collect(),
            values: rows.flat_map(|row| part.iter().map(|&j| row[j])).collect(),
        });
    }
    fields.with_groups(part.len(), groups).shifted(&held)
}

/// The decision at an intersection in several parts: those of the parts together.
///
/// # Errors
/// If that of a part is undecided.
pub(super) fn resolve_parts(
    fields: &NormalFields,
    parts: &[Vec<usize>],
    incoming: &Incoming,
    kappa: &[f64],
    patience: Patience,
) -> Result<Resolution, Undecided> {
    let mut decided = Vec::with_capacity(parts.len());
    for (index, part) in parts.iter().enumerate() {
        let own = of_part(fields, part);
        let scaling: Vec<f64> = part.iter().map(|&i| kappa[i]).collect();
        let resolution = match incoming_of(fields, parts, index, incoming) {
            Some(incoming) => resolve_within(&own, &incoming, &scaling, patience)
                .map_err(|error| error.in_whole(part))?,
            None => unchanged(&own, incoming, part, patience)?,
        };
        decided.push(resolution);
    }
    joined(fields.m(), parts, &decided).ok_or(Undecided::NoOutcome)
}

/// How the motion comes to one part; `None` if it slides on in it.
fn incoming_of(
    fields: &NormalFields,
    parts: &[Vec<usize>],
    index: usize,
    incoming: &Incoming,
) -> Option<Incoming> {
    let part = &parts[index];
    let entries = |mode: &[i8]| -> Vec<i8> { part.iter().map(|&i| mode[i]).collect() };
    match incoming {
        Incoming::Start => Some(Incoming::Start),
        Incoming::Corner { region } => Some(Incoming::Corner {
            region: entries(region),
        }),
        Incoming::Face { mode, .. } => {
            let own = entries(mode);
            if own.iter().all(|&k| k == 0) {
                None
            } else if own.contains(&0) {
                let multipliers = own_multipliers(incoming, part);
                Some(Incoming::Face {
                    mode: own,
                    multipliers,
                })
            } else {
                Some(Incoming::Corner { region: own })
            }
        }
        Incoming::Exit {
            kind,
            lambda,
            drift,
        } => leaves(fields, parts, index, *kind, lambda).then(|| Incoming::Exit {
            kind: *kind,
            lambda: part.iter().map(|&i| lambda[i]).collect(),
            drift: drift
                .as_ref()
                .map(|drift| part.iter().map(|&i| drift[i]).collect()),
        }),
    }
}

/// The multipliers of the motion before in one part; none if they are not known.
fn own_multipliers(incoming: &Incoming, part: &[usize]) -> Vec<f64> {
    match incoming {
        Incoming::Exit { lambda, .. } => part.iter().map(|&i| lambda[i]).collect(),
        Incoming::Face { mode, multipliers } => {
            let slid: Vec<usize> = (0..mode.len()).filter(|&i| mode[i] == 0).collect();
            let known = slid.iter().zip(multipliers);
            let own = known.filter(|(i, _)| part.binary_search(i).is_ok());
            own.map(|(_, &lambda)| lambda).collect()
        }
        _ => Vec::new(),
    }
}

/// Is it this part whose root is lost? At a side each part with a multiplier there, else the one that is nearest
/// to its end.
fn leaves(
    fields: &NormalFields,
    parts: &[Vec<usize>],
    index: usize,
    kind: ExitKind,
    lambda: &[f64],
) -> bool {
    let margin = |part: &[usize]| {
        let own = of_part(fields, part);
        let at: Vec<f64> = part.iter().map(|&i| lambda[i]).collect();
        let unit: Vec<f64> = (0..part.len()).map(|j| 1.0 / own.row_size(j)).collect();
        let [fold, stability] = stability_margins(&own.jacobian(&at).with_rows_scaled(&unit), true);
        match kind {
            ExitKind::Fold => fold,
            _ if part.len() > 1 => stability,
            _ => f64::INFINITY,
        }
    };
    match kind {
        ExitKind::Side => parts[index]
            .iter()
            .any(|&i| lambda[i].abs() >= 1.0 - AT_SIDE),
        _ => {
            let own = margin(&parts[index]);
            parts.iter().all(|other| own <= margin(other))
        }
    }
}

/// A part in which the motion slides on.
fn unchanged(
    own: &NormalFields,
    incoming: &Incoming,
    part: &[usize],
    patience: Patience,
) -> Result<Resolution, Undecided> {
    let multipliers = own_multipliers(incoming, part);
    let start = match multipliers.len() == own.m() {
        true => newton(own, &multipliers),
        false => stable_roots_within(own, patience).into_iter().next(),
    };
    let chosen = Continuation::mode(&vec![0; own.m()]);
    let mut resolution = Resolution::sure("", chosen);
    resolution.multipliers = start.ok_or(Undecided::NoOutcome)?;
    Ok(resolution)
}

/// The decisions of all parts as one. Of many combinations of candidates those are listed that differ from the
/// chosen one in a single part. `None` if the motion spirals in one part: around two of more surfaces.
fn joined(m: usize, parts: &[Vec<usize>], decided: &[Resolution]) -> Option<Resolution> {
    let chosen: Vec<&Continuation> = decided.iter().map(|d| &d.chosen).collect();
    let combine = |picked: &[&Continuation]| -> Option<Continuation> {
        let mut entries = vec![0; m];
        for (part, continuation) in parts.iter().zip(picked) {
            let mode = continuation.as_mode()?;
            for (&i, &entry) in part.iter().zip(mode.entries()) {
                entries[i] = entry;
            }
        }
        Some(Continuation::Mode(Mode::new(entries)))
    };
    let count: f64 = decided.iter().map(|d| d.candidates.len() as f64).product();
    let mut picked = vec![chosen.clone()];
    for (index, resolution) in decided.iter().enumerate() {
        let bases = if count <= MOST_COMBINED as f64 {
            picked.clone()
        } else {
            vec![chosen.clone()]
        };
        for base in bases {
            for candidate in &resolution.candidates {
                let mut other = base.clone();
                other[index] = candidate;
                if !picked.contains(&other) {
                    picked.push(other);
                }
            }
        }
    }
    let leading = decided.iter().find(|d| !d.leaf.is_empty());
    let leaf = leading.map_or("hidden/sliding", |d| d.leaf);
    let mut whole = Resolution::sure(leaf, combine(&chosen)?);
    whole.unique = decided.iter().all(|d| d.unique);
    whole.add_candidates(&picked.iter().filter_map(|p| combine(p)).collect::<Vec<_>>());
    whole.oscillates = decided.iter().any(|d| d.oscillates);
    whole.degenerate = decided.iter().any(|d| d.degenerate);
    whole.n_motions = decided.iter().map(|d| d.n_motions).sum();
    whole.margin = decided
        .iter()
        .fold(f64::INFINITY, |least, d| d.margin.min(least));
    let mut multipliers = vec![None; m];
    for (part, resolution) in parts.iter().zip(decided) {
        let mode = resolution.mode().map_or(&[][..], Mode::entries);
        let slid = part.iter().zip(mode).filter(|(_, &entry)| entry == 0);
        for ((&i, _), &lambda) in slid.zip(&resolution.multipliers) {
            multipliers[i] = Some(lambda);
        }
    }
    whole.multipliers = multipliers.into_iter().flatten().collect();
    Some(whole)
}
