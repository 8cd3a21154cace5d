//! The saltation matrix: what an instant makes of a change of the state.

use super::extended::Extended;
use super::piece::{dot, remove_along, Piece};
use crate::error::FieldError;
use crate::motion::{Guard, ModeField};
use crate::record::InstantRecord;
use crate::system::{PiecewiseSystem, SignStructure};
use crate::tolerances::{AT_SIDE, ROUNDING};

/// Why derivatives are not known from an instant on: they are NaN.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Lost {
    /// The motion touches the surface that ends it: its time has no derivative.
    Grazing,
    /// Several guards vanish at once, and the order in which they do so counts.
    OneSided,
    /// Infinitely many switches were jumped over.
    Accumulation,
    /// Sliding of higher order, or rest, begins or ends.
    Unsupported,
    /// A derivative is not finite.
    NotFinite,
}

impl Lost {
    /// The name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Lost::Grazing => "grazing",
            Lost::OneSided => "one-sided",
            Lost::Accumulation => "accumulation",
            Lost::Unsupported => "unsupported",
            Lost::NotFinite => "not_finite",
        }
    }
}

/// The derivatives of an instant: of its time, and of the state behind it by the state before.
#[derive(Clone, Debug)]
pub struct InstantDerivative {
    /// The time.
    pub t: f64,
    /// The derivative of the time by each column; NaN where it is not known.
    pub dt: Vec<f64>,
    /// The saltation matrix, n rows of n entries.
    pub saltation: Vec<f64>,
    /// What parameters add to their own columns, n rows of one entry for each of them.
    pub by_parameters: Vec<f64>,
    /// 1 / c with the cosine c = |dg . F| / (|dg| |F|) of the angle between motion and normal, F = (1, f) the motion before, in
    /// which time is measured by the span of the run and each state by rtol |x| + atol, both over rtol.
    pub condition: f64,
    /// Why the derivatives end here, if they do.
    pub lost: Option<Lost>,
}

impl InstantDerivative {
    /// An instant at this time of which nothing is known.
    pub(super) fn unknown(t: f64, n_columns: usize, (n, m): (usize, usize)) -> Self {
        InstantDerivative {
            t,
            dt: vec![f64::NAN; n_columns],
            saltation: vec![f64::NAN; n * n],
            by_parameters: vec![f64::NAN; n * m],
            condition: f64::NAN,
            lost: None,
        }
    }
}

/// By what time and states are measured in the condition of an instant.
pub(super) struct Weights {
    pub span: f64,
    pub rtol: f64,
    pub atol: Vec<f64>,
}

impl Weights {
    fn of(&self, i: usize, x: f64) -> f64 {
        let atol = self.atol.get(i).or(self.atol.first()).copied();
        x.abs() + atol.unwrap_or(0.0) / self.rtol
    }

    /// 1 / |cos| of the angle between a gradient and a motion.
    fn condition(&self, x: &[f64], (by_time, gradient): (f64, &[f64]), field: &[f64]) -> f64 {
        let rate = by_time + dot(gradient, field);
        let (mut normal, mut speed) = ((by_time * self.span).powi(2), self.span.powi(-2));
        for (i, x) in x.iter().enumerate() {
            let weight = self.of(i, *x);
            normal += (gradient[i] * weight).powi(2);
            if field[i] != 0.0 {
                speed += (field[i] / weight).powi(2);
            }
        }
        (normal * speed).sqrt() / rate.abs()
    }
}

/// A function that fixes the time of an instant: its derivatives by time and by the extended state.
struct Timing {
    time: f64,
    state: Vec<f64>,
}

/// What becomes of some columns, and the derivatives of the time along them.
struct Passage {
    columns: Vec<Vec<f64>>,
    dt: Vec<f64>,
}

/// An instant with the motions around it.
pub(super) struct Instant<'i, 'a> {
    pub extended: &'a Extended<'a>,
    pub record: &'i InstantRecord<'i>,
    pub before: &'i mut Piece<'a>,
    pub after: &'i mut Piece<'a>,
}

