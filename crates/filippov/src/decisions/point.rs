//! What a decision is asked about, and what its rules hand to one another.

use crate::motion::{ActiveSurfaces, Triggers};
use std::cell::RefCell;

use smallvec::{smallvec, SmallVec};

use crate::cube::KnownUniqueness;
use crate::error::FieldError;
use crate::error_scale::{ErrorScale, Units};
use crate::mode::{Mode, Signs};
use crate::motion::Deflation;
use crate::motion::{ContactField, Guard, Law, MeetingFields, ModeField, SmoothField};
use crate::motion::{Leading, Projector, TwoFoldMotion};
use crate::options::{NonUnique, Options, SlidingRule};
use crate::patience::Patience;
use crate::status::{Stop, Warning};
use crate::switch::Switch;
use crate::switching::Decision;
use crate::system::eval_on_side;
use crate::system::Actions;
use crate::system::{dot, dot_magnitude, AffineParts, PiecewiseSystem, Place, Setting};
use crate::tolerances::{MOMENT, MOST_SHORTENINGS, NO_PROGRESS, TOO_LARGE_A_CHANGE};

/// One value per surface; few are kept without allocation.
pub(crate) type Values = SmallVec<[f64; 8]>;

/// A point at which a motion ends or starts: the problem, the place, the arrival and the policy.
#[derive(Clone, Copy)]
pub(crate) struct Point<'p, 'm, 'a> {
    pub system: &'a dyn PiecewiseSystem,
    pub actions: &'a Actions<'a>,
    /// The tolerances.
    pub scale: &'p ErrorScale,
    pub t: f64,
    pub x: &'p [f64],
    /// The discrete states.
    pub q: &'p [f64],
    pub arrival: &'p Arrival<'m, 'a>,
    pub policy: Policy<'a>,
    /// What is known of the equations at meetings.
    pub known: &'p RefCell<KnownUniqueness>,
    /// Space for the fields around a meeting, which the decision before had too.
    pub space: &'p RefCell<AffineParts>,
    /// How long the caller waits.
    pub patience: Patience<'p>,
}

/// What is chosen where the system leaves a choice.
#[derive(Clone, Copy)]
pub(crate) struct Policy<'a> {
    /// How a motion slides on several surfaces.
    pub law: Law<'a>,
    pub nonunique: NonUnique,
    /// The modes asked for at the first non-unique points of the run.
    pub choices: &'a [Mode],
}

impl<'a> From<&'a Options> for Policy<'a> {
    fn from(options: &'a Options) -> Self {
        Policy {
            law: options.into(),
            nonunique: options.nonunique,
            choices: &options.choices,
        }
    }
}

/// Why a decision is asked for.
#[derive(Clone, Copy)]
pub(crate) enum Cause<'p> {
    /// The run starts here.
    Start,
    /// The state has jumped, or an event was none: the sides of this mode hold where the point lies on a surface.
    Anew(&'p Mode),
    /// These functions of the motion vanish here.
    Event {
        functions: &'p [Guard],
        /// They come within rounding of zero without a change of sign.
        touch: bool,
        /// How many derivatives along f- and f+ vanish at a multiple zero.
        vanishing: [usize; 2],
        /// The point is a two-fold that sliding on one surface has reached.
        at_two_fold: bool,
    },
    /// Infinitely many switches on these surfaces end here.
    Limit(&'p [usize]),
}

/// How the motion arrived: the motion that ends here, and why.
pub(crate) struct Arrival<'p, 'a> {
    pub cause: Cause<'p>,
    pub mode: &'p Mode,
    pub signs: &'p Signs,
    /// The surfaces slid on, in increasing order.
    pub sliding: &'p [usize],
    /// The side of every surface on which the motion is; where its entry is 0, that on which it was last.
    pub sides: &'p [i8],
    /// The surfaces whose sign matters in the mode.
    pub active: &'p ActiveSurfaces,
    /// The surfaces whose functions were zero all along the motion.
    pub resting: &'p [usize],
    /// The surfaces that the motion is still leaving tangentially.
    pub departing: SmallVec<[usize; 2]>,
    /// The last switches of the run.
    pub switches: &'p [Switch],
    /// How far the point lies off each surface by rounding; empty: not at all.
    pub residuals: &'p [f64],
    /// Triggers whose action leaves the motion as it is: it crosses them.
    pub passing: &'p [usize],
    /// The velocity of the motion a little before.
    pub velocity: &'p [f64],
    /// The field of the motion. To evaluate it changes nothing but its caches.
    pub field: RefCell<&'p mut ModeField<'a>>,
}

impl<'p> Arrival<'p, '_> {
    /// The multipliers of the motion at the last evaluation of its field.
    pub fn multipliers(&self) -> SmallVec<[f64; 2]> {
        self.field.borrow().multipliers()
    }

    /// Does the motion slide on several surfaces?
    pub fn slides_on_several(&self) -> bool {
        matches!(&**self.field.borrow(), ModeField::Intersection(_))
    }

    /// The functions that vanish, if the motion ends with an event.
    pub fn functions(&self) -> &[Guard] {
        match self.cause {
            Cause::Event { functions, .. } => functions,
            _ => &[],
        }
    }
}

