//! Derivatives along a motion: M' = Df M + D_p f on an accepted step, by collocation. The method damps what is stiff, and is of higher
//! order than the continuous extension of any step but that of Taylor series.

use std::sync::Arc;

use smallvec::SmallVec;

use super::change::{Change, Row, Rows};
use super::collocation::{fastest, operations, Collocation};
use super::extended::Extended;
use super::forms::{add, form_by_differences, is_known, pairs, Moved, Second};
use super::lengths::Lengths;
use super::orthonormal::{orthonormal, Choice};
use super::radau::{INTEGRALS, NODES, STAGES};
use super::series::{Carried, ChangeSeries, Changes};
use crate::cube::{Matrix, Vector};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::motion::{ContactField, Guard, Law, ModeField, SmoothField};
use crate::options::{Options, SlidingRule};
use crate::stepper::Taylor;
use crate::system::{
    Actions, LieDerivatives, Linearisation, Linearisations, MotionJacobian, PiecewiseSystem, Place,
    Setting, SignStructure, TracedSystem,
};
use crate::tolerances::{AT_SIDE, EPS};
use crate::vectors::dot;

/// Series that allow less than this share of a step are not used where there is another way; where there is none, less than that.
const SHORTEST: f64 = 0.25;
const SHORTEST_OF_PAIRS: f64 = 1e-3;

/// So many iterations at most for the state at the end of a part.
const MOST_ITERATIONS: usize = 60;

/// What a motion follows from, beside its mode and discrete states.
#[derive(Clone)]
pub(super) struct Surroundings<'a> {
    pub extended: &'a Extended<'a>,
    /// The impacts of its contacts.
    pub impacts: &'a Actions<'a>,
    pub law: Law<'a>,
    /// The side of each surface on which the motion is, or was last.
    pub sides: Vec<i8>,
    rtol: f64,
    /// The order of Taylor series.
    order: usize,
}

impl<'a> Surroundings<'a> {
    /// Those of the start of a run.
    pub fn at_start(
        extended: &'a Extended<'a>,
        impacts: &'a Actions<'a>,
        options: &'a Options,
    ) -> Self {
        let sides = impacts.sides_at_start(extended.system.n_surfaces());
        Surroundings {
            extended,
            impacts,
            law: Law::from(options),
            sides: sides.collect(),
            rtol: options.rtol,
            order: Taylor::order_for(options.rtol, |_| None),
        }
    }

    /// Takes the sides of a mode.
    pub fn take_sides(&mut self, mode: &Mode) {
        let known = self.sides.iter_mut().zip(mode.entries());
        known
            .filter(|(_, entry)| **entry != 0)
            .for_each(|(side, entry)| *side = *entry);
    }
}

/// The derivatives of a function that may fix the time of an instant: by the time, and by the extended state.
pub(super) struct Timing {
    pub time: f64,
    pub state: Row,
}

/// A motion of the extended system in one mode.
pub(super) struct Piece<'a> {
    pub extended: &'a Extended<'a>,
    pub mode: Mode,
    pub q: Vec<f64>,
    /// The surfaces slid on.
    pub sliding: Vec<usize>,
    /// The surfaces in contact.
    pub contacts: Vec<usize>,
    sides: Vec<i8>,
    pub signs: Vec<f64>,
    pub field: ModeField<'a>,
    /// The derivatives of its field, if the graph has them.
    jacobian: Option<Arc<MotionJacobian>>,
    /// Is the field affine in the signs of the surfaces slid on?
    pub is_affine: bool,
    /// Does its field follow from the graph alone?
    pub by_graph: bool,
    /// The series of so many changes, if they have any that is cheap.
    series: Option<(usize, Option<Arc<ChangeSeries>>)>,
    carried: Carried,
    /// The columns at the end of a step.
    at_end: Vec<f64>,
    rtol: f64,
    /// The order of the series.
    order: usize,
    collocation: Collocation,
    /// The derivatives of the field at the nodes of a part.
    nodes: Vec<Linearisation>,
    /// A point, the signs and multipliers there, and the rates.
    point: Vec<f64>,
    node_signs: Vec<f64>,
    rates: Vec<f64>,
}

