//! The motion in one mode: its field, its signs, and what is monitored.

use crate::error::FieldError;
use crate::event::{Deflation, EventFunction, Monitored};
use crate::field::{RegionField, SlidingField, SmoothField};
use crate::mode::Mode;
use crate::system::PiecewiseSystem;

/// The smooth field of a mode.
pub(super) enum ModeField<'a> {
    Region(RegionField<'a>),
    Sliding(Box<SlidingField<'a>>),
}

impl SmoothField for ModeField<'_> {
    fn eval(&mut self, t: f64, x: &mut [f64], dx: &mut [f64]) -> Result<(), FieldError> {
        match self {
            ModeField::Region(field) => field.eval(t, x, dx),
            ModeField::Sliding(field) => field.eval(t, x, dx),
        }
    }

    fn n_evaluations(&self) -> u64 {
        match self {
            ModeField::Region(field) => field.n_evaluations(),
            ModeField::Sliding(field) => field.n_evaluations(),
        }
    }
}

/// One piece of constant mode.
pub(super) struct Motion<'a> {
    pub mode: Mode,
    pub t_start: f64,
    /// Signs handed to the field; the surface slid on counts as +1.
    pub signs: Vec<f64>,
    /// Surfaces whose sign matters in this mode.
    pub active: Vec<bool>,
    pub field: ModeField<'a>,
    pub monitored: Vec<Monitored>,
}

impl<'a> Motion<'a> {
    /// The motion in `mode` from `t_start`; zeros to divide out are given per function.
    pub fn new(
        system: &'a dyn PiecewiseSystem,
        t_start: f64,
        mode: Mode,
        deflations: &[(EventFunction, Deflation)],
    ) -> Self {
        let signs = mode.signs();
        let sliding = mode.sliding();
        let mut active = vec![false; signs.len()];
        system.active(&signs, sliding, &mut active);
        let field = match sliding {
            None => ModeField::Region(RegionField::new(system, signs.clone())),
            Some(j) => ModeField::Sliding(Box::new(SlidingField::new(system, j, &signs))),
        };
        let monitor = |function, orientation, affine| Monitored {
            function,
            orientation,
            value: f64::NAN,
            rate: f64::NAN,
            curvature: 0.0,
            affine,
            deflation: deflations
                .iter()
                .find(|(f, _)| *f == function)
                .map(|(_, d)| *d),
            noise: 0.0,
        };
        let mut monitored: Vec<Monitored> = (0..signs.len())
            .filter(|&j| active[j] && Some(j) != sliding)
            .map(|j| monitor(EventFunction::Surface(j), signs[j], system.is_affine(j)))
            .collect();
        if sliding.is_some() {
            monitored.push(monitor(EventFunction::ExitMinus, 1.0, false));
            monitored.push(monitor(EventFunction::ExitPlus, 1.0, false));
        }
        let mut motion = Motion {
            mode,
            t_start,
            signs,
            active,
            field,
            monitored,
        };
        motion.note_departure();
        motion
    }

    /// Tells the field of a region whether the motion still departs from a surface.
    pub fn note_departure(&mut self) {
        let departing = self
            .monitored
            .iter()
            .any(|m| m.deflation.is_some_and(|d| d.order > 1));
        if let ModeField::Region(field) = &mut self.field {
            field.set_departing(departing);
        }
    }

    /// The surface slid on.
    pub fn sliding(&self) -> Option<usize> {
        match &self.field {
            ModeField::Region(_) => None,
            ModeField::Sliding(field) => Some(field.surface()),
        }
    }

    /// Moves `x` onto the surface slid on.
    pub fn project(&mut self, t: f64, x: &mut [f64]) -> Result<(), FieldError> {
        if let ModeField::Sliding(field) = &mut self.field {
            field.project(t, x)?;
        }
        Ok(())
    }
}
