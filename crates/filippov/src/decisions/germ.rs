//! Germs: how the guards of a mode begin along its motion.

use std::sync::Arc;

use smallvec::smallvec;

use super::point::{Left, Lefts, Notes, Point, Values};
use crate::error::FieldError;
use crate::mode::{Mode, Signs};
use crate::motion::{first_nonzero, Leading};
use crate::powers::power;
use crate::system::{dot, AffineParts, MotionJets};
use crate::tolerances::{AT_SIDE, EPS, MAX_LIE_ORDER, MOST_MEETING, VANISHING_GERM};

/// How a guard begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Germ {
    /// With this derivative, the first that does not vanish; order 0 is the value.
    Begins(Leading),
    /// All derivatives up to the highest order vanish.
    Zero,
    /// A derivative does not exist at the point.
    Unknown,
}

impl Germ {
    /// That of a first derivative; `otherwise` if none was found.
    pub fn of(leading: Leading, otherwise: Germ) -> Self {
        match leading.order {
            0 => otherwise,
            _ => Germ::Begins(leading),
        }
    }
}

/// The Taylor coefficients of the motion in a mode.
pub(super) struct MotionSeries {
    jets: Arc<MotionJets>,
    signs: Signs,
    rows: Vec<f64>,
    n: usize,
    /// The rate at which the motion changes, per component of the state: coefficient k is at most about `size * rate^k`.
    rates: Vec<f64>,
    sizes: Vec<f64>,
    pace: f64,
}

impl MotionSeries {
    /// The series from the point, with these multipliers of the surfaces slid on; `None` if the system has none. `pace` is
    /// the rate at which the fields around the point change the state.
    pub fn of(at: &Point, mode: &Mode, multipliers: &[f64], pace: f64) -> Option<Self> {
        let sliding: Vec<usize> = mode.sliding_set().collect();
        let jets = at.system.motion_jets(&sliding, MAX_LIE_ORDER)?;
        let mut signs = mode.signs();
        for (&j, &multiplier) in sliding.iter().zip(multipliers) {
            signs[j] = multiplier;
        }
        let (n, width) = (at.x.len(), jets.width());
        let mut rows = vec![0.0; (jets.order() + 1) * width];
        at.system.eval_jets(&jets, &at.place(&signs), &mut rows);
        let sizes: Vec<f64> = (0..n).map(|i| at.size(i)).collect();
        let of = |i: usize, k: usize| (rows[k * width + i] / sizes[i]).abs();
        let speed = (0..n).map(|i| of(i, 1)).fold(0.0, f64::max);
        let rate = |i: usize| {
            let orders = 1..=jets.order();
            let rates = orders.map(|k| power(of(i, k), 1.0 / k as f64));
            rates.filter(|rate| rate.is_finite()).fold(speed, f64::max)
        };
        let rates = (0..n).map(rate).collect();
        Some(MotionSeries {
            pace,
            jets,
            signs,
            rows,
            n,
            rates,
            sizes,
        })
    }

    /// How h_j begins.
    pub fn of_surface(&self, at: &Point, j: usize) -> Result<Germ, FieldError> {
        let mut gradient = vec![0.0; self.n];
        let rate = at
            .system
            .gradient(j, &at.place(&self.signs), &mut gradient)?;
        let width = self.jets.width();
        // A state at rest is known to rounding only, which moves at the pace of the fields around it.
        let size = |k: usize| {
            let parts = gradient.iter().zip(self.sizes.iter().zip(&self.rates));
            let own = if k == 1 { rate.abs() } else { 0.0 };
            own + parts
                .map(|(g, (size, rate))| {
                    let of_rounding = EPS / VANISHING_GERM * self.pace.powi(k as i32);
                    g.abs() * size * rate.powi(k as i32).max(of_rounding)
                })
                .sum::<f64>()
        };
        let coefficient = |k: usize| {
            let row = &self.rows[k * width..(k + 1) * width];
            match self.jets.surface(j) {
                Some(place) => row[place],
                None => dot(&gradient, &row[..self.n]) + if k == 1 { rate } else { 0.0 },
            }
        };
        // The point is on the surface.
        Ok(self.first(1, coefficient, size))
    }

    /// How the exit function with this index begins, where multipliers that differ by `blur` are one.
    pub fn of_exit(&self, index: usize, blur: f64) -> Germ {
        let Some(place) = self.jets.exit(index) else {
            return Germ::Unknown;
        };
        let width = self.jets.width();
        let coefficient = |k: usize| self.rows[k * width + place];
        let fastest = self.rates.iter().copied().fold(0.0, f64::max);
        let orders = 0..=self.jets.order();
        let largest = orders.map(|k| coefficient(k).abs() / fastest.powi(k as i32));
        let largest = largest.filter(|v| v.is_finite()).fold(0.0, f64::max);
        // The value itself is a difference of numbers of size 1.
        let of_value = (blur / VANISHING_GERM).max(1.0);
        let least = |k: usize| if k == 0 { of_value } else { 0.0 };
        self.first(0, coefficient, |k| {
            least(k).max(largest * fastest.powi(k as i32))
        })
    }

    fn first(
        &self,
        from: usize,
        coefficient: impl Fn(usize) -> f64,
        size: impl Fn(usize) -> f64,
    ) -> Germ {
        let mut factorial = 1.0;
        for k in 0..=self.jets.order() {
            factorial *= k.max(1) as f64;
            let c = coefficient(k);
            if !c.is_finite() {
                return Germ::Unknown;
            }
            if k >= from && c.abs() > VANISHING_GERM * size(k) {
                return Germ::Begins(Leading {
                    order: k,
                    value: c * factorial,
                });
            }
        }
        Germ::Zero
    }
}

