//! Second derivatives: of a motion by two columns each, and through instants.
//!
//! Along a curve of starts by two columns a and b the state has the mixed derivative m. At an instant fixed by g, with a + tau_a F-
//! and b + tau_b F- the changes of the point at which it happens, the derivatives of time and map up to second order give that of the
//! state behind it (`docs/theory/derivatives.md`).

use super::extended::{Column, Extended};
use super::forms::{add, pairs, Moved, Second};
use super::instant::arrival;
use super::piece::Piece;
use crate::error::FieldError;
use crate::motion::Guard;
use crate::record::InstantRecord;
use crate::vectors::dot;

/// An instant, for second derivatives.
pub(super) struct SecondOrder<'i, 'a> {
    pub extended: &'a Extended<'a>,
    pub record: &'i InstantRecord<'i>,
    pub before: &'i mut Piece<'a>,
    pub after: &'i mut Piece<'a>,
    /// The derivative of the time by the state before.
    pub time: &'i [f64],
    /// The time alone changes by the parameters of its guard: the field goes on.
    pub goes_on: bool,
}

impl SecondOrder<'_, '_> {
    /// The mixed derivatives behind the instant, from the columns before, and those of its time, NaN where a multiplier fixes that;
    /// `None` for instants of which they are not known.
    pub fn pass(
        &mut self,
        columns: &[Vec<f64>],
        second: &Second,
    ) -> Result<Option<(Second, Vec<f64>)>, FieldError> {
        let (n, size) = (
            self.extended.n,
            self.extended.n + self.extended.n_parameters(),
        );
        let record = self.record;
        let [z_before, z_after] = record.x.map(|x| self.extended.state(x));
        let pad = |field: &[f64]| [field, &vec![0.0; size - n]].concat();
        let [f_before, f_after] = record.field.map(pad);
        if self.time.iter().any(|v| v.is_nan()) {
            return Ok(None);
        }
        let is_timed = self.time.iter().any(|v| *v != 0.0);
        let place = self.before.at(record.t[0], &z_before);
        // The second derivative of what fixes the time, and its rate: the row of the time is minus its gradient over it.
        let fixing = match record.guards {
            _ if self.goes_on => None,
            [Guard::Surface(j)] => {
                let mut normal = vec![0.0; size];
                let by_time = self
                    .before
                    .gradient(*j, record.t[0], &z_before, &mut normal)?;
                let rate = by_time + dot(&normal, &f_before);
                match self.extended.form_of_surface(*j) {
                    Ok(form) => Some((form, rate)),
                    Err(_) => return Ok(None),
                }
            }
            [] if !is_timed => None,
            [] => {
                let mut acts = record.acts.iter();
                let tick =
                    acts.find_map(|act| self.extended.form_of_tick(act.index, &place).ok()?);
                match tick {
                    None => return Ok(None),
                    known => known,
                }
            }
            _ => return Ok(None),
        };
        let moving = record
            .acts
            .iter()
            .filter(|act| self.extended.moves(act.index));
        let moving: Vec<_> = moving.collect();
        if moving.len() > 1 {
            return Ok(None);
        }
        self.before.look_at(record.t[0], &z_before)?;
        self.after.look_at(record.t[1], &z_after)?;
        let (before, after) = (&*self.before, &*self.after);
        let along = |piece: &Piece, by: &Moved| piece.rates_along(by.time, &by.z);
        let unit = |time: f64, z: &[f64]| Moved {
            time,
            z: z.to_vec(),
        };
        let own = along(before, &unit(1.0, &f_before));
        let next = along(after, &unit(1.0, &f_after));
        let place = before.at(record.t[0], &z_before);
        let map = match moving.first() {
            None => None,
            Some(act) => match self.extended.second_of_map(record.t[0], act)? {
                None => return Ok(None),
                known => known,
            },
        };
        let firsts: Vec<First> = columns
            .iter()
            .map(|column| {
                let tau = dot(self.time, column);
                let w = unit(0.0, column).plus(tau, &f_before);
                let r = match &map {
                    None => w.clone(),
                    Some(map) => Moved {
                        time: w.time,
                        z: map.image(n, &w),
                    },
                };
                First {
                    tau,
                    along: along(before, &unit(0.0, column)),
                    behind: along(after, &r),
                    w,
                }
            })
            .collect();
        let mut found = Vec::with_capacity(second.pairs.len());
        let mut times = Vec::with_capacity(second.pairs.len());
        for ((a, b), mixed) in pairs(columns.len()).zip(&second.pairs) {
            let (a, b) = (&firsts[a], &firsts[b]);
            let mut q = mixed.clone();
            add(&mut q, a.tau, &b.along);
            add(&mut q, b.tau, &a.along);
            add(&mut q, a.tau * b.tau, &own);
            let mut tau = 0.0;
            if let Some((form, rate)) = &fixing {
                let bend = form.at(&self.extended.system, &place, &a.w, &b.w)[0];
                tau = dot(self.time, &q) - bend / rate;
                add(&mut q, tau, record.field[0]);
            }
            let mut behind = match &map {
                None => q,
                Some(map) => map.second_image(&q, tau, &a.w, &b.w),
            };
            if !self.goes_on {
                add(&mut behind, -tau, record.field[1]);
            }
            add(&mut behind, -a.tau, &b.behind);
            add(&mut behind, -b.tau, &a.behind);
            add(&mut behind, a.tau * b.tau, &next);
            found.push(behind);
            times.push(if self.goes_on { f64::NAN } else { tau });
        }
        let graph = self.extended.system.graph();
        let is_plane = |&j: &usize| graph.is_affine(graph.clone().surface(j as u32));
        if after.sliding.iter().all(is_plane) {
            let arrival = match record.acts.is_empty() {
                true => None,
                false => arrival(after, record.t[1], &z_after)?,
            };
            let held = match arrival {
                None => after.projection(&[], record.t[1], &z_after)?,
                known => known,
            };
            if let Some(held) = held {
                for mixed in &mut found {
                    let mut padded = pad(mixed);
                    held.apply(n, &mut padded);
                    mixed.copy_from_slice(&padded[..n]);
                }
            }
        }
        let is_finite = found.iter().flatten().all(|value| value.is_finite());
        Ok(is_finite.then_some((Second { pairs: found }, times)))
    }
}

