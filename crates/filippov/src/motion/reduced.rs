//! The sliding field on surfaces of higher relative degree.

use smallvec::SmallVec;

use super::duties::Exits;
use super::guard::Guards;
use super::{Law, ModeField, Motion, Projector, SlidingSet, SmoothField};
use crate::error::FieldError;
use crate::system::{OwnSetting, PiecewiseSystem, Setting};

/// Sliding of higher order: h = 0 and, where both fields cross the surface at the same rate, this rate = 0. It is sliding on the
/// rates in the reduced system ([`PiecewiseSystem::reduced`]). The multiplier is the equivalent control, which keeps the
/// highest of these derivatives at zero; its ends are the guards.
pub struct ReducedField<'a> {
    system: &'a dyn PiecewiseSystem,
    surfaces: SlidingSet,
    setting: OwnSetting,
    projector: Projector,
    reduced: &'a dyn PiecewiseSystem,
    inner: Box<ModeField<'a>>,
}

impl<'a> ReducedField<'a> {
    /// Sliding on these surfaces, if one of them has a higher relative degree than 1.
    pub(crate) fn new(
        system: &'a dyn PiecewiseSystem,
        law: Law<'a>,
        surfaces: &[usize],
        setting: Setting<'_>,
    ) -> Option<Self> {
        let reduced = system.reduced(surfaces)?;
        Some(ReducedField {
            system,
            surfaces: SlidingSet::from_slice(surfaces),
            setting: OwnSetting::new(setting),
            projector: Projector::new(system.n_states(), system.n_surfaces()),
            reduced,
            inner: Box::new(ModeField::new(reduced, law, surfaces, setting)),
        })
    }

    /// The system in which no surface slid on has a higher relative degree.
    pub(super) fn innermost(&self) -> &'a dyn PiecewiseSystem {
        match &*self.inner {
            ModeField::Reduced(inner) => inner.innermost(),
            _ => self.reduced,
        }
    }

    /// Takes over the discrete states that an action left.
    pub(super) fn set_discrete(&mut self, q: &[f64]) {
        self.setting.set_discrete(q);
        self.inner.set_discrete(q);
    }
}

impl Motion for ReducedField<'_> {
    fn guards(&self) -> Guards {
        self.inner.guards()
    }

    fn last_exits(&self) -> &[f64] {
        self.inner.last_exits()
    }

    fn exits_at(&mut self, t: f64, x: &mut [f64]) -> Result<Exits, FieldError> {
        self.inner.exits_at(t, x)
    }

    fn multipliers(&self) -> SmallVec<[f64; 2]> {
        self.inner.multipliers()
    }

    /// Moves `x` onto the surfaces, then onto their rates; twice, as each of the two may disturb the other.
    fn project(&mut self, t: f64, x: &mut [f64]) -> Result<(), FieldError> {
        for _ in 0..2 {
            let setting = self.setting.get();
            self.projector
                .project_onto(self.system, &self.surfaces, t, x, setting)?;
            self.inner.project(t, x)?;
        }
        Ok(())
    }
}

impl SmoothField for ReducedField<'_> {
    fn eval(&mut self, t: f64, x: &mut [f64], dx: &mut [f64]) -> Result<(), FieldError> {
        self.project(t, x)?;
        self.inner.eval_unprojected(t, x, dx)
    }

    fn eval_unprojected(
        &mut self,
        t: f64,
        x: &mut [f64],
        dx: &mut [f64],
    ) -> Result<(), FieldError> {
        self.inner.eval_unprojected(t, x, dx)
    }

    fn n_evaluations(&self) -> u64 {
        self.inner.n_evaluations()
    }
}