impl<'a> Piece<'a> {
    pub fn new(around: &Surroundings<'a>, mode: &Mode, q: &[f64]) -> Self {
        let Surroundings {
            extended,
            impacts,
            law,
            ref sides,
            ..
        } = *around;
        let system: &dyn PiecewiseSystem = &extended.system;
        let contact = match impacts.list.is_empty() {
            true => None,
            false => ContactField::new(&extended.system, impacts, mode, sides, q),
        };
        let contacts: Vec<usize> = contact.iter().flat_map(ContactField::contacts).collect();
        let zeros = mode.sliding_set();
        let sliding: Vec<usize> = zeros.filter(|j| !contacts.contains(j)).collect();
        let field = match contact {
            Some(contact) => ModeField::Contact(Box::new(contact)),
            None => ModeField::of(&extended.system, law, mode, q),
        };
        let mut signs = mode.signs();
        for &j in &contacts {
            signs[j] = f64::from(impacts.trigger_side(j, sides[j]));
        }
        let by_graph = match &field {
            ModeField::Region(_) | ModeField::Sliding(_) => true,
            ModeField::Intersection(field) => field.rule() == SlidingRule::Canopy,
            _ => false,
        };
        let linearisations = system.linearisations().filter(|_| by_graph);
        let jacobian = linearisations.and_then(|l| l.motion_jacobian(&sliding));
        let by_differences = jacobian.is_none();
        let z = extended.state(&vec![0.0; extended.n]);
        Piece {
            extended,
            mode: mode.clone(),
            q: q.to_vec(),
            node_signs: signs.to_vec(),
            signs: signs.to_vec(),
            contacts,
            sides: sides.clone(),
            field,
            jacobian,
            is_affine: sliding.is_empty() || is_affine(&extended.system, &sliding),
            by_graph,
            series: None,
            carried: Carried::default(),
            at_end: Vec::new(),
            rtol: around.rtol,
            order: around.order,
            collocation: Collocation::new(
                (extended.n, extended.n_parameters()),
                around.rtol,
                by_differences,
            ),
            nodes: Vec::new(),
            rates: vec![0.0; z.len()],
            point: z.into_vec(),
            sliding,
        }
    }

    /// Does this motion have these mode and discrete states, in these surroundings?
    pub fn is_of(&self, around: &Surroundings, mode: &Mode, q: &[f64]) -> bool {
        let is_same = || self.contacts.is_empty() || self.sides == around.sides;
        // Named discrete states are states here.
        let n_named = self.extended.n_named;
        self.mode == *mode && self.q[n_named..] == q[n_named..] && is_same()
    }

    /// How many dimensions the motion has lost: one for each surface slid on, two for each in contact.
    pub fn codimension(&self) -> usize {
        self.sliding.len() + 2 * self.contacts.len()
    }

    /// Are the derivatives of its multipliers known from the graph?
    pub fn knows_multipliers(&self) -> bool {
        self.jacobian.is_some()
    }

    /// A point of the extended system in this motion.
    pub fn at<'p>(&'p self, t: f64, z: &'p [f64]) -> Place<'p> {
        Setting::new(&self.signs, &self.q).at(t, z)
    }

    /// The field of the extended system with the signs of the mode, and those given on the surfaces slid on.
    pub fn corner(&self, t: f64, z: &[f64], signs: &[(usize, f64)]) -> Result<Row, FieldError> {
        let mut all: SmallVec<[f64; 8]> = SmallVec::from_slice(&self.signs);
        signs.iter().for_each(|&(j, sign)| all[j] = sign);
        let mut out = Row::from_elem(0.0, z.len());
        let place = Setting::new(&all, &self.q).at(t, z);
        self.extended.system.field(&place, &mut out)?;
        Ok(out)
    }

    /// The velocity of the motion.
    pub fn rates(&mut self, t: f64, z: &[f64]) -> Result<Row, FieldError> {
        let mut out = Row::from_elem(0.0, z.len());
        let mut point = Row::from_slice(z);
        self.field.eval_unprojected(t, &mut point, &mut out)?;
        Ok(out)
    }