impl<'p, 'm, 'a> Point<'p, 'm, 'a> {
    /// What the surfaces do that trigger actions.
    pub fn triggers(&self) -> Triggers<'_> {
        Triggers {
            system: self.system,
            actions: self.actions,
            sides: self.arrival.sides,
        }
    }

    /// The size of component `i` of the state ([`ErrorScale::size`]).
    pub fn size(&self, i: usize) -> f64 {
        self.scale.size(i, self.x[i])
    }

    /// What moves points onto surfaces.
    #[inline(never)]
    pub fn projector(&self) -> Projector {
        let units = self.policy.law.units.parts(self.x.len());
        Projector::new(self.x.len(), self.system.n_surfaces()).measured_in(units)
    }

    /// The sizes of the states, and the time in which one changes by its size along the motion that ends here.
    #[inline(never)]
    pub fn units(&self) -> Units<'_> {
        let units = self.policy.law.units.at(self.x);
        let velocity = self.arrival.velocity.iter().enumerate();
        let paces = velocity.map(|(i, v)| v.abs() / units.of_state(i));
        units.with_pace(paces.filter(|pace| pace.is_finite()).fold(0.0, f64::max))
    }

    /// These signs, with the discrete states.
    pub fn setting<'s>(&self, signs: &'s [f64]) -> Setting<'s>
    where
        'p: 's,
    {
        Setting { signs, q: self.q }
    }

    /// The argument of a function of the system at this point.
    pub fn place<'s>(&self, signs: &'s [f64]) -> Place<'s>
    where
        'p: 's,
    {
        self.setting(signs).at(self.t, self.x)
    }

    /// The same at another point.
    pub fn place_at<'s>(&self, t: f64, x: &'s [f64], signs: &'s [f64]) -> Place<'s>
    where
        'p: 's,
    {
        self.setting(signs).at(t, x)
    }

    /// The same question at another place.
    pub fn moved<'q>(&self, t: f64, x: &'q [f64]) -> Point<'q, 'm, 'a>
    where
        'p: 'q,
    {
        Point { t, x, ..*self }
    }

    /// The field of a mode, with the contact of bodies, from a start of which this is known.
    pub fn field_of(&self, mode: &Mode, start: Option<&Start>) -> ModeField<'p> {
        let sides = self.arrival.sides;
        if let Some(field) = ContactField::new(self.system, self.actions, mode, sides, self.q) {
            return ModeField::Contact(Box::new(field));
        }
        let mut field = ModeField::of(self.system, self.policy.law, mode, self.q);
        if let ModeField::Intersection(field) = &mut field {
            field.set_patience(self.patience);
            field.begin(start.map_or(&[], |start| &start.multipliers), false);
            if let Some(start) = start.filter(|start| start.is_given) {
                field.hold_at_start(self.t, start.is_located);
            }
        }
        field
    }

    /// Does a motion in this mode slide on its surfaces as the combination of the fields around them with its multipliers?
    pub fn slides_on_roots(&self, mode: &Mode) -> bool {
        let (law, sliding) = (&self.policy.law, mode.sliding_set());
        mode.codimension() > 0
            && law.rule == SlidingRule::Canopy
            && law.restoring.is_none()
            && self.actions.list.is_empty()
            && self
                .system
                .reduced(&sliding.collect::<SmallVec<[usize; 8]>>())
                .is_none()
    }

    /// The velocity of a motion in this mode.
    pub fn velocity(
        &self,
        notes: &mut Notes,
        mode: &Mode,
        multipliers: &[f64],
    ) -> Result<Vec<f64>, FieldError> {
        let mut start = Start::default();
        start.multipliers.extend(multipliers);
        self.velocity_from(notes, mode, Some(&start))
    }

    /// That of a start of which this is known.
    pub fn velocity_from(
        &self,
        notes: &mut Notes,
        mode: &Mode,
        start: Option<&Start>,
    ) -> Result<Vec<f64>, FieldError> {
        let mut velocity = vec![0.0; self.x.len()];
        notes.n_field_evaluations += if mode.codimension() == 0 {
            eval_on_side(self.system, &self.place(&mode.signs()), &mut velocity)?
        } else {
            let mut field = self.field_of(mode, start);
            field.eval(self.t, &mut self.x.to_vec(), &mut velocity)?;
            field.n_evaluations()
        };
        Ok(velocity)
    }

    /// The rates of all switching functions along the motion that arrives here.
    pub fn rates_here(&self) -> Result<Values, FieldError> {
        let d = self.system.n_surfaces();
        let (mut h, mut rates): (Values, Values) = (smallvec![0.0; d], smallvec![0.0; d]);
        let mut velocity = vec![0.0; self.x.len()];
        let mut x = self.x.to_vec();
        self.arrival
            .field
            .borrow_mut()
            .eval(self.t, &mut x, &mut velocity)?;
        let signs = &self.arrival.signs;
        self.system
            .surface_rates(&self.place(signs), &velocity, &mut h, &mut rates)?;
        Ok(rates)
    }

    /// The state after this time of a motion with this velocity.
    pub fn along(&self, velocity: &[f64], dt: f64) -> Vec<f64> {
        let pairs = self.x.iter().zip(velocity);
        pairs.map(|(x, v)| x + dt * v).collect()
    }

    /// The rate of h_j along a motion with this velocity, and the size of what it is the sum of.
    pub fn rate_of(
        &self,
        j: usize,
        signs: &[f64],
        velocity: &[f64],
    ) -> Result<(f64, f64), FieldError> {
        let mut gradient = vec![0.0; velocity.len()];
        let of_time = self.system.gradient(j, &self.place(signs), &mut gradient)?;
        let size = of_time.abs() + dot_magnitude(&gradient, velocity);
        Ok((of_time + dot(&gradient, velocity), size))
    }

    /// A short time for a motion with this velocity: within it neither the state nor the field with these signs changes by
    /// more than a small part ([`MOMENT`]) of its size.
    ///
    /// A component of the state that is zero has the size below which its absolute tolerance governs its error. A motion at
    /// rest tells no time: for it the moment starts from a part of the unit of time.
    pub fn moment(
        &self,
        notes: &mut Notes,
        signs: &[f64],
        velocity: &[f64],
    ) -> Result<f64, FieldError> {
        let sizes: Values = (0..self.x.len()).map(|i| self.size(i)).collect();
        let speed = |v: &[f64]| {
            let speeds = v.iter().zip(&sizes);
            speeds
                .map(|(v, size)| v.abs() / size)
                .filter(|speed| speed.is_finite())
                .fold(0.0, f64::max)
        };
        let mut moment = MOMENT / speed(velocity).max(1.0);
        let mut now = vec![0.0; self.x.len()];
        eval_on_side(self.system, &self.place(signs), &mut now)?;
        let (mut then, mut ahead) = (now.clone(), now.clone());
        let size = speed(&now);
        for _ in 0..MOST_SHORTENINGS {
            let pairs = ahead.iter_mut().zip(self.x.iter().zip(velocity));
            pairs.for_each(|(ahead, (x, v))| *ahead = x + moment * v);
            let later = self.place_at(self.t + moment, &ahead, signs);
            eval_on_side(self.system, &later, &mut then)?;
            notes.n_field_evaluations += 1;
            then.iter_mut()
                .zip(&now)
                .for_each(|(then, now)| *then -= now);
            let is_finite = then.iter().all(|change| change.is_finite());
            let change = if is_finite {
                speed(&then)
            } else {
                f64::INFINITY
            };
            // A field that is zero but for rounding changes by more than its size in any time.
            let of_rounding = change / moment * NO_PROGRESS * self.t.abs();
            if change <= TOO_LARGE_A_CHANGE * size || size <= of_rounding {
                break;
            }
            moment *= MOMENT.max(MOMENT * size / change);
        }
        Ok(moment)
    }

    /// Values of all switching functions.
    pub fn surface_values(&self, notes: &mut Notes, signs: &[f64]) -> Result<Values, FieldError> {
        let mut h: Values = smallvec![0.0; self.system.n_surfaces()];
        self.system.surfaces(&self.place(signs), &mut h)?;
        notes.n_surface_evaluations += 1;
        Ok(h)
    }

    /// The fields around the point where the surfaces of `meeting` vanish, the others with the signs of `mode`.
    pub fn corners(
        &self,
        notes: &mut Notes,
        meeting: &[usize],
        mode: &Mode,
    ) -> Result<MeetingFields, FieldError> {
        let mut corners = MeetingFields::new(self.system, meeting);
        notes.n_field_evaluations += corners.evaluate(
            self.system,
            &self.place(&mode.signs()),
            self.policy.law.units,
        )?;
        Ok(corners)
    }
}

