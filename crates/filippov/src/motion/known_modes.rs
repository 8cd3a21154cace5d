//! What follows from a mode alone, wherever its motion starts.

use std::sync::Arc;

use smallvec::SmallVec;

use super::{Asleep, Monitored};
use crate::mode::{Mode, Signs};
use crate::system::{MotionJets, PiecewiseSystem};

/// The largest number of modes that a run keeps. When the run meets another mode, it clears the list and computes the
/// properties of each mode anew.
const MOST_KNOWN: usize = 8;

/// The series of a mode, counted by the run itself: threads that share them would wait for one another at every motion.
pub(crate) type OwnJets = Arc<Arc<MotionJets>>;

/// The surfaces whose sign matters in a mode.
#[derive(Clone, Debug)]
pub(crate) struct ActiveSurfaces {
    /// Which ones they are.
    active: SmallVec<[bool; 8]>,
    /// Does every surface matter?
    are_all: bool,
    /// Those that are not asleep, in order.
    awake: SmallVec<[usize; 4]>,
}

impl ActiveSurfaces {
    /// Those with these signs on the surfaces slid on.
    pub fn new(system: &dyn PiecewiseSystem, signs: &[f64], sliding: &[usize]) -> Self {
        let mut active = SmallVec::from_elem(false, signs.len());
        system.active(signs, sliding, &mut active);
        let n_active = active.iter().filter(|active| **active).count();
        let mut awake = SmallVec::with_capacity(n_active);
        awake.extend((0..active.len()).filter(|&j| active[j]));
        ActiveSurfaces {
            are_all: active.iter().all(|active| *active),
            active,
            awake,
        }
    }

    /// Does this one matter?
    #[inline]
    pub fn has(&self, j: usize) -> bool {
        self.active[j]
    }

    /// Does every surface matter?
    #[inline]
    pub fn are_all(&self) -> bool {
        self.are_all
    }

    /// Those that are not proved to be away from the motion, in order.
    #[inline]
    pub fn awake(&self) -> &[usize] {
        &self.awake
    }

    /// The surfaces that do not matter.
    pub fn inactive(&self) -> impl Iterator<Item = usize> + '_ {
        let all = if self.are_all { 0 } else { self.active.len() };
        (0..all).filter(|&j| !self.active[j])
    }

    /// The same where these surfaces are asleep, and no others.
    #[cold]
    #[inline(never)]
    pub fn beside(&self, asleep: &Asleep) -> Self {
        let mut beside = self.clone();
        beside.awake.clear();
        match asleep.has_any() {
            true => beside.awake.extend_from_slice(asleep.awake()),
            false => beside.awake.extend(0..self.active.len()),
        }
        beside.awake.retain(|j| self.active[*j]);
        beside
    }
}

/// What follows from one mode.
#[derive(Clone)]
pub(super) struct KnownMode {
    mode: Mode,
    active: ActiveSurfaces,
    /// Its Taylor series, once they were asked for and if there are any.
    pub jets: Option<Option<OwnJets>>,
    /// What is monitored, where nothing rests and there is no contact.
    pub monitored: Option<SmallVec<[Monitored; 2]>>,
}

/// The modes of a run, as far as they are remembered, and the present one.
#[derive(Clone, Default)]
pub(crate) struct KnownModes {
    modes: Vec<KnownMode>,
    present: usize,
}

impl KnownModes {
    /// Finds what is known of a mode, which is the present one from now on.
    #[inline(always)]
    pub(super) fn recall(
        &mut self,
        system: &dyn PiecewiseSystem,
        mode: &Mode,
        (signs, sliding): (&Signs, &[usize]),
        asleep: &Asleep,
    ) {
        let place = self.modes.iter().position(|known| known.mode == *mode);
        self.present = place.unwrap_or_else(|| {
            if self.modes.len() == MOST_KNOWN {
                self.modes.clear();
            }
            let mut active = ActiveSurfaces::new(system, signs, sliding);
            if asleep.has_any() {
                active = active.beside(asleep);
            }
            self.modes.push(KnownMode {
                mode: mode.clone(),
                active,
                jets: None,
                monitored: None,
            });
            self.modes.len() - 1
        });
    }

    /// The surfaces that matter in the present mode.
    #[inline]
    pub fn active(&self) -> &ActiveSurfaces {
        &self.modes[self.present].active
    }

    /// What is known of the present mode.
    #[inline]
    pub(super) fn present(&mut self) -> &mut KnownMode {
        &mut self.modes[self.present]
    }

    /// Other surfaces are asleep, or monitored, than before.
    pub(super) fn wake(&mut self, asleep: &Asleep) {
        for known in &mut self.modes {
            known.active = known.active.beside(asleep);
            (known.jets, known.monitored) = (None, None);
        }
    }
}
