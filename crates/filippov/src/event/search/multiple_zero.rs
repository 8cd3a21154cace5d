//! Zeros that rounding or errors of the step blur: a touch, or a crossing with a multiple zero.
//!
//! Around a multiple zero a switching function is within its rounding for a while, and what is found there is some point of
//! that interval. The zero itself is one of a derivative, which has no such interval: that of the rate at a touch, of the
//! second derivative at a triple zero, of that of order k - 1 at a zero of order k. Two crossings between which the function
//! falls by less than errors of the step, as it does at a touch, are a touch too.

use smallvec::SmallVec;

use super::StepSearch;
use crate::error::FieldError;
use crate::event::{Event, Found};
use crate::motion::Guard;
use crate::motion::Monitored;
use crate::tolerances::{EPS, EXPLAINED, MAX_LIE_ORDER, MOST_HALVINGS, TOUCH_DEPTH};

/// Which derivative of a switching function vanishes at its multiple zero.
#[derive(Clone, Copy)]
enum Derivative {
    /// The rate along the extension.
    Rate,
    /// That of this order along the field.
    Lie(usize),
}

/// Where rounding, or errors of the step, blur a zero.
struct Blur {
    /// The nearest point looked at where the function is clear of zero, and its value there; 0 if it is blurred up to the
    /// start of the step.
    left: (f64, f64),
    /// The same to the right.
    right: (f64, f64),
    /// The zero that was found.
    theta: f64,
    /// The length of the step.
    dt: f64,
    /// How well a zero is to be located.
    width: f64,
}

impl Blur {
    /// The larger value where the function is clear of zero.
    fn size(&self) -> f64 {
        self.left.1.abs().max(self.right.1.abs())
    }

    /// tau^k / k! for the time tau from the zero that was found to where the function is clear of zero.
    fn power(&self, k: usize) -> f64 {
        let reach = (self.theta - self.left.0).max(self.right.0 - self.theta) * self.dt;
        (1..=k).map(|i| reach / i as f64).product()
    }

    /// Does the last one of the derivatives at `zero` alone explain the values where the function is clear of zero?
    fn is_explained(&self, derivatives: &[f64], zero: f64) -> bool {
        let term = |k: usize, time: f64| {
            let power: f64 = (1..=k).map(|i| time / i as f64).product();
            derivatives[k - 1] * power
        };
        let order = derivatives.len();
        let clear = [self.left, self.right]
            .into_iter()
            .filter(|(_, value)| *value != 0.0);
        let mut ratios = clear.map(|(at, value)| {
            let time = (at - zero) * self.dt;
            let largest = (1..order).map(|k| term(k, time).abs()).fold(0.0, f64::max);
            (term(order, time) / value, largest / value.abs())
        });
        ratios.all(|(last, largest)| {
            (last - 1.0).abs() <= EXPLAINED && (order == 1 || largest <= last.abs())
        })
    }
}

impl StepSearch<'_, '_> {
    /// May the zero that was found be a multiple one? Rounding blurs it, or the function is back above zero at the end of
    /// the step.
    pub(crate) fn may_be_multiple(&self, event: &Found) -> bool {
        let Some(first @ Guard::Surface(_)) = event.guards.first() else {
            return false;
        };
        if event.theta > 1.0 {
            return false;
        }
        // Rounding of forces that balance blurs functions of a sliding motion for long: there is no zero to be moved to.
        if event.is_blurred {
            return self.run.motion.sliding.is_empty();
        }
        if self.stepper.is_series() {
            return false;
        }
        let mut values = self.run.motion.monitored.iter().zip(&self.detector.right);
        values.any(|(m, (value, _))| m.guard == *first && *value > 0.0)
    }

