//! Roots that hold a motion to surfaces, nearer than the tolerance.
//!
//! Where the field has a root of h, as -sqrt(h) + w, the motion follows the zero h* of the rate of h, which w moves, faster than
//! steps can resolve near h = 0. While h* is within the tolerance the motion between the surface and h* is followed at h*
//! (`docs/theory/higher_order.md`).

use super::point::{Notes, Point};
use crate::cube::Vector;
use crate::error::FieldError;
use crate::mode::Mode;
use crate::motion::shares_of_rows;
use crate::system::is_zero_within;
use crate::tolerances::{
    AT_SIDE, BEND_OF_CLINGING, CLOSE_TO_ROOT, MAX_DEPTH, MOST_CLINGING, PIECES_OF_CLINGING,
    ROUNDING,
};

/// The way of a motion that is held to surfaces, as straight lines.
pub(crate) struct Clinging {
    pub surfaces: Vec<usize>,
    /// The mode in which it begins, if the surfaces hold it like roots: their entries are the sides on which the motion is.
    pub mode: Option<Mode>,
    /// Does it end where the motion leaves a surface?
    pub leaves: bool,
    /// The ends of the lines.
    pub pieces: Vec<(f64, Vec<f64>)>,
}

/// Follows the motion until it leaves a surface by the tolerance, or until `horizon`. `None` if no surface holds it here. With
/// `only_roots` a surface counts only if the rate of its function falls like a root beside it.
pub(crate) fn cling(
    at: &Point,
    notes: &mut Notes,
    only_roots: bool,
    horizon: f64,
) -> Result<Option<Clinging>, FieldError> {
    let h = at.surface_values(notes, at.arrival.signs)?;
    let (mut near, mut mode) = (Vec::new(), at.arrival.mode.clone());
    for j in 0..h.len() {
        if !at.arrival.active.has(j) || at.triggers().is_only_trigger(j) {
            continue;
        }
        let place = at.place(at.arrival.signs);
        if is_zero_within(at.system, &place, (j, h[j]), at.scale)? {
            near.push(j);
        } else if f64::from(mode.entries()[j]) * h[j] < 0.0 {
            mode.set(j, -mode.entries()[j]);
        }
    }
    // Other surfaces may be slid on; or roots hold the motion on all of them.
    for leaves_others in [false, true] {
        if leaves_others && !only_roots {
            break;
        }
        let mut roots = Roots {
            at: *at,
            mode: mode.clone(),
            surfaces: Vec::new(),
            only_roots,
        };
        let slid = near.iter().filter(|&&j| mode.entries()[j] == 0);
        if leaves_others {
            slid.for_each(|&j| roots.mode.set(j, 1));
        }
        roots.pass(notes, &h)?;
        for &j in &near {
            roots.surfaces.push(j);
            let before = roots.mode.entries()[j];
            let last = mode.entries()[j];
            match roots.side(notes, (at.t, at.x), roots.surfaces.len() - 1, last)? {
                Some(side) => roots.mode.set(j, side),
                None => {
                    roots.mode.set(j, before);
                    roots.surfaces.pop();
                }
            }
        }
        if !roots.surfaces.is_empty() {
            let clinging = roots.follow(notes, horizon)?;
            if clinging.is_some() {
                return Ok(clinging);
            }
        }
    }
    Ok(None)
}

/// The side of the surface on which a motion that touches it again and again stays for good: it has no rate on the surface, and beside
/// it, on that side, it leads back. With the state on the surface.
pub(crate) fn side_of_rest(
    at: &Point,
    notes: &mut Notes,
    j: usize,
) -> Result<Option<(i8, Vec<f64>)>, FieldError> {
    let roots = Roots {
        at: *at,
        mode: at.arrival.mode.clone(),
        surfaces: vec![j],
        only_roots: true,
    };
    let last = roots.mode.entries()[j];
    let Some(side) = roots.side(notes, (at.t, at.x), 0, last)? else {
        return Ok(None);
    };
    let mode = roots.mode.with(j, side);
    let (x, velocity) = roots.beside(notes, (at.t, at.x), &mode, &[0.0])?;
    let rate = roots.rate(0, (at.t, &x), &mode, &velocity)?;
    Ok((rate == 0.0).then_some((side, x)))
}

