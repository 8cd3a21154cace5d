//! Second derivatives: of a motion by two columns each, and through instants.
//!
//! Along a curve of starts by two columns a and b the state has the mixed derivative m. At an instant fixed by g, with a + tau_a F-
//! and b + tau_b F- the changes of the point at which it happens, the derivatives of time and map up to second order give that of the
//! state behind it (`docs/theory/derivatives.md`).

use std::sync::Arc;

use filippov_expr::NodeId;

use super::change::Change;
use super::extended::{Column, Extended};
use super::forms::{add, form_by_differences, is_known, pairs, Form, Moved, Second};
use super::instant::arrival;
use super::piece::Piece;
use crate::error::FieldError;
use crate::motion::Guard;
use crate::record::InstantRecord;
use crate::tolerances::AT_SIDE;
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

/// An instant up to second order: the states before it at its time, and its time.
pub(super) struct Timed {
    /// By each column, the derivative of the time and the change of the point.
    changes: Vec<(f64, Moved)>,
    /// The mixed derivatives of the state, n entries for each pair of columns.
    pub states: Vec<Vec<f64>>,
    /// Those of the time; NaN where the end of a multiplier fixes it at which the field goes on.
    pub times: Vec<f64>,
}

impl SecondOrder<'_, '_> {
    /// The mixed derivatives behind the instant, from the columns before; `None` for instants of which they are not known.
    pub fn pass(
        &mut self,
        columns: &[Vec<f64>],
        second: &Second,
    ) -> Result<Option<(Second, Timed)>, FieldError> {
        let (extended, record) = (self.extended, self.record);
        let mut moving = record.acts.iter().filter(|act| extended.moves(act.index));
        let map = match (moving.next(), moving.next()) {
            (None, _) => None,
            (Some(act), None) => match extended.second_of_map(record.t[0], act)? {
                None => return Ok(None),
                known => known,
            },
            _ => return Ok(None),
        };
        let Some(timed) = self.timed(columns, second)? else {
            return Ok(None);
        };
        let z = extended.state(record.x[1]);
        let at = (record.t[1], &z[..], record.field[1]);
        let changes: Vec<(f64, Moved)> = match &map {
            None => timed.changes.clone(),
            Some(map) => {
                let changes = timed.changes.iter();
                let image = |(tau, w): &(f64, Moved)| (*tau, map.image(extended.n, w));
                changes.map(image).collect()
            }
        };
        let mut found = match map {
            None => behind(self.after, at, &changes, (&timed.states, &timed.times))?,
            Some(map) => {
                let all = pairs(columns.len()).zip(timed.states.iter().zip(&timed.times));
                let states = all.map(|((a, b), (state, tau))| {
                    let [a, b] = [a, b].map(|c| &timed.changes[c].1);
                    map.second_image(state, *tau, a, b)
                });
                let states: Vec<Vec<f64>> = states.collect();
                behind(self.after, at, &changes, (&states, &timed.times))?
            }
        };
        let arrives = !record.acts.is_empty() && arrival(self.after, record.t[1], &z)?.is_some();
        if !arrives {
            let columns = changes
                .iter()
                .map(|(tau, w)| w.plus(-tau, record.field[1]).z);
            let columns: Vec<Vec<f64>> = columns.collect();
            found.hold(self.after, (record.t[1], &z), &columns)?;
        }
        Ok(Some((found, timed)))
    }