impl Instant<'_, '_> {
    /// The derivatives of the instant, and the columns after it.
    pub fn pass(
        &mut self,
        weights: &Weights,
        columns: &mut [Vec<f64>],
    ) -> Result<InstantDerivative, FieldError> {
        let (n, m) = (self.extended.n, self.extended.n_parameters());
        let mut found = InstantDerivative::unknown(self.record.t[0], columns.len(), (n, m));
        let units: Vec<Vec<f64>> = (0..n + m).map(|i| unit(n + m, i)).collect();
        let all: Vec<Vec<f64>> = columns.iter().chain(&units).cloned().collect();
        let passage = match self.passage(weights, all, &mut found.condition)? {
            Ok(passage) => passage,
            Err(lost) => {
                found.lost = Some(lost);
                return Ok(found);
            }
        };
        let k = columns.len();
        found.dt.copy_from_slice(&passage.dt[..k]);
        for (i, image) in passage.columns[k..].iter().enumerate() {
            for (r, entry) in image.iter().enumerate().take(n) {
                match i.checked_sub(n) {
                    None => found.saltation[r * n + i] = *entry,
                    Some(p) => found.by_parameters[r * m + p] = *entry,
                }
            }
        }
        columns.clone_from_slice(&passage.columns[..k]);
        let is_finite = columns.iter().flatten().all(|v| v.is_finite());
        found.lost = (!is_finite).then_some(Lost::NotFinite);
        Ok(found)
    }

    fn passage(
        &mut self,
        weights: &Weights,
        columns: Vec<Vec<f64>>,
        condition: &mut f64,
    ) -> Result<Result<Passage, Lost>, FieldError> {
        let record = self.record;
        let dt = match self.times(weights, &columns, condition)? {
            Ok((_, dt)) => dt,
            Err(lost) => return Ok(Err(lost)),
        };
        let fields = [&self.before.field, &self.after.field];
        if fields
            .iter()
            .any(|field| matches!(field, ModeField::Reduced(_) | ModeField::Rest(_)))
        {
            return Ok(Err(Lost::Unsupported));
        }
        if self.leaves_as_it_is() {
            return Ok(Ok(Passage { columns, dt }));
        }
        if let Some(columns) = self.entry(&columns)? {
            return Ok(Ok(Passage { columns, dt }));
        }
        if record.guards.len() > 1 {
            return Ok(Err(Lost::OneSided));
        }
        let (mut images, by_time) = self.mapped(&columns, record.field[0])?;
        let (n, after) = (self.extended.n, record.field[1]);
        for ((image, column), dt) in images.iter_mut().zip(&columns).zip(&dt) {
            for r in 0..n {
                image[r] += (by_time[r] - after[r]) * dt;
            }
            image.extend_from_slice(&column[n..]);
        }
        let z = self.extended.state(record.x[1]);
        // What is new is held exactly; the columns of the run keep to the other surfaces by themselves.
        let kept = match record.acts.is_empty() {
            true => &self.before.sliding[..],
            false => &[],
        };
        self.after
            .project_beside(kept, record.t[1], &z, &mut images)?;
        Ok(Ok(Passage {
            columns: images,
            dt,
        }))
    }

    /// What fixes the time, and its derivative by each column.
    fn times(
        &mut self,
        weights: &Weights,
        columns: &[Vec<f64>],
        condition: &mut f64,
    ) -> Result<Result<(Timing, Vec<f64>), Lost>, FieldError> {
        let record = self.record;
        let timing = match record.guards {
            [] => self.known_time(),
            [guard, ..] => self.timing(*guard)?,
        };
        let field = record.field[0];
        let states = &timing.state[..self.extended.n];
        if !record.guards.is_empty() {
            *condition = weights.condition(record.x[0], (timing.time, states), field);
        } else {
            *condition = 1.0;
        }
        let rate = timing.time + dot(&timing.state, field);
        // Where the motion is tangent the time has no derivative. A touch is located to the square root of rounding.
        let touches = record.acts.is_empty() && record.mode[0] == record.mode[1];
        let most = if touches { AT_SIDE } else { ROUNDING };
        let is_regular = *condition < 1.0 / most && rate != 0.0;
        if !is_regular {
            return Ok(Err(Lost::Grazing));
        }
        let shift = |column: &Vec<f64>| -dot(&timing.state, column) / rate;
        let dt = columns.iter().map(shift).collect();
        Ok(Ok((timing, dt)))
    }

