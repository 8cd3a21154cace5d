//! The search of a step for the first zero of one monitored function.

use crate::error::FieldError;
use crate::event::isolate::{
    first_zero_sampled, is_steep, Bracket, Evidence, Sampled, Zero, PROBES,
};
use crate::event::locate::{refine, Located};
use crate::event::proved::{expected_zero_proved, first_zero_proved, Proved};
use crate::event::series::{Near, Series};
use crate::event::{Found, Monitored};
use crate::field::Guard;
use crate::integrate::detection::bounds::BoundedCurve;
use crate::integrate::detection::curve::{grazes, Curve};
use crate::integrate::integrator::Integrator;
use crate::stepper::nested;
use crate::tolerances::{
    BEYOND_GUESS, BEYOND_TOUCH, EPS, POLE, RESOLVED_DEPTH, UNBOUNDED_DEPTH, UNPROVED_DEPTH,
};

/// What came of a search.
pub(in crate::integrate) enum SearchOutcome {
    /// There is no zero.
    Nothing,
    /// The function vanishes at this theta.
    At(f64, AtZero),
    /// A touch that ends nothing: the search goes on from this theta.
    Beyond(f64),
    /// The sign changes without a zero.
    Pole,
}

/// How a function vanishes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::integrate) enum AtZero {
    /// It changes its sign, and is steep enough for rounding not to blur that.
    Steep,
    /// It changes its sign where rounding blurs it.
    Blurred,
    /// It only touches zero.
    Touch,
}

/// A piece of a step that was searched.
pub(in crate::integrate) struct Searched {
    /// A touch ends nothing.
    pub passes_touches: bool,
    pub piece: (f64, f64),
    /// Largest value among the samples.
    pub scale: f64,
    /// Rounding of the function.
    pub noise: f64,
    /// How well a zero is to be located.
    pub width: f64,
}

impl Searched {
    /// A crossing by its slope: beside a multiple zero it is flat, however steep the function is on the way there.
    fn kind(&self, zero: &Located) -> AtZero {
        if is_steep(zero.slope, self.scale, self.noise) {
            AtZero::Steep
        } else {
            AtZero::Blurred
        }
    }

    /// What an isolated zero of `g` means, located to rounding.
    pub fn outcome(&self, g: Sampled, zero: Option<Zero>) -> Result<SearchOutcome, FieldError> {
        let (from, to) = self.piece;
        Ok(match zero {
            None => SearchOutcome::Nothing,
            Some(Zero::Touch(theta)) if theta <= from => SearchOutcome::Nothing,
            // A multiplier that touches its end goes on; it may leave later in the step.
            Some(Zero::Touch(theta)) if self.passes_touches => {
                let rest = theta + BEYOND_TOUCH * (to - from);
                if rest >= to {
                    SearchOutcome::Nothing
                } else {
                    SearchOutcome::Beyond(rest)
                }
            }
            Some(Zero::Touch(theta)) => SearchOutcome::At(theta, AtZero::Touch),
            // Beyond the surface from the start, by the rounding of what moved the state: the switch is now.
            Some(Zero::Crossing(bracket)) if bracket.lo >= bracket.hi => {
                let is_clear = bracket.g_lo.abs() > self.noise;
                let kind = if is_clear {
                    AtZero::Steep
                } else {
                    AtZero::Blurred
                };
                SearchOutcome::At(bracket.lo, kind)
            }
            Some(Zero::Crossing(bracket)) => {
                let located = refine(g, bracket, self.width)?;
                let theta = located.theta;
                if located.residual > POLE * self.scale {
                    return Ok(SearchOutcome::Pole);
                }
                if bracket.is_steep(self.scale, self.noise) {
                    let kind = self.kind(&located);
                    return Ok(SearchOutcome::At(theta, kind));
                }
                match grazes(g, theta, from, to, self.noise)? {
                    Some(vertex) => SearchOutcome::At(vertex, AtZero::Touch),
                    None => SearchOutcome::At(theta, AtZero::Blurred),
                }
            }
        })
    }
}

