//! The sliding field on one surface.

use smallvec::{smallvec, SmallVec};

use super::duties::Exits;
use super::guard::Guards;
use super::{Guard, Motion, Projector, SmoothField};
use crate::error::FieldError;
use crate::error_scale::Units;
use crate::motion::TwoFoldMotion;
use crate::system::{BothSides, OwnSetting, PiecewiseSystem, Setting};

/// The normal components on both sides of the surface slid on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalComponents {
    /// dh/dt along f-; positive: f- points to the surface.
    pub minus: f64,
    /// dh/dt along f+; negative: f+ points to the surface.
    pub plus: f64,
}

impl NormalComponents {
    /// The share of f+ in the sliding field, minus / (minus - plus). Where both components vanish
    /// every share is tangent, and the middle is taken.
    pub fn weight_plus(&self) -> f64 {
        if self.minus == 0.0 && self.plus == 0.0 {
            0.5
        } else {
            self.minus / (self.minus - self.plus)
        }
    }

    /// The multiplier lambda in [-1, 1]: +1 is the field of the side h > 0,
    /// lambda = (minus + plus) / (minus - plus).
    pub fn multiplier(&self) -> f64 {
        2.0 * self.weight_plus() - 1.0
    }
}

/// Filippov's field on one surface,
///
///   f_s = (a- f+ - a+ f-) / (a- - a+),   a± = d_t h + grad h . f±,
///
/// evaluated at the projection of the point onto the surface.
///
/// Reference: Filippov (1988); Guglielmi, Hairer (2022), section 4.1.
#[derive(Clone)]
pub struct SlidingField<'a> {
    system: &'a dyn PiecewiseSystem,
    surface: usize,
    setting: OwnSetting,
    sides: BothSides,
    projector: Projector,
    /// The factor of the term that draws the motion back, in place of the projection.
    restoring: Option<f64>,
    n_evaluations: u64,
    /// The guards at the last evaluation: a- and -a+.
    exits: [f64; 2],
    last_time: f64,
    two_fold: Option<Box<StartAtTwoFold>>,
}

/// Sliding starts at a two-fold: from its start until this time the multiplier is its power series, not the quotient of
/// two numbers that vanish.
#[derive(Clone)]
struct StartAtTwoFold {
    start: f64,
    until: f64,
    motion: TwoFoldMotion,
}

impl StartAtTwoFold {
    #[cold]
    fn given_at(&self, t: f64) -> Option<(f64, [f64; 2])> {
        let is_near = self.start <= t && t <= self.until;
        is_near.then(|| self.motion.after(t - self.start))
    }
}

impl<'a> SlidingField<'a> {
    /// Sliding on surface `j`, the other surfaces with the given signs, at these discrete states.
    pub fn new(system: &'a dyn PiecewiseSystem, j: usize, setting: Setting<'_>) -> Self {
        SlidingField {
            system,
            surface: j,
            setting: OwnSetting::new(setting),
            sides: BothSides::new(system.n_states(), system.n_surfaces()),
            projector: Projector::new(system.n_states(), system.n_surfaces()),
            restoring: None,
            n_evaluations: 0,
            exits: [f64::NAN; 2],
            last_time: f64::NAN,
            two_fold: None,
        }
    }

    /// The same for states of these sizes.
    #[must_use]
    pub(crate) fn with_units(mut self, units: Units<'_>) -> Self {
        let parts = units.parts(self.system.n_states());
        self.projector = self.projector.measured_in(parts);
        self
    }

    /// The same drawn back to the surface by a term with this factor, if there is one, and not projected.
    #[must_use]
    pub fn with_restoring(mut self, restoring: Option<f64>) -> Self {
        self.restoring = restoring;
        self
    }

    /// Starts anew on another surface.
    pub fn restart(&mut self, j: usize, setting: Setting<'_>) {
        self.surface = j;
        self.setting.set(setting);
        self.sides.restart();
        self.n_evaluations = 0;
        self.two_fold = None;
    }

    /// Takes over the discrete states that an action left.
    pub(super) fn set_discrete(&mut self, q: &[f64]) {
        self.setting.set_discrete(q);
    }

    /// Sliding starts at a two-fold, where the share of f+ is a quotient of two zeros, with the series of this motion.
    pub fn begin_at_two_fold(&mut self, start: f64, until: f64, motion: TwoFoldMotion) {
        self.two_fold = Some(Box::new(StartAtTwoFold {
            start,
            until,
            motion,
        }));
    }

