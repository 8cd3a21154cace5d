//! The first zero of a user's function on a piece of a step on which no sign inside of it changes.

use std::cell::RefCell;

use filippov_expr::{Enclosure, Interval, Motion};
use smallvec::{smallvec, SmallVec};

use super::StepSearch;
use crate::error::FieldError;
use crate::event::certificate::Bound;
use crate::event::isolate::{first_zero_sampled, Evidence, Zero, PROBES};
use crate::event::series::{LongestSeries, Series, NO_TERMS};
use crate::event::tube::Tube;
use crate::event::{SmoothParts, UserFunction};
use crate::locate::refine;
use crate::mode::Signs;
use crate::motion::{CurrentMotion, Piece};
use crate::options::SlidingRule;
use crate::stepper::{powers_of_nested, Basis, Interpolant};
use crate::system::{Actions, PiecewiseSystem, Setting};
use crate::tolerances::{BEHIND_TOUCH, BOUNDS_DEPTH_BESIDE_ROOT, EPS, POLE, ROUNDING};

/// The value of a user's function along the motion.
pub(super) fn value_along(
    function: &dyn UserFunction,
    interpolant: &Interpolant,
    motion: &mut CurrentMotion,
    theta: f64,
) -> Result<f64, FieldError> {
    let t = interpolant.t0 + theta * interpolant.dt;
    let mut y: SmallVec<[f64; 8]> = smallvec![0.0; interpolant.n_states()];
    interpolant.at(theta, &mut y);
    motion.project(t, &mut y)?;
    function.value(t, &y, &motion.discrete)
}

/// Where the search of a piece has come to.
#[derive(Clone, Copy)]
pub(super) struct Start {
    pub from: f64,
    /// The function is zero there: it is divided by the distance.
    pub divided: bool,
    /// The sign of the function behind it.
    pub sign: f64,
    /// If it is zero at `from`: it is clear of rounding so far behind it, in steps; 0 if that is not known.
    pub clear: f64,
}

/// What came of the search of a piece.
pub(super) enum Outcome {
    /// There is no zero.
    Nothing,
    /// The first zero.
    At(f64),
    /// The sign changes first where the function is infinite.
    Pole(f64),
    /// The function comes within rounding of zero without a change of sign, and is clear of it from here on.
    Touch(f64),
    /// The function is not finite at some of the points looked at, or at all of them.
    NotFinite { everywhere: bool },
    /// A shorter step is needed.
    Exhausted,
}

/// What is searched.
#[derive(Clone, Copy)]
pub(super) enum Source<'f> {
    /// A function of which only values are known.
    Sampled(&'f dyn UserFunction),
    /// One that reads the signs of surfaces slid on; they are what holds this piece of motion.
    Held(&'f dyn UserFunction, &'f Piece),
    /// A part of a function.
    Part(&'f dyn SmoothParts, usize),
}

/// A part that is affine is a polynomial along the step, unless the motion is drawn back to a curved surface; its coefficients
/// go into `series`, and how many they are is returned.
fn affine_series(
    parts: &dyn SmoothParts,
    part: usize,
    search: &mut StepSearch,
    start: impl FnOnce(&mut StepSearch) -> Result<f64, FieldError>,
    series: &mut LongestSeries,
) -> Option<usize> {
    let affine = parts
        .affine(part)
        .filter(|_| search.run.motion.is_straight)?;
    let start = start(search).ok()?;
    let interpolant = search.stepper.interpolant();
    let (n, rows) = (interpolant.n_states(), interpolant.coefficients());
    let n_terms = rows.len() / n;
    if n_terms < 2 || n_terms > series.len() {
        return None;
    }
    for &(i, slope) in &affine.slopes {
        let mut at = i as usize;
        for term in &mut series[..n_terms] {
            *term += slope * rows[at];
            at += n;
        }
    }
    series[0] = start;
    series[1] += affine.of_time * interpolant.dt;
    if interpolant.basis() == Basis::Nested {
        powers_of_nested(&mut series[..n_terms]);
    }
    Some(n_terms)
}

/// A place of a motion, known up to rounding.
struct Rounded<'p> {
    t: f64,
    x: &'p [f64],
}

impl Motion for Rounded<'_> {
    fn time(&self) -> Interval {
        Interval::around(self.t, EPS * self.t.abs())
    }

    fn state(&self, index: usize) -> Enclosure {
        Enclosure {
            value: Interval::around(self.x[index], ROUNDING * self.x[index].abs()),
            ..Enclosure::UNKNOWN
        }
    }
}

