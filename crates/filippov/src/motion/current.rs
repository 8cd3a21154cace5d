//! The motion in one mode: its field, its signs, and what is monitored.

use std::sync::Arc;

use smallvec::SmallVec;

use super::far_ends::FarEnds;
use super::known_modes::{KnownModes, OwnJets};
use super::{
    AffineBounds, Asleep, ContactField, Deflation, Guard, Law, ModeField, Monitored, RestField,
    SlidingSet, Triggers,
};
use crate::error::FieldError;
use crate::mode::{Mode, Signs};
use crate::options::SlidingRule;
use crate::system::Actions;
use crate::system::{MotionJets, PiecewiseSystem, Setting};

/// Fields that are kept of earlier motions.
const MOST_IDLE: usize = 8;

/// One piece of constant mode.
#[derive(Clone)]
pub(crate) struct CurrentMotion<'a> {
    pub mode: Mode,
    pub t_start: f64,
    /// Signs handed to the field; the surfaces slid on count as +1.
    pub signs: Signs,
    pub field: ModeField<'a>,
    /// The surfaces slid on, in increasing order.
    pub sliding: SlidingSet,
    /// Bounds of their multipliers, once they were asked for and if there are any.
    pub affine_bounds: Option<Option<AffineBounds>>,
    /// Which of these do not come to their ends.
    pub far_ends: FarEnds,
    /// All of them are affine: the continuous extension of a step does not leave them.
    pub is_straight: bool,
    /// Fields of other kinds, or on other surfaces, that earlier motions had, kept for their buffers.
    idle: Vec<ModeField<'a>>,
    /// What follows from the modes that it has had.
    pub known: KnownModes,
    /// Surfaces that need not be monitored for the time being.
    pub asleep: Asleep,
    pub monitored: Vec<Monitored>,
    /// It slides on several surfaces, some of them with static friction above kinetic.
    sticks: bool,
    /// It stays in its mode whatever its guards are: nothing is monitored.
    is_held: bool,
    law: Law<'a>,
    /// Surfaces that the motion stays on by either field, so that h is zero all along: not monitored.
    pub resting: SlidingSet,
    /// Surfaces whose functions were found to be zero in this mode, and that neither rest nor are slid on: they stay
    /// monitored, and are not settled on again.
    pub settled: SmallVec<[usize; 2]>,
    actions: &'a Actions<'a>,
    /// The side of every surface on which the motion is; where its entry is 0, that on which it was last: the side
    /// of a contact.
    pub sides: SmallVec<[i8; 16]>,
    /// Triggers that were crossed against their direction so far.
    pub passed: Vec<usize>,
    /// The discrete states.
    pub discrete: Vec<f64>,
}

impl<'a> CurrentMotion<'a> {
    /// The motion in `mode` from `t_start`.
    pub fn new(
        system: &'a dyn PiecewiseSystem,
        t_start: f64,
        mode: Mode,
        law: Law<'a>,
        actions: &'a Actions<'a>,
        asleep: Asleep,
    ) -> Self {
        let (signs, sliding): (_, SlidingSet) = (mode.signs(), mode.sliding_set().collect());
        let setting = Setting::new(&signs, &actions.discrete);
        let mut motion = CurrentMotion {
            t_start,
            field: ModeField::new(system, law, &sliding, setting),
            affine_bounds: None,
            far_ends: FarEnds::default(),
            is_straight: sliding.iter().all(|&j| system.is_affine(j)),
            sliding,
            idle: Vec::new(),
            known: KnownModes::default(),
            asleep,
            monitored: Vec::new(),
            sticks: false,
            is_held: false,
            law,
            resting: SmallVec::new(),
            settled: SmallVec::new(),
            actions,
            sides: actions.sides_at_start(signs.len()).collect(),
            passed: Vec::new(),
            discrete: actions.discrete.clone(),
            signs,
            mode,
        };
        motion.find_monitored(system, &[]);
        motion
    }