    /// The values of all switching functions.
    pub fn surfaces(&self, t: f64, z: &[f64]) -> Result<Vec<f64>, FieldError> {
        let mut h = vec![0.0; self.extended.system.n_surfaces()];
        self.extended.system.surfaces(&self.at(t, z), &mut h)?;
        Ok(h)
    }

    /// Carries the derivative of the state, columns of n states with the shares of the parameters behind them, over a step along
    /// which the state is `path`.
    pub fn advance(
        &mut self,
        mut path: impl FnMut(f64, &mut [f64]) -> Result<(), FieldError>,
        (t0, t1): (f64, f64),
        columns: &mut [Vec<f64>],
    ) -> Result<(), FieldError> {
        if self.advance_by_series(&mut path, (t0, t1), columns)? {
            return Ok(());
        }
        let mut lengths = self.lengths(&mut path, (t0, t1))?;
        while let Some((dt, left)) = lengths.next() {
            self.take(&mut path, t1 - left, dt)?;
            if lengths.takes(self.collocation.carry(&self.nodes, dt, columns)) {
                self.collocation.accept(&mut *columns);
            }
        }
        Ok(())
    }

    /// The same by Taylor series, if they are long enough.
    fn advance_by_series(
        &mut self,
        path: &mut impl FnMut(f64, &mut [f64]) -> Result<(), FieldError>,
        (t0, t1): (f64, f64),
        columns: &mut [Vec<f64>],
    ) -> Result<bool, FieldError> {
        let count = columns.len();
        if count == 0 {
            return Ok(true);
        }
        if self.series.as_ref().is_none_or(|known| known.0 != count) {
            self.series = Some((count, self.series_of(columns)));
        }
        let Some((_, Some(series))) = &self.series else {
            return Ok(false);
        };
        let (n, system) = (self.extended.n, &self.extended.system);
        let setting = Setting::new(&self.signs, &self.q);
        self.at_end.clear();
        for columns in columns.chunks(series.n_changes()) {
            let changes = columns.iter().map(Vec::as_slice);
            series.take(&self.point, changes, &mut self.carried);
            let (mut t, mut left) = (t0, t1 - t0);
            while left > 0.0 {
                path(t, &mut self.carried.at[..n])?;
                let motion = (system, &setting, t);
                match series.carry(motion, (self.rtol, SHORTEST), left, &mut self.carried) {
                    Some(rest) => (t, left) = (t1 - rest, rest),
                    None => return Ok(false),
                }
            }
            for change in series.changes(&self.carried) {
                self.at_end.extend_from_slice(&change[..n]);
            }
        }
        for (column, end) in columns.iter_mut().zip(self.at_end.chunks_exact(n)) {
            column[..n].copy_from_slice(end);
        }
        Ok(true)
    }

    /// The series of these columns, if they have any that is cheaper than collocation.
    fn series_of(&self, columns: &[Vec<f64>]) -> Option<Arc<ChangeSeries>> {
        if !self.by_graph {
            return None;
        }
        let (n, count) = (self.extended.n, columns.len());
        let series = |changes| self.extended.series(&self.sliding, self.order, changes);
        let all_at_once = || {
            let one = series(Changes::of(&columns[..1], n)?)?;
            let is_small = one.is_unrolled() && one.operations(count) <= operations(n, count);
            let all = is_small.then(|| series(Changes::of(columns, n)?));
            all.flatten().filter(|all| all.is_unrolled())
        };
        let found = all_at_once().or_else(|| series(Changes::Any));
        found.filter(|found| found.operations(count) <= operations(n, count))
    }

    /// Takes the gradient of a function of the state at the end of a step back to its start, and adds to the shares of the
    /// parameters behind it.
    pub fn pull_back(
        &mut self,
        mut path: impl FnMut(f64, &mut [f64]) -> Result<(), FieldError>,
        (t0, t1): (f64, f64),
        gradient: &mut Vec<f64>,
    ) -> Result<(), FieldError> {
        let mut lengths = self.lengths(&mut path, (t0, t1))?;
        while let Some((dt, left)) = lengths.next() {
            self.take(&mut path, t0 + left - dt, dt)?;
            if lengths.takes(self.collocation.pull_back(&self.nodes, dt, gradient)) {
                self.collocation.accept([&mut *gradient]);
            }
        }
        Ok(())
    }

