//! The saltation matrix: what an instant makes of a change of the state.

use smallvec::SmallVec;

use super::borders::differ;
use super::change::{Change, Row, Rows};
use super::extended::Extended;
use super::piece::{Piece, Surroundings};
use super::weights::Weights;
use crate::error::FieldError;
use crate::motion::{Guard, ModeField, RootEnd};
use crate::record::InstantRecord;
use crate::system::{Act, PiecewiseSystem, SignStructure};
use crate::tolerances::{AT_SIDE, ROUNDING};
use crate::vectors::dot;

/// Why derivatives are not known from an instant on: they are NaN.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Lost {
    /// The motion touches the surface that ends it, or slides to a point where the fields of both sides are tangent to the surface: the
    /// derivative of the time is not known.
    Grazing,
    /// Several guards vanish at once, and the order in which they do so counts.
    OneSided,
    /// Infinitely many switches were jumped over.
    Accumulation,
    /// Sliding of higher order, or rest, begins or ends.
    Unsupported,
    /// A run beside this one crosses a surface on which this one stays.
    Crossed,
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
            Lost::Crossed => "crossed",
            Lost::NotFinite => "not_finite",
        }
    }
}

/// An instant with the motions around it.
pub(super) struct Instant<'i, 'a> {
    pub extended: &'a Extended<'a>,
    pub around: &'i Surroundings<'a>,
    pub record: &'i InstantRecord<'i>,
    pub before: &'i mut Piece<'a>,
    pub after: &'i mut Piece<'a>,
}

/// The columns that do not stay on the surfaces slid on.
pub(super) type Beside = SmallVec<[usize; 4]>;

/// What an instant does to changes of the extended state.
pub(super) struct Passage {
    /// The derivative of the time, a row.
    pub time: Row,
    /// What becomes of a change, one after the other.
    pub changes: SmallVec<[Change; 1]>,
    /// The field goes on: the time alone is of interest.
    pub goes_on: bool,
    /// So many of its actions are recorded as switches, where others happen at the same time.
    pub n_recorded: usize,
    /// The last change is what brings a state that actions put beside the surfaces slid on to them, a little later.
    pub arrives: bool,
}

impl Passage {
    /// What becomes of changes of the extended state. Returns those that actions put beside the surfaces slid on.
    pub fn apply(&self, n: usize, columns: &mut [Vec<f64>]) -> Beside {
        let own = &self.changes[..self.changes.len() - usize::from(self.arrives)];
        for column in &mut *columns {
            own.iter().for_each(|change| change.apply(n, column));
        }
        let arrival = self.arrival();
        arrival.map_or_else(Beside::new, |arrival| brought_by(arrival, n, columns))
    }

    /// What brings a state that actions put beside the surfaces slid on to them.
    pub fn arrival(&self) -> Option<&Change> {
        self.changes.last().filter(|_| self.arrives)
    }
}

impl Instant<'_, '_> {
    /// What the instant does, if one guard alone fixes its time, or all of it is an entry to sliding.
    pub fn passage(
        &mut self,
        weights: &Weights,
        condition: &mut f64,
    ) -> Result<Result<Passage, Lost>, FieldError> {
        let record = self.record;
        let time = match self.time(weights, condition)? {
            Ok(time) => time,
            Err(lost) => return Ok(Err(lost)),
        };
        if self.before.is_unsupported() || self.after.is_unsupported() {
            return Ok(Err(Lost::Unsupported));
        }
        let mut passage = Passage {
            time,
            changes: SmallVec::new(),
            goes_on: self.leaves_as_it_is(),
            n_recorded: 0,
            arrives: false,
        };
        if self.leaves_at_two_fold() {
            return Ok(Err(Lost::Grazing));
        }
        if passage.goes_on {
            return Ok(Ok(passage));
        }
        let mut sliding = self.after.sliding.iter();
        let enters = record.acts.is_empty() && sliding.any(|j| !self.before.sliding.contains(j));
        let z = self.extended.state(record.x[1]);
        if enters && self.after.stays_at_an_end(record.t[1], &z)? || self.goes_on_along()? {
            return Ok(Err(Lost::OneSided));
        }
        if let Some(entry) = self.entry()? {
            passage.changes.push(entry);
            return Ok(Ok(passage));
        }
        if self.passes_others_apart(&passage.time)? {
            return Ok(Err(Lost::OneSided));
        }
        let (map, mut moved) = self.mapped()?;
        let after = record.field[1].iter();
        moved
            .iter_mut()
            .zip(after)
            .for_each(|(f, after)| *f -= after);
        let jump = Change::at_moving_time(map, moved, passage.time.clone());
        passage.changes.push(jump);
        // What is new is held exactly; the columns of the run keep to the other surfaces by themselves.
        let arrival = match record.acts.is_empty() {
            true => None,
            false => arrival(self.after, record.t[1], &z)?,
        };
        passage.arrives = arrival.is_some();
        let kept = match record.acts.is_empty() {
            true => &self.before.sliding[..],
            false => &[],
        };
        let held = match arrival {
            None => self.after.projection(kept, record.t[1], &z)?,
            known => known,
        };
        passage.changes.extend(held);
        Ok(Ok(passage))
    }

