//! Where a derivative has sides: several surfaces that are reached at once, and motions that touch one.

use smallvec::{smallvec, SmallVec};

use super::change::{matrices, Change, Row};
use super::instant::{entered, Instant};
use super::piece::{is_affine, Piece};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::motion::Guard;
use crate::system::LieDerivatives;
use crate::tolerances::{AT_SIDE, ROUNDING};
use crate::vectors::{dot, dot_magnitude};

/// So many surfaces at one instant have all their orders looked at.
pub(super) const MOST_AT_ONCE: usize = 3;

/// The derivative of the state behind an instant in a cone of changes before it.
#[derive(Clone, Debug)]
pub struct OneSided {
    /// The surfaces that the changed motion reaches, in this order; none where it misses the surface.
    pub order: Vec<usize>,
    /// The saltation matrix, n rows of n entries.
    pub saltation: Vec<f64>,
    /// What parameters add to their own columns, n rows of one entry for each of them.
    pub by_parameters: Vec<f64>,
}

/// What happens to changes in one of the cones.
pub(super) struct Cone {
    pub order: Vec<usize>,
    pub changes: SmallVec<[Change; 1]>,
}

impl Cone {
    /// As matrices, for n states and m parameters.
    pub fn matrices(&self, (n, m): (usize, usize)) -> OneSided {
        let (saltation, by_parameters) = matrices(&self.changes, (n, m));
        OneSided {
            order: self.order.clone(),
            saltation,
            by_parameters,
        }
    }
}

/// Is the derivative the same in all cones?
pub(super) fn agree(cones: &[Cone], sizes: (usize, usize)) -> bool {
    let Some((first, others)) = cones.split_first() else {
        return false;
    };
    let first = first.matrices(sizes);
    others.iter().all(|other| {
        let other = other.matrices(sizes);
        let pairs = [
            (&first.saltation, &other.saltation),
            (&first.by_parameters, &other.by_parameters),
        ];
        pairs.iter().all(|(a, b)| {
            let size = a.iter().fold(1.0_f64, |most, v| most.max(v.abs()));
            let differs = |(a, b): (&f64, &f64)| (a - b).abs() > AT_SIDE * size;
            !a.iter().zip(*b).any(differs)
        })
    })
}