    /// Carries the mixed derivatives of all pairs of columns over a step, with the columns at its start; `false` if the series of the
    /// motion are too short for them.
    pub fn advance_pairs(
        &mut self,
        mut path: impl FnMut(f64, &mut [f64]) -> Result<(), FieldError>,
        (t0, t1): (f64, f64),
        columns: &[Vec<f64>],
        second: &mut Second,
    ) -> Result<bool, FieldError> {
        let n = self.extended.n;
        let series = match self.by_graph {
            true => self
                .extended
                .series(&self.sliding, self.order, Changes::Pair),
            false => None,
        };
        let Some(series) = series else {
            self.advance_pairs_by_differences(path, (t0, t1), columns, second)?;
            return Ok(true);
        };
        let all = pairs(columns.len()).zip(&mut second.pairs);
        for ((a, b), mixed) in all.filter(|(_, mixed)| is_known(mixed)) {
            mixed.resize(self.point.len(), 0.0);
            let changes = [&columns[a][..], &columns[b], mixed];
            series.take(&self.point, changes, &mut self.carried);
            let (mut t, mut left) = (t0, t1 - t0);
            while left > 0.0 {
                path(t, &mut self.point[..n])?;
                self.take_multipliers(t)?;
                self.carried.at[..n].copy_from_slice(&self.point[..n]);
                let setting = Setting::new(&self.node_signs, &self.q);
                let motion = (&self.extended.system, &setting, t);
                let size = (self.rtol, SHORTEST_OF_PAIRS);
                match series.carry(motion, size, left, &mut self.carried) {
                    Some(rest) => (t, left) = (t1 - rest, rest),
                    None => return Ok(false),
                }
            }
            mixed.clear();
            let found = series.changes(&self.carried).last();
            mixed.extend(found.into_iter().flat_map(|found| &found[..n]));
        }
        Ok(true)
    }

    /// The same by differences of the state at the end of the step by that at its start.
    fn advance_pairs_by_differences(
        &mut self,
        mut path: impl FnMut(f64, &mut [f64]) -> Result<(), FieldError>,
        (t0, t1): (f64, f64),
        columns: &[Vec<f64>],
        second: &mut Second,
    ) -> Result<(), FieldError> {
        let n = self.extended.n;
        let mut changes: Vec<Moved> = columns
            .iter()
            .map(|column| Moved::of_state(column))
            .collect();
        let size = self.point.len();
        let mut lengths = self.lengths(&mut path, (t0, t1))?;
        while let Some((dt, left)) = lengths.next() {
            let start = t1 - left;
            self.take(&mut path, start, dt)?;
            // The changes, and the mixed ones behind them.
            let mixed = second.pairs.iter().map(|mixed| {
                let mut mixed = mixed.clone();
                mixed.resize(size, 0.0);
                mixed
            });
            let first = changes.iter().map(|change| change.z.clone());
            let mut all: Vec<Vec<f64>> = first.chain(mixed).collect();
            if !lengths.takes(self.collocation.carry(&self.nodes, dt, &all)) {
                continue;
            }
            self.collocation.accept(&mut all);
            path(start, &mut self.point[..n])?;
            let z = self.point.clone();
            let (first, carried) = all.split_at(changes.len());
            let pairs = pairs(columns.len()).zip(&mut second.pairs).zip(carried);
            for (((a, b), mixed), carried) in pairs.filter(|((_, mixed), _)| is_known(mixed)) {
                let along = (&changes[a], &changes[b]);
                let end = |t: f64, z: &[f64]| self.end_of(t, dt, z);
                let bend = form_by_differences(end, (start, &z), along)?;
                mixed.copy_from_slice(&carried[..n]);
                add(mixed, 1.0, &bend);
            }
            for (change, first) in changes.iter_mut().zip(first) {
                change.z.copy_from_slice(first);
            }
        }
        Ok(())
    }