    /// Looks at what lies around a zero that may be a multiple one, and moves it there: that of one surface, or of several
    /// that vanish there too. A zero behind the end of the step is left to the next one.
    #[cold]
    #[inline(never)]
    pub(crate) fn resolve_multiple_zero(
        &mut self,
        event: Found,
        dt: f64,
    ) -> Result<Event, FieldError> {
        let resolved = self.resolve_zero_of_first(event.clone(), dt)?;
        for guard in &event.guards[1..] {
            let vanishes = match &resolved {
                Event::At(moved) => self.vanishes(*guard, moved.theta)?,
                _ => false,
            };
            if !vanishes {
                return Ok(Event::At(event));
            }
        }
        Ok(resolved)
    }

    /// Does a switching function vanish at theta, up to rounding?
    fn vanishes(&mut self, guard: Guard, theta: f64) -> Result<bool, FieldError> {
        let mut monitored = self.run.motion.monitored.iter();
        let Some(m) = monitored
            .find(|m| m.guard == guard && guard.is_surface())
            .copied()
        else {
            return Ok(false);
        };
        Ok(self.along(&m, theta)?.0.abs() <= self.noise_of(&m)?)
    }

    fn resolve_zero_of_first(&mut self, mut event: Found, dt: f64) -> Result<Event, FieldError> {
        let Some(&guard @ Guard::Surface(j)) = event.guards.first() else {
            return Ok(Event::At(event));
        };
        let monitored = &self.run.motion.monitored;
        let Some(m) = monitored.iter().find(|m| m.guard == guard) else {
            return Ok(Event::At(event));
        };
        // Beside a zero that was just left and is divided out, the function is near zero anyway.
        if m.deflation.is_some() {
            return Ok(Event::At(event));
        }
        let (m, theta) = (*m, event.theta);
        let noise = self.noise_of(&m)?;
        let depth = noise.max(self.depth_of_touches(j, theta)?);
        // Up to where it is clear of zero on both sides.
        let least = 4.0 * EPS * (1.0 + self.run.t.abs() / dt);
        let (mut before, mut behind, mut width) = (theta, theta, least);
        let mut right = 0.0;
        while behind < 1.0 && right <= noise && right >= -depth {
            behind = (theta + width).min(1.0);
            right = self.along(&m, behind)?.0;
            width *= 4.0;
        }
        width = least;
        let mut left = 0.0;
        while before > 0.0 && left <= noise {
            before = (theta - width).max(0.0);
            left = self.along(&m, before)?.0;
            width *= 4.0;
        }
        let or_zero = |is_clear: bool, value: f64| if is_clear { value } else { 0.0 };
        let blur = Blur {
            left: (before, or_zero(left > noise, left)),
            right: (behind, or_zero(right > noise || right < -depth, right)),
            theta,
            dt,
            width: least,
        };
        if right > noise {
            let zero = self.zero_of(&m, Derivative::Rate, (before, behind), least)?;
            let Some(vertex) = zero else {
                return Ok(Event::At(event));
            };
            if self.along(&m, vertex)?.0 < -depth {
                return Ok(Event::At(event));
            }
            (event.theta, event.touch) = (vertex, true);
            event.multiple.depth = depth;
        } else if right < -depth {
            event.touch = false;
        }
        let Some((order, zero)) = self.multiplicity(&m, &blur)? else {
            return Ok(Event::At(event));
        };
        if zero > 1.0 {
            // A step that ended below zero would be taken for one behind a crossing.
            return Ok(match right < -noise && before > 0.0 {
                true => Event::Shorten(0.5 * dt),
                false => Event::None,
            });
        }
        // Errors of the step move a touch along with the extension.
        let is_placed = event.touch && right > noise && order == 2;
        if !is_placed {
            (event.theta, event.touch) = (zero.max(0.0), order % 2 == 0);
        }
        if event.touch {
            event.multiple.depth = depth;
        }
        event.multiple.blur = noise;
        event.multiple.vanishing = self.vanishing(&m, &blur, order, event.theta)?;
        Ok(Event::At(event))
    }

