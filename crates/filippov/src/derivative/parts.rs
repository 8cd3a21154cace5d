//! Several things at one time that different functions fix: ticks of different clocks, or a guard and a tick.
//!
//! If the start or a parameter changes they come one after the other, in an order that depends on the change. What they do then is
//! what each does by itself. If all orders agree the derivative goes on; else it is one-sided.

use super::change::Row;
use super::instant::{Instant, Lost, Passage};
use super::one_sided::{agree, orders, Cone, MOST_AT_ONCE};
use super::piece::Piece;
use super::weights::Weights;
use crate::error::FieldError;
use crate::record::InstantRecord;
use crate::system::{Act, PiecewiseSystem};
use crate::tolerances::{AT_SIDE, ROUNDING};

/// What one function fixes.
struct Part {
    /// The derivative of its time.
    time: Row,
    /// What is done, by the places among the acts of the instant.
    acts: Vec<usize>,
    is_guarded: bool,
    /// It moves the state, or ends the mode.
    moves: bool,
}

/// The state, mode and discrete states between two parts.
#[derive(Clone)]
struct Between {
    has_moved: bool,
    q: Vec<f64>,
}

impl<'a> Instant<'_, 'a> {
    /// What each part does, in the order in which they were done; `None` if one function fixes all of the instant.
    pub(super) fn in_parts(
        &mut self,
        weights: &Weights,
        condition: &mut f64,
    ) -> Result<Option<Result<Vec<Passage>, Lost>>, FieldError> {
        let parts = match self.parts(weights, condition)? {
            Ok(parts) => parts,
            Err(lost) => return Ok(Some(Err(lost))),
        };
        if parts.len() < 2 {
            return Ok(None);
        }
        let sizes = (self.extended.n, self.extended.n_parameters());
        let record = self.record;
        let n_moving = parts.iter().filter(|part| part.moves).count();
        let is_moved = record.x[0] != record.x[1] || record.mode[0] != record.mode[1];
        let is_clear = n_moving == usize::from(is_moved) || n_moving == 1;
        if parts.len() > MOST_AT_ONCE || !is_clear || !self.change_their_own(&parts) {
            return Ok(Some(Err(Lost::OneSided)));
        }
        let places: Vec<usize> = (0..parts.len()).collect();
        let (mut found, mut cones) = (None, Vec::new());
        for order in orders(&places) {
            let Some(passages) = self.one_by_one(&parts, &order, weights)? else {
                return Ok(Some(Err(Lost::OneSided)));
            };
            let changes = passages.iter().flat_map(|passage| &passage.changes);
            cones.push(Cone {
                order: Vec::new(),
                changes: changes.cloned().collect(),
            });
            found.get_or_insert(passages);
        }
        let found = found.filter(|_| agree(&cones, sizes));
        Ok(Some(found.ok_or(Lost::OneSided)))
    }

    /// The parts, in the order in which they were done; one alone where one function fixes all.
    fn parts(
        &mut self,
        weights: &Weights,
        condition: &mut f64,
    ) -> Result<Result<Vec<Part>, Lost>, FieldError> {
        let record = self.record;
        let mut parts: Vec<Part> = Vec::new();
        let n_timed = record.acts.iter();
        let n_timed = n_timed
            .filter(|act| self.extended.is_timed(act.index))
            .count();
        let is_guarded = self.guard().is_some();
        if n_timed + usize::from(is_guarded) < 2 {
            return Ok(Ok(parts));
        }
        let of_guard = match is_guarded {
            false => None,
            true => match self.time(weights, condition)? {
                Ok(time) => Some(time),
                Err(lost) => return Ok(Err(lost)),
            },
        };
        for (place, act) in record.acts.iter().enumerate() {
            let time = self.time_of_tick(act).or_else(|| of_guard.clone());
            let known = match &time {
                Some(time) => parts.iter().position(|part| is_same(&part.time, time)),
                None => parts.len().checked_sub(1),
            };
            let moves = self.extended.moves(act.index);
            let Some(known) = known else {
                let time = time.unwrap_or_else(|| Row::from_elem(0.0, self.size()));
                let is_guarded = of_guard.as_ref().is_some_and(|own| is_same(own, &time));
                parts.push(Part {
                    time,
                    acts: vec![place],
                    is_guarded,
                    moves: moves || is_guarded,
                });
                continue;
            };
            parts[known].acts.push(place);
            parts[known].moves |= moves;
        }
        if let Some(time) = of_guard.filter(|_| !parts.iter().any(|part| part.is_guarded)) {
            parts.push(Part {
                time,
                acts: Vec::new(),
                is_guarded: true,
                moves: true,
            });
        }
        Ok(Ok(parts))
    }

    fn size(&self) -> usize {
        self.extended.n + self.extended.n_parameters()
    }

    /// The discrete states that an act changes, with their new values.
    fn changed_by(&self, place: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let acts = self.record.acts;
        let next = acts.get(place + 1).map(|next| &next.discrete[..]);
        let next = next.unwrap_or(self.record.discrete[1]);
        let pairs = acts[place].discrete.iter().zip(next).enumerate();
        pairs
            .filter(|(_, (before, after))| before != after)
            .map(|(k, (_, after))| (k, *after))
    }

    /// Does no discrete state change in two parts?
    fn change_their_own(&self, parts: &[Part]) -> bool {
        let mut known: Vec<(usize, usize)> = Vec::new();
        for (number, part) in parts.iter().enumerate() {
            for &place in &part.acts {
                for (k, _) in self.changed_by(place) {
                    if known
                        .iter()
                        .any(|&(other, own)| own == k && other != number)
                    {
                        return false;
                    }
                    known.push((number, k));
                }
            }
        }
        true
    }

    /// What the parts do in this order, or `None` if the motion between two of them is not known.
    fn one_by_one(
        &self,
        parts: &[Part],
        order: &[usize],
        weights: &Weights,
    ) -> Result<Option<Vec<Passage>>, FieldError> {
        let record = self.record;
        let mut passages = Vec::with_capacity(order.len());
        let mut now = Between {
            has_moved: false,
            q: record.discrete[0].to_vec(),
        };
        for (number, &k) in order.iter().enumerate() {
            let part = &parts[k];
            let mut next = now.clone();
            next.has_moved |= part.moves;
            for &place in &part.acts {
                for (k, value) in self.changed_by(place) {
                    next.q[k] = value;
                }
            }
            let side = |at: &Between| usize::from(at.has_moved);
            let mode = [record.mode[side(&now)], record.mode[side(&next)]];
            let x = [record.x[side(&now)], record.x[side(&next)]];
            let mut before = Piece::new(self.around, mode[0], &now.q);
            let mut after = Piece::new(self.around, mode[1], &next.q);
            let z = x.map(|x| self.extended.state(x));
            let mut fields = [
                before.rates(record.t[0], &z[0])?,
                after.rates(record.t[1], &z[1])?,
            ];
            fields.iter_mut().for_each(|f| f.truncate(self.extended.n));
            let is_last = number + 1 == order.len();
            if !is_last && !keeps_its_sides(&after, record.t[1], &z[1])? {
                return Ok(None);
            }
            let acts: Vec<Act> = part.acts.iter().map(|&k| record.acts[k].clone()).collect();
            let own = InstantRecord {
                x,
                mode,
                discrete: [&now.q, &next.q],
                field: [&fields[0], &fields[1]],
                guards: match part.is_guarded {
                    true => record.guards,
                    false => &[],
                },
                acts: &acts,
                ..*record
            };
            let mut instant = Instant {
                extended: self.extended,
                around: self.around,
                record: &own,
                before: &mut before,
                after: &mut after,
            };
            match instant.passage(weights, &mut 0.0)? {
                Ok(mut passage) => {
                    let acts = acts.iter();
                    let shown = acts.filter(|act| self.extended.is_recorded(act.index));
                    passage.n_recorded = shown.count();
                    passages.push(passage);
                }
                Err(_) => return Ok(None),
            }
            now = next;
        }
        Ok(Some(passages))
    }
}

/// Are two rows the same but for rounding?
fn is_same(one: &[f64], other: &[f64]) -> bool {
    let mut entries = one.iter().zip(other);
    entries.all(|(a, b)| (a - b).abs() <= ROUNDING * (a.abs() + b.abs()))
}

/// Is a state on the sides of the surfaces that belong to the mode of a motion, or on them?
fn keeps_its_sides(piece: &Piece, t: f64, z: &[f64]) -> Result<bool, FieldError> {
    let (system, place) = (&piece.extended.system, piece.at(t, z));
    let h = piece.surfaces(t, z)?;
    for (j, (h, entry)) in h.iter().zip(piece.mode.entries()).enumerate() {
        if h * f64::from(*entry) < -AT_SIDE * system.surface_size(j, &place)? {
            return Ok(false);
        }
    }
    Ok(true)
}