impl Integrator<'_> {
    /// The first zero of one monitored function on [from, to], refined to rounding.
    pub(in crate::integrate) fn search(
        &mut self,
        (index, has_bounds): (usize, bool),
        (from, to): (f64, f64),
        dt: f64,
    ) -> Result<Option<(f64, bool)>, FieldError> {
        let m = self.motion.monitored[index];
        let polynomial = match m.guard {
            Guard::Surface(j) if self.is_polynomial(&m) => {
                if self.stepper.has_series() {
                    return self.search_series(index, (from, to), dt);
                }
                Polynomial::Nested(self.affine_rows(j, &m, dt)?)
            }
            _ => Polynomial::None,
        };
        self.search_piece((index, has_bounds), &polynomial, None, (from, to), dt)
    }

    /// Is a function a polynomial along the step?
    pub(in crate::integrate) fn is_polynomial(&self, m: &Monitored) -> bool {
        m.affine && self.motion.is_straight && m.guard.is_surface()
    }

    /// The first zero up to `reach`, looked for at first not far beyond where it is expected; and how far was
    /// searched.
    pub(in crate::integrate) fn search_near(
        &mut self,
        (index, has_bounds): (usize, bool),
        polynomial: &Polynomial,
        near: Option<Near>,
        reach: f64,
        dt: f64,
    ) -> Result<(Option<(f64, bool)>, f64), FieldError> {
        let piece = near.map(|near| (0.0, BEYOND_GUESS * near.theta));
        if let Some(piece) = piece.filter(|piece| has_bounds && piece.1 < reach) {
            let zero = self.search_piece((index, true), polynomial, near, piece, dt)?;
            if zero.is_some() || self.detector.uncertain {
                return Ok((zero, piece.1));
            }
        }
        let piece = (0.0, reach);
        let zero = self.search_piece((index, has_bounds), polynomial, near, piece, dt)?;
        let together = self.together(dt);
        let searched = zero.map_or(reach, |(theta, _)| (theta + together).min(reach));
        Ok((zero, searched))
    }

    pub(in crate::integrate) fn search_piece(
        &mut self,
        (index, has_bounds): (usize, bool),
        polynomial: &Polynomial,
        near: Option<Near>,
        (from, to): (f64, f64),
        dt: f64,
    ) -> Result<Option<(f64, bool)>, FieldError> {
        let m = self.motion.monitored[index];
        let noise = self.noise_beside(&m)?;
        self.motion.monitored[index].noise = noise;
        let ends_root = self.motion.ends_root(&m);
        let by_multipliers = !self.motion.slides_by_rule() && self.motion.has_bounds();
        let interpolant = self.stepper.interpolant();
        let bounds = BoundedCurve {
            system: self.system,
            interpolant,
            signs: &self.motion.signs,
            sliding: &self.motion.sliding,
            margin: &self.detector.margin,
            seen: &self.detector.seen,
            affine: self.motion.affine_bounds.as_ref().and_then(Option::as_ref),
            by_multipliers,
            known_exits: &self.detector.enclosed_exits,
            known_roots: &self.detector.enclosed_roots,
        };
        let mut curve = Curve {
            system: self.system,
            field: &mut self.motion.field,
            signs: &self.motion.signs,
            interpolant,
            is_straight: self.motion.is_straight,
            h: &mut self.detector.h,
            x: &mut self.detector.x,
            exits: &mut self.detector.exits,
            n_evaluations: &mut self.stats.n_surface_evaluations,
        };
        let (t, dt_step) = (self.t, dt);
        let mut g = |theta: f64| {
            let value = match polynomial {
                Polynomial::Quotient(series) => return Ok(series.value(theta)),
                Polynomial::Powers(series) | Polynomial::Deflated(series) => series.value(theta),
                Polynomial::Nested(rows) => nested(rows, theta),
                Polynomial::None => curve.value(&m, theta)?,
            };
            Ok(m.deflated(value, t + theta * dt_step, dt_step, noise))
        };
        let (start, end) = (m.value, self.detector.right[index].0);
        let is_quotient = matches!(polynomial, Polynomial::Quotient(_));
        let divided = match m.deflation {
            Some(zero) if !is_quotient => zero.order,
            _ => 0,
        };
        let mut over = |a, b| match polynomial {
            Polynomial::Quotient(series)
            | Polynomial::Powers(series)
            | Polynomial::Deflated(series) => Some(series.bound(a, b)),
            _ => bounds.over(&m, a, b),
        };
        let width = EPS * (t.abs() / dt).max(0.5 * to);
        let is_bounded = match polynomial {
            Polynomial::Nested(_) => false,
            Polynomial::None => has_bounds,
            _ => true,
        };
        if is_bounded && divided == 0 && from == 0.0 {
            let piece = (from, to);
            let left = if is_quotient { g(0.0)? } else { start };
            if let Some(near) = near {
                let expected = expected_zero_proved(&mut g, &mut over, piece, left, noise, near)?;
                let falls = |b: &Bracket| b.is_steep(left.max(-b.g_hi), noise);
                if let Some(bracket) = expected.filter(falls) {
                    let located = refine(&mut g, bracket, width)?;
                    self.detector.blurred |=
                        !is_steep(located.slope, left.max(-bracket.g_hi), noise);
                    return Ok(Some((located.theta, false)));
                }
            }
            let right = if to == 1.0 { end } else { g(to)? };
            let ends = (left, right);
            let proved = first_zero_proved(&mut g, &mut over, piece, ends, noise, near)?;
            let zero = match proved {
                Proved::Nothing => return Ok(None),
                Proved::Single(bracket) => Some(bracket),
                Proved::Unknown => None,
            };
            let scale = left.max(right.abs());
            if let Some(bracket) = zero.filter(|bracket| bracket.is_steep(scale, noise)) {
                let located = refine(&mut g, bracket, width)?;
                self.detector.blurred |= !is_steep(located.slope, scale, noise);
                return Ok(Some((located.theta, false)));
            }
        }
        let mut values = [f64::NAN; 5];
        for (i, value) in values.iter_mut().enumerate() {
            let theta = from + (to - from) * 0.25 * i as f64;
            *value = match theta {
                0.0 => m.deflated(start, t, dt, noise),
                1.0 => m.deflated(end, t + dt, dt, noise),
                _ => g(theta)?,
            };
        }
        let evidence = match (m.guard, is_bounded) {
            (_, true) => Evidence::Bounds {
                bounds: &mut over,
                divided,
                patience: match ends_root {
                    true => UNPROVED_DEPTH,
                    false => UNBOUNDED_DEPTH,
                },
            },
            // Along the step an affine surface is a quintic; the quartic and its remainder describe it.
            (Guard::Surface(_), _) if m.affine => Evidence::Probes(&[]),
            (Guard::Surface(_), _) => Evidence::Probes(&PROBES),
            _ => Evidence::Probes(&PROBES[..1]),
        };
        let isolated = first_zero_sampled(&mut g, from, to, values, noise, evidence)?;
        self.detector.unresolved |= isolated.depth > RESOLVED_DEPTH && !is_bounded;
        self.detector.uncertain |= isolated.exhausted || isolated.not_finite;
        let searched = Searched {
            passes_touches: ends_root,
            piece: (from, to),
            scale: values.iter().fold(0.0_f64, |m, v| m.max(v.abs())),
            noise,
            width,
        };
        match searched.outcome(&mut g, isolated.zero)? {
            SearchOutcome::Nothing => Ok(None),
            SearchOutcome::At(theta, kind) => {
                self.detector.blurred |= kind != AtZero::Steep;
                Ok(Some((theta, kind == AtZero::Touch)))
            }
            SearchOutcome::Beyond(rest) => {
                self.search_piece((index, has_bounds), polynomial, None, (rest, to), dt)
            }
            SearchOutcome::Pole => {
                self.detector.uncertain = true;
                Ok(None)
            }
        }
    }

    /// An affine h along a Taylor step.
    pub(in crate::integrate) fn as_polynomial<'a>(
        &self,
        m: &Monitored,
        rows: &'a [f64],
    ) -> Polynomial<'a> {
        let series = Series::new(rows);
        match m.deflation {
            None => Polynomial::Powers(series),
            Some(zero) if zero.t == self.t => {
                Polynomial::Quotient(series.divided(zero.order as usize))
            }
            Some(_) => Polynomial::Deflated(series),
        }
    }

    /// The rows of an affine h along the extension of a step of DOPRI5, in its nested form.
    fn affine_rows(&self, j: usize, m: &Monitored, dt: f64) -> Result<[f64; 6], FieldError> {
        let (point, signs) = ((self.t, &self.x[..]), &self.motion.signs);
        let extension = self.stepper.interpolant().coefficients();
        let mut rows = [0.0; 6];
        let ht = self
            .system
            .gradient_products(j, point, signs, extension, &mut rows)?;
        rows.iter_mut().for_each(|row| *row *= m.orientation);
        rows[0] = m.value;
        rows[1] += m.orientation * ht * dt;
        Ok(rows)
    }
}

