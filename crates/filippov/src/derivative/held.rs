//! A motion in one mode, whatever its guards are: these guards, with their derivatives.

use super::extended::Extended;
use super::piece::{Piece, Surroundings};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::motion::{Guard, SmoothField};
use crate::options::Options;
use crate::record::Gradient;
use crate::system::{
    Act, ActionMap, Actions, PiecewiseSystem, Setting, SignStructure, TracedSystem,
};

/// The motion of a mode, asked at places that it need not be admissible at.
pub struct HeldMotion<'a> {
    piece: Piece<'a>,
    guards: Vec<Guard>,
}

/// A guard at a place: positive while the motion lasts.
#[derive(Clone, Debug)]
pub struct GuardAt {
    /// Which one.
    pub guard: Guard,
    /// Its value.
    pub value: f64,
    /// Its derivatives by the time, and by the states with the parameters behind them.
    pub gradient: Gradient,
}

/// What an action makes of a place, and its derivative.
#[derive(Clone, Debug)]
pub struct ActionAt {
    /// The state after it.
    pub x: Vec<f64>,
    /// The discrete states after it.
    pub q: Vec<f64>,
    /// The derivative of the state, n rows by the states with the parameters behind them; `None`: the state is as it was.
    pub rows: Option<Vec<Vec<f64>>>,
    /// The derivative of the state by the time.
    pub by_time: Vec<f64>,
    /// What the action waits for, if that is a clock with parameters: its value, and its derivatives.
    pub clock: Option<(f64, Gradient)>,
}

impl<'a> HeldMotion<'a> {
    /// The motion of a mode with these discrete states.
    pub fn new(
        (system, extended): (&TracedSystem, &'a Extended<'a>),
        impacts: &'a Actions<'a>,
        options: &'a Options,
        mode: &Mode,
        q: &[f64],
    ) -> Self {
        let mut around = Surroundings::at_start(extended, impacts, options);
        around.take_sides(mode);
        let piece = Piece::new(&around, mode, q);
        let sliding: Vec<usize> = mode.sliding_set().collect();
        let mut active = vec![false; mode.entries().len()];
        system.active(&mode.signs(), &sliding, &mut active);
        let entries = mode.entries().iter().enumerate();
        let surfaces = entries.filter(|(j, entry)| active[*j] && **entry != 0);
        let mut guards: Vec<Guard> = surfaces.map(|(j, _)| Guard::Surface(j)).collect();
        guards.extend(piece.field.guards());
        HeldMotion { piece, guards }
    }

    /// What ends the motion.
    pub fn guards(&self) -> &[Guard] {
        &self.guards
    }

    /// The velocity at a place, with the parameters, which rest.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn velocity(&mut self, t: f64, x: &[f64]) -> Result<Vec<f64>, FieldError> {
        let mut z = self.piece.extended.state(x);
        let mut velocity = vec![0.0; z.len()];
        self.piece
            .field
            .eval_unprojected(t, &mut z, &mut velocity)?;
        Ok(velocity)
    }

    /// The multipliers at the place asked about last, in the order of the surfaces slid on.
    pub fn multipliers(&self) -> Vec<f64> {
        self.piece.field.multipliers().to_vec()
    }

    /// The values of the guards at a place.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn values(&mut self, t: f64, x: &[f64]) -> Result<Vec<f64>, FieldError> {
        let z = self.piece.extended.state(x);
        let mut h = vec![0.0; self.piece.mode.entries().len()];
        let system = &self.piece.extended.system;
        system.surfaces(&self.piece.at(t, &z), &mut h)?;
        let exits = self.piece.field.exits_at(t, &mut z.clone())?;
        let multipliers = self.piece.field.multipliers();
        let own = self.piece.field.guards();
        let value = |guard: &Guard| match *guard {
            Guard::Surface(j) => h[j] * f64::from(self.piece.mode.entries()[j]),
            Guard::Multiplier { surface, end } if self.is_smooth(surface) => {
                let place = self.piece.sliding.iter().position(|&k| k == surface);
                let known = place.and_then(|place| multipliers.get(place));
                known.map_or(f64::NAN, |known| 1.0 - f64::from(end) * known)
            }
            guard => {
                let place = own.iter().position(|known| *known == guard);
                place.map_or(f64::NAN, |place| exits[place])
            }
        };
        Ok(self.guards.iter().map(value).collect())
    }

    /// The guards at a place, with their derivatives.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn guards_at(&mut self, t: f64, x: &[f64]) -> Result<Vec<GuardAt>, FieldError> {
        let values = self.values(t, x)?;
        let z = self.piece.extended.state(x);
        let mut found = Vec::with_capacity(values.len());
        for (place, value) in values.into_iter().enumerate() {
            let guard = self.guards[place];
            let mut gradient = self.piece.gradient_of(guard, t, &z)?;
            let sense = match guard {
                Guard::Surface(j) => f64::from(self.piece.mode.entries()[j]),
                Guard::Multiplier { surface, end } if self.is_smooth(surface) => -f64::from(end),
                _ => 1.0,
            };
            gradient.time *= sense;
            gradient.state.iter_mut().for_each(|entry| *entry *= sense);
            found.push(GuardAt {
                guard,
                value,
                gradient,
            });
        }
        Ok(found)
    }

    /// Is the guard of a multiplier a function of the multiplier itself? That of static friction is not.
    fn is_smooth(&self, surface: usize) -> bool {
        !self.piece.extended.system.sticks_at(surface) && self.piece.knows_multipliers()
    }
}

impl Extended<'_> {
    /// What an action makes of a place of a motion in this mode.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn act(
        &self,
        (actions, index): (&Actions, usize),
        mode: &Mode,
        (t, x, q): (f64, &[f64], &[f64]),
    ) -> Result<ActionAt, FieldError> {
        let (mut after, mut discrete) = (x.to_vec(), q.to_vec());
        let signs = mode.signs();
        let map: &dyn ActionMap = actions.list[index].map;
        map.apply(t, &mut after, &signs, &mut discrete)?;
        let derivative = match self.maps.get(index).and_then(Option::as_ref) {
            Some(map) => Some(map.derivative((t, x, q), &self.values)?),
            None => None,
        };
        let (rows, by_time) = derivative.map_or((None, vec![0.0; x.len()]), |(rows, by_time)| {
            (Some(rows), by_time)
        });
        let z = self.state(x);
        let place = Setting::new(&signs, q).at(t, &z);
        let act = Act {
            index,
            x: x.to_vec(),
            discrete: q.to_vec(),
        };
        Ok(ActionAt {
            x: after,
            q: discrete,
            rows,
            by_time,
            clock: self.clock(act.index, &place),
        })
    }
}