    /// The state of the motion from a place a time dt later, with the stages found by iteration; NaN if that does not converge.
    fn end_of(&mut self, t: f64, dt: f64, z: &[f64]) -> Result<Vec<f64>, FieldError> {
        let n = self.extended.n;
        let mut stages = vec![z.to_vec(); STAGES];
        let mut rates = vec![vec![0.0; z.len()]; STAGES];
        for _ in 0..MOST_ITERATIONS {
            for ((stage, rates), node) in stages.iter().zip(&mut rates).zip(&NODES) {
                let time = t + node * dt;
                self.field
                    .eval_unprojected(time, &mut stage.clone(), rates)?;
            }
            let (mut change, mut size) = (0.0_f64, 0.0_f64);
            for (stage, weights) in stages.iter_mut().zip(&INTEGRALS) {
                for r in 0..n {
                    let terms = weights.iter().zip(&rates).map(|(w, rates)| w * rates[r]);
                    let value = z[r] + dt * terms.sum::<f64>();
                    change = change.max((value - stage[r]).abs());
                    size = size.max(value.abs());
                    stage[r] = value;
                }
            }
            if change <= 2.0 * EPS * size {
                stages[STAGES - 1].truncate(n);
                return Ok(stages.pop().unwrap_or_default());
            }
        }
        Ok(vec![f64::NAN; n])
    }

    /// Finds the derivatives of the field at a point, for [`rates_along`](Self::rates_along).
    pub fn look_at(&mut self, t: f64, z: &[f64]) -> Result<(), FieldError> {
        self.point.copy_from_slice(z);
        self.slopes(0, t)
    }

    /// The derivative of the field along a change of time and state, at the point looked at.
    pub fn rates_along(&self, time: f64, change: &[f64]) -> Vec<f64> {
        let (rows, by_time, width) = (self.nodes[0].rows(), self.nodes[0].time(), change.len());
        let l = rows.n_rows() - width;
        let mut all = change.to_vec();
        all.resize(width + l, 0.0);
        if l > 0 {
            let own = Matrix::of(l, |k, c| rows.entry(width + k, width + c));
            let known = |k: usize| time * by_time[k] - rows.dot(k, &all);
            let known: Vector = (width..width + l).map(known).collect();
            match own.solve(&known) {
                Some(multipliers) => all[width..].copy_from_slice(&multipliers),
                None => all.fill(f64::NAN),
            }
        }
        let rate = |r: usize| time * by_time[r] - rows.dot(r, &all);
        (0..self.extended.n).map(rate).collect()
    }

    /// The derivative of a switching function by time; writes those by the extended state.
    pub fn gradient(
        &self,
        j: usize,
        t: f64,
        z: &[f64],
        out: &mut [f64],
    ) -> Result<f64, FieldError> {
        self.extended.system.gradient(j, &self.at(t, z), out)
    }

    /// How a step is divided into parts.
    fn lengths(
        &mut self,
        path: &mut impl FnMut(f64, &mut [f64]) -> Result<(), FieldError>,
        (t0, t1): (f64, f64),
    ) -> Result<Lengths, FieldError> {
        let n = self.extended.n;
        path(0.5 * (t0 + t1), &mut self.point[..n])?;
        self.slopes(0, 0.5 * (t0 + t1))?;
        let fastest = fastest(self.nodes[0].rows(), (n, self.point.len() - n));
        let by_differences = self.jacobian.is_none();
        Ok(Lengths::new(t1 - t0, fastest, self.rtol, by_differences))
    }

    /// Takes the derivatives of the field at the nodes of a part.
    fn take(
        &mut self,
        path: &mut impl FnMut(f64, &mut [f64]) -> Result<(), FieldError>,
        start: f64,
        dt: f64,
    ) -> Result<(), FieldError> {
        for (i, node) in NODES.iter().enumerate() {
            let t = start + node * dt;
            path(t, &mut self.point[..self.extended.n])?;
            self.slopes(i, t)?;
        }
        Ok(())
    }