    /// Does sliding start at a two-fold, and is this time so near that its multiplier is given?
    pub fn is_at_two_fold(&self, t: f64) -> bool {
        self.given_at(t).is_some()
    }

    /// The share of f+ and the normal components, if they are given.
    #[inline(always)]
    fn given_at(&self, t: f64) -> Option<(f64, [f64; 2])> {
        self.two_fold.as_ref()?.given_at(t)
    }

    /// The share of f+ at time t, with these normal components.
    fn weight_plus(&self, t: f64, components: NormalComponents) -> f64 {
        self.given_at(t)
            .map_or_else(|| components.weight_plus(), |given| given.0)
    }

    /// The multiplier of the last evaluation.
    pub fn multiplier(&self) -> f64 {
        2.0 * self.weight_plus(self.last_time, self.last()) - 1.0
    }

    /// Takes over the guards at time t, where something else has evaluated them.
    pub fn set_exits(&mut self, t: f64, exits: [f64; 2]) {
        (self.exits, self.last_time) = (exits, t);
    }

    /// The surface slid on.
    pub fn surface(&self) -> usize {
        self.surface
    }

    /// Normal components of the last evaluation.
    pub fn last(&self) -> NormalComponents {
        NormalComponents {
            minus: self.exits[0],
            plus: -self.exits[1],
        }
    }

    /// The normal components at (t, x), after projection.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn normal_components(
        &mut self,
        t: f64,
        x: &mut [f64],
    ) -> Result<NormalComponents, FieldError> {
        self.project(t, x)?;
        self.normal_components_at(t, x)
    }

    /// The normal components at a point (t, x) of the surface.
    ///
    /// # Errors
    /// If a function of the user raises.
    #[inline(always)]
    pub fn normal_components_at(
        &mut self,
        t: f64,
        x: &[f64],
    ) -> Result<NormalComponents, FieldError> {
        let sides = &mut self.sides;
        let place = self.setting.at(t, x);
        self.n_evaluations += self.system.both_sides(self.surface, &place, sides)?;
        self.exits = [sides.normal_minus, -sides.normal_plus];
        if let Some((_, [minus, plus])) = self.given_at(t) {
            self.exits = [minus, -plus];
        }
        self.last_time = t;
        Ok(self.last())
    }
}

impl Motion for SlidingField<'_> {
    fn guards(&self) -> Guards {
        Guards::from_slice(&Guard::ends(self.surface))
    }

    #[inline]
    fn last_exits(&self) -> &[f64] {
        &self.exits
    }

    fn exits(&mut self, t: f64, x: &mut [f64]) -> Result<Exits, FieldError> {
        self.normal_components(t, x)?;
        Ok(self.exits.as_slice().into())
    }

    fn exits_at(&mut self, t: f64, x: &mut [f64]) -> Result<Exits, FieldError> {
        self.normal_components_at(t, x)?;
        Ok(self.exits.as_slice().into())
    }

    fn multipliers(&self) -> SmallVec<[f64; 2]> {
        smallvec![self.multiplier()]
    }

    fn project(&mut self, t: f64, x: &mut [f64]) -> Result<(), FieldError> {
        if self.restoring.is_some() {
            return Ok(());
        }
        self.projector
            .project(self.system, self.surface, t, x, self.setting.get())
    }
}

impl SmoothField for SlidingField<'_> {
    fn eval(&mut self, t: f64, x: &mut [f64], dx: &mut [f64]) -> Result<(), FieldError> {
        self.project(t, x)?;
        self.eval_unprojected(t, x, dx)?;
        if let Some(factor) = self.restoring {
            let term = (&[self.surface][..], factor);
            self.projector
                .pull_back(self.system, term, &self.setting.at(t, x), dx)?;
        }
        Ok(())
    }

    /// Beside the surface h = 0 it is the field on h = constant.
    #[inline(always)]
    fn eval_unprojected(
        &mut self,
        t: f64,
        x: &mut [f64],
        dx: &mut [f64],
    ) -> Result<(), FieldError> {
        let a = self.normal_components_at(t, x)?;
        let weight_plus = self.weight_plus(t, a);
        let sides = self.sides.f_minus.iter().zip(&self.sides.f_plus);
        for (dx, (minus, plus)) in dx.iter_mut().zip(sides) {
            *dx = minus + weight_plus * (plus - minus);
        }
        Ok(())
    }

    fn n_evaluations(&self) -> u64 {
        self.n_evaluations
    }
}
