//! The field of a region.

use smallvec::SmallVec;

use super::{Motion, SmoothField};
use crate::error::FieldError;
use crate::mode::Signs;
use crate::system::PiecewiseSystem;
use crate::tolerances::{EPS, OFFSET_ROUNDING, SIDE_OFFSET, SIDE_REACH, STEPS_INSIDE};

/// The smooth field of one region: f(t, x, s) with fixed signs.
pub struct RegionField<'a> {
    system: &'a dyn PiecewiseSystem,
    signs: Signs,
    n_evaluations: u64,
    departing: bool,
}

impl<'a> RegionField<'a> {
    /// The field of the region with these signs.
    pub fn new(system: &'a dyn PiecewiseSystem, signs: &[f64]) -> Self {
        RegionField {
            system,
            signs: Signs::from_slice(signs),
            n_evaluations: 0,
            departing: false,
        }
    }

    /// Starts anew in another region.
    pub fn restart(&mut self, signs: &[f64]) {
        self.signs.copy_from_slice(signs);
        self.n_evaluations = 0;
        self.departing = false;
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
            let inside = move_inside(self.system, t, x, &self.signs, offset, f64::INFINITY)?;
            self.system.field(t, &inside, &self.signs, dx)?;
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
        self.system.field(t, x, &self.signs, dx)?;
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

/// Moves a point that lies on surfaces up to rounding into the region of `signs`: off every surface
/// that is nearer than the distance `offset`, or up to `reach` on the wrong side.
///
/// # Errors
/// If a function of the user raises.
pub fn move_inside<S: PiecewiseSystem + ?Sized>(
    system: &S,
    t: f64,
    x: &[f64],
    signs: &[f64],
    offset: f64,
    reach: f64,
) -> Result<Vec<f64>, FieldError> {
    let mut moved = x.to_vec();
    let mut h = vec![0.0; system.n_surfaces()];
    let mut gradient = vec![0.0; x.len()];
    let mut is_moved: SmallVec<[bool; 8]> = SmallVec::from_elem(false, h.len());
    for _ in 0..STEPS_INSIDE {
        let mut is_there = true;
        system.surfaces(t, &moved, signs, &mut h)?;
        for (j, h) in h.iter().enumerate() {
            system.gradient(j, t, &moved, signs, &mut gradient)?;
            let norm2: f64 = gradient.iter().map(|g| g * g).sum();
            let wanted = offset * norm2.sqrt();
            let missing = wanted - signs[j] * h;
            // A curved surface makes the first step too long or too short; what is left is rounding.
            let is_off = if is_moved[j] {
                missing.abs() > OFFSET_ROUNDING * wanted
            } else {
                missing > 0.0 && h.abs() <= reach * norm2.sqrt()
            };
            if norm2 > 0.0 && is_off {
                let shift = signs[j] * missing / norm2;
                moved
                    .iter_mut()
                    .zip(&gradient)
                    .for_each(|(x, g)| *x += shift * g);
                is_moved[j] = true;
                is_there = false;
            }
        }
        if is_there {
            break;
        }
    }
    Ok(moved)
}

/// The offsets to try, from a few units of rounding of the state upwards.
pub fn side_offsets(x: &[f64]) -> impl Iterator<Item = f64> {
    let size = x.iter().fold(1.0_f64, |m, v| m.max(v.abs()));
    (0..6).map(move |k| SIDE_OFFSET * EPS * size * 16_f64.powi(k))
}

/// Evaluates the field of one side at a point that lies on a surface up to rounding.
///
/// If the field is not finite there (a power 3/2 of the distance, a black box that looks at the
/// sign of h itself), the point is moved into the region of `signs`, just far enough. Returns the
/// number of evaluations.
///
/// # Errors
/// If a function of the user raises.
pub fn eval_on_side<S: PiecewiseSystem + ?Sized>(
    system: &S,
    t: f64,
    x: &[f64],
    signs: &[f64],
    dx: &mut [f64],
) -> Result<u64, FieldError> {
    system.field(t, x, signs, dx)?;
    if dx.iter().all(|v| v.is_finite()) {
        return Ok(1);
    }
    Ok(1 + eval_off_surface(system, t, x, signs, dx)?)
}

/// As [`eval_on_side`], for a field known not to exist on its surface: moves the point first.
///
/// # Errors
/// If a function of the user raises.
pub fn eval_off_surface<S: PiecewiseSystem + ?Sized>(
    system: &S,
    t: f64,
    x: &[f64],
    signs: &[f64],
    dx: &mut [f64],
) -> Result<u64, FieldError> {
    let mut evaluations = 0;
    for offset in side_offsets(x) {
        let inside = move_inside(system, t, x, signs, offset, SIDE_REACH * offset)?;
        system.field(t, &inside, signs, dx)?;
        evaluations += 1;
        if dx.iter().all(|v| v.is_finite()) {
            break;
        }
    }
    Ok(evaluations)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use filippov_expr::{Backend, BinaryOp, Graph, Names};

    use super::RegionField;
    use crate::field::SmoothField;
    use crate::system::TracedSystem;

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
        let mut field = RegionField::new(&system, &[1.0]);
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
