//! The search of a step for the first zero of one guard.

use super::along_series::Polynomial;
use super::bounds::BoundedCurve;
use super::curve::{grazes, Curve};
use super::sought::{AtZero, Search, Sought};
use super::StepSearch;
use crate::error::FieldError;
use crate::event::certificate::Proof;
use crate::event::isolate::{
    first_zero_sampled, is_steep, Bracket, Evidence, Sampled, Zero, PROBES,
};
use crate::event::proved::{expected_zero_proved, first_zero_proved, Proved};
use crate::event::series::{FirstZero, Near, Series, NO_TERMS};
use crate::event::Found;
use crate::locate::refine;
use crate::motion::Guard;
use crate::system::Setting;
use crate::tolerances::{
    BEYOND_GUESS, BEYOND_TOUCH, BOUNDS_DEPTH, EPS, POLE, RESOLVED_DEPTH, SMALL_REST, UNPROVED_DEPTH,
};

/// A piece of a step that was searched.
struct Piece {
    ends: (f64, f64),
    /// Largest value among the samples.
    scale: f64,
    /// Rounding of the guard.
    noise: f64,
    /// How well a zero is to be located.
    width: f64,
}

impl Piece {
    /// What an isolated zero of `g` means, located to rounding.
    fn outcome(&self, g: Sampled, zero: Option<Zero>) -> Result<Search, FieldError> {
        let (from, to) = self.ends;
        Ok(match zero {
            None => Search::Nothing,
            Some(Zero::Touch(theta)) if theta <= from => Search::Nothing,
            Some(Zero::Touch(theta)) => Search::At(theta, AtZero::Touch),
            // Beyond the surface from the start, by the rounding of what moved the state: the switch is now.
            Some(Zero::Crossing(bracket)) if bracket.lo >= bracket.hi => {
                let is_clear = bracket.g_lo.abs() > self.noise;
                Search::At(bracket.lo, AtZero::crossing(is_clear))
            }
            Some(Zero::Crossing(bracket)) => {
                let located = refine(g, bracket, self.width)?;
                let theta = located.theta;
                if located.residual > POLE * self.scale {
                    // The sign changes without a zero.
                    return Ok(Search::Unsure);
                }
                if bracket.is_steep(self.scale, self.noise) {
                    let stays_steep = is_steep(located.slope, self.scale, self.noise);
                    return Ok(Search::At(theta, AtZero::crossing(stays_steep)));
                }
                match grazes(g, theta, from, to, self.noise)? {
                    Some(vertex) => Search::At(vertex, AtZero::Touch),
                    None => Search::At(theta, AtZero::Blurred),
                }
            }
        })
    }
}

impl StepSearch<'_, '_> {
    /// Searches the step for a zero of one guard that comes first; `false` if a shorter step is needed.
    pub(super) fn search(&mut self, index: usize, sought: &mut Sought) -> Result<bool, FieldError> {
        if self.run.motion.monitored[index].deflation.is_some() {
            let m = self.run.motion.monitored[index];
            self.run.motion.monitored[index].noise = self.noise_beside(&m)?;
        }
        let mut proof = None;
        if !self.stepper.extends_freely() {
            proof = self.filter(index, sought)?;
            if proof.is_none() {
                return Ok(true);
            }
            self.extend()?;
        }
        let (zero, searched) = self.search_step(index, proof, sought)?;
        sought.reach = searched;
        Ok(self.keep(index, zero, sought))
    }

    /// Keeps what a search found; `false` if it needs a shorter step.
    pub(super) fn keep(&self, index: usize, zero: Search, sought: &mut Sought) -> bool {
        if let Search::At(theta, kind) = zero {
            let (guard, together) = (
                self.run.motion.monitored[index].guard,
                self.together(sought.dt),
            );
            sought.keep(guard, (theta, kind), together);
        }
        !matches!(zero, Search::Unsure)
    }

    /// The first zero of a guard, and how far it was searched: to the same point, or to one behind a zero. `proof` is the
    /// answer of the bounds, if they were asked.
    fn search_step(
        &mut self,
        index: usize,
        proof: Option<Proof>,
        sought: &mut Sought,
    ) -> Result<(Search, f64), FieldError> {
        let m = self.run.motion.monitored[index];
        let (value, _) = self.detector.right[index];
        let reach = sought.reach;
        let mut buffer = NO_TERMS;
        let rows = &mut buffer[..self.n_rows()];
        let mut polynomial = Polynomial::None;
        let mut near = None;
        if let Some(likeness) = self.series_along(&m, rows, value)? {
            let along = self.as_polynomial(&m, rows);
            if let Polynomial::Quotient(series) | Polynomial::Powers(series) = &along {
                let margin = likeness.margin;
                if value > 0.0 && series.stays_above(margin) {
                    return Ok((Search::Nothing, reach));
                }
                // Leaving small terms out is cheaper, and hardly ever too rough.
                for spare in [SMALL_REST, 0.0] {
                    let (found, rest) = series.first_zero(reach, margin, spare);
                    match found {
                        FirstZero::Nowhere if value > 0.0 || reach < 1.0 => {
                            return Ok((Search::Nothing, reach));
                        }
                        FirstZero::Between { lo, hi, guess } if value < 0.0 || hi < 1.0 => {
                            let between = (lo, hi, guess, rest);
                            if let Some((theta, kind)) =
                                self.only_zero(index, series, likeness, between)?
                            {
                                let searched = (theta + self.together(sought.dt)).min(reach);
                                return Ok((Search::At(theta, kind), searched));
                            }
                        }
                        _ => {}
                    }
                    if rest == 0.0 {
                        break;
                    }
                }
                near = series.near_zero();
            }
            if likeness.is_exact {
                polynomial = along;
            }
        }
        if let Polynomial::None = polynomial {
            return self.search_bounded(index, value, proof, sought);
        }
        self.search_near((index, true), &polynomial, near, sought)
    }