    /// The instant itself, whatever comes behind it.
    pub fn timed(
        &mut self,
        columns: &[Vec<f64>],
        second: &Second,
    ) -> Result<Option<Timed>, FieldError> {
        let is_one = !self.goes_on || self.record.guards.len() == 1;
        if !is_one || self.time.iter().any(|v| v.is_nan()) {
            return Ok(None);
        }
        let (t, field) = (self.record.t[0], self.record.field[0]);
        let z = self.extended.state(self.record.x[0]);
        let still = Moved::of_state(&vec![0.0; z.len()]);
        let by_field = still.plus(1.0, field);
        let is_timed = self.time.iter().any(|v| *v != 0.0);
        // The second derivative of what fixes the time, and its rate: the row of the time is minus its gradient over it.
        let fixing = match *self.record.guards {
            _ if self.goes_on => None,
            [guard] => {
                let by = self.before.gradient_of(guard, t, &z)?;
                let rate = by.time + dot(&by.state, &by_field.z);
                match guard {
                    Guard::Surface(j) => match self.extended.form_of_surface(j) {
                        Ok(form) => Some((Bend::Form(form), rate)),
                        Err(_) => return Ok(None),
                    },
                    guard => Some((Bend::Guard(guard), rate)),
                }
            }
            [] if !is_timed => None,
            [] => {
                let place = self.before.at(t, &z);
                let mut acts = self.record.acts.iter();
                let tick =
                    acts.find_map(|act| self.extended.form_of_tick(act.index, &place).ok()?);
                match tick {
                    None => return Ok(None),
                    Some((form, rate)) => Some((Bend::Form(form), rate)),
                }
            }
            _ => return Ok(None),
        };
        self.before.look_at(t, &z)?;
        let own = self.before.rates_along(1.0, &by_field.z);
        let alongs: Vec<Vec<f64>> = columns
            .iter()
            .map(|column| self.before.rates_along(0.0, column))
            .collect();
        let mut timed = Timed {
            changes: Vec::with_capacity(columns.len()),
            states: Vec::with_capacity(second.pairs.len()),
            times: Vec::with_capacity(second.pairs.len()),
        };
        timed.changes.extend(columns.iter().map(|column| {
            let tau = dot(self.time, column);
            (tau, Moved::of_state(column).plus(tau, field))
        }));
        for ((a, b), mixed) in pairs(columns.len()).zip(&second.pairs) {
            let mut state = mixed.clone();
            let mut time = if self.goes_on { f64::NAN } else { 0.0 };
            if is_known(mixed) {
                let [(tau_a, of_a), (tau_b, of_b)] = [a, b].map(|c| &timed.changes[c]);
                add(&mut state, *tau_a, &alongs[b]);
                add(&mut state, *tau_b, &alongs[a]);
                add(&mut state, tau_a * tau_b, &own);
                if let Some((bend, rate)) = &fixing {
                    let bend = bend.along(self.before, (t, &z), (of_a, of_b))?;
                    time = dot(self.time, &state) - bend / rate;
                    add(&mut state, time, field);
                }
            } else {
                time = f64::NAN;
            }
            timed.states.push(state);
            timed.times.push(time);
        }
        Ok(Some(timed))
    }
}

/// The second derivative of what fixes the time of an instant.
enum Bend {
    /// Of a function of the graph.
    Form(Arc<Form>),
    /// Of a guard that the motion follows.
    Guard(Guard),
}

impl Bend {
    /// Along two changes at a place.
    fn along(
        &self,
        before: &mut Piece,
        (t, z): (f64, &[f64]),
        (u, v): (&Moved, &Moved),
    ) -> Result<f64, FieldError> {
        Ok(match self {
            Bend::Form(form) => form.at(&before.extended.system, &before.at(t, z), u, v)[0],
            Bend::Guard(guard) => {
                let value = |t: f64, z: &[f64]| Ok(vec![before.field.value_of(*guard, t, z)?]);
                form_by_differences(value, (t, z), (u, v))?[0]
            }
        })
    }
}

/// Are the surfaces slid on planes, and those in contact too, with rates that are affine?
fn are_planes(piece: &Piece) -> bool {
    let extended = piece.extended;
    let mut graph = extended.system.graph().clone();
    let surfaces = piece.sliding.iter().chain(&piece.contacts);
    let surfaces: Vec<NodeId> = surfaces.map(|&j| graph.surface(j as u32)).collect();
    let rates = piece.contacts.iter();
    let rates: Vec<NodeId> = rates.map(|&j| extended.rate_in(&mut graph, j)).collect();
    let mut all = surfaces.into_iter().chain(rates);
    all.all(|node| graph.is_affine(node))
}