/// What a series tells of a piece of a step: the sign behind its start, and the zeros.
pub(super) type Told = (f64, SmallVec<[f64; 4]>);

/// What a series along the step tells of the piece up to `to`; none if it leaves a doubt.
fn zeros_of_series(rows: &[f64], search: &StepSearch, start: Start, to: f64) -> Option<Told> {
    // A zero at the start of the step is divided out.
    let divided = usize::from(start.divided && start.from == 0.0);
    let rows = &rows[divided..];
    let others: f64 = rows[1..].iter().map(|c| c.abs()).sum();
    let size = others + rows[0].abs();
    let (left, noise) = (rows[0].signum(), ROUNDING * size);
    let is_first = start.from == 0.0 && (divided == 1 || left == start.sign);
    let series = Series::new(rows);
    let is_clear = || rows[0].abs() > others + noise;
    if is_first && is_clear() {
        return Some((left, SmallVec::new()));
    }
    let interpolant = search.stepper.interpolant();
    let width = 0.5 * EPS * (interpolant.t0.abs() / interpolant.dt).max(1.0);
    let beside = 4.0 * search.together(interpolant.dt);
    let mut zeros = series.all_zeros(noise, width)?;
    let count = |is_there: &dyn Fn(f64) -> bool| zeros.iter().filter(|&&at| is_there(at)).count();
    let n_before = count(&|at| at <= start.from + beside);
    let n_at_start = count(&|at| (at - start.from).abs() <= beside);
    let n_at_end = count(&|at| (at - to).abs() <= beside);
    let turns = if n_before % 2 == 0 { 1.0 } else { -1.0 };
    let sign = turns * left;
    // A zero at the end needs a closer look.
    let is_clear = n_at_start == usize::from(start.divided) - divided
        && n_at_end == 0
        && (start.divided || sign == start.sign);
    zeros.retain(|at| *at > start.from + beside && *at < to);
    is_clear.then_some((sign, zeros))
}

/// A function along a piece of a step.
pub(super) struct Along<'f, 'a> {
    source: Source<'f>,
    system: &'a dyn PiecewiseSystem,
    actions: &'a Actions<'a>,
    rule: SlidingRule,
    signs: Signs,
    /// Its series along the step, if it is affine.
    series: Option<SmallVec<[f64; 32]>>,
    /// Room for a state.
    y: RefCell<SmallVec<[f64; 8]>>,
}

impl<'f, 'a> Along<'f, 'a> {
    pub fn new(source: Source<'f>, signs: &Signs, search: &mut StepSearch<'_, 'a>) -> Self {
        let run = &search.run;
        let mut along = Along {
            source,
            system: run.system,
            actions: run.actions,
            rule: run.options.sliding,
            signs: signs.clone(),
            series: None,
            y: RefCell::new(smallvec![0.0; search.run.x.len()]),
        };
        if let Source::Part(parts, part) = source {
            let mut series = NO_TERMS;
            let start = |search: &mut StepSearch| along.value(search, 0.0);
            let n_terms = affine_series(parts, part, search, start, &mut series);
            along.series = n_terms.map(|n| SmallVec::from_slice(&series[..n]));
        }
        along
    }

    pub fn is_sampled(&self) -> bool {
        !matches!(self.source, Source::Part(..))
    }

    /// Is it a smooth function of a user? Of one in pieces the sign behind the end of a step is asked for in the next one.
    pub fn is_smooth(&self) -> bool {
        match self.source {
            Source::Sampled(_) | Source::Held(..) => true,
            Source::Part(parts, _) => parts.n_inner() == 0,
        }
    }

    /// Is it a switching function inside of a user's function?
    pub fn is_inner(&self) -> bool {
        matches!(self.source, Source::Part(parts, part) if part < parts.n_inner())
    }

    /// The value in the step.
    pub fn value(&self, search: &mut StepSearch, theta: f64) -> Result<f64, FieldError> {
        self.value_on(search.stepper.interpolant(), &mut search.run.motion, theta)
    }