    /// Becomes the motion in `mode` from `t_start`; zeros to divide out are given per function.
    pub fn restart(
        &mut self,
        system: &'a dyn PiecewiseSystem,
        t_start: f64,
        mode: Mode,
        zeros: &[(Guard, Deflation)],
    ) {
        if !self.settled.is_empty() && self.mode != mode {
            self.settled.clear();
        }
        if !self.actions.list.is_empty() {
            let known = self.sides.iter_mut().zip(mode.entries());
            known
                .filter(|(_, &entry)| entry != 0)
                .for_each(|(side, &entry)| *side = entry);
        }
        self.sliding.clear();
        for j in mode.sliding_set() {
            self.sliding.push(j);
        }
        mode.write_signs(&mut self.signs);
        self.mode = mode;
        self.t_start = t_start;
        self.affine_bounds = None;
        self.far_ends.restart();
        self.is_straight = self.sliding.iter().all(|&j| system.is_affine(j));
        self.restart_field(system);
        self.find_monitored(system, zeros);
    }

    /// Stays in whatever mode it restarts in: nothing is monitored any more.
    pub fn hold(&mut self) {
        self.is_held = true;
        self.known.wake(&self.asleep);
    }

    /// Is an arrival at this surface looked for?
    pub fn looks_for(&self, j: usize) -> bool {
        !self.is_held && self.known.active().has(j)
    }

    /// Makes the field that of the mode.
    #[inline(always)]
    fn restart_field(&mut self, system: &'a dyn PiecewiseSystem) {
        let sliding = &self.sliding;
        if !self.actions.list.is_empty() && !sliding.is_empty() {
            let (mode, sides, q) = (&self.mode, &self.sides, &self.discrete);
            if let Some(contact) = ContactField::new(system, self.actions, mode, sides, q) {
                return self.replace_field(ModeField::Contact(Box::new(contact)));
            }
        }
        let setting = Setting::new(&self.signs, &self.discrete);
        if !sliding.is_empty() && system.reduced(sliding).is_some() {
            let field = ModeField::new(system, self.law, sliding, setting);
            return self.replace_field(field);
        }
        if self.field.restart(sliding, setting) {
            return;
        }
        let mut idle = self.idle.iter_mut();
        match idle.position(|field| field.restart(sliding, setting)) {
            Some(index) if self.field.is_lasting() => {
                std::mem::swap(&mut self.field, &mut self.idle[index]);
            }
            Some(index) => self.field = self.idle.swap_remove(index),
            None => {
                // That which was used longest ago.
                let is_full = self.idle.len() == MOST_IDLE;
                let spare = is_full.then(|| self.idle.remove(0));
                let field = ModeField::in_space_of(spare, system, self.law, sliding, setting);
                self.replace_field(field);
            }
        }
    }