impl<'a> Instant<'_, 'a> {
    /// What becomes of changes if the surfaces that are reached at once are reached one after the other, in every order; `None` if
    /// one of the orders leads to another mode.
    pub(super) fn cones(&mut self) -> Result<Option<Vec<Cone>>, FieldError> {
        let record = self.record;
        let surfaces: Option<Vec<usize>> = record
            .guards
            .iter()
            .map(|guard| match guard {
                Guard::Surface(j) => Some(*j),
                _ => None,
            })
            .collect();
        let entries = record.mode.map(|mode| mode.entries());
        let Some(mut surfaces) = surfaces else {
            return Ok(None);
        };
        surfaces.extend(self.passed_with_it()?);
        let differs = |j: usize| entries[0][j] != entries[1][j];
        let are_all = record.acts.is_empty()
            && surfaces.len() > 1
            && (0..entries[0].len()).all(|j| surfaces.contains(&j) == differs(j))
            && surfaces.iter().all(|&j| entries[0][j] != 0);
        if !are_all {
            return Ok(None);
        }
        let orders = match surfaces.len() <= MOST_AT_ONCE {
            true => orders(&surfaces),
            false if self.act_apart(&surfaces)? => vec![surfaces],
            false => return Ok(None),
        };
        let mut cones = Vec::new();
        for order in orders {
            match self.one_after_the_other(&order)? {
                Some(changes) => cones.push(Cone { order, changes }),
                None => return Ok(None),
            }
        }
        Ok(Some(cones))
    }

    /// Does the field jump at each of some surfaces, and of those slid on, by as much whatever the signs of the others are, and along
    /// them? Their order is of no account then.
    fn act_apart(&self, surfaces: &[usize]) -> Result<bool, FieldError> {
        let surfaces = [surfaces, &self.before.sliding].concat();
        if !is_affine(&self.extended.system, &surfaces) {
            return Ok(false);
        }
        let (t, z) = (self.record.t[0], self.extended.state(self.record.x[0]));
        let (mut jumps, mut normals) = (Vec::new(), Vec::new());
        for &j in &surfaces {
            let above = self.before.corner(t, &z, &[(j, 1.0)])?;
            let mut jump = self.before.corner(t, &z, &[(j, -1.0)])?;
            jump.iter_mut().zip(&above).for_each(|(b, a)| *b = a - *b);
            let mut normal = Row::from_elem(0.0, z.len());
            self.before.gradient(j, t, &z, &mut normal)?;
            jumps.push(jump);
            normals.push(normal);
        }
        let is_along = |jump: &Row, normal: &Row| {
            dot(normal, jump).abs() <= ROUNDING * dot_magnitude(normal, jump)
        };
        let places = 0..surfaces.len();
        Ok(places.clone().all(|k| {
            let mut others = places.clone().filter(|&other| other != k);
            others.all(|other| is_along(&jumps[k], &normals[other]))
        }))
    }

    fn one_after_the_other(
        &mut self,
        order: &[usize],
    ) -> Result<Option<SmallVec<[Change; 1]>>, FieldError> {
        let record = self.record;
        let (t, z) = (record.t[0], self.extended.state(record.x[0]));
        let mut mode: Mode = record.mode[0].clone();
        let mut field = Row::from_slice(record.field[0]);
        let mut sliding = self.before.sliding.clone();
        let mut changes = SmallVec::new();
        for (number, &j) in order.iter().enumerate() {
            let normal = |piece: &Piece, k: usize| -> Result<(f64, Vec<f64>), FieldError> {
                let mut row = vec![0.0; z.len()];
                let time = piece.gradient(k, t, &z, &mut row)?;
                Ok((time, row))
            };
            let (time, row) = normal(self.before, j)?;
            let rate = time + dot(&row, &field);
            mode = mode.with(j, record.mode[1].entries()[j]);
            let mut next = Piece::new(self.around, &mode, record.discrete[1]);
            let mut rates = next.rates(t, &z)?;
            rates.truncate(field.len());
            // The mode between has to be one that the motion keeps until it reaches the next surface.
            let slides_on = next.field.multipliers().iter().all(|l| l.abs() <= 1.0);
            let mut is_kept = slides_on && rates.iter().all(|v| v.is_finite());
            for (k, &other) in order.iter().enumerate() {
                let (time, row) = normal(self.before, other)?;
                let rate = time + dot(&row, &rates);
                let side = match k <= number {
                    true => f64::from(mode.entries()[other]),
                    false => -f64::from(mode.entries()[other]),
                };
                is_kept &= side == 0.0 || rate * side > 0.0;
            }
            if !is_kept {
                return Ok(None);
            }
            let entry = match mode.entries()[j] {
                0 => entered(self.extended, &next, &sliding, (t, &z))?,
                _ => None,
            };
            match entry {
                Some(entry) => changes.push(entry),
                None => {
                    let moved = field
                        .iter()
                        .zip(&rates)
                        .map(|(before, after)| before - after);
                    let time = row.iter().map(|g| -g / rate).collect();
                    changes.push(Change::at_moving_time(None, moved.collect(), time));
                    changes.extend(next.projection(&sliding, t, &z)?);
                }
            }
            (field, sliding) = (rates, next.sliding.clone());
        }
        Ok(Some(changes))
    }

    /// The two sides of a motion that touches a surface and stays in its mode: missed it is the identity, and reached a short piece on
    /// the surface. One side alone where the field is the same on both; none if the motion on the other side leads away.
    pub(super) fn touching(&mut self) -> Result<Vec<Cone>, FieldError> {
        let record = self.record;
        let (&[Guard::Surface(j)], true) = (record.guards, record.acts.is_empty()) else {
            return Ok(Vec::new());
        };
        // Beside others that the motion slides on, the field on one side is not that of one corner.
        if !self.before.sliding.is_empty() {
            return Ok(Vec::new());
        }
        let entry = record.mode[0].entries()[j];
        let stays = record.mode[0] == record.mode[1] && entry != 0;
        if !stays || self.extended.triggered_by(j).is_some() {
            return Ok(Vec::new());
        }
        let (t, z) = (record.t[0], self.extended.state(record.x[0]));
        let missed = Cone {
            order: Vec::new(),
            changes: SmallVec::new(),
        };
        let beyond = self.before.corner(t, &z, &[(j, -f64::from(entry))])?;
        let jump: Row = beyond
            .iter()
            .zip(record.field[0])
            .map(|(far, near)| far - near)
            .collect();
        let mut normal = Row::from_elem(0.0, z.len());
        self.before.gradient(j, t, &z, &mut normal)?;
        let size = |v: &[f64]| v.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        if size(&jump) <= AT_SIDE * size(record.field[0]) {
            return Ok(vec![missed]);
        }
        if dot(&normal, &jump) * f64::from(entry) <= 0.0 {
            return Ok(Vec::new());
        }
        let reached = Cone {
            order: vec![j],
            changes: smallvec![Change::normal_to(smallvec![normal], smallvec![jump])],
        };
        Ok(vec![missed, reached])
    }

    /// What an impact without speed adds to the state for the root of the depth that the undisturbed motion would reach: the state
    /// behind it differs from the undisturbed motion by so much times sqrt(-min g). Empty for other instants.
    ///
    /// With the map x + W a for the speed a of approach, and the second derivative b of g along the motion, it is -W sqrt(2 b).
    pub(super) fn square_root(&self) -> Result<Vec<f64>, FieldError> {
        let (record, n) = (self.record, self.extended.n);
        let &[Guard::Surface(j)] = record.guards else {
            return Ok(Vec::new());
        };
        let action = self.extended.triggered_by(j);
        let map = action.and_then(|action| self.extended.maps[action].as_ref());
        let Some(map) = map else {
            return Ok(Vec::new());
        };
        let (t, z) = (record.t[0], self.extended.state(record.x[0]));
        let (rows, _) = map.derivative((t, record.x[0]), &self.extended.values)?;
        let place = self.before.at(t, &z);
        let mut by_state = vec![0.0; z.len()];
        let system = &self.extended.system;
        let by_time = system.rate_gradient(j, &place, &mut by_state)?.time;
        let bend = by_time + dot(&by_state, record.field[0]);
        // Along the gradient of the speed it changes by the square of that.
        let speed = &by_state[..n];
        let change = dot(speed, speed);
        let side = f64::from(record.mode[0].entries()[j]);
        if bend * side <= 0.0 || change == 0.0 {
            return Ok(Vec::new());
        }
        let scale = -(2.0 * bend.abs()).sqrt() / change * side;
        let added = rows.iter().zip(speed);
        Ok(added
            .map(|(row, own)| scale * (dot(&row[..n], speed) - own))
            .collect())
    }
}

/// All orders of some surfaces.
pub(super) fn orders(surfaces: &[usize]) -> Vec<Vec<usize>> {
    if surfaces.len() <= 1 {
        return vec![surfaces.to_vec()];
    }
    let first = |place: usize| {
        let mut others = surfaces.to_vec();
        let own = others.remove(place);
        orders(&others)
            .into_iter()
            .map(move |rest| [&[own], &rest[..]].concat())
    };
    (0..surfaces.len()).flat_map(first).collect()
}
