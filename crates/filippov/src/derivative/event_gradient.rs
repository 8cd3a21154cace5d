//! Functions of a user at a point of a motion: their values and derivatives, and what fixes the times of their zeros.

use super::extended::extended_system;
use super::piece::Piece;
use crate::error::{Error, FieldError};
use crate::system::{sides_where, PiecewiseSystem, Rules, Setting, SignStructure, TracedSystem};
use crate::tolerances::{AT_SIDE, ROUNDING};
use crate::vectors::dot;

/// The gradient of a function by time, states and parameters.
pub struct EventGradient {
    /// A system whose first component is the function. Its first surfaces are those of the system of the run.
    extended: TracedSystem,
}

/// A function at a point.
pub(super) struct Slopes {
    pub value: f64,
    /// Its derivative by time.
    pub time: f64,
    /// By the extended state.
    pub gradient: Vec<f64>,
}

/// What fixes the time of a zero: the function itself, or, if it jumps through zero, the function inside of it that vanishes there.
pub(super) struct ZeroOf {
    /// The time of the zero.
    t: f64,
    /// How far from there, in time, it vanishes by itself.
    away: f64,
    /// How fast it changes along the motion.
    pub rate: f64,
    /// Its derivatives by the extended state.
    pub gradient: Vec<f64>,
}

impl ZeroOf {
    /// Nothing in the function vanishes there, and an instant of the run is then.
    pub fn is_brought_by(&self, instant: f64) -> bool {
        let size = 1.0 + self.t.abs();
        (instant - self.t).abs() <= ROUNDING * size && self.away > AT_SIDE * size
    }
}

impl EventGradient {
    /// Of the first component of a system with these rules, by the states and these parameters.
    ///
    /// # Errors
    /// If an expression cannot be compiled.
    pub fn new(
        function: &TracedSystem,
        rules: &Rules,
        parameters: &[usize],
    ) -> Result<Self, Error> {
        let extended = extended_system(function, rules, parameters)?;
        Ok(EventGradient { extended })
    }

    /// The function at a point of a motion, on the sides from which that comes. On a surface slid on a sign is the multiplier; `None` if
    /// the function reads several of these, or a sign that sticks, or if the derivative of the multiplier is not known.
    pub(super) fn on(
        &self,
        piece: &mut Piece,
        (t, z): (f64, &[f64]),
    ) -> Result<Option<Slopes>, FieldError> {
        let mut signs = self.signs(piece, (t, z))?;
        let mut found = self.with_signs(&signs, &piece.q, (t, z))?;
        let mut is_split = false;
        for j in piece.sliding.clone() {
            signs[j] = -1.0;
            let other = self.with_signs(&signs, &piece.q, (t, z))?;
            signs[j] = 1.0;
            let size = found.value.abs() + other.value.abs();
            if (found.value - other.value).abs() <= ROUNDING * size {
                continue;
            }
            if is_split || piece.extended.system.sticks_at(j) {
                return Ok(None);
            }
            let Some((by_time, by_state)) = piece.multiplier_slopes(j, t, z)? else {
                return Ok(None);
            };
            found = between(&found, &other, piece.multiplier(j), (by_time, &by_state));
            is_split = true;
        }
        Ok(Some(found))
    }

    /// The signs at a point of a motion: those of its mode, 1 on surfaces slid on, and the sides on which other functions are.
    fn signs(&self, piece: &Piece, (t, z): (f64, &[f64])) -> Result<Vec<f64>, FieldError> {
        let set = |signs: &mut [f64]| {
            for (j, &known) in piece.signs.iter().enumerate() {
                signs[j] = if known == 0.0 { signs[j] } else { known };
            }
            piece.sliding.iter().for_each(|&j| signs[j] = 1.0);
        };
        sides_where(&self.extended, (t, z), &piece.q, set)
    }

