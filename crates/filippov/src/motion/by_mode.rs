//! The field of a mode, whatever its kind; among them sliding on surfaces of higher relative degree, whose field is that of a mode
//! of the reduced system.

use std::ops::{Deref, DerefMut};

use smallvec::SmallVec;

use super::duties::Exits;
use super::guard::{Guard, Guards};
use super::{
    ContactField, IntersectionField, Motion, Projector, RegionField, RestField, SlidingField,
    SmoothField,
};
use crate::error::FieldError;
use crate::error_scale::Units;
use crate::mode::Mode;
use crate::options::{Options, SlidingRule};
use crate::page::IS_PAGE;
use crate::system::{OwnSetting, PiecewiseSystem, Setting};
use crate::tolerances::EPS;

/// The motion of a mode, whatever its kind.
#[derive(Clone)]
pub(crate) enum ModeField<'a> {
    Region(RegionField<'a>),
    Sliding(Box<SlidingField<'a>>),
    Intersection(Box<IntersectionField<'a>>),
    Contact(Box<ContactField<'a>>),
    Reduced(Box<ReducedField<'a>>),
    Rest(RestField),
}

/// How a motion slides where several surfaces meet.
#[derive(Clone, Copy)]
pub(crate) struct Law<'a> {
    /// The combination of the fields.
    pub rule: SlidingRule,
    /// The scaling of all surfaces; empty: 1 for each.
    pub kappa: &'a [f64],
    /// The factor of the term that draws it back, in place of the projection.
    pub restoring: Option<f64>,
    /// The sizes of the states.
    pub units: Units<'a>,
}

impl<'a> From<&'a Options> for Law<'a> {
    fn from(options: &'a Options) -> Self {
        Law {
            rule: options.sliding,
            kappa: &options.kappa,
            restoring: options.stabilization.restoring(),
            units: options.into(),
        }
    }
}

impl Law<'_> {
    /// The scaling of some surfaces.
    pub fn scaling(&self, surfaces: &[usize]) -> Vec<f64> {
        let scaling = surfaces.iter().map(|&j| self.kappa.get(j).copied());
        scaling.map(|kappa| kappa.unwrap_or(1.0)).collect()
    }
}

/// The surfaces slid on, in order.
pub(crate) type SlidingSet = SmallVec<[usize; 4]>;

impl<'a> ModeField<'a> {
    /// The field of a mode without contact, at these discrete states.
    pub fn of(system: &'a dyn PiecewiseSystem, law: Law<'a>, mode: &Mode, q: &[f64]) -> Self {
        let sliding: SlidingSet = mode.sliding_set().collect();
        ModeField::new(system, law, &sliding, Setting::new(&mode.signs(), q))
    }

    /// How far from zero a guard with this index may be by rounding, at the last evaluation, where that is known.
    pub(crate) fn noise_of_exit(&self, index: usize) -> f64 {
        match self {
            ModeField::Contact(field) => field.noise_of_exit(index),
            _ => 0.0,
        }
    }

    pub(crate) fn new(
        system: &'a dyn PiecewiseSystem,
        law: Law<'a>,
        sliding: &[usize],
        setting: Setting<'_>,
    ) -> Self {
        if let Some(field) = ReducedField::new(system, law, sliding, setting) {
            return ModeField::Reduced(Box::new(field));
        }
        match *sliding {
            [] => ModeField::Region(RegionField::new(system, setting)),
            [j] => {
                let field = SlidingField::new(system, j, setting).with_units(law.units);
                ModeField::Sliding(Box::new(field.with_restoring(law.restoring)))
            }
            _ => {
                let field = IntersectionField::new(system, sliding, setting, &[]);
                let field = field.with_rule(law.rule).with_restoring(law.restoring);
                let field = field.with_units(law.units);
                ModeField::Intersection(Box::new(field.with_scaling(&law.scaling(sliding))))
            }
        }
    }

    /// The field of a mode without contact and without surfaces of higher relative degree, in the space of one that slides on several
    /// surfaces, if there is one.
    pub(crate) fn in_space_of(
        spare: Option<Self>,
        system: &'a dyn PiecewiseSystem,
        law: Law<'a>,
        sliding: &[usize],
        setting: Setting<'_>,
    ) -> Self {
        if let Some(ModeField::Intersection(mut field)) = spare.filter(|_| !IS_PAGE) {
            let is_one = sliding.len() > 1 && law.rule == SlidingRule::Canopy;
            if is_one && field.refit(sliding, setting, &law.scaling(sliding)) {
                return ModeField::Intersection(field);
            }
        }
        ModeField::new(system, law, sliding, setting)
    }

    /// Becomes the field of another mode of its kind; `false` if it is of another kind, or slides on several surfaces that are not
    /// those of the mode.
    pub(crate) fn restart(&mut self, sliding: &[usize], setting: Setting<'_>) -> bool {
        match (self, sliding) {
            (ModeField::Region(field), []) => field.restart(setting),
            (ModeField::Sliding(field), &[j]) => field.restart(j, setting),
            (ModeField::Intersection(field), set) => return field.restart(set, setting),
            _ => return false,
        }
        true
    }
}

impl ModeField<'_> {
    /// Is it worth to be kept for another motion?
    pub(crate) fn is_lasting(&self) -> bool {
        match self {
            ModeField::Region(_) | ModeField::Sliding(_) => true,
            ModeField::Intersection(field) => field.is_lasting(),
            ModeField::Contact(_) | ModeField::Reduced(_) | ModeField::Rest(_) => false,
        }
    }

    /// The gradient of a guard by central differences: writes its derivatives by the states, and returns that by time. NaN if the
    /// motion has no such guard.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub(crate) fn gradient_of(
        &mut self,
        guard: Guard,
        t: f64,
        x: &[f64],
        state: &mut [f64],
    ) -> Result<f64, FieldError> {
        let mut value = |t: f64, x: &[f64]| self.value_of(guard, t, x);
        let reach = |v: f64| EPS.cbrt() * (1.0 + v.abs());
        let mut moved = x.to_vec();
        for (i, entry) in state.iter_mut().enumerate() {
            let d = reach(x[i]);
            moved[i] = x[i] + d;
            let above = value(t, &moved)?;
            moved[i] = x[i] - d;
            let below = value(t, &moved)?;
            moved[i] = x[i];
            *entry = (above - below) / (2.0 * d);
        }
        let d = reach(t);
        Ok((value(t + d, x)? - value(t - d, x)?) / (2.0 * d))
    }

    /// The value of a guard; NaN if the motion has no such guard.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub(crate) fn value_of(&mut self, guard: Guard, t: f64, x: &[f64]) -> Result<f64, FieldError> {
        let place = self.guards().iter().position(|g| *g == guard);
        let exits = self.exits_at(t, &mut x.to_vec())?;
        Ok(place.map_or(f64::NAN, |place| exits[place]))
    }

    /// The motion has come to time t.
    pub(crate) fn come_to(&mut self, t: f64) {
        match self {
            ModeField::Intersection(field) => field.come_to(t),
            ModeField::Reduced(field) => field.inner.come_to(t),
            _ => {}
        }
    }

    /// Takes over the discrete states that an action left.
    pub(crate) fn set_discrete(&mut self, q: &[f64]) {
        match self {
            ModeField::Region(field) => field.set_discrete(q),
            ModeField::Sliding(field) => field.set_discrete(q),
            ModeField::Intersection(field) => field.set_discrete(q),
            ModeField::Contact(field) => field.set_discrete(q),
            ModeField::Reduced(field) => field.set_discrete(q),
            ModeField::Rest(_) => {}
        }
    }
}