    /// Finds the derivatives of the field at the point, for one of the nodes.
    fn slopes(&mut self, node: usize, t: f64) -> Result<(), FieldError> {
        while self.nodes.len() <= node {
            self.nodes.push(match &self.jacobian {
                Some(jacobian) => jacobian.linearisation(),
                None => Linearisation::dense(self.point.len()),
            });
        }
        let Some(jacobian) = &self.jacobian else {
            return self.slopes_by_differences(node, t);
        };
        let jacobian = Arc::clone(jacobian);
        self.take_multipliers(t)?;
        let place = Setting::new(&self.node_signs, &self.q).at(t, &self.point);
        let system = &self.extended.system;
        system.eval_jacobian(&jacobian, &place, &mut self.nodes[node]);
        Ok(())
    }

    /// Finds the multipliers at the point, as signs of the surfaces slid on.
    fn take_multipliers(&mut self, t: f64) -> Result<(), FieldError> {
        self.node_signs.copy_from_slice(&self.signs);
        if self.sliding.is_empty() {
            return Ok(());
        }
        let (z, system) = (&mut self.point, &self.extended.system);
        let place = Setting::new(&self.signs, &self.q).at(t, z);
        let ratios = self.sliding.iter().map(|&j| system.stick_ratio(j, &place));
        let ratios: SmallVec<[f64; 4]> = ratios.collect();
        self.field.eval_unprojected(t, z, &mut self.rates)?;
        let multipliers = self.field.multipliers();
        for (k, (&j, ratio)) in self.sliding.iter().zip(ratios).enumerate() {
            self.node_signs[j] = ratio * multipliers.get(k).copied().unwrap_or(f64::NAN);
        }
        Ok(())
    }

    /// The same by central differences of the natural extension of the field.
    fn slopes_by_differences(&mut self, node: usize, t: f64) -> Result<(), FieldError> {
        let size = self.point.len();
        let mut dense = vec![0.0; size * size];
        let mut moved = self.point.clone();
        let (mut above, mut below) = (vec![0.0; size], vec![0.0; size]);
        for c in 0..size {
            let d = EPS.cbrt() * (1.0 + self.point[c].abs());
            for (side, rates) in [(d, &mut above), (-d, &mut below)] {
                moved.copy_from_slice(&self.point);
                moved[c] += side;
                self.field.eval_unprojected(t, &mut moved, rates)?;
            }
            for (r, (above, below)) in above.iter().zip(&below).enumerate() {
                dense[r * size + c] = -(above - below) / (2.0 * d);
            }
        }
        let d = EPS.cbrt() * (1.0 + t.abs());
        for (side, rates) in [(d, &mut above), (-d, &mut below)] {
            moved.copy_from_slice(&self.point);
            self.field.eval_unprojected(t + side, &mut moved, rates)?;
        }
        self.nodes[node].fill(|values, time| {
            values.copy_from_slice(&dense);
            let rates = time.iter_mut().zip(above.iter().zip(&below));
            rates.for_each(|(rate, (above, below))| *rate = (above - below) / (2.0 * d));
        });
        Ok(())
    }

    /// The multiplier of a surface slid on, at the point that was looked at last.
    pub fn multiplier(&self, j: usize) -> f64 {
        self.node_signs[j]
    }

    /// Is that multiplier at an end of its interval, or not known?
    pub fn is_at_an_end(&self, j: usize) -> bool {
        let beyond = self.node_signs[j].abs() - 1.0;
        beyond.abs() <= AT_SIDE || beyond.is_nan()
    }