    /// The derivatives of the time by the columns; `None` where there are none.
    pub fn time_by(
        &mut self,
        weights: &Weights,
        columns: &[Vec<f64>],
    ) -> Result<Option<Vec<f64>>, FieldError> {
        let found = self.times(weights, columns, &mut 0.0)?;
        Ok(found.ok().map(|(_, dt)| dt))
    }

    /// What fixes a known time: the clock that ticks, or the time alone.
    fn known_time(&self) -> Timing {
        let (t, z) = (self.record.t[0], self.extended.state(self.record.x[0]));
        let place = self.before.at(t, &z);
        let mut acts = self.record.acts.iter();
        let clock = acts.find_map(|act| self.extended.clock(act.index, &place));
        let (time, state) = clock.unwrap_or_else(|| (1.0, vec![0.0; z.len()]));
        Timing { time, state }
    }

    /// The gradient of a guard of the motion before.
    fn timing(&mut self, guard: Guard) -> Result<Timing, FieldError> {
        let (t, z) = (self.record.t[0], self.extended.state(self.record.x[0]));
        let mut state = vec![0.0; z.len()];
        let system = &self.extended.system;
        match guard {
            Guard::Surface(j) => {
                let time = system.gradient(j, &self.before.at(t, &z), &mut state)?;
                return Ok(Timing { time, state });
            }
            Guard::Multiplier { surface, .. } if !system.sticks_at(surface) => {
                if let Some((time, state)) = self.before.multiplier_slopes(surface, t, &z)? {
                    return Ok(Timing { time, state });
                }
            }
            _ => {}
        }
        let time = self.before.field.gradient_of(guard, t, &z, &mut state)?;
        Ok(Timing { time, state })
    }

    /// Does the same field go on? So it is at the end of a multiplier where nothing else changes.
    fn leaves_as_it_is(&self) -> bool {
        let record = self.record;
        if !record.acts.is_empty() {
            return false;
        }
        let same = |except: Option<usize>| {
            let entries = record.mode.map(|mode| mode.entries());
            let mut all = entries[0].iter().zip(entries[1]).enumerate();
            all.all(|(j, (a, b))| a == b || Some(j) == except)
        };
        match *record.guards {
            [Guard::Multiplier { surface, end }] => {
                !self.extended.system.sticks_at(surface)
                    && record.mode[1].entries()[surface] == end
                    && same(Some(surface))
            }
            [Guard::Force(surface)] => {
                record.mode[1].entries()[surface] != 0 && same(Some(surface))
            }
            [Guard::Surface(_)] => same(None) && record.field[0] == record.field[1],
            _ => false,
        }
    }

    /// The columns after an entry: what leads off the surfaces slid on is taken from them along the jumps of the field. `None` if
    /// it is another kind of instant, or if the field is not affine in the signs.
    fn entry(&self, columns: &[Vec<f64>]) -> Result<Option<Vec<Vec<f64>>>, FieldError> {
        let record = self.record;
        let entries = record.mode.map(|mode| mode.entries());
        let enters = |j: usize| entries[1][j] == 0 && record.guards.contains(&Guard::Surface(j));
        let is_entry = !record.guards.is_empty()
            && record.acts.is_empty()
            && record.guards.iter().all(|guard| guard.is_surface())
            && (0..entries[0].len()).all(|j| entries[0][j] == entries[1][j] || enters(j))
            && record
                .guards
                .iter()
                .all(|g| matches!(g, Guard::Surface(j) if enters(*j)));
        if !is_entry {
            return Ok(None);
        }
        let z = self.extended.state(record.x[1]);
        let slid_on = &self.before.sliding;
        entered(
            self.extended,
            self.after,
            slid_on,
            (record.t[1], &z),
            columns,
        )
    }