    fn value_on(
        &self,
        interpolant: &Interpolant,
        motion: &mut CurrentMotion,
        theta: f64,
    ) -> Result<f64, FieldError> {
        let (parts, part) = match (&self.series, self.source) {
            (Some(rows), _) => return Ok(Series::new(rows).value(theta)),
            (None, Source::Sampled(function)) => {
                return value_along(function, interpolant, motion, theta)
            }
            (None, Source::Held(function, piece)) => {
                let t = interpolant.t0 + theta * interpolant.dt;
                let mut y = self.y.borrow_mut();
                interpolant.at(theta, &mut y);
                motion.project(t, &mut y)?;
                let held = piece.held(self.system, self.actions, self.rule, (t, &y))?;
                return function.value_held((t, &y), piece, &held);
            }
            (None, Source::Part(parts, part)) => (parts, part),
        };
        let t = interpolant.t0 + theta * interpolant.dt;
        let mut y = self.y.borrow_mut();
        interpolant.at(theta, &mut y);
        motion.project(t, &mut y)?;
        let setting = Setting::new(&self.signs, &motion.discrete);
        Ok(parts.value(part, &setting.at(t, &y)))
    }

    /// What the series tells of the piece up to `to`; none if there is no series, or one that leaves a doubt.
    pub fn zeros_of_series(&self, search: &StepSearch, start: Start, to: f64) -> Option<Told> {
        zeros_of_series(self.series.as_ref()?, search, start, to)
    }

    /// How well the function is known at a point of the step; 0 for a smooth one, of which its values tell.
    pub fn rounding(&self, search: &StepSearch, theta: f64) -> f64 {
        if self.is_smooth() {
            return 0.0;
        }
        let (interpolant, motion) = (search.stepper.interpolant(), &search.run.motion);
        let (margin, q) = (&search.detector.margin, &motion.discrete);
        let bound = self.bound(interpolant, margin, q, (theta, theta), 1.0);
        // Where a root begins there are no bounds.
        let width = bound.map_or(0.0, |bound| bound.value.hi - bound.value.lo);
        if width.is_finite() {
            width
        } else {
            0.0
        }
    }

    /// Bounds on a piece, of the function times `sign`.
    fn bound(
        &self,
        interpolant: &Interpolant,
        margin: &[f64],
        q: &[f64],
        (a, b): (f64, f64),
        sign: f64,
    ) -> Option<Bound> {
        let (parts, part) = match (&self.series, self.source) {
            (_, Source::Sampled(_) | Source::Held(..)) => return None,
            (Some(rows), _) => {
                let Bound { value, slope } = Series::new(rows).bound(a, b);
                return Some(Bound {
                    value: value.scaled(sign),
                    slope: slope.scaled(sign),
                });
            }
            (None, Source::Part(parts, part)) => (parts, part),
        };
        let tube = Tube::new(interpolant, (a, b), margin);
        let enclosure = parts.enclose(part, &tube, Setting::new(&self.signs, q));
        Some(Bound::new(enclosure, sign, interpolant.dt))
    }
}