    fn with_signs(
        &self,
        signs: &[f64],
        q: &[f64],
        (t, z): (f64, &[f64]),
    ) -> Result<Slopes, FieldError> {
        let system = &self.extended;
        let here = Setting::new(signs, q).at(t, z);
        let mut gradient = vec![0.0; z.len()];
        system.field(&here, &mut gradient)?;
        let value = gradient[0];
        let linearisations = system.linearisations();
        let known = linearisations.and_then(|known| Some((known, known.motion_jacobian(&[])?)));
        let Some((known, jacobian)) = known else {
            gradient.fill(f64::NAN);
            let time = f64::NAN;
            return Ok(Slopes {
                value,
                time,
                gradient,
            });
        };
        let mut slopes = jacobian.linearisation();
        known.eval_jacobian(&jacobian, &here, &mut slopes);
        gradient.fill(0.0);
        for (column, value) in slopes.rows().row(0) {
            gradient[column] = -value;
        }
        let time = slopes.time()[0];
        Ok(Slopes {
            value,
            time,
            gradient,
        })
    }

    /// What fixes the time of a zero at a point of a motion; NaN where [`on`](Self::on) knows nothing.
    pub(super) fn at_zero(
        &self,
        piece: &mut Piece,
        (t, z): (f64, &[f64]),
    ) -> Result<ZeroOf, FieldError> {
        let rates = piece.rates(t, z)?;
        let zero_of = |value: f64, time: f64, gradient: Vec<f64>| {
            let rate = time + dot(&gradient, &rates);
            let away = time_to_zero(value, rate);
            ZeroOf {
                t,
                away,
                rate,
                gradient,
            }
        };
        let Some(Slopes {
            value,
            time,
            gradient,
        }) = self.on(piece, (t, z))?
        else {
            return Ok(zero_of(f64::NAN, f64::NAN, vec![f64::NAN; z.len()]));
        };
        let mut found = zero_of(value, time, gradient);
        let signs = self.signs(piece, (t, z))?;
        let system = &self.extended;
        let mut h = vec![0.0; system.n_surfaces()];
        system.surfaces(&Setting::new(&signs, &piece.q).at(t, z), &mut h)?;
        // Beside a zero of a factor all values are rounding: what is nearest to its zero, in time, fixes it.
        for j in (0..h.len()).filter(|j| !piece.sliding.contains(j)) {
            let mut across = signs.clone();
            across[j] = -signs[j];
            if value * self.with_signs(&across, &piece.q, (t, z))?.value >= 0.0 {
                continue;
            }
            let mut gradient = vec![0.0; z.len()];
            let here = Setting::new(&signs, &piece.q).at(t, z);
            let time = system.gradient(j, &here, &mut gradient)?;
            let inner = zero_of(h[j], time, gradient);
            if inner.away < found.away {
                found = inner;
            }
        }
        Ok(found)
    }
}

/// A function that is affine in a multiplier, from its values at 1 and -1.
fn between(plus: &Slopes, minus: &Slopes, multiplier: f64, by: (f64, &[f64])) -> Slopes {
    let half = 0.5 * (plus.value - minus.value);
    let mean =
        |plus: f64, minus: f64| 0.5 * ((1.0 + multiplier) * plus + (1.0 - multiplier) * minus);
    let pairs = plus.gradient.iter().zip(&minus.gradient).zip(by.1);
    Slopes {
        value: mean(plus.value, minus.value),
        time: mean(plus.time, minus.time) + half * by.0,
        gradient: pairs
            .map(|((&plus, &minus), slope)| mean(plus, minus) + half * slope)
            .collect(),
    }
}

/// How long a value takes to its zero at this rate; infinitely long if nothing is known of it.
fn time_to_zero(value: f64, rate: f64) -> f64 {
    let time = if value == 0.0 {
        0.0
    } else {
        (value / rate).abs()
    };
    if time.is_nan() {
        f64::INFINITY
    } else {
        time
    }
}
