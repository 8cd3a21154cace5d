//! The motion in one mode: its field, its signs, and what is monitored.

use crate::error::FieldError;
use crate::event::{Deflation, EventFunction, Monitored};
use crate::field::{RegionField, SlidingField, SmoothField};
use crate::mode::{Mode, Signs};
use crate::system::PiecewiseSystem;

/// The smooth field of a mode.
pub(super) enum ModeField<'a> {
    Region(RegionField<'a>),
    Sliding(Box<SlidingField<'a>>),
}

impl<'a> ModeField<'a> {
    fn new(system: &'a dyn PiecewiseSystem, sliding: Option<usize>, signs: &[f64]) -> Self {
        match sliding {
            None => ModeField::Region(RegionField::new(system, signs)),
            Some(j) => ModeField::Sliding(Box::new(SlidingField::new(system, j, signs))),
        }
    }

    /// Becomes the field of another mode of its kind; `false` if it is of another kind.
    fn restart(&mut self, sliding: Option<usize>, signs: &[f64]) -> bool {
        match (self, sliding) {
            (ModeField::Region(field), None) => field.restart(signs),
            (ModeField::Sliding(field), Some(j)) => field.restart(j, signs),
            _ => return false,
        }
        true
    }
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
    pub signs: Signs,
    /// Surfaces whose sign matters in this mode.
    pub active: Vec<bool>,
    pub field: ModeField<'a>,
    /// Fields of other kinds that earlier motions had, kept for their buffers.
    idle: Vec<ModeField<'a>>,
    pub monitored: Vec<Monitored>,
}

impl<'a> Motion<'a> {
    /// The motion in `mode` from `t_start`.
    pub fn new(system: &'a dyn PiecewiseSystem, t_start: f64, mode: Mode) -> Self {
        let signs = mode.signs();
        let mut motion = Motion {
            t_start,
            active: vec![false; signs.len()],
            field: ModeField::new(system, mode.sliding(), &signs),
            idle: Vec::new(),
            monitored: Vec::new(),
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
        deflations: &[(EventFunction, Deflation)],
    ) {
        let (signs, sliding) = (mode.signs(), mode.sliding());
        if !self.field.restart(sliding, &signs) {
            let known = self
                .idle
                .iter_mut()
                .position(|f| f.restart(sliding, &signs));
            let field = match known {
                Some(index) => self.idle.swap_remove(index),
                None => ModeField::new(system, sliding, &signs),
            };
            self.idle.push(std::mem::replace(&mut self.field, field));
        }
        (self.mode, self.t_start, self.signs) = (mode, t_start, signs);
        self.find_monitored(system, deflations);
    }

    fn find_monitored(
        &mut self,
        system: &dyn PiecewiseSystem,
        deflations: &[(EventFunction, Deflation)],
    ) {
        let (signs, sliding) = (&self.signs, self.mode.sliding());
        system.active(signs, sliding, &mut self.active);
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
        self.monitored.clear();
        let surfaces = (0..signs.len()).filter(|&j| self.active[j] && Some(j) != sliding);
        self.monitored.extend(
            surfaces.map(|j| monitor(EventFunction::Surface(j), signs[j], system.is_affine(j))),
        );
        if sliding.is_some() {
            let exits = [EventFunction::ExitMinus, EventFunction::ExitPlus];
            self.monitored
                .extend(exits.map(|exit| monitor(exit, 1.0, false)));
        }
        self.note_departure();
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