    /// Does the motion cross a surface and then go along it, up to rounding? A changed one may slide on it, and differ by as much.
    fn goes_on_along(&mut self) -> Result<bool, FieldError> {
        let record = self.record;
        let [before, after] = record.mode.map(|mode| mode.entries());
        let guard = match *record.guards {
            [guard @ Guard::Surface(j)] if before[j] * after[j] < 0 => guard,
            _ => return Ok(false),
        };
        let z = self.extended.state(record.x[0]);
        let own = self.before.gradient_of(guard, record.t[0], &z)?;
        let [before, after] = record.field.map(|field| own.time + dot(&own.state, field));
        Ok(record.acts.is_empty() && after.abs() <= ROUNDING * before.abs())
    }

    /// The derivative of the time, a row, from what fixes it.
    pub fn time(
        &mut self,
        weights: &Weights,
        condition: &mut f64,
    ) -> Result<Result<Row, Lost>, FieldError> {
        let record = self.record;
        let Some(guard) = self.guard() else {
            *condition = 1.0;
            let mut acts = record.acts.iter();
            let time = acts.find_map(|act| self.time_of_tick(act));
            let fixed = || Row::from_elem(0.0, self.extended.n + self.extended.n_parameters());
            return Ok(Ok(time.unwrap_or_else(fixed)));
        };
        let z = self.extended.state(record.x[0]);
        let timing = self.before.gradient_of(guard, record.t[0], &z)?;
        let field = record.field[0];
        let states = &timing.state[..self.extended.n];
        let (x, gradient) = (record.x[0], (timing.time, states));
        *condition = weights.condition(x, gradient, field, weights.span);
        let unit = weights.time_of_change(record.t[0], x, field);
        let rate = timing.time + dot(&timing.state, field);
        // Where the motion is tangent the time has no derivative. A touch is located to the square root of rounding.
        let touches = record.acts.is_empty() && record.mode[0] == record.mode[1];
        let most = if touches { AT_SIDE } else { ROUNDING };
        let is_regular = weights.condition(x, gradient, field, unit) < 1.0 / most && rate != 0.0;
        // A touch at which the function is stationary, as cos(x) - p is at p = 1, is moved by the parameters alone.
        let by_parameters = timing.state[self.extended.n..].iter();
        let values = self.extended.values.iter().map(|p| 1.0 + p.abs());
        let moved = by_parameters.zip(values).map(|(g, p)| (g * p).abs());
        let is_moved = touches && moved.sum::<f64>() * AT_SIDE > rate.abs() * unit;
        // A multiplier is of size 1. Where it is so steep, or where the equations of an affine field become singular, it is a
        // quotient of two functions that vanish, and neither it nor the field before is known.
        let is_pole = match guard {
            Guard::Multiplier { .. } => weights.length(x, gradient, unit) > 1.0 / AT_SIDE,
            Guard::Root(RootEnd::Fold) => self.before.is_affine,
            _ => false,
        };
        if !is_regular || is_moved || is_pole {
            return Ok(Err(Lost::Grazing));
        }
        Ok(Ok(timing.state.iter().map(|g| -g / rate).collect()))
    }

    /// The derivative of the time at which a guard vanishes, a row.
    pub fn time_of(&mut self, guard: Guard) -> Result<Row, FieldError> {
        let z = self.extended.state(self.record.x[0]);
        let own = self.before.gradient_of(guard, self.record.t[0], &z)?;
        let rate = own.time + dot(&own.state, self.record.field[0]);
        Ok(own.state.iter().map(|g| -g / rate).collect())
    }

    /// Those of the guards that vanish together with the one that fixes the time, and of the surfaces passed with it.
    pub fn further_times(&mut self) -> Result<SmallVec<[Row; 1]>, FieldError> {
        let passed = self.passed_with_it()?;
        let further = self.record.guards.iter().skip(1).copied();
        let all = further.chain(passed.into_iter().map(Guard::Surface));
        all.map(|guard| self.time_of(guard)).collect()
    }

    /// The guard that fixes the time, if it is no known time: also that of a start on the surface of an action.
    pub fn guard(&self) -> Option<Guard> {
        let first = self.record.acts.first();
        let surface = first.and_then(|act| self.extended.surface_of(act.index));
        let guards = self.record.guards.first().copied();
        guards.or(surface.map(Guard::Surface))
    }

