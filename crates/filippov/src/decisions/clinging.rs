//! Roots that hold a motion to a surface, nearer than the tolerance.
//!
//! Where the field has a root of h, as -sqrt(h) + w, the motion follows the zero h* of the rate of h, which w moves, faster than
//! steps can resolve near h = 0. While h* is within the tolerance the motion between the surface and h* is followed at h*
//! (`docs/theory/higher_order.md`).

use super::point::{Notes, Point};
use crate::error::FieldError;
use crate::motion::Projector;
use crate::system::dot;
use crate::tolerances::{
    AT_SIDE, BEND_OF_CLINGING, HALVINGS_OF_CLINGING, MOST_CLINGING, PIECES_OF_CLINGING, ROUNDING,
};

/// The way of a motion that is held to a surface, as straight lines.
pub(crate) struct Clinging {
    pub surface: usize,
    /// Does it end where the motion leaves the surface?
    pub leaves: bool,
    /// The ends of the lines.
    pub pieces: Vec<(f64, Vec<f64>)>,
}

/// Follows the motion until it leaves the surface by the tolerance, or until `horizon`. `None` if no surface holds it here.
pub(crate) fn cling(
    at: &Point,
    notes: &mut Notes,
    horizon: f64,
) -> Result<Option<Clinging>, FieldError> {
    let h = at.surface_values(notes, at.arrival.signs)?;
    for j in 0..h.len() {
        if !at.arrival.active[j] || at.triggers().is_only_trigger(j) {
            continue;
        }
        let mut row = vec![0.0; at.x.len()];
        at.system
            .gradient(j, &at.place(at.arrival.signs), &mut row)?;
        let tolerance = at.scale.along(&row, at.x);
        if h[j].abs() > tolerance || !tolerance.is_finite() {
            continue;
        }
        let root = Root { at: *at, j };
        if let Some(clinging) = root.follow(notes, horizon)? {
            return Ok(Some(clinging));
        }
    }
    Ok(None)
}

/// The zero of the rate of h_j beside the surface.
struct Root<'p, 'm, 'a> {
    at: Point<'p, 'm, 'a>,
    j: usize,
}

/// A state that clings to the surface.
struct Held {
    x: Vec<f64>,
    velocity: Vec<f64>,
    /// How far it is from the surface, in tolerances.
    distance: f64,
}

