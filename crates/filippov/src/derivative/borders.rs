//! Where a run begins, lands or ends at something that a changed run misses.

use super::extended::{Column, Extended};
use super::forms::add;
use super::piece::{Piece, Surroundings};
use super::weights::Weights;
use crate::error::FieldError;
use crate::motion::Guard;
use crate::record::InstantRecord;
use crate::system::{
    sides_of, Act, LieDerivatives, PiecewiseSystem, Setting, SignStructure, TracedSystem,
};
use crate::tolerances::{AT_SIDE, ROUNDING};
use crate::vectors::dot;

/// Why derivatives are those of one side: what the start or the end of a run coincides with.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Borders {
    /// Surfaces on which the run starts and at which the sides differ: derivatives by the start, and by parameters of these.
    pub starts_on: Vec<usize>,
    /// The first time at which an action finds the state on surfaces at which the sides differ, or puts it there, and these: all
    /// derivatives from there.
    pub lands_on: Option<(f64, Vec<usize>)>,
    /// The first time from which the multiplier of a surface slid on stays at its end: a changed run slides, or leaves the surface.
    pub stays_at_end: Option<f64>,
    /// An action at the initial time, which a run that begins later misses: derivatives by the initial time.
    pub starts_at_action: bool,
    /// A clock ticks at the initial time, before or after which the motion is another: derivatives by the start.
    pub starts_at_tick: bool,
    /// A law starts at one of its thresholds, beside which it has another value: derivatives by the start, and by parameters that
    /// move the threshold.
    pub starts_at_threshold: bool,
    /// The first time at which an action finds the state where its map jumps, or the derivative of that: all derivatives from there.
    pub acts_at_sides: Option<f64>,
    /// The last instant is at the end, and a changed run has it later, or is then beside a surface slid on: all derivatives there.
    pub ends_at_instant: bool,
}

impl Borders {
    /// Are derivatives those of both sides?
    pub fn is_empty(&self) -> bool {
        *self == Borders::default()
    }
}

/// Does an instant at the initial time, from which a run by these columns begins, do something that one which begins later misses?
pub(super) fn is_missed_later(
    extended: &Extended,
    record: &InstantRecord,
    start: f64,
    kinds: &[Column],
) -> bool {
    let mut acts = record.acts.iter();
    let changes = acts.any(|act| extended.moves(act.index)) || record.field[0] != record.field[1];
    record.t[0] == start && !record.acts.is_empty() && changes && kinds.contains(&Column::Start)
}

/// The surfaces on which actions put the state, and at which the sides differ for one of these columns behind the actions; `dt` are the
/// derivatives of their time, and `arrives` states that one of the columns was beside the surfaces slid on before it came to them.
pub(super) fn surfaces_landed_on(
    piece: &mut Piece,
    record: &InstantRecord,
    dt: &[f64],
    columns: &[Vec<f64>],
    arrives: bool,
) -> Result<Vec<usize>, FieldError> {
    if record.acts.is_empty() {
        return Ok(Vec::new());
    }
    let (t, field) = (record.t[1], record.field[1]);
    let z = piece.extended.state(record.x[1]);
    let moved = |(&dt, column): (&f64, &Vec<f64>)| Beside::moved(dt, column, field);
    let moved: Vec<Beside> = dt.iter().zip(columns).map(moved).collect();
    let mut found = surfaces_with_sides(piece, (t, &z), &moved)?.0;
    if arrives && slides_by_sides(piece, (t, &z))? {
        found.extend_from_slice(&piece.sliding);
        found.sort_unstable();
        found.dedup();
    }
    // What an action happens on is met by a changed run too; again, if the action puts it back behind its surface.
    let own = |act: &Act| piece.extended.surface_of(act.index);
    let own: Vec<usize> = record.acts.iter().filter_map(own).collect();
    let reached = |j: &usize| own.contains(j) || record.guards.contains(&Guard::Surface(*j));
    found.retain(|j| !reached(j));
    let h = piece.surfaces(t, &z)?;
    for j in own {
        let normal = normal_if_on(piece, (j, h[j]), (t, &z))?;
        if normal.is_some_and(|normal| moved.iter().any(|change| change.leads_off(&normal))) {
            found.push(j);
        }
    }
    Ok(found)
}