    /// The derivative of the time of an action at a known time, a row; none for other actions.
    pub fn time_of_tick(&self, act: &Act) -> Option<Row> {
        let z = self.extended.state(self.record.x[0]);
        let place = self.before.at(self.record.t[0], &z);
        self.extended.time_of_tick(act.index, &place)
    }

    /// The surfaces that the motion passes besides those that fix the time, as their functions vanish there too.
    pub(super) fn passed_with_it(&self) -> Result<Vec<usize>, FieldError> {
        let record = self.record;
        let entries = record.mode.map(|mode| mode.entries());
        let is_passed = |j: &usize| {
            let (before, after) = (entries[0][*j], entries[1][*j]);
            before != 0 && before != after && !record.guards.contains(&Guard::Surface(*j))
        };
        let passed: Vec<usize> = (0..entries[0].len()).filter(is_passed).collect();
        if !record.acts.is_empty() || passed.is_empty() {
            return Ok(Vec::new());
        }
        let (t, z) = (record.t[0], self.extended.state(record.x[0]));
        let (h, place) = (self.before.surfaces(t, &z)?, self.before.at(t, &z));
        let mut found = Vec::new();
        for j in passed {
            if h[j].abs() <= AT_SIDE * self.extended.system.surface_size(j, &place)? {
                found.push(j);
            }
        }
        Ok(found)
    }