    /// The derivatives of the multiplier of a surface slid on, by the time and by the extended state; `None` where the graph has
    /// none. NaN where the jumps of the field are tangent to the surfaces: there the equations do not determine the multiplier.
    pub fn multiplier_slopes(
        &mut self,
        j: usize,
        t: f64,
        z: &[f64],
    ) -> Result<Option<(f64, Row)>, FieldError> {
        let place = self.sliding.iter().position(|&k| k == j);
        let (Some(place), Some(_)) = (place, &self.jacobian) else {
            return Ok(None);
        };
        self.point.copy_from_slice(z);
        self.slopes(0, t)?;
        let normals = self.normals(t, z)?;
        let slopes = &self.nodes[0];
        let (size, l) = (z.len(), self.sliding.len());
        // dlambda_j = -w . dG with G_l^T w = e_j.
        let mut transposed = Matrix::zeros(l);
        for c in 0..l {
            for (column, value) in slopes.rows().row(size + c).filter(|(k, _)| *k >= size) {
                transposed[(column - size, c)] = value;
            }
        }
        let mut unit = Vector::from_elem(0.0, l);
        unit[place] = 1.0;
        // The largest term of an entry of G_l, for the equation of each surface.
        let largest_of = |normal: &Row| {
            let jump = |r: usize| slopes.rows().row(r).filter(|(c, _)| *c >= size);
            let terms = (0..size).flat_map(|r| jump(r).map(move |(_, v)| (normal[r] * v).abs()));
            terms.fold(0.0, f64::max)
        };
        let is_regular = |weights: &Vector| {
            let mut pairs = weights.iter().zip(&normals);
            pairs.all(|(weight, normal)| (weight * largest_of(normal)).abs() < 1.0 / AT_SIDE)
        };
        let Some(weights) = transposed.solve(&unit).filter(is_regular) else {
            return Ok(Some((f64::NAN, Row::from_elem(f64::NAN, size))));
        };
        let (mut time, mut state) = (0.0, Row::from_elem(0.0, size));
        for (c, weight) in weights.iter().enumerate() {
            time += weight * slopes.time()[size + c];
            for (column, value) in slopes.rows().row(size + c).filter(|(k, _)| *k < size) {
                state[column] -= weight * value;
            }
        }
        Ok(Some((time, state)))
    }

    /// The derivatives of a guard by the time and by the extended state, in either sense: those of the switching function, or of the
    /// multiplier.
    pub fn gradient_of(&mut self, guard: Guard, t: f64, z: &[f64]) -> Result<Timing, FieldError> {
        let mut state = Row::from_elem(0.0, z.len());
        match guard {
            Guard::Surface(j) => {
                let time = self.gradient(j, t, z, &mut state)?;
                return Ok(Timing { time, state });
            }
            Guard::Multiplier { surface, .. } if !self.extended.system.sticks_at(surface) => {
                if let Some((time, state)) = self.multiplier_slopes(surface, t, z)? {
                    return Ok(Timing { time, state });
                }
            }
            _ => {}
        }
        let time = self.field.gradient_of(guard, t, z, &mut state)?;
        Ok(Timing { time, state })
    }

    /// The derivatives of the rate of h_j along the field of a side, by the time and by the extended state.
    pub fn gradient_of_rate(
        &self,
        (j, side): (usize, i8),
        t: f64,
        z: &[f64],
    ) -> Result<Timing, FieldError> {
        let mut signs: SmallVec<[f64; 8]> = SmallVec::from_slice(&self.signs);
        signs[j] = f64::from(side);
        let mut state = Row::from_elem(0.0, z.len());
        let place = Setting::new(&signs, &self.q).at(t, z);
        let found = self.extended.system.rate_gradient(j, &place, &mut state)?;
        Ok(Timing {
            time: found.time,
            state,
        })
    }

    /// Is it a motion whose changes are not followed: on a surface of higher relative degree, or at rest where its fields are not
    /// regular?
    pub fn is_unsupported(&self) -> bool {
        matches!(self.field, ModeField::Reduced(_) | ModeField::Rest(_))
    }

    /// Does a multiplier stay at the end of its interval, to first order, or is it not known? A motion beside this one leaves on one
    /// side, and slides on the other.
    pub fn stays_at_an_end(&mut self, t: f64, z: &[f64]) -> Result<bool, FieldError> {
        let field = self.rates(t, z)?;
        let multipliers = self.field.multipliers();
        if multipliers.iter().any(|l| !l.is_finite()) {
            return Ok(true);
        }
        let at_end = |l: &f64| (l.abs() - 1.0).abs() <= AT_SIDE;
        let Some(k) = multipliers.iter().position(at_end) else {
            return Ok(false);
        };
        let slopes = match self.sliding.get(k) {
            Some(&j) => self.multiplier_slopes(j, t, z)?,
            None => None,
        };
        let Some((by_time, slopes)) = slopes else {
            return Ok(false);
        };
        // The multiplier is at its end for all motions beside this one too: the field on that side is tangent to the surface everywhere.
        if by_time == 0.0 && slopes.iter().all(|slope| *slope == 0.0) {
            return Ok(false);
        }
        let ends = |sign: f64| -> Result<Row, FieldError> {
            let signs: Vec<_> = self.sliding.iter().map(|&j| (j, sign)).collect();
            self.corner(t, z, &signs)
        };
        let (above, below) = (ends(1.0)?, ends(-1.0)?);
        let speeds = above.iter().zip(&below).map(|(a, b)| a.abs().max(b.abs()));
        let terms = slopes
            .iter()
            .zip(speeds)
            .map(|(s, speed)| (s * speed).abs());
        let size = by_time.abs() + terms.sum::<f64>();
        Ok((by_time + dot(&slopes, &field)).abs() <= AT_SIDE * size)
    }

