//! Can a motion start in this mode? All its guards have to begin positive.

use super::blow_up::beginnings;
use super::germ::{Germ, MotionSeries};
use super::point::{Left, Lefts, Next, Notes, Point};
use super::rule::{How, Meeting};
use super::trial::{try_mode, Trial};

use crate::cube::{is_undetermined, stable_roots_with_border, NormalFields};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::motion::{first_nonzero, Leading, TwoFold};
use crate::motion::{Guard, MeetingFields, RootEnd, Tie};
use crate::system::dot;
use crate::system::eval_on_side;
use crate::tolerances::{AT_SIDE, DOUBTFUL, ROUNDING, TANGENT};

/// A mode in which a motion can go on.
#[derive(Clone, Debug)]
pub(super) struct Viable {
    pub next: Next,
    /// Does no guard stay zero?
    pub is_strict: bool,
    /// Does the field beyond a surface on which the motion stays press it there? Then it may as well slide.
    pub is_pressed: bool,
}

impl Viable {
    /// All guards grow.
    pub fn strictly(next: Next) -> Self {
        Viable {
            next,
            is_strict: true,
            is_pressed: false,
        }
    }
}

pub(super) enum Verdict {
    Viable(Viable),
    /// This guard begins negative.
    Fails(Guard),
    /// This multiplier is within rounding of its end and comes to it at once: the mode ends in a moment.
    Fades(Guard, Viable),
    /// The motion stays on this surface, and the field beyond presses it there: it is that of the mode that slides there too, with a
    /// multiplier at its end.
    Slides(usize, Viable),
    /// Derivatives at the point do not decide about this motion.
    Open(Next),
    /// Nor would a trial: the mode has no field at the point.
    Untold,
}

/// One way in which a motion starts in a mode, with what is known of its guards.
struct Outset {
    viable: Viable,
    failing: Option<Guard>,
    fading: Option<Guard>,
    /// A surface on which it stays, pressed by the field beyond.
    slides: Option<usize>,
    is_open: bool,
}

impl Outset {
    /// Adds a guard, whose function has the sign `side` in the mode.
    fn add(&mut self, guard: Guard, side: i8, germ: Germ) {
        match germ {
            Germ::Begins(leading) if leading.value * f64::from(side) < 0.0 => {
                self.failing = self.failing.or(Some(guard));
            }
            Germ::Begins(leading) if leading.order > 0 => {
                self.viable.next.left.push(Left { guard, leading });
            }
            Germ::Begins(_) => {}
            Germ::Zero => self.viable.is_strict = false,
            Germ::Unknown => self.is_open = true,
        }
    }

    /// Adds the end of a multiplier, `left` before it.
    fn add_end(&mut self, guard: Guard, left: f64, germ: Germ) {
        match germ {
            Germ::Begins(Leading { order: 1.., value }) if value < 0.0 && left > 0.0 => {
                self.fading = self.fading.or(Some(guard));
            }
            germ => self.add(guard, 1, germ),
        }
    }

    fn verdict(self) -> Verdict {
        match (self.failing, self.fading, self.slides) {
            (Some(guard), ..) => Verdict::Fails(guard),
            (None, Some(guard), _) => Verdict::Fades(guard, self.viable),
            (None, None, Some(j)) => Verdict::Slides(j, self.viable),
            (None, None, None) if self.is_open => Verdict::Open(self.viable.next),
            (None, None, None) => Verdict::Viable(self.viable),
        }
    }
}

/// A mode that agrees with all switching functions.
#[derive(Clone, Copy)]
pub(super) struct Candidate<'c> {
    pub meeting: &'c Meeting<'c>,
    pub fields: &'c NormalFields,
    pub noise: &'c [f64],
    /// The rate at which the fields around the point change the state.
    pub pace: f64,
    /// On the surfaces of the meeting.
    pub entries: &'c Mode,
    pub mode: &'c Mode,
    /// Of which surfaces of the meeting is the function a guard: does it vanish here?
    pub guarded: &'c [bool],
    pub corners: &'c MeetingFields,
}