impl<'a> Deref for ModeField<'a> {
    type Target = dyn Motion + 'a;

    #[inline]
    fn deref(&self) -> &Self::Target {
        match self {
            ModeField::Region(field) => field,
            ModeField::Sliding(field) => &**field,
            ModeField::Intersection(field) => &**field,
            ModeField::Contact(field) => &**field,
            ModeField::Reduced(field) => &**field,
            ModeField::Rest(field) => field,
        }
    }
}

impl DerefMut for ModeField<'_> {
    #[inline]
    fn deref_mut(&mut self) -> &mut Self::Target {
        match self {
            ModeField::Region(field) => field,
            ModeField::Sliding(field) => &mut **field,
            ModeField::Intersection(field) => &mut **field,
            ModeField::Contact(field) => &mut **field,
            ModeField::Reduced(field) => &mut **field,
            ModeField::Rest(field) => field,
        }
    }
}

impl SmoothField for ModeField<'_> {
    fn eval(&mut self, t: f64, x: &mut [f64], dx: &mut [f64]) -> Result<(), FieldError> {
        (**self).eval(t, x, dx)
    }

    fn eval_unprojected(
        &mut self,
        t: f64,
        x: &mut [f64],
        dx: &mut [f64],
    ) -> Result<(), FieldError> {
        (**self).eval_unprojected(t, x, dx)
    }

    fn n_evaluations(&self) -> u64 {
        (**self).n_evaluations()
    }
}

/// Sliding of higher order: h = 0 and, where both fields cross the surface at the same rate, this rate = 0. It is sliding on the
/// rates in the reduced system ([`PiecewiseSystem::reduced`]). The multiplier is the equivalent control, which keeps the
/// highest of these derivatives at zero; its ends are the guards.
#[derive(Clone)]
pub(crate) struct ReducedField<'a> {
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
            projector: Projector::new(system.n_states(), system.n_surfaces())
                .measured_in(law.units.parts(system.n_states())),
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

    /// Moves `x` onto the surfaces and onto their rates.
    fn project(&mut self, t: f64, x: &mut [f64]) -> Result<(), FieldError> {
        let setting = self.setting.get();
        self.projector
            .project_onto_rates(self.system, &self.surfaces, t, x, setting)
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