    /// The gradients of the surfaces slid on and of those in contact by the extended state.
    pub fn normals(&self, t: f64, z: &[f64]) -> Result<Rows, FieldError> {
        let gradient = |&j: &usize| {
            let mut row = Row::from_elem(0.0, z.len());
            let place = self.at(t, z);
            self.extended.system.gradient(j, &place, &mut row)?;
            Ok(row)
        };
        self.sliding
            .iter()
            .chain(&self.contacts)
            .map(gradient)
            .collect()
    }

    /// The gradients of the rates of the surfaces in contact.
    pub fn rate_normals(&self, t: f64, z: &[f64]) -> Result<Rows, FieldError> {
        let gradient = |&j: &usize| {
            let mut row = Row::from_elem(0.0, z.len());
            self.extended
                .system
                .rate_gradient(j, &self.at(t, z), &mut row)?;
            Ok(row)
        };
        self.contacts.iter().map(gradient).collect()
    }

    /// Takes from the columns what leads off the surfaces slid on, and off those in contact and their rates.
    pub fn project(&self, t: f64, z: &[f64], columns: &mut [Vec<f64>]) -> Result<(), FieldError> {
        if let Some(projection) = self.projection(&[], t, z)? {
            columns
                .iter_mut()
                .for_each(|column| projection.apply(self.extended.n, column));
        }
        Ok(())
    }

    /// What takes from a change its parts off the surfaces slid on but for some, and off those in contact and their rates.
    pub fn projection(
        &self,
        kept: &[usize],
        t: f64,
        z: &[f64],
    ) -> Result<Option<Change>, FieldError> {
        let mut surfaces = self.sliding.iter().chain(&self.contacts);
        if surfaces.all(|j| kept.contains(j)) && self.contacts.is_empty() {
            return Ok(None);
        }
        let surfaces = self.sliding.iter().chain(&self.contacts);
        let normals = surfaces.zip(self.normals(t, z)?);
        let mut normals: Rows = normals
            .filter(|(j, _)| !kept.contains(j))
            .map(|(_, normal)| normal)
            .collect();
        normals.extend(self.rate_normals(t, z)?);
        Ok((!normals.is_empty()).then(|| self.held_by(normals)))
    }

    /// What takes from a change its parts along these gradients.
    pub fn held_by(&self, normals: Rows) -> Change {
        let n = self.extended.n;
        let normals = independent(normals, n);
        let directions = normals.iter().map(|row| Row::from_slice(&row[..n]));
        let directions = directions.collect();
        Change::normal_to(normals, directions)
    }
}

/// Rows without those that follow from the ones before, by their first n entries.
fn independent(rows: Rows, n: usize) -> Rows {
    let unit = |row: &Row| {
        let length = dot(&row[..n], &row[..n]).sqrt();
        row[..n].iter().map(|v| v / length).collect()
    };
    let units: Vec<Vec<f64>> = rows.iter().map(unit).collect();
    let choice = Choice {
        in_order: units.len(),
        most: units.len(),
        size: Some(1.0),
    };
    let telling = orthonormal(&units, n, choice).order;
    telling.into_iter().map(|i| rows[i].clone()).collect()
}

/// Is the field affine in the signs of these surfaces?
pub(super) fn is_affine(system: &TracedSystem, surfaces: &[usize]) -> bool {
    let known = system.affine_signs();
    known.is_some_and(|affine| affine.affine_parts(surfaces).is_some())
}
