//! Surfaces in one place: functions that vanish together, as x and x (1 + y) do.

use super::Projector;
use crate::error::FieldError;
use crate::error_scale::Units;
use crate::system::{dot, PiecewiseSystem, Place};
use crate::tolerances::{BESIDE, ROUNDING, TANGENT};

/// Two surfaces in one place: of the four regions around them two exist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tie {
    /// Counted within a set.
    pub leader: usize,
    /// Counted within a set.
    pub follower: usize,
    /// Have the functions the same sign (+1), or opposite ones (-1)?
    pub sense: i8,
}

impl Tie {
    /// Do the signs of both surfaces agree in this pattern?
    pub fn holds(&self, pattern: usize) -> bool {
        let are_equal = pattern >> self.leader & 1 == pattern >> self.follower & 1;
        are_equal == (self.sense > 0)
    }

    /// Is this a mode of motion: on both surfaces, or in a region that exists?
    pub fn allows(&self, entries: &[i8]) -> bool {
        entries[self.follower] == self.sense * entries[self.leader]
    }
}

/// Have the functions of two surfaces in one place the same sign (+1), or opposite ones (-1)? `None` if they are not in one
/// place, or if that differs between the sides of the first one, whose sign the second may contain. Surfaces that are `tied` to
/// the first one, with their senses, change sides with it.
///
/// # Errors
/// If a function of the user raises.
pub fn sense_of(
    system: &dyn PiecewiseSystem,
    (place, units): (&Place<'_>, Units<'_>),
    [j, k]: [usize; 2],
    tied: &[(usize, i8)],
) -> Result<Option<i8>, FieldError> {
    let mut senses = [0; 2];
    for (sense, side) in senses.iter_mut().zip([-1.0, 1.0]) {
        let mut signs = place.signs.to_vec();
        signs[j] = side;
        for &(other, sense) in tied {
            signs[other] = f64::from(sense) * side;
        }
        if system.has_nested_signs() {
            let fixed: Vec<usize> = tied.iter().map(|tie| tie.0).chain([j, k]).collect();
            let_others_jump(system, place, &mut signs, &fixed)?;
        }
        let on_side = place.with_signs(&signs);
        let [one, other] = [j, k].map(|j| normal(system, &on_side, j));
        let (one, other) = (one?, other?);
        let are_parallel = parallel(&one, &other, &on_side, units);
        if !are_parallel || in_the_place_of(system, (&on_side, units), j, &[k])?.is_empty() {
            return Ok(None);
        }
        *sense = dot(&one, &other)
            .partial_cmp(&0.0)
            .map_or(0, |order| order as i8);
    }
    let [minus, plus] = senses;
    Ok((minus == plus && plus != 0).then_some(plus))
}

/// Gives all surfaces but the `fixed` ones the sides that they are on with these signs of the fixed ones.
fn let_others_jump(
    system: &dyn PiecewiseSystem,
    place: &Place<'_>,
    signs: &mut [f64],
    fixed: &[usize],
) -> Result<(), FieldError> {
    let mut h = vec![0.0; signs.len()];
    let mut is_new = true;
    // A jump may make others jump.
    for _ in 0..h.len() {
        if !std::mem::take(&mut is_new) {
            break;
        }
        system.surfaces(&place.with_signs(signs), &mut h)?;
        for i in (0..h.len()).filter(|i| !fixed.contains(i)) {
            let noise = ROUNDING * system.surface_size(i, &place.with_signs(signs))?;
            if h[i] * signs[i] < 0.0 && h[i].abs() > noise {
                signs[i] = -signs[i];
                is_new = true;
            }
        }
    }
    Ok(())
}