    /// The order of the zero in a blur and where it is, if it is a multiple one: the first order whose derivative alone
    /// explains the values where the function is clear of rounding. The derivative before it vanishes at the zero.
    fn multiplicity(
        &mut self,
        m: &Monitored,
        blur: &Blur,
    ) -> Result<Option<(usize, f64)>, FieldError> {
        if !self.run.motion.sliding.is_empty() || blur.size() == 0.0 {
            return Ok(None);
        }
        let highest = self.run.system.max_lie_order().min(MAX_LIE_ORDER);
        let side = self.run.motion.mode.entries()[m.surface().unwrap_or(0)];
        for order in 1..=highest {
            let is_odd = order % 2 == 1;
            // Positive before, the function tells by its value behind whether its sign changes.
            let changes = blur.right.1 < 0.0;
            if blur.right.1 != 0.0 && changes != is_odd {
                continue;
            }
            let zero = if order == 1 {
                Some(blur.theta)
            } else {
                self.zero_of_derivative(m, order, blur)?
            };
            let Some(zero) = zero else { continue };
            let mut terms = SmallVec::<[f64; MAX_LIE_ORDER]>::new();
            for k in 1..=order {
                let at = zero.clamp(0.0, 1.0);
                terms.push(self.lie_along(m, (k, side), at)?);
            }
            if blur.is_explained(&terms, zero) {
                return Ok((order > 1).then_some((order, zero)));
            }
        }
        Ok(None)
    }

    /// Where the derivative before this order vanishes, as far as it is in the blur; behind the end of the step its tangent
    /// tells.
    fn zero_of_derivative(
        &mut self,
        m: &Monitored,
        order: usize,
        blur: &Blur,
    ) -> Result<Option<f64>, FieldError> {
        let ends = (blur.left.0, blur.right.0);
        let found = self.zero_of(m, Derivative::Lie(order - 1), ends, blur.width)?;
        if found.is_some() || blur.left.1 > 0.0 && blur.right.1 != 0.0 {
            return Ok(found);
        }
        let side = self.run.motion.mode.entries()[m.surface().unwrap_or(0)];
        let end = if blur.right.1 == 0.0 { ends.1 } else { ends.0 };
        let value = self.lie_along(m, (order - 1, side), end)?;
        let slope = self.lie_along(m, (order, side), end)? * blur.dt;
        let zero = end - value / slope;
        let reach = 2.0 * (ends.1 - ends.0);
        let is_near = zero > ends.0 - reach && zero < ends.1 + reach;
        Ok(is_near.then_some(zero))
    }

    /// How many derivatives of the function vanish at its zero of this order, along the field of either side.
    fn vanishing(
        &self,
        m: &Monitored,
        blur: &Blur,
        order: usize,
        zero: f64,
    ) -> Result<[usize; 2], FieldError> {
        let own = self.run.motion.mode.entries()[m.surface().unwrap_or(0)];
        let highest = self.run.system.max_lie_order().min(MAX_LIE_ORDER);
        let term = |k: usize, side: i8| -> Result<f64, FieldError> {
            Ok((self.lie_along(m, (k, side), zero)? * blur.power(k)).abs())
        };
        let last = term(order, own)?;
        let mut n_vanishing = 0;
        while n_vanishing + 1 < order && term(n_vanishing + 1, -own)? <= last {
            n_vanishing += 1;
        }
        // The other side may be flatter: a term below the one behind it is due to the place of the zero.
        while (order - 1..highest - 1).contains(&n_vanishing)
            && term(n_vanishing + 1, -own)? < term(n_vanishing + 2, -own)?
        {
            n_vanishing += 1;
        }
        let mut counts = [order - 1; 2];
        counts[usize::from(own < 0)] = n_vanishing;
        Ok(counts)
    }