/// A monitored function along a step, in the form of the step's continuous extension.
pub(in crate::integrate) enum Polynomial<'a> {
    /// It is none.
    None,
    /// The nested form of DOPRI5.
    Nested([f64; 6]),
    /// A series.
    Powers(Series<'a>),
    /// A series; the zero at the start of this step is divided out.
    Quotient(Series<'a>),
    /// A series; a zero before this step is yet to be divided out.
    Deflated(Series<'a>),
}

impl Integrator<'_> {
    /// Where an exit function of sliding on an intersection vanishes, others may have vanished before that were dismissed
    /// without a proof: as the determinant of their equations vanishes the multipliers go to infinity, some of them past
    /// their ends, within so short a time that nothing else in the step tells.
    pub(in crate::integrate) fn look_before_exit(
        &mut self,
        found: &mut Option<Found>,
        dt: f64,
    ) -> Result<(), FieldError> {
        let is_exit = |guard: &Guard| !guard.is_surface();
        let Some(theta) = found
            .as_ref()
            .filter(|event| self.detector.dismissed && event.functions.iter().any(is_exit))
            .map(|event| event.theta)
        else {
            return Ok(());
        };
        let n_sides = 2 * self.motion.sliding.len();
        let mut before = None;
        let mut gap = 0.5 * theta;
        while before.is_none() && gap > self.together(dt) {
            let at = theta - gap;
            self.stepper.interpolant().at(at, &mut self.detector.x);
            let x = &mut self.detector.x;
            let exits = self.motion.field.exits(self.t + at * dt, x)?;
            let is_beyond = exits.iter().take(n_sides).any(|&exit| exit <= 0.0);
            before = is_beyond.then_some(at);
            gap *= 0.25;
        }
        let Some(before) = before else {
            return Ok(());
        };
        for index in 0..self.motion.monitored.len() {
            let guard = self.motion.monitored[index].guard;
            if matches!(guard, Guard::Multiplier { .. } | Guard::Force(_)) {
                let zero = self.search((index, false), (0.0, before), dt)?;
                self.keep_earliest(found, index, zero, dt);
            }
        }
        Ok(())
    }
}