impl Second {
    /// Takes from them what leads off the surfaces that the motion keeps to, and off the rates of those in contact: rounding, what a
    /// limit left, or what the map of an impact does not tell. `columns` are the first derivatives.
    ///
    /// Along a curve of states with h = 0 the second derivative m has dh m + d^2h(a, b) = 0.
    pub fn hold(
        &mut self,
        piece: &Piece,
        (t, z): (f64, &[f64]),
        columns: &[Vec<f64>],
    ) -> Result<(), FieldError> {
        let extended = piece.extended;
        let surfaces = piece.sliding.iter().chain(&piece.contacts);
        let forms = surfaces.map(|&j| extended.form_of_surface(j));
        let rates = piece.contacts.iter().map(|&j| extended.form_of_rate(j));
        let forms: Result<Vec<Arc<Form>>, _> = forms.chain(rates).collect();
        let Some(forms) = forms.ok().filter(|forms| !forms.is_empty()) else {
            return Ok(());
        };
        let mut rows = piece.normals(t, z)?;
        rows.extend(piece.rate_normals(t, z)?);
        for ((a, b), mixed) in pairs(columns.len()).zip(&mut self.pairs) {
            let along = [a, b].map(|c| Moved::of_state(&columns[c]));
            let place = piece.at(t, z);
            // What the form adds is the share of a last entry that is 1.
            let rows = rows.iter().zip(&forms).map(|(row, form)| {
                let mut row = row.clone();
                row.push(form.at(&extended.system, &place, &along[0], &along[1])[0]);
                row
            });
            let held = piece.held_by(rows.collect());
            mixed.resize(z.len(), 0.0);
            mixed.push(1.0);
            held.apply(extended.n, mixed);
            mixed.truncate(extended.n);
        }
        Ok(())
    }

    /// Takes a change of all of them.
    fn apply(&mut self, n: usize, change: &Change, size: usize) {
        for mixed in &mut self.pairs {
            mixed.resize(size, 0.0);
            change.apply(n, mixed);
            mixed.truncate(n);
        }
    }

    /// Goes on at a start on surfaces slid on, or where an action puts the state there. A state beside them is led back by the field
    /// of its own side: pairs with a column that goes there have no second derivative, nor have those that leave a curved surface.
    pub fn arrive(
        &mut self,
        (piece, arrival): (&Piece, &Change),
        (t, z): (f64, &[f64]),
        columns: &[Vec<f64>],
        beside: &[usize],
    ) -> Result<(), FieldError> {
        let n = piece.extended.n;
        let normals = piece.normals(t, z)?;
        let is_curved = !are_planes(piece);
        for ((a, b), mixed) in pairs(columns.len()).zip(&mut self.pairs) {
            let mut leaves = beside.contains(&a) || beside.contains(&b);
            let along = (Moved::of_state(&columns[a]), Moved::of_state(&columns[b]));
            for (&j, normal) in piece.sliding.iter().zip(&normals).filter(|_| is_curved) {
                let Ok(form) = piece.extended.form_of_surface(j) else {
                    leaves = true;
                    break;
                };
                let bend = form.at(&piece.extended.system, &piece.at(t, z), &along.0, &along.1)[0];
                let off = dot(&normal[..n], mixed);
                leaves |= (bend + off).abs() > AT_SIDE * (bend.abs() + off.abs());
            }
            if leaves {
                mixed.fill(f64::NAN);
            }
        }
        if !is_curved {
            self.apply(n, arrival, z.len());
        }
        Ok(())
    }
}

/// The mixed derivatives behind an instant or a limit of instants, from those of the state at its time and those of the time, NaN if
/// the same field goes on; `changes` are by each column the derivative of the time and the change of the point behind.
pub(super) fn behind(
    after: &mut Piece,
    (t, z, field): (f64, &[f64], &[f64]),
    changes: &[(f64, Moved)],
    (states, times): (&[Vec<f64>], &[f64]),
) -> Result<Second, FieldError> {
    after.look_at(t, z)?;
    let still = Moved::of_state(&vec![0.0; z.len()]);
    let own = after.rates_along(1.0, &still.plus(1.0, field).z);
    let rates = changes
        .iter()
        .map(|(_, change)| after.rates_along(change.time, &change.z));
    let rates: Vec<Vec<f64>> = rates.collect();
    let all = pairs(changes.len()).zip(states.iter().zip(times));
    let found = all.map(|((a, b), (state, time))| {
        let (tau_a, tau_b) = (changes[a].0, changes[b].0);
        let mut mixed = state.clone();
        if !time.is_nan() {
            add(&mut mixed, -time, field);
        }
        add(&mut mixed, -tau_a, &rates[b]);
        add(&mut mixed, -tau_b, &rates[a]);
        add(&mut mixed, tau_a * tau_b, &own);
        mixed
    });
    Ok(Second {
        pairs: found.collect(),
    })
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