/// What a column is at an instant: the derivative of its time, the change of its point, and the rates along the column before, and
/// along its image behind.
struct First {
    tau: f64,
    w: Moved,
    along: Vec<f64>,
    behind: Vec<f64>,
}

/// The mixed derivatives at the start of a run, with the velocity there: a run that begins later has moved less.
pub(super) fn at_start(
    piece: &mut Piece,
    (t, z): (f64, &[f64]),
    field: &[f64],
    kinds: &[Column],
) -> Result<Second, FieldError> {
    let n = piece.extended.n;
    piece.look_at(t, z)?;
    let moved = kinds.iter().map(|kind| {
        let (mut time, mut by) = (0.0, vec![0.0; z.len()]);
        match *kind {
            Column::State(i) => by[i] = 1.0,
            Column::Parameter(p) => by[n + p] = 1.0,
            Column::Start => time = 1.0,
        }
        (time, piece.rates_along(time, &by))
    });
    let moved: Vec<(f64, Vec<f64>)> = moved.collect();
    let on = piece.rates_along(1.0, field);
    let found = pairs(kinds.len()).map(|(a, b)| {
        let (a, b) = (&moved[a], &moved[b]);
        let mut mixed = vec![0.0; n];
        add(&mut mixed, -a.0, &b.1);
        add(&mut mixed, -b.0, &a.1);
        add(&mut mixed, a.0 * b.0, &on);
        mixed
    });
    let found = found.collect();
    Ok(Second { pairs: found })
}
