//! Zeros of the user's own functions in a step, found piece by piece where a function is finite.
//!
//! A function with kinks or jumps is smooth between the zeros of the switching functions inside of it. These are searched
//! first, each between the zeros of those before it; then the function itself. Where its sign differs on both sides of such
//! a zero, it has a zero there.

use filippov_expr::sort_few;
use smallvec::{smallvec, SmallVec};

use super::user_piece::{value_along, Along, Outcome, Source, Start};
use super::StepSearch;
use crate::error::FieldError;
use crate::event::{AtEnd, SmoothParts, StepEnd, UserEvents, UserFunction};
use crate::mode::Signs;
use crate::motion::Piece;
use crate::page::IS_PAGE;
use crate::stepper::Interpolant;
use crate::tolerances::{
    AT_SIDE, MOST_SAMPLES, MOST_ZEROS, NEAR_KINK, PIECES_OF_SERIES, ROUNDING, SHARES_BEFORE_KINK,
    SHARES_BEHIND_ZERO,
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

/// A change of the sign of a function.
#[derive(Clone, Copy)]
struct Change {
    at: f64,
    /// The sign before and after it; 0 where the function is zero all along.
    before: f64,
    after: f64,
}

/// Where the signs inside of a function change in the step, and which they are.
struct Cuts {
    /// The signs at the start of the step.
    start: Signs,
    /// (theta, index of the sign, sign after), in order of theta.
    changes: SmallVec<[(f64, usize, f64); 4]>,
    /// What happens at the end of the step.
    end: StepEnd,
}

impl Cuts {
    /// The signs just behind `theta`.
    fn signs_behind(&self, theta: f64) -> Signs {
        let mut signs = self.start.clone();
        let passed = self.changes.iter().take_while(|change| change.0 <= theta);
        passed.for_each(|&(_, index, sign)| signs[index] = sign);
        signs
    }

    /// Does a sign change at `theta` or later?
    fn has_change_from(&self, theta: f64) -> bool {
        self.changes.iter().any(|change| change.0 >= theta)
    }

    /// The ends of the pieces of [0, theta] on which no sign changes; the last one is `theta`.
    fn ends(&self, theta: f64) -> SmallVec<[f64; 8]> {
        let mut ends: SmallVec<[f64; 8]> = SmallVec::new();
        for &(at, ..) in &self.changes {
            if at > 0.0 && at < theta && ends.last() != Some(&at) {
                ends.push(at);
            }
        }
        ends.push(theta);
        ends
    }
}

/// What is known of a function where the search begins.
#[derive(Clone, Copy)]
struct AtStart {
    /// The sign before; 0 if there is none to compare with.
    before: f64,
    /// The function is zero there, and it has been said.
    is_known_zero: bool,
    /// May the function, smooth as it is, have jumped there?
    may_have_jumped: bool,
    /// It has, from a value that is not zero to zero.
    has_jumped_to_zero: bool,
}

impl AtStart {
    /// The start of a piece of a smooth function.
    fn of_piece(self, from: f64) -> Start {
        Start {
            from,
            divided: self.is_known_zero,
            sign: side(self.before),
            clear: 0.0,
        }
    }
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
        let is_final = self.stepper.extends_freely();
        if is_final || !is_extended && found.as_ref().is_none_or(|zeros| zeros.is_empty()) {
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
        if IS_PAGE {
            // It has no functions of a user.
            return Ok(Some(zeros));
        }
        for index in 0..events.events.len() {
            if !self.add_zeros(events, index, theta, &mut zeros)? || zeros.len() > MOST_ZEROS {
                return Ok(None);
            }
            if events.at_start && events.left[index] == 0.0 {
                let event = &events.events[index];
                let sign = sign_of(self.user_value(event.function, 1e-7 * theta)?);
                if sign != 0.0 && event.direction * sign >= 0.0 {
                    zeros.push((0.0, index));
                }
            }
        }
        Ok(Some(zeros))
    }

    /// Adds the zeros of a user's function that are in its direction; false if a shorter step is needed.
    fn add_zeros(
        &mut self,
        events: &UserEvents,
        index: usize,
        theta: f64,
        zeros: &mut Vec<(f64, usize)>,
    ) -> Result<bool, FieldError> {
        let direction = events.events[index].direction;
        let mut add = |at: f64, before: f64| {
            if direction * before <= 0.0 {
                zeros.push((at, index));
            }
        };
        let function = events.events[index].function;
        if let Some((j, sense)) = function.surface() {
            if let Some(is_reached) = self.reaches(j, events) {
                let side = sense * f64::from(self.run.motion.mode.entries()[j]);
                if is_reached {
                    add(theta, side);
                }
                events.at_end.borrow_mut()[index] = AtEnd::of_side(side);
                return Ok(true);
            }
        }
        let &Interpolant { t0, dt, .. } = self.stepper.interpolant();
        // It is not known where a motion went on from within a step.
        let left = match events.left[index] {
            value if value.is_nan() => self.user_value(function, 0.0)?,
            value => value,
        };
        let was_zero = (events.last[index] - t0).abs() <= self.together(dt) * dt;
        let mut start = AtStart {
            before: side(left),
            is_known_zero: left == 0.0 || was_zero,
            may_have_jumped: false,
            has_jumped_to_zero: false,
        };
        let held = self.piece_held(function);
        let is_on_surfaces = held.is_none() && self.run.motion.mode.codimension() > 0;
        let is_small = left.abs() <= AT_SIDE * events.before[index].abs();
        let may_stay = start.is_known_zero || is_small || events.before[index].is_nan();
        if is_on_surfaces && may_stay && self.stays_zero(function, theta)? {
            let before = events.sides[index];
            if !start.is_known_zero && before != 0.0 {
                add(0.0, before);
            }
            events.at_end.borrow_mut()[index] = AtEnd {
                side: 0.0,
                value: 0.0,
            };
            return Ok(true);
        }
        let sampled = match &held {
            Some(piece) => {
                let source = Source::Held(function, piece);
                let here = Along::new(source, &Signs::new(), self).value(self, 0.0)?;
                start.is_known_zero = was_zero || here == 0.0;
                // The signs jump where sliding begins.
                let before = events.sides[index];
                start.may_have_jumped = events.may_have_jumped || before != 0.0;
                start.before = match start.may_have_jumped {
                    true => before,
                    false => side(here),
                };
                Some(source)
            }
            None if function.parts().is_none() => Some(Source::Sampled(function)),
            None => None,
        };
        if let Some(along) = sampled {
            let none = Cuts::none(0);
            let Some((changes, side)) = self.changes_along(along, &none, theta, start)? else {
                return Ok(false);
            };
            changes
                .iter()
                .for_each(|change| add(change.at, change.before));
            events.at_end.borrow_mut()[index] = AtEnd::of_side(side);
            return Ok(true);
        }
        let Some(parts) = function.parts() else {
            return Ok(true);
        };
        if parts.n_inner() == 0 && !events.may_have_jumped {
            let told = self.zeros_of_affine(parts, left, start.of_piece(0.0), theta);
            if let Some(((mut side, found), value)) = told {
                for at in found {
                    add(at, side);
                    side = -side;
                }
                let side = if left == 0.0 && value == 0.0 {
                    0.0
                } else {
                    side
                };
                events.at_end.borrow_mut()[index] = AtEnd { side, value };
                return Ok(true);
            }
        }
        let mut cuts = Cuts::none(parts.n_inner());
        start.may_have_jumped = events.may_have_jumped;
        start.has_jumped_to_zero = events.may_have_jumped && events.jumped_to_zero[index];
        if parts.n_inner() > 0 || events.may_have_jumped {
            // At a kink or a jump rounding decides what the value there is: what counts is the piece before, if there is one.
            start.is_known_zero = was_zero;
            start.before = events.sides[index];
        }
        for part in 0..parts.n_inner() {
            if !self.add_cuts(parts, part, &mut cuts, theta)? {
                return Ok(false);
            }
        }
        let whole = Source::Part(parts, parts.n_inner());
        cuts.end = events.end;
        let Some((changes, side)) = self.changes_along(whole, &cuts, theta, start)? else {
            return Ok(false);
        };
        changes
            .iter()
            .for_each(|change| add(change.at, change.before));
        events.at_end.borrow_mut()[index] = AtEnd::of_side(side);
        Ok(true)
    }

    /// The piece of motion that says what holds it, if the function reads the sign of a surface slid on.
    fn piece_held(&self, function: &dyn UserFunction) -> Option<Piece> {
        let motion = &self.run.motion;
        let mut sliding = motion.mode.sliding_set();
        sliding.any(|j| function.reads(j)).then(|| Piece {
            mode: motion.mode.clone(),
            discrete: motion.discrete.clone(),
            sides: motion.sides.to_vec(),
            near: motion.multipliers().to_vec(),
            start: self.run.x.clone(),
        })
    }

    /// Does the motion arrive at a surface at the end of the step? `None` if nothing looks for that.
    fn reaches(&self, j: usize, events: &UserEvents) -> Option<bool> {
        let motion = &self.run.motion;
        if motion.mode.entries()[j] == 0 || motion.resting.contains(&j) {
            return Some(false);
        }
        let arrives_at = events.arrives_at.as_ref();
        let is_reached = arrives_at.map(|surfaces| surfaces.contains(&j));
        is_reached.filter(|_| motion.looks_for(j))
    }

    /// Adds the zeros of a switching function to the cuts; false if a shorter step is needed.
    fn add_cuts(
        &mut self,
        parts: &dyn SmoothParts,
        part: usize,
        cuts: &mut Cuts,
        theta: f64,
    ) -> Result<bool, FieldError> {
        let source = Source::Part(parts, part);
        let end = cuts.ends(theta)[0];
        let nothing = AtStart {
            before: 0.0,
            is_known_zero: false,
            may_have_jumped: false,
            has_jumped_to_zero: false,
        };
        let mut ignored = Vec::new();
        let along = Along::new(source, &cuts.start, self);
        let start = self.enter(&along, (0.0, end), nothing, &mut ignored)?;
        cuts.start[part] = start.sign;
        let known = AtStart {
            before: start.sign,
            is_known_zero: start.divided,
            may_have_jumped: false,
            has_jumped_to_zero: false,
        };
        let Some((changes, _)) = self.changes_along(source, cuts, theta, known)? else {
            return Ok(false);
        };
        let together = self.together(self.stepper.interpolant().dt);
        for change in &changes {
            // Signs that change up to rounding at one time do so at one.
            let mut known = cuts.changes.iter().map(|known| known.0);
            let at = known.find(|known| (known - change.at).abs() <= together);
            cuts.changes
                .push((at.unwrap_or(change.at), part, change.after));
        }
        sort_few(&mut cuts.changes, |a, b| a.0.total_cmp(&b.0).is_lt());
        Ok(true)
    }

    /// The start of the search on a piece, and the change of sign there, if the sign before was another one.
    fn enter(
        &mut self,
        along: &Along,
        (from, to): (f64, f64),
        before: AtStart,
        changes: &mut Vec<Change>,
    ) -> Result<Start, FieldError> {
        let value = along.value(self, from)?;
        let size = match to > from {
            true => along.value(self, to)?.abs().max(value.abs()),
            false => value.abs(),
        };
        let noise = (ROUNDING * size).max(along.rounding(self, from));
        let is_zero = before.is_known_zero || value.abs() <= noise;
        // A root that begins here may not exist a rounding error before.
        let sign = match is_zero || value.is_nan() {
            true if to == from => 0.0,
            true => self.first_sign_behind(along, from, to)?,
            false => sign_of(value),
        };
        if sign == 0.0 && before.has_jumped_to_zero && before.before != 0.0 {
            // It stays there.
            changes.push(Change {
                at: from,
                before: before.before,
                after: 0.0,
            });
        }
        let sign = if sign == 0.0 { before.before } else { sign };
        if before.before * sign < 0.0 && !before.is_known_zero {
            changes.push(Change {
                at: from,
                before: before.before,
                after: sign,
            });
        }
        Ok(Start {
            from,
            divided: is_zero,
            sign: side(sign),
            clear: 0.0,
        })
    }

    /// The changes of sign of one function, and its sign at the end; `None` if a shorter step is needed.
    fn changes_along(
        &mut self,
        source: Source,
        cuts: &Cuts,
        theta: f64,
        at_start: AtStart,
    ) -> Result<Option<(Vec<Change>, f64)>, FieldError> {
        let together = self.together(self.stepper.interpolant().dt);
        let mut changes = Vec::new();
        let mut before = at_start;
        let mut from = 0.0;
        for to in cuts.ends(theta) {
            let signs = cuts.signs_behind(from);
            let along = Along::new(source, &signs, self);
            let mut start = match along.is_smooth() && !before.may_have_jumped {
                true => before.of_piece(from),
                false => self.enter(&along, (from, to), before, &mut changes)?,
            };
            let ends_at_law = cuts.end == StepEnd::Law;
            let kink = to < theta || ends_at_law || cuts.has_change_from(theta - together);
            if !self.search_piece_of(&along, &mut start, (to, theta, kink), &mut changes)? {
                return Ok(None);
            }
            let stays_zero = changes.last().is_some_and(|change| change.after == 0.0);
            before = AtStart {
                before: if stays_zero { 0.0 } else { start.sign },
                is_known_zero: false,
                may_have_jumped: false,
                has_jumped_to_zero: false,
            };
            from = to;
        }
        // A jump at the very end, which no other step tells.
        let is_known = changes.last().is_some_and(|change| change.at == theta);
        if cuts.end == StepEnd::Stops && cuts.has_change_from(before_end(theta)) && !is_known {
            let along = Along::new(source, &cuts.signs_behind(theta), self);
            let end = self.enter(&along, (theta, theta), before, &mut changes)?;
            before.before = end.sign;
        }
        Ok(Some((changes, before.before)))
    }

    /// Searches one piece on which no inner sign changes, up to `to_end`, where one may change (`kink`); `theta` is the end of
    /// the search. False if a shorter step is needed.
    ///
    /// A piece where the function is finite at some points only is halved, down to the rounding of time, so that all
    /// of the step is searched where the function is finite; the piece that is left at the edge is not. Where it is
    /// finite at none of the points it counts as nowhere finite.
    fn search_piece_of(
        &mut self,
        along: &Along,
        start: &mut Start,
        (to_end, theta, kink): (f64, f64, bool),
        changes: &mut Vec<Change>,
    ) -> Result<bool, FieldError> {
        if let Some((sign, zeros)) = along.zeros_of_series(self, *start, to_end) {
            start.sign = add_changes(sign, &zeros, changes);
            (start.from, start.divided) = (to_end, false);
            return Ok(changes.len() <= MOST_ZEROS);
        }
        let together = self.together(self.stepper.interpolant().dt);
        let mut ends = self.sampled_pieces(along, start.from, to_end);
        let longest_unknown = match self.stepper.extends_freely() {
            true => (to_end - start.from) / f64::from(PIECES_OF_SERIES),
            false => to_end - start.from,
        };
        let mut n_cuts = 0;
        while let Some(&to) = ends.last() {
            if n_cuts > MOST_SAMPLES {
                return Ok(false);
            }
            if start.divided {
                let (sign, clear) = self.sign_behind(along, start.from, to)?;
                start.clear = clear;
                // A switching function that touches zero does not change its sign.
                let is_here = |change: &Change| change.at == start.from && change.before == sign;
                if along.is_inner() && changes.last().is_some_and(is_here) {
                    changes.pop();
                }
                start.sign = if sign == 0.0 { start.sign } else { sign };
            }
            let is_last = ends.len() == 1 && to_end == theta && along.is_smooth();
            match self.search_user_piece(along, *start, to, is_last)? {
                Outcome::Exhausted => return Ok(false),
                Outcome::Nothing => {
                    (start.from, start.divided) = (to, false);
                    ends.pop();
                }
                Outcome::Touch(at) => {
                    n_cuts += 1;
                    (start.from, start.divided) = (at, false);
                    ends.retain(|end| *end > at);
                    if ends.is_empty() {
                        break;
                    }
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
                        *start = self.start_at(along, to, start.sign, changes)?;
                        ends.pop();
                    }
                }
                Outcome::Pole(at) => {
                    let behind = (at + together).min(to_end);
                    *start = self.start_at(along, behind, start.sign, changes)?;
                    ends.retain(|end| *end > start.from);
                    // Behind it in pieces over which the function does not change by orders of magnitude.
                    let mut length = ends.last().map_or(0.0, |end| end - start.from);
                    while length > together {
                        length *= 0.5;
                        n_cuts += 1;
                        ends.push(start.from + length);
                    }
                }
                // What the sign is beyond the end of the piece tells whether it changes there.
                Outcome::At(at) if kink && at >= to_end - together => break,
                // The end is known up to rounding only: before it a function that turns back there may be zero too.
                Outcome::At(at)
                    if kink
                        && to_end - at <= NEAR_KINK * (to_end - start.from)
                        && !self.changes_before(along, at, to_end, start.sign)? =>
                {
                    break
                }
                Outcome::At(at) => {
                    // A zero at the end of the step is there to the bit: the next step knows it.
                    let is_at_end = at >= theta - together;
                    let at = if is_at_end { theta } else { at };
                    changes.push(Change {
                        at,
                        before: start.sign,
                        after: -start.sign,
                    });
                    if changes.len() > MOST_ZEROS {
                        return Ok(false);
                    }
                    let is_stuck = start.divided && at <= start.from;
                    (start.from, start.divided, start.sign) = (at, true, -start.sign);
                    if is_stuck || is_at_end {
                        break;
                    }
                    ends.retain(|end| *end > at + together);
                }
            }
        }
        Ok(true)
    }

    /// Is the sign somewhere between a zero and the end of the piece, clear of rounding, another one than before?
    fn changes_before(
        &mut self,
        along: &Along,
        zero: f64,
        end: f64,
        before: f64,
    ) -> Result<bool, FieldError> {
        for share in SHARES_BEFORE_KINK {
            let at = zero + share * (end - zero);
            if before * along.value(self, at)? < -along.rounding(self, at) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The sign of a function that is zero where it is entered, or is not defined there, as near behind as it is clear of rounding;
    /// 0 if it is nowhere.
    fn first_sign_behind(&mut self, along: &Along, from: f64, to: f64) -> Result<f64, FieldError> {
        let mut behind = self.together(self.stepper.interpolant().dt);
        while behind < to - from {
            let value = along.value(self, from + behind)?;
            if value.abs() > along.rounding(self, from + behind) {
                return Ok(sign_of(value));
            }
            behind *= 8.0;
        }
        Ok(0.0)
    }

    /// The sign behind a zero, where it is clear of rounding, and how far behind: nearer to a multiple zero, or to one of a steep
    /// root, rounding decides.
    fn sign_behind(&mut self, along: &Along, from: f64, to: f64) -> Result<(f64, f64), FieldError> {
        // The zero itself is known up to the rounding of time.
        let least = self.together(self.stepper.interpolant().dt);
        let mut behind = 0.0;
        for share in SHARES_BEHIND_ZERO {
            behind = (share * (to - from)).max(least.min(0.25 * (to - from)));
            let value = along.value(self, from + behind)?;
            if value.abs() > along.rounding(self, from + behind) {
                return Ok((sign_of(value), behind));
            }
        }
        Ok((0.0, behind))
    }

    /// The ends of the pieces that are searched one after the other, the first one last: a function without bounds is
    /// sampled, on a long step in pieces.
    fn sampled_pieces(&self, along: &Along, from: f64, to: f64) -> SmallVec<[f64; 16]> {
        let n = match along.is_sampled() && self.stepper.extends_freely() {
            true => PIECES_OF_SERIES,
            false => 1,
        };
        let end = |k| from + (to - from) * f64::from(k) / f64::from(n);
        (1..=n).rev().map(end).collect()
    }

    /// The search goes on from a point that no zero led to. A sign inside of a function may be another one there, which is no
    /// zero of the function.
    fn start_at(
        &mut self,
        along: &Along,
        from: f64,
        before: f64,
        changes: &mut Vec<Change>,
    ) -> Result<Start, FieldError> {
        let value = along.value(self, from)?;
        let sign = match value.is_nan() {
            true => before,
            false => value.signum(),
        };
        if along.is_inner() && sign != before {
            changes.push(Change {
                at: from,
                before,
                after: sign,
            });
        }
        Ok(Start {
            from,
            divided: value == 0.0,
            sign,
            clear: 0.0,
        })
    }
}

impl Cuts {
    fn none(n: usize) -> Self {
        Cuts {
            start: smallvec![0.0; n],
            changes: SmallVec::new(),
            end: StepEnd::GoesOn,
        }
    }
}

/// Adds the changes at zeros of a function that has this sign before the first; returns the sign behind the last.
fn add_changes(sign: f64, zeros: &[f64], changes: &mut Vec<Change>) -> f64 {
    let mut before = sign;
    for &at in zeros {
        let after = -before;
        changes.push(Change { at, before, after });
        before = after;
    }
    before
}

/// A little less.
fn before_end(theta: f64) -> f64 {
    theta * (1.0 - f64::EPSILON)
}

/// -1, 0 or +1; that of a value that does not exist is 0.
fn sign_of(value: f64) -> f64 {
    match value == 0.0 || value.is_nan() {
        true => 0.0,
        false => value.signum(),
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