    /// The first zero of a guard as far as bounds tell, and how far was searched.
    fn search_bounded(
        &mut self,
        index: usize,
        value_at_end: f64,
        proof: Option<Proof>,
        sought: &mut Sought,
    ) -> Result<(Search, f64), FieldError> {
        let m = self.run.motion.monitored[index];
        let mut buffer = NO_TERMS;
        let rows = &mut buffer[..self.n_rows()];
        // Beyond zero at the end: there is a zero, whether there are bounds or not.
        let proof = match proof {
            Some(proof) => proof,
            None if value_at_end <= 0.0 && self.exit_series(&m, rows).is_some() => Proof::Open,
            None => self.prove_clear(index, value_at_end, sought.reach),
        };
        if proof == Proof::Silent && !self.exit_may_vanish(&m) {
            sought.dismissed |= self.run.motion.ends_root(&m);
            return Ok((Search::Nothing, sought.reach));
        }
        if proof == Proof::Clear {
            return Ok((Search::Nothing, sought.reach));
        }
        let known = self.exit_series(&m, rows);
        let near = known.and_then(|_| Series::new(rows).near_zero());
        let bounded = (index, proof == Proof::Open);
        self.search_near(bounded, &Polynomial::None, near, sought)
    }

    /// The first zero, looked for at first not far beyond where it is expected; and how far was searched.
    fn search_near(
        &mut self,
        (index, has_bounds): (usize, bool),
        polynomial: &Polynomial,
        near: Option<Near>,
        sought: &mut Sought,
    ) -> Result<(Search, f64), FieldError> {
        let reach = sought.reach;
        let piece = near.map(|near| (0.0, BEYOND_GUESS * near.theta));
        if let Some(piece) = piece.filter(|piece| has_bounds && piece.1 < reach) {
            let zero = self.search_piece((index, true), polynomial, near, piece, sought)?;
            if !matches!(zero, Search::Nothing) {
                return Ok((zero, piece.1));
            }
        }
        let zero =
            self.search_piece((index, has_bounds), polynomial, near, (0.0, reach), sought)?;
        let searched = match zero {
            Search::At(theta, _) => (theta + self.together(sought.dt)).min(reach),
            _ => reach,
        };
        Ok((zero, searched))
    }

    /// The first zero of a guard on a piece of the step, or beyond its end.
    pub(super) fn search_on(
        &mut self,
        index: usize,
        piece: (f64, f64),
        sought: &mut Sought,
    ) -> Result<Search, FieldError> {
        let m = self.run.motion.monitored[index];
        let mut buffer = NO_TERMS;
        let rows = &mut buffer[..self.n_rows()];
        let mut polynomial = Polynomial::None;
        if self.is_polynomial(&m) {
            self.affine_series(&m, rows)?;
            polynomial = self.as_polynomial(&m, rows);
        }
        self.search_piece((index, false), &polynomial, None, piece, sought)
    }