/// Those of `others` whose functions vanish where that of surface j does, around the place.
///
/// # Errors
/// If a function of the user raises.
pub fn in_the_place_of(
    system: &dyn PiecewiseSystem,
    (place, units): (&Place<'_>, Units<'_>),
    j: usize,
    others: &[usize],
) -> Result<Vec<usize>, FieldError> {
    let mut h = [(); 2].map(|()| vec![0.0; place.signs.len()]);
    system.surfaces(place, &mut h[1])?;
    let (mut found, mut gradient) = (others.to_vec(), vec![0.0; place.x.len()]);
    // Beside the place, so that surfaces that only touch are told apart.
    for distance in BESIDE {
        let (later, beside) = beside_on(system, (place, units), j, distance)?;
        let moved = place.moved(later, &beside);
        system.surfaces(&moved, &mut h[0])?;
        let is_on = h[0][j].abs() <= ROUNDING * system.surface_size(j, &moved)?;
        // Far away there may be no place on the surface, or the other function may have no value.
        let is_far = distance > BESIDE[0];
        if is_far && !is_on {
            break;
        }
        let mut vanishing = Vec::with_capacity(found.len());
        for k in found {
            let rate = system.gradient(k, &moved, &mut gradient)?;
            let entries = gradient.iter().enumerate();
            let parts = entries.map(|(i, g)| g.abs() * units.of_state(i));
            let size = parts.sum::<f64>() + rate.abs() * units.of_time(place.t);
            // One with a multiple zero has no gradient there.
            let is_zero = h[0][k].abs().max(h[1][k].abs()) <= TANGENT * size;
            if is_zero || is_far && !size.is_finite() {
                vanishing.push(k);
            }
        }
        found = vanishing;
    }
    Ok(found)
}

/// A place on surface j at this distance beside this one, later if it is positive, and before if it is negative.
///
/// # Errors
/// If a function of the user raises.
pub fn beside_on(
    system: &dyn PiecewiseSystem,
    (place, units): (&Place<'_>, Units<'_>),
    j: usize,
    distance: f64,
) -> Result<(f64, Vec<f64>), FieldError> {
    let (&Place { t, x, signs, .. }, side) = (place, distance.signum());
    let later = t + distance * units.of_time(t);
    let shifts = (0..x.len()).map(|i| distance * (1.0 + side / (2.0 + i as f64)));
    let pairs = x.iter().zip(shifts).enumerate();
    let beside = pairs.map(|(i, (x, d))| x + d * units.of_state(i));
    let mut beside: Vec<f64> = beside.collect();
    let mut projector =
        Projector::new(beside.len(), signs.len()).measured_in(units.parts(beside.len()));
    projector.project(system, j, later, &mut beside, place.setting())?;
    Ok((later, beside))
}

/// The normal of a surface in time and space: the gradient, then the derivative in time.
///
/// # Errors
/// If a function of the user raises.
pub fn normal(
    system: &dyn PiecewiseSystem,
    place: &Place<'_>,
    j: usize,
) -> Result<Vec<f64>, FieldError> {
    let n = place.x.len();
    let mut row = vec![0.0; n + 1];
    row[n] = system.gradient(j, place, &mut row[..n])?;
    Ok(row)
}

/// Are two normals the same, up to their lengths, or is one zero? In the user's units, and in those of the states.
pub fn parallel(one: &[f64], other: &[f64], place: &Place<'_>, units: Units<'_>) -> bool {
    let mut products = [[0.0; 3]; 2];
    for (i, (a, b)) in one.iter().zip(other).enumerate() {
        let unit = match i < place.x.len() {
            true => units.of_state(i),
            false => units.of_time(place.t),
        };
        for (sums, unit) in products.iter_mut().zip([1.0, unit]) {
            let (a, b) = (a * unit, b * unit);
            sums[0] += a * b;
            sums[1] += a * a;
            sums[2] += b * b;
        }
    }
    let mut both = products.iter();
    both.all(|[product, a, b]| are_parallel(*product, a * b))
}

/// The same, from the product of the normals and that of their squares.
pub fn are_parallel(product: f64, squares: f64) -> bool {
    squares - product * product <= TANGENT * squares
}