/// The zeros of the rates of some functions, each beside its surface.
struct Roots<'p, 'm, 'a> {
    at: Point<'p, 'm, 'a>,
    /// That of each of these surfaces is the side on which the motion is.
    mode: Mode,
    surfaces: Vec<usize>,
    only_roots: bool,
}

/// A state that clings to the surfaces.
struct Held {
    x: Vec<f64>,
    velocity: Vec<f64>,
    /// How far it is from the farthest surface, in tolerances.
    distance: f64,
}

impl Roots<'_, '_, '_> {
    /// Where another function vanishes, as that of a known time, the motion is on the side to which it leads.
    fn pass(&mut self, notes: &mut Notes, h: &[f64]) -> Result<(), FieldError> {
        let at = &self.at;
        let mut velocity = at.velocity(notes, &self.mode, &[])?;
        velocity
            .iter_mut()
            .filter(|v| !v.is_finite())
            .for_each(|v| *v = 0.0);
        let signs = self.mode.signs();
        for j in (0..h.len()).filter(|&j| !at.triggers().is_only_trigger(j)) {
            let size = at.system.surface_size(j, &at.place(&signs))?;
            let side = self.mode.entries()[j];
            let (rate, noise) = at.rate_of(j, &signs, &velocity)?;
            if h[j].abs() <= ROUNDING * size && f64::from(side) * rate < -AT_SIDE * noise {
                self.mode.set(j, -side);
            }
        }
        Ok(())
    }

    fn follow(mut self, notes: &mut Notes, horizon: f64) -> Result<Option<Clinging>, FieldError> {
        let (mut t, mut x) = (self.at.t, self.at.x.to_vec());
        let first = self.mode.clone();
        let shortest = ROUNDING * t.abs().max(horizon - t);
        let mut dt = 2.0 * shortest;
        let (mut pieces, mut leaves) = (Vec::new(), false);
        let before = self.margins(notes, t, &x)?;
        while t < horizon && pieces.len() < PIECES_OF_CLINGING {
            if self.at.patience.is_over() {
                return Ok(None);
            }
            if !self.is_held(notes, t, &x)? {
                break;
            }
            dt = dt.min(horizon - t);
            let Some([middle, end]) = self.step(notes, (t, &x), dt)? else {
                return Ok(None);
            };
            let bend: Vec<f64> = (0..x.len())
                .map(|i| middle.x[i] - 0.5 * (x[i] + end.x[i]))
                .collect();
            let bend = self.at.scale.largest(&bend, &x);
            let margins = self.margins(notes, t + dt, &end.x)?;
            let is_inside = margins
                .iter()
                .zip(&before)
                .all(|(now, before)| *now >= before.min(0.0));
            let is_far = end.distance >= MOST_CLINGING || !is_inside;
            if (bend > BEND_OF_CLINGING || is_far) && dt > shortest {
                dt = (0.5 * dt).max(shortest);
                continue;
            }
            t = if dt < horizon - t { t + dt } else { horizon };
            x = end.x;
            pieces.push((t, x.clone()));
            // Where another function has changed its sign the motion is decided anew.
            leaves = end.distance > 1.0;
            if leaves || !is_inside {
                break;
            }
            if bend < 0.25 * BEND_OF_CLINGING {
                dt *= 2.0;
            }
        }
        let clinging = Clinging {
            surfaces: self.surfaces,
            mode: self.only_roots.then_some(first),
            leaves,
            pieces,
        };
        Ok((!clinging.pieces.is_empty()).then_some(clinging))
    }

    /// Do all of the surfaces still hold the motion, each on the side to which it leads now?
    fn is_held(&mut self, notes: &mut Notes, t: f64, x: &[f64]) -> Result<bool, FieldError> {
        for i in 0..self.surfaces.len() {
            let j = self.surfaces[i];
            match self.side(notes, (t, x), i, self.mode.entries()[j])? {
                Some(side) => self.mode.set(j, side),
                None => return Ok(false),
            }
        }
        Ok(true)
    }

    /// The side of surface `i` of those to which the fields lead, if the one there leads back from the tolerance; the last one if
    /// neither leads anywhere.
    fn side(
        &self,
        notes: &mut Notes,
        (t, x): (f64, &[f64]),
        i: usize,
        last: i8,
    ) -> Result<Option<i8>, FieldError> {
        let sides = if last == 0 { [1, -1] } else { [last, -last] };
        let mut distances = vec![0.0; self.surfaces.len()];
        let mut rates = [[0.0; 3]; 2];
        for (rates, side) in rates.iter_mut().zip(sides) {
            let mode = self.mode.with(self.surfaces[i], side);
            for (rate, distance) in rates.iter_mut().zip([0.0, CLOSE_TO_ROOT, 1.0]) {
                distances[i] = distance;
                let (x, velocity) = self.beside(notes, (t, x), &mode, &distances)?;
                *rate = self.rate(i, (t, &x), &mode, &velocity)?;
            }
        }
        let finite = rates.iter().flatten().filter(|rate| rate.is_finite());
        let noise = AT_SIDE * finite.fold(0.0_f64, |most, rate| most.max(rate.abs()));
        let mut still = None;
        for ([rate, rate_near, rate_there], side) in rates.into_iter().zip(sides) {
            // In proportion to the distance it would fall by that part of it.
            let is_root = rate - rate_near > 2.0 * CLOSE_TO_ROOT * (rate - rate_there);
            let leads_back = rate_there < -noise && (is_root || !self.only_roots);
            if rate > noise {
                return Ok(leads_back.then_some(side));
            }
            if rate.abs() <= noise && leads_back {
                still = still.or(Some(side));
            }
        }
        Ok(still)
    }

    /// The states after half of a time and all of it, by the classical method of fourth order; `None` if one is not finite.
    fn step(
        &self,
        notes: &mut Notes,
        (t, x): (f64, &[f64]),
        dt: f64,
    ) -> Result<Option<[Held; 2]>, FieldError> {
        let mut after = |share: f64| {
            let dt = share * dt;
            let mut velocity = self.held(notes, t, x)?.velocity;
            let mut sum = velocity.clone();
            for (ahead, weight) in [(0.5, 2.0), (0.5, 2.0), (1.0, 1.0)] {
                let pairs = x.iter().zip(&velocity);
                let stage: Vec<f64> = pairs.map(|(x, v)| x + ahead * dt * v).collect();
                velocity = self.held(notes, t + ahead * dt, &stage)?.velocity;
                sum.iter_mut()
                    .zip(&velocity)
                    .for_each(|(s, v)| *s += weight * v);
            }
            let pairs = x.iter().zip(&sum);
            let end: Vec<f64> = pairs.map(|(x, s)| x + dt / 6.0 * s).collect();
            self.held(notes, t + dt, &end)
        };
        let states = [after(0.5)?, after(1.0)?];
        let is_finite = |held: &Held| held.x.iter().chain(&held.velocity).all(|v| v.is_finite());
        Ok(states.iter().all(is_finite).then_some(states))
    }

    /// The point beside x at which the functions have no rate, each on its side of the surface; on the surface if the field leads to it
    /// from there. The distance of one may depend on that of another.
    fn held(&self, notes: &mut Notes, t: f64, x: &[f64]) -> Result<Held, FieldError> {
        let mut distances = vec![0.0; self.surfaces.len()];
        for _ in 0..self.surfaces.len() {
            for i in 0..self.surfaces.len() {
                distances[i] = self.distance(notes, (t, x), i, &distances)?;
            }
        }
        let (x, velocity) = self.beside(notes, (t, x), &self.mode, &distances)?;
        Ok(Held {
            x,
            velocity,
            distance: distances.into_iter().fold(0.0, f64::max),
        })
    }

    /// How far from surface `i` of those its function has no rate, in tolerances, if these are the distances of the others.
    fn distance(
        &self,
        notes: &mut Notes,
        (t, x): (f64, &[f64]),
        i: usize,
        distances: &[f64],
    ) -> Result<f64, FieldError> {
        let mut distances = distances.to_vec();
        let mut rate = |distance: f64| {
            distances[i] = distance;
            let (x, velocity) = self.beside(notes, (t, x), &self.mode, &distances)?;
            self.rate(i, (t, &x), &self.mode, &velocity)
        };
        if rate(0.0)? <= 0.0 {
            return Ok(0.0);
        }
        let (mut low, mut high) = (0.0_f64, MOST_CLINGING);
        if rate(high)? >= 0.0 {
            low = high;
        }
        // Of cubes, as the zero may be nearer by many powers of ten.
        (low, high) = (low.cbrt(), high.cbrt());
        for _ in 0..MAX_DEPTH {
            let middle = 0.5 * (low + high);
            match rate(middle.powi(3))? > 0.0 {
                true => low = middle,
                false => high = middle,
            }
        }
        Ok(high.powi(3))
    }

    /// The point so many tolerances beside the surfaces, in the mode, and the velocity there.
    fn beside(
        &self,
        notes: &mut Notes,
        (t, x): (f64, &[f64]),
        mode: &Mode,
        distances: &[f64],
    ) -> Result<(Vec<f64>, Vec<f64>), FieldError> {
        let (at, n, mut x) = (&self.at, x.len(), x.to_vec());
        let signs = mode.signs();
        let mut projector = at.projector();
        projector.project_onto(at.system, &self.surfaces, t, &mut x, at.setting(&signs))?;
        let (mut rows, mut shifts) = (vec![0.0; n * self.surfaces.len()], Vector::new());
        let held = self.surfaces.iter().zip(distances);
        for (row, (&j, distance)) in rows.chunks_exact_mut(n).zip(held) {
            at.system.gradient(j, &at.place_at(t, &x, &signs), row)?;
            shifts.push(f64::from(mode.entries()[j]) * distance * at.scale.along(row, &x));
        }
        if let Some(shares) = shares_of_rows(&rows, &shifts) {
            for (row, share) in rows.chunks_exact(n).zip(shares) {
                x.iter_mut().zip(row).for_each(|(x, g)| *x += share * g);
            }
        }
        let velocity = at.moved(t, &x).velocity(notes, mode, &[])?;
        Ok((x, velocity))
    }

    /// The rate at which the motion leads away from surface `i` of those.
    fn rate(
        &self,
        i: usize,
        (t, x): (f64, &[f64]),
        mode: &Mode,
        velocity: &[f64],
    ) -> Result<f64, FieldError> {
        let j = self.surfaces[i];
        let (rate, _) = self.at.moved(t, x).rate_of(j, &mode.signs(), velocity)?;
        Ok(f64::from(mode.entries()[j]) * rate)
    }

    /// The other functions that matter, positive in the sense of the mode.
    fn margins(&self, notes: &mut Notes, t: f64, x: &[f64]) -> Result<Vec<f64>, FieldError> {
        let entries = self.mode.entries();
        let h = self
            .at
            .moved(t, x)
            .surface_values(notes, &self.mode.signs())?;
        let others = (0..h.len()).filter(|&k| {
            !self.surfaces.contains(&k) && self.at.arrival.active.has(k) && entries[k] != 0
        });
        Ok(others.map(|k| f64::from(entries[k]) * h[k]).collect())
    }
}