impl Candidate<'_> {
    /// Do all guards begin positive, for some multipliers?
    pub fn verdict(&self, at: &Point, notes: &mut Notes) -> Result<Verdict, FieldError> {
        if self.entries.codimension() == 0 {
            return Ok(self.with_multipliers(at, &[])?.verdict());
        }
        let is_silent = silent_rows((self.fields, self.noise), self.entries.entries());
        if self.entries.sliding_set().any(|i| is_silent[i]) {
            return match self.entries.sliding() {
                Some(place) => self.at_two_fold(at, notes, place),
                None => self.blown_up(at, notes, &is_silent),
            };
        }
        let face = self.fields.restrict(self.entries.entries());
        if is_undetermined(&face) {
            return Ok(Verdict::Open(self.outset(&[]).viable.next));
        }
        let roots = stable_roots_with_border(&face, at.patience).into_iter();
        self.first_viable(roots.map(|lambda| self.with_multipliers(at, &lambda)))
    }

    /// The guard that fails if no root is stable: on one surface the end of the multiplier whose field points away.
    pub fn guard(&self) -> Guard {
        let Some(place) = self.entries.sliding() else {
            return Guard::Root(RootEnd::Stability);
        };
        let below = self
            .fields
            .in_region(self.entries.with(place, -1).entries())[place];
        let [minus, plus] = Guard::ends(self.meeting.surfaces[place]);
        if below <= 0.0 {
            minus
        } else {
            plus
        }
    }

    fn first_viable(
        &self,
        outsets: impl Iterator<Item = Result<Outset, FieldError>>,
    ) -> Result<Verdict, FieldError> {
        let mut found = Verdict::Fails(self.guard());
        for outset in outsets {
            match (outset?.verdict(), &found) {
                (Verdict::Viable(viable), _) => return Ok(Verdict::Viable(viable)),
                (
                    Verdict::Fails(_) | Verdict::Fades(..) | Verdict::Slides(..),
                    Verdict::Open(_),
                ) => {}
                (Verdict::Fails(_), Verdict::Fades(..)) => {}
                (verdict, _) => found = verdict,
            }
        }
        Ok(found)
    }

    /// The start with these multipliers; none if they are not known.
    fn outset(&self, multipliers: &[f64]) -> Outset {
        let mut next = Next::new(self.mode.clone(), Lefts::new());
        if !multipliers.is_empty() {
            next.start_mut().multipliers = multipliers.to_vec();
        }
        Outset {
            viable: Viable::strictly(next),
            failing: None,
            fading: None,
            slides: None,
            is_open: false,
        }
    }

    /// The surfaces of the meeting that are guards of the mode: their places in it, their numbers and sides.
    fn surfaces(&self) -> impl Iterator<Item = (usize, usize, i8)> + '_ {
        let places = self.meeting.surfaces.iter().zip(self.entries.entries());
        let places = places.zip(self.guarded).enumerate();
        places.filter_map(|(i, ((&j, &side), guarded))| {
            (*guarded && side != 0).then_some((i, j, side))
        })
    }

    fn with_multipliers(&self, at: &Point, lambda: &[f64]) -> Result<Outset, FieldError> {
        let (mode, ties) = (self.mode, self.corners.ties());
        let mut next = lambda.iter().copied();
        let entries = self.entries.entries().iter().map(|&entry| match entry {
            0 => next.next().unwrap_or(0.0),
            side => f64::from(side),
        });
        let place: Vec<f64> = entries.collect();
        let g = match (lambda, at.system.has_nested_signs()) {
            ([], true) => self.components_in_region(at)?,
            ([], false) => self.fields.in_region(self.entries.entries()).into_owned(),
            _ => self.fields.interpolate(&place).to_vec(),
        };
        let is_tangent = |i: usize| g[i].abs() <= self.noise[i];
        // Before the end with this index.
        let left = |index: usize| 1.0 + [1.0, -1.0][index % 2] * lambda[index / 2];
        let is_at_end = |index: usize| left(index) <= AT_SIDE;
        let any_end = (0..2 * lambda.len()).any(is_at_end);
        let any_tangent = self.surfaces().any(|(i, ..)| is_tangent(i));
        let mut outset = self.outset(lambda);
        let series = match any_end || any_tangent {
            true => MotionSeries::of(at, mode, lambda, self.pace),
            false => None,
        };
        for (i, j, side) in self.surfaces() {
            let guard = Guard::Surface(j);
            let mut germ = match &series {
                _ if !is_tangent(i) => Germ::Begins(Leading {
                    order: 1,
                    value: g[i],
                }),
                Some(series) => series.of_surface(at, j)?,
                None => Germ::Unknown,
            };
            if lambda.is_empty() && germ == Germ::Unknown {
                let leading = first_nonzero(at.system, j, side, 1, &at.place(&mode.signs()))?;
                germ = Germ::of(leading, Germ::Zero);
            }
            if germ != Germ::Zero {
                outset.add(guard, side, germ);
                continue;
            }
            let is_pressed = self.is_pressed(&place, i);
            let is_own = lambda.is_empty() || self.is_neutral(i);
            if is_own || is_pressed {
                outset.add(guard, side, germ);
                outset.viable.is_pressed |= is_pressed;
                outset.viable.next.left.push(Left::stays(j));
                outset.slides = outset.slides.or((!is_own).then_some(j));
            } else {
                outset.is_open = true;
            }
        }
        if let ([tie], true, false, 2) = (ties, any_end, any_tangent, lambda.len()) {
            return self.at_tied_end(at, outset, *tie, lambda);
        }
        let slid = self.entries.sliding_set();
        let guards = slid.flat_map(|i| Guard::ends(self.meeting.surfaces[i]).map(|end| (i, end)));
        for (index, (i, guard)) in guards.enumerate().filter(|(index, _)| is_at_end(*index)) {
            // Where the field of a side is tangent up to noise the multiplier is at its end.
            let blur = self.noise[i] / self.fields.row_size(i);
            let germ = series.as_ref().map(|series| series.of_exit(index, blur));
            outset.add_end(guard, left(index), germ.unwrap_or(Germ::Unknown));
        }
        Ok(outset)
    }

    /// The components normal to the surfaces of the meeting in the region, with its own normals: those of functions that
    /// contain signs of others bend. Where a motion slides it needs none of its own, as it is tangent to what they differ by.
    fn components_in_region(&self, at: &Point) -> Result<Vec<f64>, FieldError> {
        let (mut field, mut normal) = (vec![0.0; at.x.len()], vec![0.0; at.x.len()]);
        let signs = self.mode.signs();
        eval_on_side(at.system, &at.place(&signs), &mut field)?;
        let components = self.meeting.surfaces.iter().map(|&j| {
            let of_time = at.system.gradient(j, &at.place(&signs), &mut normal)?;
            Ok(of_time + dot(&normal, &field))
        });
        components.collect()
    }

    /// A motion with these multipliers and sides stays on surface i of the meeting. Does the field beyond the surface press it
    /// there? Then it slides.
    fn is_pressed(&self, place: &[f64], i: usize) -> bool {
        let mut beyond = place.to_vec();
        beyond[i] = -place[i];
        place[i] * self.fields.interpolate(&beyond)[i] > self.noise[i]
    }

    /// Are all fields around the surfaces slid on, and on both sides of surface i of the meeting, tangent to that? Only then
    /// does a motion that slides keep the sign of its mode.
    fn is_neutral(&self, i: usize) -> bool {
        let beyond = [-1, 1].map(|side| self.entries.with(i, side));
        let is_silent = |mode: &Mode| silent_rows((self.fields, self.noise), mode.entries())[i];
        !self.corners.depends_on(i) || beyond.iter().all(is_silent)
    }

    /// Sliding on two surfaces in one place that begins with multipliers at their ends: the motion is that of one region,
    /// which has to lead back to the surfaces.
    fn at_tied_end(
        &self,
        at: &Point,
        mut outset: Outset,
        tie: Tie,
        lambda: &[f64],
    ) -> Result<Outset, FieldError> {
        let side: i8 = if lambda[0] < 0.0 { -1 } else { 1 };
        let sides = [(tie.leader, side), (tie.follower, tie.sense * side)];
        let (mut region, mut beyond) = (self.mode.clone(), self.entries.clone());
        for (i, side) in sides {
            region.set(self.meeting.surfaces[i], side);
            beyond.set(i, -side);
        }
        let held = self.fields.in_region(beyond.entries())[tie.leader];
        let germ = match MotionSeries::of(at, &region, &[], self.pace) {
            Some(series) => series.of_surface(at, self.meeting.surfaces[tie.leader])?,
            None => Germ::Unknown,
        };
        let germ = match germ {
            Germ::Begins(Leading { order, value }) => Germ::Begins(Leading {
                order: order - 1,
                value: -2.0 * f64::from(side) * value / held.abs(),
            }),
            other => other,
        };
        for (i, end) in sides {
            let surface = self.meeting.surfaces[i];
            outset.add(Guard::Multiplier { surface, end }, 1, germ);
        }
        Ok(outset)
    }

    /// Sliding on one surface to which both fields are tangent.
    fn at_two_fold(
        &self,
        at: &Point,
        notes: &mut Notes,
        place: usize,
    ) -> Result<Verdict, FieldError> {
        let slid = self.meeting.surfaces[place];
        let signs = self.mode.signs();
        let mut two_fold = TwoFold::new(at.system, slid, 1, at.place(&signs));
        if matches!(self.meeting.how, How::Event(_)) {
            two_fold = two_fold.located();
        }
        if !two_fold.is_regular()? && self.is_same_on_sides(at, notes, slid)? {
            return self.tried(at, notes);
        }
        let [minus, plus] = Guard::ends(slid);
        let motions = two_fold.motions()?.into_iter();
        let verdict = self.first_viable(motions.map(|motion| {
            let mut outset = self.outset(&[motion.multiplier()]);
            outset.add(minus, 1, Germ::of(motion.minus, Germ::Unknown));
            outset.add(plus, -1, Germ::of(motion.plus, Germ::Unknown));
            for (_, j, side) in self.surfaces() {
                let leading = two_fold.first_along(j, &motion)?;
                outset.add(Guard::Surface(j), side, Germ::of(leading, Germ::Unknown));
            }
            let start = outset.viable.next.start_mut();
            (start.is_given, start.two_fold) = (true, Some(motion));
            Ok(outset)
        }))?;
        Ok(match verdict {
            // A trial knows no multiplier either.
            Verdict::Open(_) => Verdict::Untold,
            // The derivatives that decide may be rounding of the place.
            Verdict::Fails(_) if self.is_same_on_sides(at, notes, slid)? => {
                self.tried(at, notes)?
            }
            verdict => verdict,
        })
    }

    /// Sliding between fields that agree, so that every multiplier gives the same motion: we follow it for a moment, and take it
    /// if no other mode is viable.
    fn tried(&self, at: &Point, notes: &mut Notes) -> Result<Verdict, FieldError> {
        let next = self.outset(&[]).viable.next;
        let trial = try_mode(at, notes, &next, self.meeting.surfaces, ROUNDING)?;
        Ok(match trial {
            Trial::Leaves(left) => {
                Verdict::Fades(self.guard(), Viable::strictly(Next { left, ..next }))
            }
            _ => Verdict::Fails(self.guard()),
        })
    }

    /// Are the fields on both sides of a surface the same here?
    fn is_same_on_sides(
        &self,
        at: &Point,
        notes: &mut Notes,
        j: usize,
    ) -> Result<bool, FieldError> {
        let [minus, plus] = [-1, 1].map(|side| at.velocity(notes, &self.mode.with(j, side), &[]));
        let (minus, plus) = (minus?, plus?);
        let mut pairs = minus.iter().zip(&plus).enumerate();
        Ok(pairs.all(|(i, (a, b))| (a - b).abs() <= TANGENT * self.pace * at.size(i)))
    }

    /// Sliding on several surfaces where equations of the multipliers vanish.
    fn blown_up(
        &self,
        at: &Point,
        notes: &mut Notes,
        is_silent: &[bool],
    ) -> Result<Verdict, FieldError> {
        let beginnings = beginnings(at, notes, self.meeting, self.mode, is_silent)?;
        self.first_viable(beginnings.into_iter().map(|beginning| {
            let mut outset = self.outset(&beginning.multipliers);
            let start = outset.viable.next.start_mut();
            (start.is_given, start.is_located) = (true, matches!(self.meeting.how, How::Event(_)));
            let (lambda, rates) = (&beginning.multipliers, &beginning.rates);
            outset.is_open = lambda.iter().any(|l| 1.0 - l.abs() <= AT_SIDE);
            let largest = rates
                .iter()
                .fold(0.0_f64, |most, rate| most.max(rate.abs()));
            for (i, j, side) in self.surfaces() {
                let (order, value) = (1 + usize::from(is_silent[i]), rates[i]);
                let germ = match value.abs() <= DOUBTFUL * largest {
                    true => Germ::Unknown,
                    false => Germ::Begins(Leading { order, value }),
                };
                outset.add(Guard::Surface(j), side, germ);
            }
            Ok(outset)
        }))
    }
}

/// To which surfaces of the meeting are all fields around the surfaces slid on tangent?
pub(super) fn silent_rows((fields, noise): (&NormalFields, &[f64]), entries: &[i8]) -> Vec<bool> {
    let slid: Vec<usize> = (0..entries.len()).filter(|&i| entries[i] == 0).collect();
    let mut is_silent = vec![true; fields.m()];
    let mut region = entries.to_vec();
    for pattern in 0..1_usize << slid.len() {
        for (bit, &i) in slid.iter().enumerate() {
            region[i] = if pattern >> bit & 1 == 1 { 1 } else { -1 };
        }
        let rows = is_silent.iter_mut().zip(noise);
        for ((is_silent, noise), value) in rows.zip(fields.in_region(&region).iter()) {
            *is_silent &= value.abs() <= *noise;
        }
    }
    is_silent
}
