//! Zeros of the user's own functions in a step, found piece by piece where a function is finite.

use smallvec::SmallVec;

use super::StepSearch;
use crate::error::FieldError;
use crate::event::certificate::Bound;
use crate::event::isolate::{first_zero_sampled, Evidence, Zero, PROBES};
use crate::event::tube::Tube;
use crate::event::{UserEvent, UserEvents, UserFunction};
use crate::locate::refine;
use crate::motion::CurrentMotion;
use crate::stepper::Interpolant;
use crate::tolerances::{
    EPS, MOST_CUTS, MOST_ZEROS, PIECES_OF_SERIES, POLE, SURFACE_NOISE, UNBOUNDED_DEPTH,
};

impl StepSearch<'_, '_> {
    /// The value of a user's function along the motion.
    pub fn user_value(
        &mut self,
        function: &dyn UserFunction,
        theta: f64,
    ) -> Result<f64, FieldError> {
        value_along(
            function,
            self.stepper.interpolant(),
            &mut self.run.motion,
            theta,
        )
    }
}

/// The value of a user's function along the motion.
pub(super) fn value_along(
    function: &dyn UserFunction,
    interpolant: &Interpolant,
    motion: &mut CurrentMotion,
    theta: f64,
) -> Result<f64, FieldError> {
    let t = interpolant.t0 + theta * interpolant.dt;
    let mut y = vec![0.0; interpolant.n_states()];
    interpolant.at(theta, &mut y);
    motion.project(t, &mut y)?;
    function.value(t, &y, &motion.discrete)
}

/// Where the search of a step has come to.
#[derive(Clone, Copy)]
struct Start {
    from: f64,
    /// The function is zero there: it is divided by the distance.
    divided: bool,
    /// The sign of the function behind it.
    sign: f64,
}

/// What came of the search of a piece.
enum Outcome {
    /// There is no zero.
    Nothing,
    /// The first zero.
    At(f64),
    /// The sign changes first where the function is infinite.
    Pole(f64),
    /// The function is not finite at some of the points looked at, or at all of them.
    NotFinite { everywhere: bool },
    /// A shorter step is needed.
    Exhausted,
}

impl StepSearch<'_, '_> {
    /// The zeros (theta, index) of the functions up to `theta`, in no order; `None` if a shorter step is needed to tell them
    /// apart. Those along the extension that is at hand say whether the better one is needed, unless it is anyway.
    pub fn user_zeros(
        &mut self,
        events: &UserEvents,
        theta: f64,
        is_extended: bool,
    ) -> Result<Option<Vec<(f64, usize)>>, FieldError> {
        self.stepper.extend_cheaply(&self.run.x);
        let found = self.search_user_zeros(events, theta)?;
        if !is_extended && found.as_ref().is_none_or(|zeros| zeros.is_empty()) {
            return Ok(found);
        }
        self.stepper
            .extend(&mut self.run.motion.field, &self.run.x)?;
        self.search_user_zeros(events, theta)
    }

    /// All zeros in (0, theta], in no order; `None` if a shorter step is needed.
    pub fn search_user_zeros(
        &mut self,
        events: &UserEvents,
        theta: f64,
    ) -> Result<Option<Vec<(f64, usize)>>, FieldError> {
        let mut zeros = Vec::new();
        for index in 0..events.events.len() {
            if !self.search_zeros_of(events, index, theta, &mut zeros)? {
                return Ok(None);
            }
        }
        Ok(Some(zeros))
    }

