//! Functions of a user at a point of a motion: their values and derivatives, and what fixes the times of their zeros.

use super::borders::has_sides;
use super::extended::extended_system;
use super::piece::Piece;
use super::weights::Weights;
use crate::error::{Error, FieldError};
use crate::system::{sides_where, PiecewiseSystem, Rules, Setting, SignStructure, TracedSystem};
use crate::tolerances::{AT_SIDE, EPS, ROUNDING};
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
    /// The sign whose function it is, if it is not the function itself.
    inner: Option<usize>,
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

    /// Does the function jump at a point across a surface of its own, or its gradient, as far as the tolerance tells?
    pub(super) fn has_sides(
        &self,
        piece: &Piece,
        (t, z): (f64, &[f64]),
        weights: &Weights,
    ) -> Result<bool, FieldError> {
        let signs = self.signs(piece, (t, z))?;
        let projection = piece.projection(&[], t, z)?;
        // Motions on the surfaces slid on, and in contact, do not leave what vanishes on these.
        let is_left = |normal: &[f64]| {
            let mut left = normal.to_vec();
            if let Some(projection) = &projection {
                projection.pull_back(piece.extended.n, &mut left);
            }
            dot(&left, &left) > AT_SIDE * AT_SIDE * dot(normal, normal)
        };
        let at = |signs: &[f64], z: &[f64]| {
            let mut found = self.with_signs(signs, &piece.q, (t, z))?;
            found.gradient.push(found.value);
            Ok(found.gradient)
        };
        let own = (&self.extended, &piece.q[..], piece.signs.len());
        has_sides(own, signs, (t, z), (is_left, at), weights)
    }

    /// What fixes the time of a zero at a point of a motion; NaN where [`on`](Self::on) knows nothing.
    pub(super) fn at_zero(
        &self,
        piece: &mut Piece,
        (t, z): (f64, &[f64]),
    ) -> Result<ZeroOf, FieldError> {
        let rates = piece.rates(t, z)?;
        let zero_of = |inner: Option<usize>, value: f64, time: f64, gradient: Vec<f64>| {
            let rate = time + dot(&gradient, &rates);
            let away = time_to_zero(value, rate);
            ZeroOf {
                t,
                away,
                rate,
                gradient,
                inner,
            }
        };
        let Some(Slopes {
            value,
            time,
            gradient,
        }) = self.on(piece, (t, z))?
        else {
            let gradient = vec![f64::NAN; z.len()];
            return Ok(zero_of(None, f64::NAN, f64::NAN, gradient));
        };
        let mut found = zero_of(None, value, time, gradient);
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
            let inner = zero_of(Some(j), h[j], time, gradient);
            if inner.away < found.away {
                found = inner;
            }
        }
        Ok(found)
    }

    /// Does what fixes the time of a zero turn back there, as far as the tolerance tells? A parabola with its rate and the change of this
    /// goes beyond zero by rate^2 / (2 |rate'|). The time of a touch has no derivative.
    pub(super) fn touches(
        &self,
        piece: &mut Piece,
        (t, z): (f64, &[f64]),
        zero: &ZeroOf,
        weights: &Weights,
    ) -> Result<bool, FieldError> {
        let (n, rates) = (piece.extended.n, piece.rates(t, z)?);
        let (x, gradient) = (&z[..n], &zero.gradient[..n]);
        let unit = weights.time_of_change(t, x, &rates[..n]);
        let tolerance = weights.error(x, gradient);
        let by_parameters = zero.gradient[n..].iter().zip(&z[n..]);
        let rounding = by_parameters.map(|(g, p)| EPS * (g * (1.0 + p.abs())).abs());
        // The motion comes from a moment before.
        let moment = EPS.cbrt() * unit;
        let before: Vec<f64> = z.iter().zip(&rates).map(|(z, f)| z - moment * f).collect();
        let rate_before = self.rate(piece, (t - moment, &before), zero.inner)?;
        let bend = ((zero.rate - rate_before) / moment).abs();
        let beyond = zero.rate * zero.rate / (2.0 * bend);
        Ok(beyond <= tolerance + rounding.sum::<f64>())
    }

    /// How fast the function changes along the motion, or that of a sign inside of it.
    fn rate(
        &self,
        piece: &mut Piece,
        (t, z): (f64, &[f64]),
        inner: Option<usize>,
    ) -> Result<f64, FieldError> {
        let rates = piece.rates(t, z)?;
        let Some(j) = inner else {
            let found = self.on(piece, (t, z))?;
            return Ok(found.map_or(f64::NAN, |s| s.time + dot(&s.gradient, &rates)));
        };
        let signs = self.signs(piece, (t, z))?;
        let mut gradient = vec![0.0; z.len()];
        let here = Setting::new(&signs, &piece.q).at(t, z);
        let time = self.extended.gradient(j, &here, &mut gradient)?;
        Ok(time + dot(&gradient, &rates))
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
