//! The field of a region.

use super::{Motion, SmoothField};
use crate::error::FieldError;
use crate::page::IS_PAGE;
use crate::system::{
    move_inside, side_offsets, OwnSetting, PiecewiseSystem, RegionFields, Setting,
};

/// The smooth field of one region: f(t, x, s) with fixed signs.
#[derive(Clone)]
pub struct RegionField<'a> {
    system: &'a dyn PiecewiseSystem,
    setting: OwnSetting,
    /// The system as one of whose field the signs alone make much, and what they make of it.
    settled: Option<(&'a dyn RegionFields, Vec<f64>)>,
    n_evaluations: u64,
    departing: bool,
}

impl<'a> RegionField<'a> {
    /// The field of the region with these signs, at these discrete states.
    pub fn new(system: &'a dyn PiecewiseSystem, setting: Setting<'_>) -> Self {
        let mut field = RegionField {
            system,
            setting: OwnSetting::new(setting),
            settled: system.region_fields().map(|fields| (fields, Vec::new())),
            n_evaluations: 0,
            departing: false,
        };
        field.settle();
        field
    }

    fn settle(&mut self) {
        if let Some((fields, values)) = self.settled.as_mut().filter(|_| !IS_PAGE) {
            fields.settle(self.setting.get(), values);
        }
    }

    /// Starts anew in another region.
    pub fn restart(&mut self, setting: Setting<'_>) {
        self.setting.set(setting);
        self.settle();
        self.n_evaluations = 0;
        self.departing = false;
    }

    /// Takes over the discrete states that an action left.
    pub(super) fn set_discrete(&mut self, q: &[f64]) {
        self.setting.set_discrete(q);
        self.settle();
    }

    /// While the motion departs tangentially from a surface, stages may lie beyond it however short
    /// the step: a field that is not finite there is continued by its value on the surface.
    pub fn set_departing(&mut self, departing: bool) {
        self.departing = departing;
    }

    /// The field just inside of the region, as near as it is finite.
    #[cold]
    fn eval_inside(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<(), FieldError> {
        for offset in side_offsets(x) {
            let place = self.setting.at(t, x);
            let (t, inside) = move_inside(self.system, &place, offset, f64::INFINITY)?;
            self.system.field(&place.moved(t, &inside), dx)?;
            self.n_evaluations += 1;
            if dx.iter().all(|v| v.is_finite()) {
                break;
            }
        }
        Ok(())
    }
}

impl SmoothField for RegionField<'_> {
    #[inline(always)]
    fn eval(&mut self, t: f64, x: &mut [f64], dx: &mut [f64]) -> Result<(), FieldError> {
        self.n_evaluations += 1;
        let place = self.setting.at(t, x);
        match &self.settled {
            Some((fields, values)) if !IS_PAGE => fields.eval(&place, values, dx),
            _ => self.system.field(&place, dx)?,
        }
        if self.departing && dx.iter().any(|v| !v.is_finite()) {
            self.eval_inside(t, x, dx)?;
        }
        Ok(())
    }

    fn n_evaluations(&self) -> u64 {
        self.n_evaluations
    }
}

impl Motion for RegionField<'_> {}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use filippov_expr::{Backend, BinaryOp, Graph, Names};

    use super::RegionField;
    use crate::motion::SmoothField;
    use crate::system::{Setting, TracedSystem};

    /// x' = 1 + (|x|^2 - 1)^(3/2): it exists only outside of the unit circle.
    fn outside_of_the_circle() -> TracedSystem {
        let mut g = Graph::new();
        let (x, y, one) = (g.state(0), g.state(1), g.constant(1.0));
        let (x2, y2, exponent) = (g.mul(x, x), g.mul(y, y), g.constant(1.5));
        let radius = g.add(x2, y2);
        let h = g.sub(radius, one);
        g.declare_surface(h);
        let power = g.binary(BinaryOp::Pow, h, exponent);
        let fast = g.add(one, power);
        TracedSystem::new(g, vec![fast, one], vec![], Names::default(), Backend::Auto).unwrap()
    }

    #[test]
    fn a_stage_far_behind_a_curved_surface_is_continued_from_the_surface_at_once() {
        let system = outside_of_the_circle();
        let mut field = RegionField::new(&system, Setting::of_signs(&[1.0]));
        let (mut x, mut dx) = ([0.7, 0.5], [0.0; 2]);
        field.eval(0.0, &mut x, &mut dx).unwrap();
        assert!(dx[0].is_nan());
        field.set_departing(true);
        field.eval(0.0, &mut x, &mut dx).unwrap();
        assert!((dx[0] - 1.0).abs() < 1e-12);
        // The two that do not exist, and one inside of the region.
        assert_eq!(field.n_evaluations(), 3);
    }
}
