//! The fields around the place where surfaces vanish, and what of them is clear of zero.

use super::point::{Notes, Point};
use crate::cube::{zero_between, NormalFields};
use crate::error::FieldError;
use crate::error::Undecided;
use crate::mode::Mode;
use crate::motion::MeetingFields;
use crate::tolerances::{DOUBTFUL, FEW_SURFACES, MOST_MEETING, TANGENT};

/// The fields around the surfaces of a meeting.
pub(super) struct Surroundings {
    pub corners: MeetingFields,
    pub fields: NormalFields,
    /// What a normal component may be without being clear of zero, for each surface: the error of the fields at a located
    /// event, and what the rounding of time and state makes of zero.
    pub noise: Vec<f64>,
}

impl Surroundings {
    /// Where these surfaces vanish, the others with the signs of `mode`. Why there are none, if a field is not finite, or there
    /// are too many.
    pub fn of(
        at: &Point,
        notes: &mut Notes,
        surfaces: &[usize],
        mode: &Mode,
    ) -> Result<Result<Self, Undecided>, FieldError> {
        let groups = at.system.sign_groups(surfaces);
        let largest = groups.iter().map(Vec::len).max().unwrap_or(0);
        if largest > MOST_MEETING {
            return Ok(Err(Undecided::TooMany { n: largest }));
        }
        let corners = at.corners(notes, surfaces, mode)?;
        let fields = match corners.normal_fields() {
            Ok(fields) => fields,
            Err(undecided) => return Ok(Err(undecided)),
        };
        let mut gradient = vec![0.0; at.x.len()];
        let mut noise = Vec::with_capacity(surfaces.len());
        // We look at all regions around a few surfaces, and at both sides of each surface if there are more.
        let m = surfaces.len();
        for (i, &j) in surfaces.iter().enumerate() {
            let mut largest = DOUBTFUL * fields.row_size(i);
            let own = [j];
            let turned = if m <= FEW_SURFACES { surfaces } else { &own };
            for pattern in 0..1_usize << turned.len() {
                let mut signs = mode.signs();
                for (bit, &k) in turned.iter().enumerate() {
                    signs[k] = if pattern >> bit & 1 == 1 { 1.0 } else { -1.0 };
                }
                let partials = at
                    .system
                    .rate_gradient(j, &at.place(&signs), &mut gradient)?;
                let parts = gradient.iter().zip(at.x).enumerate();
                let size: f64 = parts
                    .map(|(i, (g, x))| g.abs() * at.scale.size(i, *x))
                    .filter(|part| part.is_finite())
                    .sum();
                let by_slope = TANGENT * (size + (partials.time * at.t).abs());
                largest = largest.max(match by_slope <= fields.row_size(i) {
                    true => by_slope,
                    false => by_slope.min(change_nearby(at, j, &signs, partials.rate)?),
                });
            }
            noise.push(largest);
        }
        Ok(Ok(Surroundings {
            corners,
            fields,
            noise,
        }))
    }

    /// Are all fields tangent to one of several surfaces? One at which bodies stick has a field of its own.
    pub fn has_silent(&self, at: &Point) -> bool {
        let set = self.corners.set();
        let is_silent = |(i, noise): (usize, &f64)| {
            let sticks = at.system.sticks_at(set[i]);
            !sticks && self.fields.row_range(i).iter().all(|v| v.abs() <= *noise)
        };
        set.len() > 1 && self.noise.iter().enumerate().any(is_silent)
    }

    /// Is a normal component at some surface not clear of zero, in a region or along a motion that slides on one surface?
    pub fn is_doubtful(&self) -> bool {
        is_doubtful(&self.fields, &self.noise)
    }

    /// Answers the same question about a group of surfaces that is independent of the others.
    pub fn is_doubtful_at(&self, group: &[usize]) -> bool {
        let mut held = vec![-1; self.fields.m()];
        group.iter().for_each(|&i| held[i] = 0);
        let noise: Vec<f64> = group.iter().map(|&i| self.noise[i]).collect();
        is_doubtful(&self.fields.restrict(&held), &noise)
    }
}

/// The change of the rate of h_j between the point and places that rounding cannot tell from it. At the kink of |c|^1.4 the slope
/// of the rate is infinite, and this change is small. Infinite if the rate is known at none of these places.
fn change_nearby(at: &Point, j: usize, signs: &[f64], rate: f64) -> Result<f64, FieldError> {
    let (mut row, mut largest) = (vec![0.0; at.x.len()], None);
    for shift in [TANGENT, -TANGENT] {
        let states = at.x.iter().enumerate();
        let x: Vec<f64> = states
            .map(|(i, x)| x + shift * at.scale.size(i, *x))
            .collect();
        let place = at.place_at(at.t * (1.0 + shift), &x, signs);
        let change = (at.system.rate_gradient(j, &place, &mut row)?.rate - rate).abs();
        if change.is_finite() {
            largest = Some(change.max(largest.unwrap_or(0.0)));
        }
    }
    Ok(largest.unwrap_or(f64::INFINITY))
}

fn is_doubtful(fields: &NormalFields, noise: &[f64]) -> bool {
    if fields.any_component(|i, component| component.abs() <= noise[i]) {
        return true;
    }
    let m = fields.m();
    let edges = (0..m).flat_map(|i| (0..1_usize << m).map(move |pattern| (i, pattern)));
    for (slid, pattern) in edges.filter(|(i, pattern)| pattern >> i & 1 == 0) {
        let side = |i: usize| if pattern >> i & 1 == 1 { 1.0 } else { -1.0 };
        let mut place: Vec<f64> = (0..m).map(side).collect();
        let minus = fields.interpolate(&place)[slid];
        place[slid] = 1.0;
        let plus = fields.interpolate(&place)[slid];
        if minus > 0.0 && plus < 0.0 {
            place[slid] = zero_between(minus, plus);
            let components = fields.interpolate(&place);
            let is_tangent = |i: usize| i != slid && components[i].abs() <= noise[i];
            if (0..m).any(is_tangent) {
                return true;
            }
        }
    }
    false
}