/// What a rule knows of the motion that follows.
#[derive(Default)]
pub(crate) struct Found<'f> {
    /// Its multipliers; none if they are not known.
    pub multipliers: &'f [f64],
    /// The fields around the point, evaluated there with its signs on all surfaces that are not among theirs.
    pub parts: Option<&'f mut AffineParts>,
}

/// The surfaces of `meeting` that the motion in `after` leaves, with the leading derivatives of h.
pub(crate) fn surfaces_left(
    at: &Point,
    notes: &mut Notes,
    after: &Mode,
    meeting: &[usize],
    found: Found<'_>,
) -> Result<Lefts, FieldError> {
    let mut left: Lefts = smallvec![];
    let leaving: Vec<usize> = meeting
        .iter()
        .copied()
        .filter(|&j| after.entries()[j] != 0)
        .collect();
    if leaving.is_empty() {
        return Ok(left);
    }
    let (signs, multipliers) = (after.signs(), found.multipliers);
    // At the exit of a multiplier all forces may balance, and nothing of the motion itself tells how large they are.
    let mut around: Vec<usize> = leaving.iter().copied().chain(after.sliding_set()).collect();
    around.sort_unstable();
    let mut own;
    let mut parts = found.parts.filter(|parts| parts.surfaces() == around);
    if parts.is_none() {
        own = parts_around(at, notes, &signs, &around)?;
        parts = own.as_mut();
    }
    let sizes = match &parts {
        Some(parts) => sizes_of_rates(parts),
        None => component_sizes(at, notes, after, &around)?,
    };
    // The strength of a contact that sticks is not that with which it slips.
    let is_combined = at.slides_on_roots(after) && !leaving.iter().any(|&j| at.system.sticks_at(j));
    let mut parts = parts.filter(|_| is_combined);
    let known = parts.as_ref().and_then(|parts| velocity_in(parts, after));
    let velocity = match known {
        Some(velocity) => velocity,
        None => at.velocity(notes, after, multipliers)?,
    };
    for j in leaving {
        let (value, size) = at.rate_of(j, &signs, &velocity)?;
        let place = around.binary_search(&j).unwrap_or(0);
        let leading = if value.abs() > AT_SIDE * size.max(sizes[place]) {
            Leading { order: 1, value }
        } else if after.codimension() == 0 {
            let side = after.entries()[j];
            first_nonzero(at.system, j, side, 1, &at.place(&signs))?
        } else {
            // The normal component vanishes at the exit of a multiplier: its rate along the new motion.
            let dt = at.moment(notes, &signs, &velocity)?;
            let x = at.along(&velocity, dt);
            let later = at.moved(at.t + dt, &x);
            let known = match &mut parts {
                Some(parts) => {
                    evaluate(&later, notes, parts, &signs)?;
                    velocity_in(parts, after)
                }
                None => None,
            };
            let velocity = match known {
                Some(velocity) => velocity,
                None => later.velocity(notes, after, multipliers)?,
            };
            let (then, _) = later.rate_of(j, &signs, &velocity)?;
            let (order, value) = (2, (then - value) / dt);
            Leading { order, value }
        };
        left.push(Left::beside(j, leading));
    }
    Ok(left)
}

/// The velocity in a mode by the fields around the point; `None` if they do not determine it.
fn velocity_in(parts: &AffineParts, mode: &Mode) -> Option<Vec<f64>> {
    let velocity = parts.velocity_in(mode.entries())?;
    velocity.iter().all(|v| v.is_finite()).then_some(velocity)
}

/// Evaluates the fields around the point where the other surfaces have these signs.
pub(super) fn evaluate(
    at: &Point,
    notes: &mut Notes,
    parts: &mut AffineParts,
    signs: &[f64],
) -> Result<(), FieldError> {
    if let Some(affine) = at.system.affine_signs() {
        notes.n_field_evaluations += parts.evaluate(affine, &at.place(signs))?;
    }
    Ok(())
}

/// The fields around these surfaces where the others have these signs; `None` if they are not affine in theirs.
fn parts_around(
    at: &Point,
    notes: &mut Notes,
    signs: &[f64],
    surfaces: &[usize],
) -> Result<Option<AffineParts>, FieldError> {
    let affine = at.system.affine_signs();
    let mut parts = affine.and_then(|affine| affine.affine_parts(surfaces));
    if let Some(parts) = &mut parts {
        evaluate(at, notes, parts, signs)?;
    }
    Ok(parts)
}

/// For each surface a bound of its rate in the fields around it.
fn sizes_of_rates(parts: &AffineParts) -> Values {
    let spread = |row| parts.normal().row(row).map(|(_, n)| n.abs()).sum::<f64>();
    let rows = parts.nu().into_iter().enumerate();
    rows.map(|(row, nu)| nu.abs() + spread(row)).collect()
}

/// The largest component normal to each of these surfaces among the fields around them; 0 where these are too many to be looked at, or
/// not finite.
fn component_sizes(
    at: &Point,
    notes: &mut Notes,
    mode: &Mode,
    surfaces: &[usize],
) -> Result<Values, FieldError> {
    let groups = at.system.sign_groups(surfaces);
    if groups.iter().any(|group| group.len() > MOST_MEETING) {
        return Ok(smallvec![0.0; surfaces.len()]);
    }
    let fields = at.corners(notes, surfaces, mode)?.normal_fields();
    let size = |i| fields.as_ref().map_or(0.0, |fields| fields.row_size(i));
    Ok((0..surfaces.len()).map(size).collect())
}