    /// The zeros of one function; false if a shorter step is needed.
    ///
    /// A piece where the function is finite at some points only is halved, down to the rounding of time, so that all
    /// of the step is searched where the function is finite; the piece that is left at the edge is not. Where it is
    /// finite at none of the points it counts as nowhere finite.
    fn search_zeros_of(
        &mut self,
        events: &UserEvents,
        index: usize,
        theta: f64,
        zeros: &mut Vec<(f64, usize)>,
    ) -> Result<bool, FieldError> {
        let (t0, dt) = (self.stepper.interpolant().t0, self.stepper.interpolant().dt);
        let together = self.together(dt);
        let UserEvent {
            function,
            direction,
            ..
        } = events.events[index];
        let value = events.left[index];
        let mut start = Start {
            from: 0.0,
            divided: events.last[index] == t0 || value == 0.0,
            sign: side(value),
        };
        let mut ends = self.sampled_pieces(function, theta);
        let longest_unknown = match self.stepper.extends_freely() {
            true => theta / f64::from(PIECES_OF_SERIES),
            false => theta,
        };
        if events.at_start && value == 0.0 {
            let first = ends.last().map_or(theta, |end| *end);
            let sign = self.user_value(function, 1e-7 * first)?.signum();
            if sign != 0.0 && direction * sign >= 0.0 {
                zeros.push((0.0, index));
            }
        }
        let mut n_cuts = 0;
        while let Some(&to) = ends.last() {
            if n_cuts > MOST_CUTS {
                return Ok(false);
            }
            if start.divided {
                let probe = start.from + 1e-7 * (to - start.from);
                start.sign = side(self.user_value(function, probe)?);
            }
            let piece = self.search_user_piece(function, start, to, ends.len() == 1)?;
            match piece {
                Outcome::Exhausted => return Ok(false),
                Outcome::Nothing => {
                    (start.from, start.divided) = (to, false);
                    ends.pop();
                }
                Outcome::NotFinite { everywhere } => {
                    let length = to - start.from;
                    let longest = if everywhere {
                        longest_unknown
                    } else {
                        together
                    };
                    if length > longest {
                        n_cuts += 1;
                        ends.push(start.from + 0.5 * length);
                    } else {
                        start = self.start_at(function, to)?;
                        ends.pop();
                    }
                }
                Outcome::Pole(at) => {
                    start = self.start_at(function, (at + together).min(theta))?;
                    ends.retain(|end| *end > start.from);
                    // Behind it in pieces over which the function does not change by orders of magnitude.
                    let mut length = ends.last().map_or(0.0, |end| end - start.from);
                    while length > together {
                        length *= 0.5;
                        n_cuts += 1;
                        ends.push(start.from + length);
                    }
                }
                Outcome::At(at) => {
                    // A zero at the end of the step is there to the bit: the next step knows it.
                    let is_last = at >= theta - together;
                    let at = if is_last { theta } else { at };
                    if direction * start.sign <= 0.0 {
                        zeros.push((at, index));
                    }
                    if zeros.len() > MOST_ZEROS {
                        return Ok(false);
                    }
                    if at <= start.from || is_last {
                        break;
                    }
                    (start.from, start.divided) = (at, true);
                    ends.retain(|end| *end > at + together);
                }
            }
        }
        Ok(true)
    }

    /// The ends of the pieces of a step that are searched one after the other, the first one last: a function without
    /// bounds is sampled, on a long step in pieces.
    fn sampled_pieces(&self, function: &dyn UserFunction, theta: f64) -> SmallVec<[f64; 16]> {
        let is_sampled = !function.has_bounds();
        let n = match is_sampled && self.stepper.extends_freely() {
            true => PIECES_OF_SERIES,
            false => 1,
        };
        let end = |k| theta * f64::from(k) / f64::from(n);
        (1..=n).rev().map(end).collect()
    }

    /// The search goes on from a point that no zero led to.
    fn start_at(&mut self, function: &dyn UserFunction, from: f64) -> Result<Start, FieldError> {
        let value = self.user_value(function, from)?;
        Ok(Start {
            from,
            divided: value == 0.0,
            sign: side(value),
        })
    }

    /// The first zero up to `to`, which `is_last` says to be the end of the search.
    fn search_user_piece(
        &mut self,
        function: &dyn UserFunction,
        Start {
            from,
            divided,
            sign,
        }: Start,
        to: f64,
        is_last: bool,
    ) -> Result<Outcome, FieldError> {
        let limit = (to - from) * 1e-7;
        let (interpolant, motion) = (self.stepper.interpolant(), &mut self.run.motion);
        let q = motion.discrete.clone();
        let (t0, dt) = (interpolant.t0, interpolant.dt);
        let mut g = |at: f64| {
            if !divided {
                return Ok(sign * value_along(function, interpolant, motion, at)?);
            }
            // The zero at the start is divided out; its limit is the difference quotient.
            let away = (at - from).max(limit);
            Ok(sign * value_along(function, interpolant, motion, from + away)? / away)
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
        let mut bounds = |a: f64, b: f64| {
            let enclosure = function.enclose(&Tube::new(interpolant, (a, b), margin), &q)?;
            Some(Bound::new(enclosure, sign, dt))
        };
        let evidence = Evidence::Bounds {
            bounds: &mut bounds,
            divided: i32::from(divided),
            patience: UNBOUNDED_DEPTH,
        };
        // Rounding of a function whose terms are not known: that of its values.
        let largest = values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let noise = SURFACE_NOISE * largest;
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
        // Zero up to rounding where the motion may end, as a switching function at its switch.
        let ends_there = is_last && largest > 0.0 && values[4].abs() <= noise;
        Ok(match ends_there {
            true => Outcome::At(to),
            false => Outcome::Nothing,
        })
    }
}

/// The sign of a value; that of one that does not exist is never used.
fn side(value: f64) -> f64 {
    if value.is_nan() {
        1.0
    } else {
        value.signum()
    }
}