/// What rules find out beside the motion that follows. A trial has notes of its own, which are dropped.
#[derive(Clone, Debug, Default)]
pub(crate) struct Notes {
    pub warnings: Vec<Warning>,
    /// How many non-unique points the run has met, those of this decision included.
    pub n_choices: usize,
    /// At a non-unique point, all modes among which one was chosen.
    pub candidates: Vec<Mode>,
    /// The motion may spiral outwards.
    pub spirals: bool,
    /// Which part of its rule decided at an intersection; empty if the rule has one only.
    pub leaf: &'static str,
    pub n_field_evaluations: u64,
    pub n_surface_evaluations: u64,
}

impl Notes {
    /// Notes of a trial: what it costs counts, what it warns of does not.
    pub fn of_trial(&self) -> Notes {
        Notes {
            n_choices: self.n_choices,
            ..Notes::default()
        }
    }

    /// Adds the warnings and the choices of a trial that the run follows.
    pub fn take_findings(&mut self, trial: Notes) {
        self.warnings.extend(trial.warnings);
        (self.n_choices, self.candidates) = (trial.n_choices, trial.candidates);
        (self.spirals, self.leaf) = (trial.spirals, trial.leaf);
    }

    /// Adds what a trial cost.
    pub fn add_costs(&mut self, trial: &Notes) {
        self.n_field_evaluations += trial.n_field_evaluations;
        self.n_surface_evaluations += trial.n_surface_evaluations;
    }
}

