//! The field of a mode, whatever its kind.

use smallvec::{smallvec, SmallVec};

use super::{
    ContactField, Guard, Guards, IntersectionField, RegionField, SlidingField, SmoothField,
};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::options::{Options, SlidingRule};
use crate::system::PiecewiseSystem;

/// The smooth field of a mode.
pub(crate) enum ModeField<'a> {
    Region(RegionField<'a>),
    Sliding(Box<SlidingField<'a>>),
    Intersection(Box<IntersectionField<'a>>),
    Contact(Box<ContactField<'a>>),
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
}

impl<'a> From<&'a Options> for Law<'a> {
    fn from(options: &'a Options) -> Self {
        Law {
            rule: options.sliding,
            kappa: &options.kappa,
            restoring: options.stabilization.restoring(),
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

/// Values of the exit functions of a motion: positive inside.
pub(crate) type Exits = SmallVec<[f64; 6]>;

impl<'a> ModeField<'a> {
    /// The field of a mode without contact.
    pub fn of(system: &'a dyn PiecewiseSystem, law: Law<'a>, mode: &Mode) -> Self {
        let sliding: SlidingSet = mode.sliding_set().collect();
        ModeField::new(system, law, &sliding, &mode.signs())
    }

    pub(crate) fn new(
        system: &'a dyn PiecewiseSystem,
        law: Law<'a>,
        sliding: &[usize],
        signs: &[f64],
    ) -> Self {
        match *sliding {
            [] => ModeField::Region(RegionField::new(system, signs)),
            [j] => {
                let field = SlidingField::new(system, j, signs);
                ModeField::Sliding(Box::new(field.with_restoring(law.restoring)))
            }
            _ => {
                let field = IntersectionField::new(system, sliding, signs, &[]);
                let field = field.with_rule(law.rule).with_restoring(law.restoring);
                ModeField::Intersection(Box::new(field.with_scaling(&law.scaling(sliding))))
            }
        }
    }

    /// What ends sliding, in the order of the exit functions.
    pub fn guards(&self) -> Guards {
        match self {
            ModeField::Region(_) => Guards::new(),
            ModeField::Sliding(field) => Guards::from_slice(&Guard::ends(field.surface())),
            ModeField::Intersection(field) => field.guards().collect(),
            ModeField::Contact(field) => field.guards().collect(),
        }
    }

    /// The exit functions at the last evaluation.
    pub fn last_exits(&self) -> Exits {
        match self {
            ModeField::Region(_) => Exits::new(),
            ModeField::Sliding(field) => field.last().exits(),
            ModeField::Intersection(field) => Exits::from_slice(field.exits()),
            ModeField::Contact(field) => field.exits().collect(),
        }
    }

    /// The exit functions at (t, x), after projection.
    pub fn exits(&mut self, t: f64, x: &mut [f64]) -> Result<Exits, FieldError> {
        match self {
            ModeField::Region(_) => {}
            ModeField::Sliding(field) => {
                field.normal_components(t, x)?;
            }
            ModeField::Intersection(_) | ModeField::Contact(_) => {
                self.eval(t, x, &mut vec![0.0; x.len()])?;
            }
        }
        Ok(self.last_exits())
    }

    /// The exit functions at a point (t, x) of the surfaces slid on.
    pub fn exits_at(&mut self, t: f64, x: &mut [f64]) -> Result<Exits, FieldError> {
        match self {
            ModeField::Region(_) => {}
            ModeField::Sliding(field) => {
                field.normal_components_at(t, x)?;
            }
            ModeField::Intersection(_) | ModeField::Contact(_) => {
                self.eval_unprojected(t, x, &mut vec![0.0; x.len()])?;
            }
        }
        Ok(self.last_exits())
    }

    /// The multipliers at the last evaluation, in the order of the surfaces slid on.
    #[inline]
    pub fn multipliers(&self) -> SmallVec<[f64; 2]> {
        match self {
            ModeField::Region(_) => SmallVec::new(),
            ModeField::Sliding(field) => smallvec![field.multiplier()],
            ModeField::Intersection(field) => SmallVec::from_slice(field.multipliers()),
            ModeField::Contact(field) => field.lambdas().into(),
        }
    }

    /// Moves `x` onto the surfaces slid on.
    pub fn project(&mut self, t: f64, x: &mut [f64]) -> Result<(), FieldError> {
        match self {
            ModeField::Region(_) => Ok(()),
            ModeField::Sliding(field) => field.project(t, x),
            ModeField::Intersection(field) => field.project(t, x),
            ModeField::Contact(field) => field.project(t, x),
        }
    }

    /// Becomes the field of another mode of its kind; `false` if it is of another kind.
    pub(crate) fn restart(&mut self, sliding: &[usize], signs: &[f64]) -> bool {
        match (self, sliding) {
            (ModeField::Region(field), []) => field.restart(signs),
            (ModeField::Sliding(field), &[j]) => field.restart(j, signs),
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
            ModeField::Intersection(field) => field.eval(t, x, dx),
            ModeField::Contact(field) => field.eval(t, x, dx),
        }
    }

    fn eval_unprojected(
        &mut self,
        t: f64,
        x: &mut [f64],
        dx: &mut [f64],
    ) -> Result<(), FieldError> {
        match self {
            ModeField::Region(field) => field.eval(t, x, dx),
            ModeField::Sliding(field) => field.eval_unprojected(t, x, dx),
            ModeField::Intersection(field) => field.eval_unprojected(t, x, dx),
            ModeField::Contact(field) => field.eval(t, x, dx),
        }
    }

    fn n_evaluations(&self) -> u64 {
        match self {
            ModeField::Region(field) => field.n_evaluations(),
            ModeField::Sliding(field) => field.n_evaluations(),
            ModeField::Intersection(field) => field.n_evaluations(),
            ModeField::Contact(field) => field.n_evaluations(),
        }
    }
}