    /// Does a changed motion, on the surfaces that this one keeps to, come to one of the others at another time than this?
    fn passes_others_apart(&mut self, time: &[f64]) -> Result<bool, FieldError> {
        let (t, z) = (self.record.t[0], self.extended.state(self.record.x[0]));
        let passed = self.passed_with_it()?.into_iter().map(Guard::Surface);
        let others: SmallVec<[Guard; 2]> = self
            .record
            .guards
            .iter()
            .skip(1)
            .copied()
            .chain(passed)
            .collect();
        if others.is_empty() {
            return Ok(false);
        }
        let onto_surfaces = self.before.projection(&[], t, &z)?;
        if !self.record.acts.is_empty() {
            return Ok(true);
        }
        for guard in others {
            let own = match guard {
                Guard::Surface(_) => self.before.gradient_of(guard, t, &z)?,
                // Sliding ends when the field on the side where the motion leaves becomes tangent to the surface. We use the rate of
                // that field, since the multiplier may be a quotient of two functions that vanish.
                Guard::Multiplier { surface, end }
                    if self.before.sliding[..] == [surface]
                        && self.record.mode[1].entries()[surface] == end
                        && !self.extended.system.sticks_at(surface) =>
                {
                    self.before.gradient_of_rate((surface, end), t, &z)?
                }
                _ => return Ok(true),
            };
            let rate = own.time + dot(&own.state, self.record.field[0]);
            let size = own
                .state
                .iter()
                .fold(rate.abs(), |most, g| most.max(g.abs()));
            let entries = own.state.iter().zip(time);
            let mut apart: Vec<f64> = entries.map(|(g, time)| g + rate * time).collect();
            if let Some(onto_surfaces) = &onto_surfaces {
                onto_surfaces.pull_back(self.extended.n, &mut apart);
            }
            if apart.iter().any(|entry| entry.abs() > AT_SIDE * size) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Does the same field go on? So it is at the ends of multipliers where nothing else changes: those of several surfaces that are
    /// left at once, in whatever order a changed motion leaves them.
    fn leaves_as_it_is(&self) -> bool {
        let record = self.record;
        if !record.acts.is_empty() {
            return false;
        }
        let entries = record.mode.map(|mode| mode.entries());
        let same = |left: &[usize]| {
            let mut all = entries[0].iter().zip(entries[1]).enumerate();
            all.all(|(j, (a, b))| a == b || left.contains(&j))
        };
        if let [Guard::Surface(_)] = *record.guards {
            return same(&[]) && record.field[0] == record.field[1];
        }
        let left = record.guards.iter().map(|guard| match *guard {
            Guard::Multiplier { surface, end } => {
                let is_left = entries[1][surface] == end;
                (is_left && !self.extended.system.sticks_at(surface)).then_some(surface)
            }
            Guard::Force(surface) => (entries[1][surface] != 0).then_some(surface),
            _ => None,
        });
        let left: Option<SmallVec<[usize; 2]>> = left.collect();
        left.is_some_and(|left| !left.is_empty() && same(&left))
    }

    /// Does sliding on a surface end on the other side than its multiplier tells? So it is where the fields of both sides become
    /// tangent to the surface, and the multiplier, the quotient of two functions that vanish, does not fix the time.
    fn leaves_at_two_fold(&self) -> bool {
        let record = self.record;
        match *record.guards {
            [Guard::Multiplier { surface, end }] => {
                record.acts.is_empty() && record.mode[1].entries()[surface] == -end
            }
            _ => false,
        }
    }

    /// What an entry does: what leads off the surfaces slid on is taken from a change along the jumps of the field. `None` if it is
    /// another kind of instant, or if the field is not affine in the signs.
    fn entry(&self) -> Result<Option<Change>, FieldError> {
        let record = self.record;
        let entries = record.mode.map(|mode| mode.entries());
        let enters = |j: usize| entries[1][j] == 0 && record.guards.contains(&Guard::Surface(j));
        let mut guards = record.guards.iter();
        let is_entry = !record.guards.is_empty()
            && record.acts.is_empty()
            && guards.all(|g| matches!(g, Guard::Surface(j) if enters(*j)))
            && (0..entries[0].len()).all(|j| entries[0][j] == entries[1][j] || enters(j));
        if !is_entry {
            return Ok(None);
        }
        let z = self.extended.state(record.x[1]);
        let slid_on = &self.before.sliding;
        entered(self.extended, self.after, slid_on, (record.t[1], &z))
    }

    /// The derivative of the maps of the actions, if they move the state, and what becomes of the field before, R_x f + R_t.
    fn mapped(&self) -> Result<Mapped, FieldError> {
        let (n, values) = (self.extended.n, &self.extended.values);
        let mut total: Option<Vec<Vec<f64>>> = None;
        let mut along = Row::from_slice(self.record.field[0]);
        for act in self.record.acts {
            let Some(map) = self.extended.maps.get(act.index).and_then(Option::as_ref) else {
                continue;
            };
            let place = (self.record.t[0], &act.x[..]);
            let (rows, by_time) = map.derivative(place, values)?;
            let moved = rows.iter().zip(&by_time);
            along = moved
                .map(|(row, by_time)| dot(&row[..n], &along) + by_time)
                .collect();
            total = Some(match total {
                None => rows,
                Some(earlier) => rows.iter().map(|row| chained(n, row, &earlier)).collect(),
            });
        }
        Ok((total, along))
    }
}

/// The rows of the derivative of maps, if any moves the state, and what becomes of the field before.
type Mapped = (Option<Vec<Vec<f64>>>, Row);

/// A row of the derivative of a map behind another one.
fn chained(n: usize, row: &[f64], earlier: &[Vec<f64>]) -> Vec<f64> {
    let mut product = row.to_vec();
    product[..n].fill(0.0);
    for (share, earlier) in row.iter().zip(earlier) {
        let entries = product.iter_mut().zip(earlier);
        entries.for_each(|(entry, value)| *entry += share * value);
    }
    product
}

/// What becomes of a change at a point that comes to the surfaces which a motion slides on, from any side of those that it did not
/// slide on before. `None` if the field is not affine in their signs.
///
/// With the jumps B of the field at all these surfaces and their gradients dH it is I - B' (dH' B')^-1 dH', where dH' are the gradients
/// of the new ones, and B' their jumps less what keeps the motion on the others.
pub(super) fn entered(
    extended: &Extended,
    sliding: &Piece,
    slid_on: &[usize],
    (t, z): (f64, &[f64]),
) -> Result<Option<Change>, FieldError> {
    let n = extended.n;
    if !sliding.is_affine || matches!(sliding.field, ModeField::Reduced(_) | ModeField::Contact(_))
    {
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
    if !kept.normals.is_empty() {
        let onto_kept = kept.taken_out(n);
        new.changes
            .iter_mut()
            .for_each(|jump| onto_kept.apply(n, jump));
    }
    Ok(Some(new.taken_out(n)))
}

/// What becomes of a change at a start on surfaces that the motion slides on, or where an action puts it on them: a start beside them
/// comes to them at once. `None` if it slides on none.
pub(super) fn arrival(piece: &Piece, t: f64, z: &[f64]) -> Result<Option<Change>, FieldError> {
    if piece.sliding.is_empty() {
        return Ok(None);
    }
    match entered(piece.extended, piece, &[], (t, z))? {
        None => piece.projection(&[], t, z),
        entry => Ok(entry),
    }
}

/// Brings changes to the surfaces slid on. Returns those that were beside them.
pub(super) fn brought_by(arrival: &Change, n: usize, columns: &mut [Vec<f64>]) -> Beside {
    let mut beside = Beside::new();
    for (c, column) in columns.iter_mut().enumerate() {
        let before = column.clone();
        arrival.apply(n, column);
        beside.extend(differ(&before, column).then_some(c));
    }
    beside
}

/// Surfaces with the jumps of the field there.
#[derive(Default)]
struct Jumps {
    changes: Rows,
    normals: Rows,
}

impl Jumps {
    /// What takes from a change its parts off the surfaces, along the jumps.
    fn taken_out(&self, n: usize) -> Change {
        let directions = self.changes.iter().map(|jump| Row::from_slice(&jump[..n]));
        Change::normal_to(self.normals.clone(), directions.collect())
    }
}