/// The motion that follows.
#[derive(Clone, Debug)]
pub(crate) struct Next {
    pub mode: Mode,
    /// What vanishes at its start.
    pub left: Lefts,
    /// What else is known of its start; seldom anything, and kept apart as decisions are handed from rule to rule.
    pub start: Option<Box<Start>>,
}

impl Next {
    pub fn new(mode: Mode, left: Lefts) -> Self {
        Next {
            mode,
            left,
            start: None,
        }
    }

    /// What is known of its start, to be added to.
    pub fn start_mut(&mut self) -> &mut Start {
        self.start.get_or_insert_default()
    }

    /// The multipliers at its start; none if they are not known.
    pub fn multipliers(&self) -> &[f64] {
        self.start.as_ref().map_or(&[], |start| &start.multipliers)
    }

    /// Does it start with the laps of an outward spiral?
    pub fn leaps(&self) -> bool {
        self.start
            .as_ref()
            .is_some_and(|start| start.leap.is_some())
    }
}

/// What is known of the start of a motion.
#[derive(Clone, Debug, Default)]
pub(crate) struct Start {
    /// The multipliers; none if they are not known.
    pub multipliers: Vec<f64>,
    /// The regularised motion oscillates around them.
    pub oscillates: bool,
    /// Do the equations of the multipliers vanish at the start, so that these hold there?
    pub is_given: bool,
    /// Is the start an event, whose place is known to rounding only?
    pub is_located: bool,
    /// On one surface, the motion that slides from a two-fold.
    pub two_fold: Option<TwoFoldMotion>,
    /// No motion leaves the point: the state stays as it is.
    pub is_rest: bool,
    /// The motion begins with the laps of an outward spiral.
    pub leap: Option<Leap>,
    /// The state, where that is not the place of the decision.
    pub moved: Option<Vec<f64>>,
}