    /// Returns how far the error of the step may move a switching function below zero at a touch. For a series step this
    /// error is neglected: the result is 0.
    fn depth_of_touches(&mut self, j: usize, theta: f64) -> Result<f64, FieldError> {
        if self.stepper.is_series() {
            return Ok(0.0);
        }
        let mut x = vec![0.0; self.run.x.len()];
        self.stepper.interpolant().at(theta, &mut x);
        let t = self.run.t + theta * self.stepper.interpolant().dt;
        let place = self.run.motion.setting().at(t, &x);
        let tolerance = self.run.system.tolerance(j, &place, &self.run.scale)?;
        Ok(TOUCH_DEPTH * tolerance)
    }

    /// Value and rate of a switching function along the extension, in the sense of the mode.
    fn along(&mut self, m: &Monitored, theta: f64) -> Result<(f64, f64), FieldError> {
        let Some(j) = m.surface() else {
            return Ok((f64::NAN, f64::NAN));
        };
        let (mut x, mut velocity) = (vec![0.0; self.run.x.len()], vec![0.0; self.run.x.len()]);
        let extension = self.stepper.interpolant();
        extension.at(theta, &mut x);
        extension.derivative(theta, &mut velocity);
        let t = self.run.t + theta * extension.dt;
        if !self.run.motion.is_straight {
            self.run.motion.project(t, &mut x)?;
        }
        let n = self.run.system.n_surfaces();
        let (mut h, mut rates) = (vec![0.0; n], vec![0.0; n]);
        let place = self.run.motion.setting().at(t, &x);
        self.run
            .system
            .surface_rates(&place, &velocity, &mut h, &mut rates)?;
        self.run.stats.n_surface_evaluations += 1;
        Ok((m.orientation * h[j], m.orientation * rates[j]))
    }

    /// A Lie derivative of this order of a switching function along the field of a side, in the sense of the mode.
    fn lie_along(
        &self,
        m: &Monitored,
        (order, side): (usize, i8),
        theta: f64,
    ) -> Result<f64, FieldError> {
        let Some(j) = m.surface() else {
            return Ok(f64::NAN);
        };
        let mut x = vec![0.0; self.run.x.len()];
        let extension = self.stepper.interpolant();
        extension.at(theta, &mut x);
        let t = self.run.t + theta * extension.dt;
        let mut signs = self.run.motion.signs.clone();
        signs[j] = f64::from(side);
        let word = [side; MAX_LIE_ORDER];
        let place = self.run.motion.setting().with_signs(&signs).at(t, &x);
        let lie = self
            .run
            .system
            .lie_derivative(j, j, &word[..order], &place)?;
        Ok(m.orientation * lie.value)
    }

    /// Where a derivative changes its sign between two points; `None` if it does not.
    fn zero_of(
        &mut self,
        m: &Monitored,
        which: Derivative,
        (mut lo, mut hi): (f64, f64),
        width: f64,
    ) -> Result<Option<f64>, FieldError> {
        let side = self.run.motion.mode.entries()[m.surface().unwrap_or(0)];
        let mut at = |theta: f64| match which {
            Derivative::Rate => Ok(self.along(m, theta)?.1),
            Derivative::Lie(order) => self.lie_along(m, (order, side), theta),
        };
        let (mut left, mut right) = (at(lo)?, at(hi)?);
        let changes = left * right < 0.0;
        if !changes {
            return Ok(None);
        }
        // Regula falsi with the halved retained value, which ends with a step to rounding on either side.
        for _ in 0..MOST_HALVINGS {
            let theta = lo + (hi - lo) * left / (left - right);
            let value = at(theta)?;
            if value == 0.0 || hi - lo <= width {
                return Ok(Some(theta));
            }
            if value * left > 0.0 {
                (lo, left, right) = (theta, value, 0.5 * right);
            } else {
                (hi, right, left) = (theta, value, 0.5 * left);
            }
        }
        Ok(Some(0.5 * (lo + hi)))
    }
}