impl StepSearch<'_, '_> {
    /// Is a function zero all along the step, up to rounding, as one is that vanishes on the surfaces slid on?
    pub(super) fn stays_zero(
        &mut self,
        function: &dyn UserFunction,
        theta: f64,
    ) -> Result<bool, FieldError> {
        let Some(parts) = function.parts() else {
            return Ok(false);
        };
        let mut y: SmallVec<[f64; 8]> = smallvec![0.0; self.run.x.len()];
        for share in [1.0, 0.5, 0.25, 0.1] {
            let (at, motion) = (share * theta, &mut self.run.motion);
            let interpolant = self.stepper.interpolant();
            let t = interpolant.t0 + at * interpolant.dt;
            interpolant.at(at, &mut y);
            motion.project(t, &mut y)?;
            let mut signs: Signs = smallvec![0.0; parts.n_inner()];
            for part in 0..parts.n_inner() {
                let place = Setting::new(&signs, &motion.discrete).at(t, &y);
                signs[part] = parts.value(part, &place).signum();
            }
            let setting = Setting::new(&signs, &motion.discrete);
            let value = parts.value(parts.n_inner(), &setting.at(t, &y));
            let bound = parts.enclose(parts.n_inner(), &Rounded { t, x: &y }, setting);
            let width = bound.value.hi - bound.value.lo;
            // A value that does not exist is no zero.
            let is_zero = width.is_finite() && value.abs() <= width;
            if !is_zero {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The zeros up to `to` of a smooth affine function that has this value at the start, as its series tells them. The second
    /// result is the value at the end of the step, NaN if `to` is before it.
    pub(super) fn zeros_of_affine(
        &mut self,
        parts: &dyn SmoothParts,
        value: f64,
        start: Start,
        to: f64,
    ) -> Option<(Told, f64)> {
        let mut series = NO_TERMS;
        let n_terms = affine_series(parts, parts.n_inner(), self, |_| Ok(value), &mut series)?;
        let series = &series[..n_terms];
        let told = zeros_of_series(series, self, start, to)?;
        let value_at_end = match to == 1.0 {
            true => Series::new(series).ends()[1],
            false => f64::NAN,
        };
        Some((told, value_at_end))
    }

    /// The first zero up to `to`, which `is_last` says to be the end of the search.
    pub(super) fn search_user_piece(
        &mut self,
        along: &Along,
        start: Start,
        to: f64,
        is_last: bool,
    ) -> Result<Outcome, FieldError> {
        let beside = self.together(self.stepper.interpolant().dt);
        let Start {
            from,
            divided,
            sign,
            clear,
        } = start;
        let limit = clear.max((to - from) * 1e-7);
        let rounding = along.rounding(self, from);
        let (interpolant, motion) = (self.stepper.interpolant(), &mut self.run.motion);
        let q = motion.discrete.clone();
        let (t0, dt) = (interpolant.t0, interpolant.dt);
        let mut g = |at: f64| {
            if !divided {
                return Ok(sign * along.value_on(interpolant, motion, at)?);
            }
            // The zero at the start is divided out; its limit is the difference quotient.
            let away = (at - from).max(limit);
            Ok(sign * along.value_on(interpolant, motion, from + away)? / away)
        };
        let mut values = [0.0; 5];
        for (i, value) in values.iter_mut().enumerate() {
            *value = g(from + (to - from) * 0.25 * i as f64)?;
        }
        if values.iter().any(|v| !v.is_finite()) {
            let mut everywhere = values.iter().all(|v| !v.is_finite());
            for probe in PROBES {
                everywhere = everywhere && !g(from + (to - from) * probe)?.is_finite();
            }
            return Ok(Outcome::NotFinite { everywhere });
        }
        let margin = &self.detector.margin;
        let mut bounds = |a: f64, b: f64| along.bound(interpolant, margin, &q, (a, b), sign);
        // Rounding of a function whose terms are not known: that of its values.
        let largest = values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        // Where bounds know a small value better than that, the search cuts the piece into shorter ones.
        let is_lost = |at: f64, value: f64| {
            let is_small = value != 0.0 && value.abs() <= ROUNDING * largest;
            let known = is_small.then(|| bounds(at, at)).flatten();
            known.is_some_and(|bound| value.abs() > bound.value.hi - bound.value.lo)
        };
        if !divided
            && to - from > 4.0 * beside
            && (is_lost(from, values[0]) || is_lost(to, values[4]))
        {
            return Ok(Outcome::NotFinite { everywhere: false });
        }
        let evidence = Evidence::Bounds {
            bounds: &mut bounds,
            divided: i32::from(divided),
            patience: BOUNDS_DEPTH_BESIDE_ROOT,
        };
        let noise = (ROUNDING * largest).max(match divided {
            true => 0.0,
            false => rounding,
        });
        let isolated = first_zero_sampled(&mut g, from, to, values, noise, evidence)?;
        if isolated.not_finite {
            return Ok(Outcome::NotFinite { everywhere: false });
        }
        if isolated.exhausted {
            return Ok(Outcome::Exhausted);
        }
        if let Some(Zero::Crossing(bracket)) = isolated.zero {
            let width = 0.5 * EPS * (t0.abs() / dt).max(1.0);
            let zero = refine(&mut g, bracket, width)?;
            // A jump is no larger than the values beside it.
            let is_pole = POLE * zero.residual > largest;
            return Ok(match is_pole {
                true => Outcome::Pole(zero.theta),
                false => Outcome::At(zero.theta),
            });
        }
        if let Some(Zero::Touch(at)) = isolated.zero {
            let mut width = beside.max(EPS * (to - from));
            while at + width < to && g(at + width)?.abs() <= BEHIND_TOUCH * noise {
                width *= 2.0;
            }
            if at + width < to {
                // A sample may be on the zero to the bit.
                return Ok(match g(at + width)? < 0.0 {
                    true => Outcome::At(at),
                    false => Outcome::Touch(at + width),
                });
            }
        }
        // Zero up to rounding where the motion may end, as a switching function at its switch.
        let ends_there = is_last && largest > 0.0 && values[4].abs() <= noise;
        Ok(match ends_there {
            true => Outcome::At(to),
            false => Outcome::Nothing,
        })
    }
}