impl Root<'_, '_, '_> {
    fn follow(&self, notes: &mut Notes, horizon: f64) -> Result<Option<Clinging>, FieldError> {
        let (mut t, mut x) = (self.at.t, self.at.x.to_vec());
        let Some(mut side) = self.side(notes, t, &x, self.at.arrival.mode.entries()[self.j])?
        else {
            return Ok(None);
        };
        let shortest = ROUNDING * t.abs().max(horizon - t);
        let mut dt = 2.0 * shortest;
        let (mut pieces, mut leaves) = (Vec::new(), false);
        let before = self.margins(notes, t, &x, side)?;
        while t < horizon && pieces.len() < PIECES_OF_CLINGING {
            if self.at.patience.is_over() {
                return Ok(None);
            }
            match self.side(notes, t, &x, side)? {
                Some(found) => side = found,
                None => break,
            }
            dt = dt.min(horizon - t);
            let Some([middle, end]) = self.step(notes, (t, &x), side, dt)? else {
                return Ok(None);
            };
            let bend: Vec<f64> = (0..x.len())
                .map(|i| middle.x[i] - 0.5 * (x[i] + end.x[i]))
                .collect();
            let bend = self.at.scale.largest(&bend, &x);
            let margins = self.margins(notes, t + dt, &end.x, side)?;
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
            surface: self.j,
            leaves,
            pieces,
        };
        Ok((!clinging.pieces.is_empty()).then_some(clinging))
    }

    /// The side to which the fields lead, if the one there leads back from the tolerance; the last one if neither leads anywhere.
    fn side(
        &self,
        notes: &mut Notes,
        t: f64,
        x: &[f64],
        last: i8,
    ) -> Result<Option<i8>, FieldError> {
        let sides = if last == 0 { [1, -1] } else { [last, -last] };
        let mut rates = [[0.0; 2]; 2];
        for (rates, side) in rates.iter_mut().zip(sides) {
            for (rate, distance) in rates.iter_mut().zip([0.0, 1.0]) {
                *rate = self.beside(notes, t, x, side, distance)?.2;
            }
        }
        let finite = rates.iter().flatten().filter(|rate| rate.is_finite());
        let noise = AT_SIDE * finite.fold(0.0_f64, |most, rate| most.max(rate.abs()));
        let mut still = None;
        for ([rate, rate_there], side) in rates.into_iter().zip(sides) {
            let leads_back = rate_there < -noise;
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
        side: i8,
        dt: f64,
    ) -> Result<Option<[Held; 2]>, FieldError> {
        let mut after = |share: f64| {
            let dt = share * dt;
            let mut velocity = self.held(notes, t, x, side)?.velocity;
            let mut sum = velocity.clone();
            for (ahead, weight) in [(0.5, 2.0), (0.5, 2.0), (1.0, 1.0)] {
                let pairs = x.iter().zip(&velocity);
                let stage: Vec<f64> = pairs.map(|(x, v)| x + ahead * dt * v).collect();
                velocity = self.held(notes, t + ahead * dt, &stage, side)?.velocity;
                sum.iter_mut()
                    .zip(&velocity)
                    .for_each(|(s, v)| *s += weight * v);
            }
            let pairs = x.iter().zip(&sum);
            let end: Vec<f64> = pairs.map(|(x, s)| x + dt / 6.0 * s).collect();
            self.held(notes, t + dt, &end, side)
        };
        let states = [after(0.5)?, after(1.0)?];
        let is_finite = |held: &Held| held.x.iter().chain(&held.velocity).all(|v| v.is_finite());
        Ok(states.iter().all(is_finite).then_some(states))
    }

    /// The point beside x at which h_j has no rate, on this side of the surface; on it if the field leads to it from there.
    fn held(&self, notes: &mut Notes, t: f64, x: &[f64], side: i8) -> Result<Held, FieldError> {
        let (mut low, mut high) = (0.0_f64, MOST_CLINGING);
        let (on, velocity, rate) = self.beside(notes, t, x, side, 0.0)?;
        if rate <= 0.0 {
            return Ok(Held {
                x: on,
                velocity,
                distance: 0.0,
            });
        }
        if self.beside(notes, t, x, side, high)?.2 >= 0.0 {
            low = high;
        }
        // Of cubes, as the zero may be nearer by many powers of ten.
        (low, high) = (low.cbrt(), high.cbrt());
        for _ in 0..HALVINGS_OF_CLINGING {
            let middle = 0.5 * (low + high);
            match self.beside(notes, t, x, side, middle.powi(3))?.2 > 0.0 {
                true => low = middle,
                false => high = middle,
            }
        }
        let distance = high.powi(3);
        let (x, velocity, _) = self.beside(notes, t, x, side, distance)?;
        Ok(Held {
            x,
            velocity,
            distance,
        })
    }

    /// The point so many tolerances beside the surface, the velocity there, and the rate at which it leads away.
    fn beside(
        &self,
        notes: &mut Notes,
        t: f64,
        x: &[f64],
        side: i8,
        distance: f64,
    ) -> Result<(Vec<f64>, Vec<f64>, f64), FieldError> {
        let (at, j, mut x) = (&self.at, self.j, x.to_vec());
        let mode = at.arrival.mode.with(j, side);
        let signs = mode.signs();
        let mut projector = Projector::new(x.len(), signs.len());
        projector.project(at.system, j, t, &mut x, at.setting(&signs))?;
        let mut row = vec![0.0; x.len()];
        at.system
            .gradient(j, &at.place_at(t, &x, &signs), &mut row)?;
        let shift = f64::from(side) * distance * at.scale.along(&row, &x) / dot(&row, &row);
        x.iter_mut().zip(&row).for_each(|(x, g)| *x += shift * g);
        let there = at.moved(t, &x);
        let velocity = there.velocity(notes, &mode, &[])?;
        let rate = f64::from(side) * there.rate_of(j, &signs, &velocity)?.0;
        Ok((x, velocity, rate))
    }

    /// The other functions that matter, positive in the sense of the mode.
    fn margins(
        &self,
        notes: &mut Notes,
        t: f64,
        x: &[f64],
        side: i8,
    ) -> Result<Vec<f64>, FieldError> {
        let mode = self.at.arrival.mode.with(self.j, side);
        let h = self.at.moved(t, x).surface_values(notes, &mode.signs())?;
        let others = (0..h.len())
            .filter(|&k| k != self.j && self.at.arrival.active[k] && mode.entries()[k] != 0);
        Ok(others
            .map(|k| f64::from(mode.entries()[k]) * h[k])
            .collect())
    }
}