/// The surfaces on which the state is when actions are done at a known time, and at which the sides differ for one of these columns: a
/// changed run meets them before the actions or not; `dt` are the derivatives of the time.
pub(super) fn surfaces_at_action(
    piece: &mut Piece,
    record: &InstantRecord,
    dt: &[f64],
    columns: &[Vec<f64>],
) -> Result<Vec<usize>, FieldError> {
    if record.acts.is_empty() || !record.guards.is_empty() {
        return Ok(Vec::new());
    }
    let z = piece.extended.state(record.x[0]);
    let moved = |(&dt, column): (&f64, &Vec<f64>)| Beside::moved(dt, column, record.field[0]);
    let moved: Vec<Beside> = dt.iter().zip(columns).map(moved).collect();
    Ok(surfaces_with_sides(piece, (record.t[0], &z), &moved)?.0)
}

/// Does the map of the first action of an instant jump where the state is, or its derivative, and does one of these columns, whose
/// derivatives of the time are `dt`, lead off there?
pub(super) fn map_has_sides(
    extended: &Extended,
    record: &InstantRecord,
    dt: &[f64],
    columns: &[Vec<f64>],
    weights: &Weights,
) -> Result<bool, FieldError> {
    let Some(act) = record.acts.iter().find(|act| extended.moves(act.index)) else {
        return Ok(false);
    };
    let Some(map) = extended.maps[act.index].as_ref() else {
        return Ok(false);
    };
    let (t, z) = (record.t[0], extended.state(&act.x));
    let moved = |(&dt, column): (&f64, &Vec<f64>)| Beside::moved(dt, column, record.field[0]);
    let moved: Vec<Beside> = dt.iter().zip(columns).map(moved).collect();
    let system = map.expressions;
    let is_left = |normal: &[f64]| {
        let normal = (0.0, normal.to_vec());
        moved.iter().any(|change| change.leads_off(&normal))
    };
    let at = |signs: &[f64], z: &[f64]| map.with_signs((t, z), signs);
    let signs = sides_of(system, (t, &z), &[])?;
    has_sides((system, &[], 0), signs, (t, &z), (is_left, at), weights)
}