    /// The columns behind the maps of the actions, and what becomes of the field before, R_x f + R_t.
    fn mapped(
        &self,
        columns: &[Vec<f64>],
        field: &[f64],
    ) -> Result<(Vec<Vec<f64>>, Vec<f64>), FieldError> {
        let (n, m) = (self.extended.n, self.extended.n_parameters());
        let mut images: Vec<Vec<f64>> = columns.to_vec();
        let mut along = field.to_vec();
        along.resize(n + m, 0.0);
        for act in self.record.acts {
            let Some(map) = self.extended.maps.get(act.index).and_then(Option::as_ref) else {
                continue;
            };
            let mut all = images.clone();
            all.push(along.clone());
            let place = (self.record.t[0], &act.x[..], &act.discrete[..]);
            let (mut mapped, by_time) = map.apply(place, &self.extended.values, &all)?;
            let moved = mapped.pop().unwrap_or_default();
            for (image, mapped) in images.iter_mut().zip(mapped) {
                image[..n].copy_from_slice(&mapped);
            }
            for r in 0..n {
                along[r] = moved[r] + by_time[r];
            }
        }
        images.iter_mut().for_each(|image| image.truncate(n));
        along.truncate(n);
        Ok((images, along))
    }
}

/// What is left of the columns of a point that comes to the surfaces which a motion slides on, from any side of those that it did
/// not slide on before. `None` if the field is not affine in their signs.
///
/// With the jumps B of the field at all these surfaces and their gradients dH it is I - B' (dH' B')^-1 dH', where dH' are the gradients
/// of the new ones, and B' their jumps less what keeps the motion on the others.
pub(super) fn entered(
    extended: &Extended,
    sliding: &Piece,
    slid_on: &[usize],
    (t, z): (f64, &[f64]),
    columns: &[Vec<f64>],
) -> Result<Option<Vec<Vec<f64>>>, FieldError> {
    let n = extended.n;
    let is_affine = extended
        .system
        .affine_signs()
        .is_some_and(|affine| affine.affine_parts(&sliding.sliding).is_some());
    if !is_affine || matches!(sliding.field, ModeField::Reduced(_) | ModeField::Contact(_)) {
        return Ok(None);
    }
    let normals = sliding.normals(t, z)?;
    let (mut kept, mut new) = (Jumps::default(), Jumps::default());
    for (&j, normal) in sliding.sliding.iter().zip(normals) {
        let above = sliding.corner(t, z, &[(j, 1.0)])?;
        let below = sliding.corner(t, z, &[(j, -1.0)])?;
        let jump = above.iter().zip(&below).map(|(a, b)| a - b).collect();
        let side = if slid_on.contains(&j) {
            &mut kept
        } else {
            &mut new
        };
        side.changes.push(jump);
        side.normals.push(normal);
    }
    let along_kept: Vec<&[f64]> = kept.changes.iter().map(|jump| &jump[..n]).collect();
    remove_along(&along_kept, &kept.normals, &mut new.changes);
    let directions: Vec<&[f64]> = new.changes.iter().map(|jump| &jump[..n]).collect();
    let mut columns = columns.to_vec();
    remove_along(&directions, &new.normals, &mut columns);
    Ok(Some(columns))
}

/// Surfaces with the jumps of the field there.
#[derive(Default)]
struct Jumps {
    changes: Vec<Vec<f64>>,
    normals: Vec<Vec<f64>>,
}

fn unit(size: usize, i: usize) -> Vec<f64> {
    let mut unit = vec![0.0; size];
    unit[i] = 1.0;
    unit
}
