//! A system given by Rust closures.

use super::{
    dot, dot_magnitude, AffineSigns, LieValue, PiecewiseSystem, Place, RatePartials, SignStructure,
    Word,
};
use crate::error::FieldError;
use crate::tolerances::EPS;

/// A system x' = f(t, x, s) given by closures; gradients and Lie derivatives by differences.
///
/// # Example
///
/// ```
/// use filippov::{ClosureSystem, Problem};
/// // x' = 0.3 - sign(x): reaches x = 0 at t = 1/0.7 and stays there with lambda = 0.3.
/// let system = ClosureSystem::new(
///     1,
///     1,
///     |_t, _x, s, dx| dx[0] = 0.3 - s[0],
///     |_t, x, h| h[0] = x[0],
/// );
/// let solution = Problem::new(&system, (0.0, 10.0), &[1.0]).solve()?;
/// assert_eq!(solution.switches.len(), 1);
/// assert!((solution.switches.at(0).t - 1.0 / 0.7).abs() < 1e-12);
/// # Ok::<(), filippov::Error>(())
/// ```
pub struct ClosureSystem<F, H> {
    n_states: usize,
    n_surfaces: usize,
    field: F,
    surfaces: H,
    is_affine_in_signs: bool,
    /// Surfaces that trigger actions and switch nothing.
    smooth: Vec<usize>,
}

impl<F, H> ClosureSystem<F, H>
where
    F: Fn(f64, &[f64], &[f64], &mut [f64]) + Sync,
    H: Fn(f64, &[f64], &mut [f64]) + Sync,
{
    /// A system with `n_states` states and `n_surfaces` switching functions; `field(t, x, s, dx)`
    /// writes the field for the signs `s`, `surfaces(t, x, h)` the switching functions.
    pub fn new(n_states: usize, n_surfaces: usize, field: F, surfaces: H) -> Self {
        ClosureSystem {
            n_states,
            n_surfaces,
            field,
            surfaces,
            is_affine_in_signs: false,
            smooth: Vec::new(),
        }
    }

    /// Declares that the field does not depend on the signs of these surfaces: they trigger actions.
    #[must_use]
    pub fn with_smooth_surfaces(mut self, surfaces: &[usize]) -> Self {
        self.smooth = surfaces.to_vec();
        self
    }

    /// Declares that the field is affine in the signs, f = a(t, x) + B(t, x) s, and that the gradients of the
    /// switching functions do not depend on them: sliding on m surfaces then takes m + 1 evaluations.
    #[must_use]
    pub fn with_affine_signs(mut self) -> Self {
        self.is_affine_in_signs = true;
        self
    }
}

impl<F, H> PiecewiseSystem for ClosureSystem<F, H>
where
    F: Fn(f64, &[f64], &[f64], &mut [f64]) + Sync,
    H: Fn(f64, &[f64], &mut [f64]) + Sync,
{
    fn n_states(&self) -> usize {
        self.n_states
    }

    fn n_surfaces(&self) -> usize {
        self.n_surfaces
    }

    fn field(&self, place: &Place<'_>, dx: &mut [f64]) -> Result<(), FieldError> {
        (self.field)(place.t, place.x, place.signs, dx);
        Ok(())
    }

    fn surfaces(&self, place: &Place<'_>, h: &mut [f64]) -> Result<(), FieldError> {
        (self.surfaces)(place.t, place.x, h);
        Ok(())
    }

    fn affine_signs(&self) -> Option<&dyn AffineSigns> {
        if self.is_affine_in_signs {
            Some(self)
        } else {
            None
        }
    }
}

impl<F, H> SignStructure for ClosureSystem<F, H> {
    fn switches_at(&self, j: usize) -> bool {
        !self.smooth.contains(&j)
    }
}

impl<F, H> AffineSigns for ClosureSystem<F, H>
where
    F: Fn(f64, &[f64], &[f64], &mut [f64]) + Sync,
    H: Fn(f64, &[f64], &mut [f64]) + Sync,
{
}

/// The gradient of L_f h_j by central differences.
pub(super) fn rate_gradient_by_differences<S: PiecewiseSystem + ?Sized>(
    system: &S,
    j: usize,
    place: &Place<'_>,
    gradient: &mut [f64],
) -> Result<RatePartials, FieldError> {
    let &Place { t, x, signs, .. } = place;
    let side = if signs[j] < 0.0 { -1 } else { 1 };
    let at = |t: f64, x: &[f64]| lie_by_differences(system, j, j, &[side], &place.moved(t, x));
    let LieValue {
        value: rate,
        magnitude,
    } = at(t, x)?;
    let mut moved = x.to_vec();
    for (i, out) in gradient.iter_mut().enumerate() {
        let d = EPS.cbrt() * (1.0 + x[i].abs());
        let (up, down) = (x[i] + d, x[i] - d);
        moved[i] = up;
        let above = at(t, &moved)?.value;
        moved[i] = down;
        let below = at(t, &moved)?.value;
        moved[i] = x[i];
        *out = (above - below) / (up - down);
    }
    let d = EPS.cbrt() * (1.0 + t.abs());
    let time = (at(t + d, x)?.value - at(t - d, x)?.value) / (2.0 * d);
    Ok(RatePartials {
        rate,
        magnitude,
        time,
    })
}

/// Lie derivatives by differences: order one from the gradient, each further order by a difference
/// of the previous one along the field, central where both sides are finite, else one-sided.
pub(super) fn lie_by_differences<S: PiecewiseSystem + ?Sized>(
    system: &S,
    i: usize,
    j: usize,
    word: Word,
    place: &Place<'_>,
) -> Result<LieValue, FieldError> {
    let &Place { t, x, signs, .. } = place;
    let Some((&last, rest)) = word.split_last() else {
        let mut h = vec![0.0; system.n_surfaces()];
        system.surfaces(place, &mut h)?;
        return Ok(LieValue {
            value: h[i],
            magnitude: h[i].abs(),
        });
    };
    let n = system.n_states();
    let mut f = vec![0.0; n];
    let mut signs_here = signs.to_vec();
    signs_here[j] = f64::from(last);
    crate::system::eval_on_side(system, &place.with_signs(&signs_here), &mut f)?;
    if rest.is_empty() {
        let mut gradient = vec![0.0; n];
        let ht = system.gradient(i, place, &mut gradient)?;
        return Ok(LieValue {
            value: ht + dot(&gradient, &f),
            magnitude: ht.abs() + dot_magnitude(&gradient, &f),
        });
    }
    let size = x.iter().fold(1.0_f64, |m, v| m.max(v.abs()));
    let speed = f.iter().fold(1.0_f64, |m, v| m.max(v.abs()));
    let d = EPS.powf(1.0 / (word.len() as f64 + 2.0)) * size / speed;
    let at = |shift: f64| {
        let moved: Vec<f64> = x.iter().zip(&f).map(|(x, f)| x + shift * f).collect();
        lie_by_differences(system, i, j, rest, &place.moved(t + shift, &moved))
    };
    let (above, below, here) = (at(d)?, at(-d)?, at(0.0)?);
    let value = match (above.value.is_finite(), below.value.is_finite()) {
        (true, true) => (above.value - below.value) / (2.0 * d),
        (true, false) => (above.value - here.value) / d,
        _ => (here.value - below.value) / d,
    };
    let magnitude = value.abs().max(here.magnitude * speed / size);
    Ok(LieValue { value, magnitude })
}