/// Does a function jump at a point across one of its surfaces, or its gradient, as far as the tolerance tells? `at` returns its values and
/// their gradients, for these signs and this state. Surfaces count from the place `first` on, if motions beside this one leave them.
pub(super) fn has_sides(
    (system, q, first): (&TracedSystem, &[f64], usize),
    mut signs: Vec<f64>,
    (t, z): (f64, &[f64]),
    (is_left, at): (
        impl Fn(&[f64]) -> bool,
        impl Fn(&[f64], &[f64]) -> Result<Vec<f64>, FieldError>,
    ),
    weights: &Weights,
) -> Result<bool, FieldError> {
    let mut h = vec![0.0; system.n_surfaces()];
    system.surfaces(&Setting::new(&signs, q).at(t, z), &mut h)?;
    for j in first..h.len() {
        let mut normal = vec![0.0; z.len()];
        system.gradient(j, &Setting::new(&signs, q).at(t, z), &mut normal)?;
        let error = weights.error(z, &normal);
        if h[j].abs() > error || !is_left(&normal) {
            continue;
        }
        // The values a part of the size of the states away from here tell how large they are by themselves.
        let mut away = z.to_vec();
        let factor = error / (weights.rtol * dot(&normal, &normal));
        add(&mut away, factor, &normal);
        let away = at(&signs, &away)?;
        let one = at(&signs, z)?;
        signs[j] = -signs[j];
        let other = at(&signs, z)?;
        signs[j] = -signs[j];
        let share = weights.rtol.max(AT_SIDE);
        let differ = |((one, other), away): ((&f64, &f64), &f64)| {
            (one - other).abs() > share * one.abs().max(away.abs())
        };
        if one.iter().zip(&other).zip(&away).any(differ) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// The derivatives of h_j by time and state, if a place is on the surface.
fn normal_if_on(
    piece: &Piece,
    (j, h): (usize, f64),
    (t, z): (f64, &[f64]),
) -> Result<Option<(f64, Vec<f64>)>, FieldError> {
    let size = piece.extended.system.surface_size(j, &piece.at(t, z))?;
    if h.abs() > ROUNDING * size {
        return Ok(None);
    }
    let mut normal = vec![0.0; z.len()];
    let by_time = piece.gradient(j, t, z, &mut normal)?;
    Ok(Some((by_time, normal)))
}

/// A change of time and state, with the sizes of what that of the state is the sum of.
struct Beside {
    time: f64,
    state: Vec<f64>,
    sizes: Vec<f64>,
}

impl Beside {
    /// The change of a column, and of the motion with this velocity over the change of time.
    fn moved(time: f64, column: &[f64], velocity: &[f64]) -> Self {
        let (mut state, mut sizes) = (column.to_vec(), column.to_vec());
        sizes.iter_mut().for_each(|size| *size = size.abs());
        for (i, rate) in velocity.iter().enumerate() {
            state[i] += rate * time;
            sizes[i] += (rate * time).abs();
        }
        Beside { time, state, sizes }
    }

    /// Does it lead off a surface with these derivatives?
    fn leads_off(&self, (by_time, normal): &(f64, Vec<f64>)) -> bool {
        let terms = normal.iter().zip(&self.sizes).map(|(g, v)| (g * v).abs());
        let size = (by_time * self.time).abs() + terms.sum::<f64>();
        (by_time * self.time + dot(normal, &self.state)).abs() > ROUNDING * size
    }
}

/// The surfaces through a start at which the sides differ for one of these columns, as they are before the motion acts on them, and
/// those at which they do not yet, and on which the motion stays.
pub(super) fn surfaces_at_start(
    piece: &mut Piece,
    at: (f64, &[f64]),
    kinds: &[Column],
    columns: &[Vec<f64>],
) -> Result<(Vec<usize>, Vec<usize>), FieldError> {
    let later = |kind: &Column| f64::from(*kind == Column::Start);
    let moved = kinds.iter().zip(columns);
    let moved: Vec<Beside> = moved
        .map(|(kind, column)| Beside::moved(later(kind), column, &[]))
        .collect();
    surfaces_with_sides(piece, at, &moved)
}

/// Does a multiplier of the surfaces slid on stay at its end from a place on, and change with one of these columns that have come to
/// the surfaces?
pub(super) fn stays_at_end(
    piece: &mut Piece,
    (t, z): (f64, &[f64]),
    columns: &[Vec<f64>],
) -> Result<bool, FieldError> {
    if piece.sliding.is_empty() || !piece.stays_at_an_end(t, z)? {
        return Ok(false);
    }
    for j in piece.sliding.clone() {
        let Some((_, slopes)) = piece.multiplier_slopes(j, t, z)? else {
            continue;
        };
        let changes = |column: &Vec<f64>| {
            let terms = slopes.iter().zip(column).map(|(s, v)| (s * v).abs());
            dot(&slopes, column).abs() > AT_SIDE * terms.sum::<f64>()
        };
        if piece.is_at_an_end(j) && columns.iter().any(changes) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// A surface on which a run stays by itself, as one at rest does, and the sides of it to which the columns lead: 0 if they were on it
/// so far.
pub(super) struct Kept {
    surface: usize,
    sides: Vec<f64>,
    /// Do the sides differ? On a kink they may do so later only.
    has_sides: bool,
}

impl Kept {
    /// Surfaces on which a run is at a place, with the sides to which these columns lead there.
    pub fn all(
        surfaces: &[usize],
        has_sides: bool,
        piece: &Piece,
        at: (f64, &[f64]),
        columns: &[Vec<f64>],
    ) -> Result<Vec<Kept>, FieldError> {
        let mut all = Vec::with_capacity(surfaces.len());
        for &surface in surfaces {
            let sides = vec![0.0; columns.len()];
            let mut kept = Kept {
                surface,
                sides,
                has_sides,
            };
            kept.is_crossed(piece, at, columns)?;
            all.push(kept);
        }
        Ok(all)
    }

    /// Quiet surfaces on which a run is, with one column that came to each of them.
    pub fn moved_off(surfaces: &[usize]) -> Vec<Kept> {
        let own = surfaces.iter().map(|&surface| Kept {
            surface,
            sides: vec![1.0],
            has_sides: false,
        });
        own.collect()
    }

    /// The surface, if its sides differ from here on for one of the columns.
    pub fn begins_to_differ(
        &mut self,
        piece: &Piece,
        (t, z): (f64, &[f64]),
    ) -> Result<Option<usize>, FieldError> {
        if self.has_sides || self.sides.iter().all(|side| *side == 0.0) {
            return Ok(None);
        }
        let mut normal = vec![0.0; z.len()];
        piece.gradient(self.surface, t, z, &mut normal)?;
        self.has_sides = bends_across(piece, self.surface, (t, z), &normal)?;
        Ok(self.has_sides.then_some(self.surface))
    }

    /// The surface, if what vanishes at an instant has a kink there: from then on its sides differ for the columns that came to them.
    pub fn bends_what_vanishes(
        &mut self,
        piece: &mut Piece,
        record: &InstantRecord,
    ) -> Result<Option<usize>, FieldError> {
        if self.has_sides || self.sides.iter().all(|side| *side == 0.0) {
            return Ok(None);
        }
        let z = piece.extended.state(record.x[0]);
        for guard in record.guards {
            let Guard::Surface(j) = *guard else {
                continue;
            };
            self.has_sides |= has_kink_on(piece, j, self.surface, (record.t[0], &z))?;
        }
        Ok(self.has_sides.then_some(self.surface))
    }

    /// Does the run stay on the surface at this place, in the same mode?
    pub fn holds(&self, piece: &Piece, t: f64, z: &[f64]) -> Result<bool, FieldError> {
        let place = piece.at(t, z);
        let size = piece.extended.system.surface_size(self.surface, &place)?;
        let h = piece.surfaces(t, z)?[self.surface];
        Ok(h.abs() <= ROUNDING * size && piece.mode.entries()[self.surface] != 0)
    }

    /// Does one of the columns come to the other side? A run beside this one crosses the surface then.
    pub fn is_crossed(
        &mut self,
        piece: &Piece,
        (t, z): (f64, &[f64]),
        columns: &[Vec<f64>],
    ) -> Result<bool, FieldError> {
        let mut normal = vec![0.0; z.len()];
        piece.gradient(self.surface, t, z, &mut normal)?;
        let mut is_crossed = false;
        for (side, column) in self.sides.iter_mut().zip(columns) {
            let terms = normal.iter().zip(column).map(|(g, v)| (g * v).abs());
            let (size, height) = (terms.sum::<f64>(), dot(&normal, column));
            if height.abs() > AT_SIDE * size {
                is_crossed |= height * *side < 0.0;
                *side = height.signum();
            }
        }
        Ok(is_crossed && self.has_sides)
    }
}

/// Does a motion come to the surfaces slid on by another way from each corner, or leave them on one side?
fn slides_by_sides(piece: &mut Piece, (t, z): (f64, &[f64])) -> Result<bool, FieldError> {
    Ok(!piece.sliding.is_empty() && (!piece.is_affine || piece.stays_at_an_end(t, z)?))
}

/// The surfaces through a place at which the sides differ, if one of these changes of its time and state moves it off them: surfaces
/// that the motion leaves where the field jumps, or does not leave where its derivative jumps; those that it slides on, if the way there
/// has sides, as across another one; and those at which another one of them has a kink. Behind them those that it does not leave and
/// that have no sides here.
fn surfaces_with_sides(
    piece: &mut Piece,
    (t, z): (f64, &[f64]),
    changes: &[Beside],
) -> Result<(Vec<usize>, Vec<usize>), FieldError> {
    let h = piece.surfaces(t, z)?;
    let field = piece.rates(t, z)?;
    let slides_by_sides = slides_by_sides(piece, (t, z))?;
    let (mut found, mut others, mut kept) = (Vec::new(), Vec::new(), Vec::new());
    for (j, h) in h.iter().enumerate() {
        let Some(normal) = normal_if_on(piece, (j, *h), (t, z))? else {
            continue;
        };
        if !changes.iter().any(|change| change.leads_off(&normal)) {
            continue;
        }
        let (by_time, normal) = normal;
        let has_sides = match piece.mode.entries()[j] {
            0 => piece.sliding.contains(&j) && slides_by_sides,
            _ => {
                let system = &piece.extended.system;
                let jumps = system.jumps_across(j, &piece.signs, &piece.sliding);
                let is_kept = !jumps && is_kept(piece, j, (t, z), (by_time, &normal), &field)?;
                let bends = is_kept && bends_across(piece, j, (t, z), &normal)?;
                kept.extend((is_kept && !bends).then_some(j));
                jumps || bends
            }
        };
        match has_sides {
            true => found.push(j),
            false => others.push(j),
        }
    }
    let mut all = found.clone();
    for k in others {
        // A place beside all of them comes to a surface slid on across the others, or not.
        if !found.is_empty() && piece.sliding.contains(&k) {
            all.push(k);
            continue;
        }
        for &j in &found {
            if has_kink_on(piece, j, k, (t, z))? {
                all.push(k);
                break;
            }
        }
    }
    // Places on both sides of a surface that the motion stays on come to a surface slid on that has a kink there.
    let mut still_kept = Vec::new();
    for k in kept {
        let mut has_kink = false;
        for j in piece.sliding.clone() {
            has_kink |= has_kink_on(piece, j, k, (t, z))?;
        }
        match has_kink {
            true => all.push(k),
            false => still_kept.push(k),
        }
    }
    all.sort_unstable();
    all.dedup();
    Ok((all, still_kept))
}

/// Does the function of surface `j` have a kink on surface `k` at a place?
fn has_kink_on(
    piece: &mut Piece,
    j: usize,
    k: usize,
    (t, z): (f64, &[f64]),
) -> Result<bool, FieldError> {
    let mut normals = [vec![0.0; z.len()], vec![0.0; z.len()]];
    for normal in &mut normals {
        piece.gradient(j, t, z, normal)?;
        piece.signs[k] = -piece.signs[k];
    }
    Ok(differ(&normals[0], &normals[1]))
}

/// Does a motion with this velocity stay on a surface, as far as the first two derivatives say?
fn is_kept(
    piece: &Piece,
    j: usize,
    (t, z): (f64, &[f64]),
    (by_time, normal): (f64, &[f64]),
    field: &[f64],
) -> Result<bool, FieldError> {
    let is_zero = |time: f64, gradient: &[f64]| {
        let terms = gradient.iter().zip(field).map(|(g, f)| (g * f).abs());
        let size = time.abs() + terms.sum::<f64>();
        (time + dot(gradient, field)).abs() <= AT_SIDE * size
    };
    if !is_zero(by_time, normal) {
        return Ok(false);
    }
    if !piece.sliding.is_empty() {
        return Ok(true);
    }
    let mut by_state = vec![0.0; z.len()];
    let rate = piece
        .extended
        .system
        .rate_gradient(j, &piece.at(t, z), &mut by_state)?;
    Ok(is_zero(rate.time, &by_state))
}

/// Does the derivative of the field jump across a surface where the field does not?
fn bends_across(
    piece: &Piece,
    j: usize,
    (t, z): (f64, &[f64]),
    normal: &[f64],
) -> Result<bool, FieldError> {
    let size = dot(normal, normal).sqrt();
    let step = AT_SIDE.sqrt() / size;
    let beside: Vec<f64> = z
        .iter()
        .zip(normal)
        .map(|(z, n)| z + step * n / size)
        .collect();
    let [above, below] = [1.0, -1.0].map(|sign| piece.corner(t, &beside, &[(j, sign)]));
    let (above, below) = (above?, below?);
    let jump = above.iter().zip(&below).map(|(a, b)| (a - b).abs());
    Ok(jump.fold(0.0, f64::max) > step * AT_SIDE.sqrt())
}

/// Does a clock tick at the initial time, at another time for some of these columns, and change the motion?
pub(super) fn ticks_at_start(
    around: &Surroundings,
    piece: &mut Piece,
    (t, z): (f64, &[f64]),
    kinds: &[Column],
) -> Result<bool, FieldError> {
    let extended = piece.extended;
    let ticks = extended.ticks_at(&piece.at(t, z));
    let moves = |kind: &Column, tick: &[f64]| match *kind {
        Column::Start => true,
        Column::State(i) => tick[i] != 0.0,
        Column::Parameter(p) => tick[extended.n + p] != 0.0,
    };
    if !kinds
        .iter()
        .any(|kind| ticks.iter().any(|tick| moves(kind, tick)))
    {
        return Ok(false);
    }
    let q = extended.discrete_before(t, (z, &piece.q))?;
    let mut earlier = Piece::new(around, &piece.mode, &q);
    let system = &extended.system;
    let now = piece.surfaces(t, z)?;
    for (j, (h, now)) in earlier.surfaces(t, z)?.iter().zip(&now).enumerate() {
        let side = f64::from(piece.mode.entries()[j]);
        let size = AT_SIDE * system.surface_size(j, &earlier.at(t, z))?;
        // On the surface before the tick, a start a little earlier is on either side.
        let is_elsewhere = match h.abs() > size {
            true => h * side < 0.0 || side == 0.0,
            false => now.abs() > size && system.jumps_across(j, &earlier.signs, &earlier.sliding),
        };
        if is_elsewhere {
            return Ok(true);
        }
    }
    Ok(differ(&piece.rates(t, z)?, &earlier.rates(t, z)?))
}

/// Does a law start with another value, if the start or a threshold is moved by a little along one of these columns?
pub(super) fn starts_at_threshold(
    piece: &Piece,
    (t, z): (f64, &[f64]),
    kinds: &[Column],
) -> Result<bool, FieldError> {
    for kind in kinds {
        if piece.extended.is_at_threshold(*kind, t, (z, &piece.q))? {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Do two vectors differ by more than rounding?
pub(super) fn differ(one: &[f64], other: &[f64]) -> bool {
    let size = one
        .iter()
        .chain(other)
        .fold(0.0_f64, |most, v| most.max(v.abs()));
    let mut entries = one.iter().zip(other);
    entries.any(|(a, b)| (a - b).abs() > AT_SIDE * size)
}
