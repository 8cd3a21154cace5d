//! A motion in one mode, whatever its guards are: these guards, with their derivatives.

use super::change::Row;
use super::extended::Extended;
use super::piece::{Piece, Surroundings};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::motion::Guard;
use crate::options::Options;
use crate::record::Gradient;
use crate::system::{ActionMap, Actions, PiecewiseSystem, Setting, SignStructure, TracedSystem};

/// The motion of a mode, asked at places that it need not be admissible at.
pub struct HeldMotion<'a> {
    piece: Piece<'a>,
    guards: Vec<Guard>,
    q: Vec<f64>,
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
        HeldMotion {
            piece,
            guards,
            q: q.to_vec(),
        }
    }

    /// Its mode.
    pub fn mode(&self) -> &Mode {
        &self.piece.mode
    }

    /// What ends the motion.
    pub fn guards(&self) -> &[Guard] {
        &self.guards
    }

    /// The velocity at a place.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn velocity(&mut self, t: f64, x: &[f64]) -> Result<Vec<f64>, FieldError> {
        let z = self.state(x);
        let mut velocity = self.piece.rates(t, &z)?;
        velocity.truncate(x.len());
        Ok(velocity.to_vec())
    }

    /// The extended state: named discrete states and parameters behind the states.
    fn state(&self, x: &[f64]) -> Row {
        let extended = self.piece.extended;
        extended.state(&extended.with_named(x, &self.q))
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
        let z = self.state(x);
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
        let guards = values.into_iter().enumerate();
        guards
            .map(|(place, value)| self.with_gradient(place, value, t, x))
            .collect()
    }

    /// One of the guards at a place, by its number, with its derivatives.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn guard_at(
        &mut self,
        place: usize,
        t: f64,
        x: &[f64],
    ) -> Result<Option<GuardAt>, FieldError> {
        let value = self.values(t, x)?.get(place).copied();
        value
            .map(|value| self.with_gradient(place, value, t, x))
            .transpose()
    }

    fn with_gradient(
        &mut self,
        place: usize,
        value: f64,
        t: f64,
        x: &[f64],
    ) -> Result<GuardAt, FieldError> {
        let (guard, z) = (self.guards[place], self.state(x));
        let mut gradient = self.piece.gradient_of(guard, t, &z)?;
        let sense = match guard {
            Guard::Surface(j) => f64::from(self.piece.mode.entries()[j]),
            Guard::Multiplier { surface, end } if self.is_smooth(surface) => -f64::from(end),
            _ => 1.0,
        };
        gradient.time *= sense;
        gradient.state.iter_mut().for_each(|entry| *entry *= sense);
        let time = gradient.time;
        let state = self.piece.extended.without_named(&gradient.state);
        Ok(GuardAt {
            guard,
            value,
            gradient: Gradient { time, state },
        })
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
        let before = self.with_named(x, q);
        let derivative = match self.maps.get(index).and_then(Option::as_ref) {
            Some(map) => Some(map.derivative((t, &before), &self.values)?),
            None => None,
        };
        let (rows, mut by_time) = derivative.unzip();
        let rows = rows.map(|rows| {
            let own = rows.iter().take(x.len());
            own.map(|row| self.without_named(row)).collect()
        });
        let by_time = by_time.take().unwrap_or_else(|| vec![0.0; x.len()]);
        let z = self.state(&before);
        let place = Setting::new(&signs, q).at(t, &z);
        let clock = self.clock_value(index, &place);
        Ok(ActionAt {
            x: after,
            q: discrete,
            rows,
            by_time: by_time[..x.len()].to_vec(),
            clock: clock.map(|(value, gradient)| {
                let state = self.without_named(&gradient.state);
                (value, Gradient { state, ..gradient })
            }),
        })
    }

    /// A row by the states and the parameters, without the named discrete states between them.
    fn without_named(&self, row: &[f64]) -> Vec<f64> {
        let own = self.n - self.n_named;
        [&row[..own], &row[self.n..]].concat()
    }
}