    fn search_piece(
        &mut self,
        (index, has_bounds): (usize, bool),
        polynomial: &Polynomial,
        near: Option<Near>,
        (from, to): (f64, f64),
        sought: &mut Sought,
    ) -> Result<Search, FieldError> {
        let m = self.run.motion.monitored[index];
        let noise = self.noise_beside(&m)?;
        self.run.motion.monitored[index].noise = noise;
        let ends_root = self.run.motion.ends_root(&m);
        let by_multipliers = !self.run.motion.slides_by_rule() && self.run.motion.has_bounds();
        let interpolant = self.stepper.interpolant();
        let setting = Setting::new(&self.run.motion.signs, &self.run.motion.discrete);
        let bounds = BoundedCurve {
            system: self.run.system,
            sliding_system: self.run.motion.sliding_system(self.run.system),
            interpolant,
            setting,
            sliding: &self.run.motion.sliding,
            margin: &self.detector.margin,
            seen: &self.run.seen,
            affine: self
                .run
                .motion
                .affine_bounds
                .as_ref()
                .and_then(Option::as_ref),
            by_multipliers,
            known_exits: &self.detector.enclosed_exits,
            far: self.run.motion.far_ends.places(),
            known_roots: &self.detector.enclosed_roots,
        };
        let mut curve = Curve {
            system: self.run.system,
            field: &mut self.run.motion.field,
            setting,
            interpolant,
            is_straight: self.run.motion.is_straight,
            h: &mut self.detector.h,
            x: &mut self.detector.x,
            exits: &mut self.detector.exits,
            n_evaluations: &mut self.run.stats.n_surface_evaluations,
        };
        let (t, dt) = (self.run.t, sought.dt);
        let mut g = |theta: f64| {
            let value = match polynomial {
                Polynomial::Quotient(series) => return Ok(series.value(theta)),
                Polynomial::Powers(series) | Polynomial::Deflated(series) => series.value(theta),
                Polynomial::None => curve.value(&m, theta)?,
            };
            Ok(m.deflated(value, t + theta * dt, dt, noise))
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
            Polynomial::None => bounds.over(&m, a, b),
        };
        let width = EPS * (t.abs() / dt).max(0.5 * to);
        let is_bounded = has_bounds || !matches!(polynomial, Polynomial::None);
        if is_bounded && divided == 0 && from == 0.0 {
            let piece = (from, to);
            let left = if is_quotient { g(0.0)? } else { start };
            if let Some(near) = near {
                let expected = expected_zero_proved(&mut g, &mut over, piece, left, noise, near)?;
                let falls = |b: &Bracket| b.is_steep(left.max(-b.g_hi), noise);
                if let Some(bracket) = expected.filter(falls) {
                    let located = refine(&mut g, bracket, width)?;
                    let stays_steep = is_steep(located.slope, left.max(-bracket.g_hi), noise);
                    return Ok(Search::At(located.theta, AtZero::crossing(stays_steep)));
                }
            }
            let right = if to == 1.0 { end } else { g(to)? };
            let ends = (left, right);
            let proved = first_zero_proved(&mut g, &mut over, piece, ends, noise, near)?;
            let zero = match proved {
                Proved::Nothing => return Ok(Search::Nothing),
                Proved::Single(bracket) => Some(bracket),
                Proved::Unknown => None,
            };
            let scale = left.max(right.abs());
            if let Some(bracket) = zero.filter(|bracket| bracket.is_steep(scale, noise)) {
                let located = refine(&mut g, bracket, width)?;
                let stays_steep = is_steep(located.slope, scale, noise);
                return Ok(Search::At(located.theta, AtZero::crossing(stays_steep)));
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
                    false => BOUNDS_DEPTH,
                },
            },
            // Along the step an affine surface is a quintic; the quartic and its remainder describe it.
            (Guard::Surface(_), _) if m.affine => Evidence::Probes(&[]),
            (Guard::Surface(_), _) => Evidence::Probes(&PROBES),
            _ => Evidence::Probes(&PROBES[..1]),
        };
        let isolated = first_zero_sampled(&mut g, from, to, values, noise, evidence)?;
        if isolated.exhausted || isolated.not_finite {
            return Ok(Search::Unsure);
        }
        if isolated.depth > RESOLVED_DEPTH && !is_bounded {
            sought.longest = sought.longest.min(dt);
        }
        let zero = match isolated.zero {
            // A multiplier that touches its end goes on; it may leave later in the step.
            Some(Zero::Touch(theta)) if ends_root => {
                let rest = theta + BEYOND_TOUCH * (to - from);
                if theta > from && rest < to {
                    let piece = (rest, to);
                    return self.search_piece((index, has_bounds), polynomial, None, piece, sought);
                }
                None
            }
            zero => zero,
        };
        let piece = Piece {
            ends: (from, to),
            scale: values.iter().fold(0.0_f64, |m, v| m.max(v.abs())),
            noise,
            width,
        };
        piece.outcome(&mut g, zero)
    }

    /// Where an exit function of sliding on an intersection vanishes, others may have vanished before that were dismissed
    /// without a proof: as the determinant of their equations vanishes the multipliers go to infinity, some of them past
    /// their ends, within so short a time that nothing else in the step tells. `false` if a shorter step is needed.
    pub(super) fn look_before_exit(&mut self, sought: &mut Sought) -> Result<bool, FieldError> {
        let ends_sliding = |found: &Found| !found.guards.iter().all(|guard| guard.is_surface());
        let theta = match &sought.found {
            Some(found) if sought.dismissed && ends_sliding(found) => found.theta,
            _ => return Ok(true),
        };
        let n_sides = 2 * self.run.motion.sliding.len();
        let mut before = None;
        let mut gap = 0.5 * theta;
        while before.is_none() && gap > self.together(sought.dt) {
            let at = theta - gap;
            self.stepper.interpolant().at(at, &mut self.detector.x);
            let x = &mut self.detector.x;
            let exits = self
                .run
                .motion
                .field
                .exits(self.run.t + at * sought.dt, x)?;
            let is_beyond = exits.iter().take(n_sides).any(|&exit| exit <= 0.0);
            before = is_beyond.then_some(at);
            gap *= 0.25;
        }
        let Some(before) = before else {
            return Ok(true);
        };
        for index in 0..self.run.motion.monitored.len() {
            let guard = self.run.motion.monitored[index].guard;
            if matches!(guard, Guard::Multiplier { .. } | Guard::Force(_)) {
                let zero = self.search_on(index, (0.0, before), sought)?;
                if !self.keep(index, zero, sought) {
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }
}