/// The first laps of an outward spiral, up to a small distance from the intersection. There are infinitely many: the record
/// has one straight line for all. The spiral is one member of a one-parameter family of solutions.
///
/// Reference: Guglielmi, Hairer (2022), formula (6.5).
#[derive(Clone, Debug)]
pub(crate) struct Leap {
    /// The region that the motion enters at the end, and is said to be in from the start on.
    pub region: Mode,
    /// The surface on its border on which it enters.
    pub(super) border: usize,
    /// How long it takes, and how far it leads.
    pub(super) duration: f64,
    pub(super) shift: Vec<f64>,
}

/// The motion that follows, or why the run ends.
pub(crate) type Decided = Result<Next, Stop>;

/// What vanishes at the start of a motion, seldom more than one function.
pub(crate) type Lefts = SmallVec<[Left; 1]>;

/// A function that vanishes at the start of a motion, with its first non-vanishing derivative; of an exit function on one
/// surface that of the normal component.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Left {
    pub guard: Guard,
    pub leading: Leading,
}

impl Left {
    /// The surface is left with this derivative of h.
    pub fn beside(j: usize, leading: Leading) -> Self {
        let guard = Guard::Surface(j);
        Left { guard, leading }
    }

    /// The motion stays on the surface.
    pub fn stays(j: usize) -> Self {
        let (order, value) = (0, 0.0);
        Left::beside(j, Leading { order, value })
    }

    /// What vanishes after the decision at surface `j`.
    #[inline]
    pub fn after(j: usize, decision: &Decision) -> Lefts {
        let ends = Guard::ends(j).into_iter();
        let exits = |leading: [Leading; 2]| {
            let pairs = ends.zip(leading);
            pairs.map(|(guard, leading)| Left { guard, leading })
        };
        if let Some(motion) = decision.starts_at_two_fold() {
            return exits([motion.minus, motion.plus]).collect();
        }
        match decision.entry {
            -1 => smallvec![Left::beside(j, decision.minus)],
            1 => smallvec![Left::beside(j, decision.plus)],
            _ => {
                // The normal component is the derivative of h: one order less.
                let less = |leading: Leading| Leading {
                    order: leading.order.saturating_sub(1),
                    ..leading
                };
                let left = exits([decision.minus, decision.plus].map(less));
                left.filter(|left| left.leading.order > 0).collect()
            }
        }
    }

    /// The surface that is left; for an exit function there is none.
    pub fn surface(&self) -> Option<usize> {
        match self.guard {
            Guard::Surface(j) => Some(j),
            _ => None,
        }
    }

    /// The zero to divide out of the function along the motion from `t`.
    pub fn deflation(self, t: f64) -> Option<(Guard, Deflation)> {
        let Left { guard, leading } = self;
        (leading.order > 0).then(|| {
            let order = i32::try_from(leading.order).unwrap_or(1);
            // In the sense of the mode every monitored function starts out positive.
            (
                guard,
                Deflation {
                    t,
                    order,
                    leading: leading.coefficient().abs(),
                    residual: 0.0,
                    is_clean: false,
                    blur: 0.0,
                },
            )
        })
    }
}