    /// The signs handed to the field, and the discrete states.
    pub fn setting(&self) -> Setting<'_> {
        Setting::new(&self.signs, &self.discrete)
    }

    /// An action has changed the discrete states.
    pub fn set_discrete(&mut self, q: Vec<f64>) {
        self.field.set_discrete(&q);
        self.far_ends.restart();
        self.discrete = q;
    }

    /// Takes another field and keeps the one before, if it can be used again.
    fn replace_field(&mut self, field: ModeField<'a>) {
        let before = std::mem::replace(&mut self.field, field);
        if before.is_lasting() {
            if self.idle.len() == MOST_IDLE {
                self.idle.remove(0);
            }
            self.idle.push(before);
        }
    }

    /// Finds what is known of the present mode.
    #[inline(always)]
    fn recall(&mut self, system: &dyn PiecewiseSystem) {
        let signs = (&self.signs, &self.sliding[..]);
        self.known.recall(system, &self.mode, signs, &self.asleep);
    }

    /// The Taylor series of the mode; `find` looks for them the first time: for those on the surfaces slid on, with these curved switching
    /// functions, or with all.
    #[inline(always)]
    pub fn jets(
        &mut self,
        system: &dyn PiecewiseSystem,
        find: impl FnOnce(&[usize], Option<&[usize]>) -> Option<Arc<MotionJets>>,
    ) -> Option<OwnJets> {
        match &self.known.present().jets {
            Some(Some(jets)) => Some(Arc::clone(jets)),
            Some(None) => None,
            None => self.find_jets(system, find),
        }
    }

    #[cold]
    #[inline(never)]
    fn find_jets(
        &mut self,
        system: &dyn PiecewiseSystem,
        find: impl FnOnce(&[usize], Option<&[usize]>) -> Option<Arc<MotionJets>>,
    ) -> Option<OwnJets> {
        let awake = self.asleep.curved_awake(system);
        let found = find(&self.sliding, awake.as_deref()).map(Arc::new);
        self.known.present().jets = Some(found.clone());
        found
    }

    fn find_monitored(&mut self, system: &dyn PiecewiseSystem, zeros: &[(Guard, Deflation)]) {
        self.recall(system);
        self.sticks = self.sliding.len() > 1 && self.sliding.iter().any(|&j| system.sticks_at(j));
        let is_plain = self.resting.is_empty()
            && matches!(self.field, ModeField::Region(_) | ModeField::Sliding(_));
        let known = self.known.present().monitored.as_ref();
        self.monitored.clear();
        match known.filter(|_| is_plain) {
            Some(known) => self.monitored.extend_from_slice(known),
            None => {
                self.list_monitored(system);
                if is_plain {
                    let listed = SmallVec::from_slice(&self.monitored);
                    self.known.present().monitored = Some(listed);
                }
            }
        }
        // Of several for one function the first counts.
        for (guard, deflation) in zeros.iter().rev() {
            let own = self.monitored.iter_mut().filter(|m| m.guard == *guard);
            own.for_each(|m| m.deflation = Some(*deflation));
        }
        self.note_departure();
    }

    /// Lists what is monitored in this mode, wherever its motion starts.
    fn list_monitored(&mut self, system: &dyn PiecewiseSystem) {
        if self.is_held {
            return;
        }
        let monitor = |guard, place, orientation, affine| Monitored {
            guard,
            place,
            orientation,
            value: f64::NAN,
            rate: f64::NAN,
            curvature: 0.0,
            affine,
            deflation: None,
            noise: 0.0,
        };
        for &j in self.known.active().awake() {
            if self.mode.entries()[j] != 0 && !self.resting.contains(&j) {
                let affine = system.is_affine(j);
                let listed = monitor(Guard::Surface(j), j, self.signs[j], affine);
                self.monitored.push(listed);
            }
        }
        let exits = self.field.guards().into_iter().enumerate();
        self.monitored
            .extend(exits.map(|(place, guard)| monitor(guard, place, 1.0, false)));
    }

    /// The motion is about to start at this point: finds out which surfaces are asleep there.
    #[inline(always)]
    pub fn look_around(&mut self, system: &dyn PiecewiseSystem, t: f64, x: &[f64]) {
        if self.asleep.is_used() {
            self.find_asleep(system, t, x);
        }
    }

    #[cold]
    #[inline(never)]
    fn find_asleep(&mut self, system: &dyn PiecewiseSystem, t: f64, x: &[f64]) {
        if !self.asleep.contains_point(t, x, &self.discrete) {
            self.asleep.look_around(system, t, x, &self.discrete);
            self.known.wake(&self.asleep);
        }
    }

    /// The motion leaves the box in which surfaces are asleep, along a step over these ranges of time and states: lists anew what is
    /// monitored, and returns the places of what was not.
    pub fn wake(
        &mut self,
        system: &dyn PiecewiseSystem,
        ranges: &[[f64; 2]],
    ) -> SmallVec<[usize; 8]> {
        self.asleep.follow(system, ranges, &self.discrete);
        self.list_again(system)
    }

    /// Monitors all surfaces from now on; returns the places of those that were asleep.
    pub fn wake_all(&mut self, system: &dyn PiecewiseSystem) -> SmallVec<[usize; 8]> {
        self.asleep.end();
        self.list_again(system)
    }

    /// Lists anew what is monitored; what was monitored stays as it was, and what is divided out stays monitored.
    fn list_again(&mut self, system: &dyn PiecewiseSystem) -> SmallVec<[usize; 8]> {
        self.known.wake(&self.asleep);
        let before = std::mem::take(&mut self.monitored);
        self.list_monitored(system);
        let mut woken = SmallVec::new();
        for (place, m) in self.monitored.iter_mut().enumerate() {
            match before.iter().find(|other| other.guard == m.guard) {
                Some(known) => *m = *known,
                None => woken.push(place),
            }
        }
        let is_listed = |m: &&Monitored| self.monitored.iter().any(|n| n.guard == m.guard);
        let kept: SmallVec<[Monitored; 2]> = before
            .iter()
            .filter(|m| m.deflation.is_some() && !is_listed(m))
            .copied()
            .collect();
        self.monitored.extend(kept);
        woken
    }

    /// The surfaces that it still leaves tangentially.
    pub fn departing(&self) -> impl Iterator<Item = usize> + '_ {
        let tangent = |m: &&Monitored| m.deflation.is_some_and(|zero| zero.order > 1);
        self.monitored
            .iter()
            .filter(tangent)
            .filter_map(Monitored::surface)
    }

    /// Tells the field of a region whether the motion still departs from a surface.
    pub fn note_departure(&mut self) {
        let departing = self.departing().next().is_some();
        if let ModeField::Region(field) = &mut self.field {
            field.set_departing(departing);
        }
    }

    /// Do bounds of the multipliers hold for the exit functions?
    pub fn has_bounds(&self) -> bool {
        !self.is_in_contact() && !self.is_of_higher_order() && !self.is_at_rest() && !self.sticks
    }

    /// Is it drawn back to the surfaces slid on, and not projected?
    pub fn is_drawn_back(&self) -> bool {
        self.law.restoring.is_some() && !self.sliding.is_empty()
    }

    /// Is its field the multilinear combination of the fields around the surfaces slid on?
    pub fn has_canopy_field(&self) -> bool {
        match &self.field {
            ModeField::Contact(_) | ModeField::Reduced(_) | ModeField::Rest(_) => false,
            ModeField::Intersection(field) => field.rule() == SlidingRule::Canopy,
            ModeField::Region(_) | ModeField::Sliding(_) => true,
        }
    }

    /// Does it slide on several surfaces by another rule than the canopy?
    pub fn slides_by_rule(&self) -> bool {
        matches!(&self.field, ModeField::Intersection(field) if field.rule() != SlidingRule::Canopy)
    }

    /// Do redundant contacts share a load? Then their equations do not determine the multipliers.
    pub fn shares_load(&self) -> bool {
        matches!(&self.field, ModeField::Intersection(field) if field.shares_load())
    }

    /// Is the motion in contact at some surface?
    pub fn is_in_contact(&self) -> bool {
        matches!(self.field, ModeField::Contact(_))
    }

    /// The system whose normal components end it: a reduced one on a surface of higher relative degree.
    #[inline]
    pub fn sliding_system(&self, system: &'a dyn PiecewiseSystem) -> &'a dyn PiecewiseSystem {
        match &self.field {
            ModeField::Reduced(field) => field.innermost(),
            _ => system,
        }
    }

    /// Rests in its mode from now on.
    pub fn rest(&mut self, system: &dyn PiecewiseSystem) {
        let field = ModeField::Rest(RestField::new(self.sliding.len()));
        self.replace_field(field);
        self.find_monitored(system, &[]);
    }

    /// Does it rest?
    pub fn is_at_rest(&self) -> bool {
        matches!(self.field, ModeField::Rest(_))
    }

    /// Does it slide on a surface of higher relative degree?
    pub fn is_of_higher_order(&self) -> bool {
        matches!(self.field, ModeField::Reduced(_))
    }

    /// Does a guard end sliding on several surfaces, or contact?
    pub fn ends_root(&self, m: &Monitored) -> bool {
        let is_one = self.sliding.len() == 1 && !self.is_in_contact();
        !m.guard.is_surface() && !is_one
    }

    /// Bounds of the multipliers, if there are any.
    pub fn affine_bounds(&self) -> Option<&AffineBounds> {
        self.affine_bounds.as_ref()?.as_ref()
    }

    /// The surfaces slid on.
    pub fn sliding(&self) -> &[usize] {
        &self.sliding
    }

    /// The multipliers at the last evaluation, in the order of the surfaces slid on.
    pub fn multipliers(&self) -> SmallVec<[f64; 2]> {
        self.field.multipliers()
    }

    /// What the surfaces do that trigger actions.
    pub fn triggers<'t>(&'t self, system: &'t dyn PiecewiseSystem) -> Triggers<'t> {
        Triggers {
            system,
            actions: self.actions,
            sides: &self.sides,
        }
    }

    /// How far the point lies off these surfaces and those slid on, by rounding, if the functions have these values there; 0
    /// for the others.
    pub fn residuals(&self, h: &[f64], surfaces: &[usize]) -> Vec<f64> {
        let mut residuals = vec![0.0; h.len()];
        for &j in surfaces.iter().chain(&self.sliding) {
            residuals[j] = h[j].abs();
        }
        residuals
    }

    /// Moves `x` onto the surfaces slid on.
    pub fn project(&mut self, t: f64, x: &mut [f64]) -> Result<(), FieldError> {
        self.field.project(t, x)
    }
}
