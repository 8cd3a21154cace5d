//! Surfaces with one normal at a point: are they in one place, or do they touch? What holds a motion on two that touch?

use smallvec::SmallVec;

use super::candidate::Candidate;
use super::point::{Notes, Point, Values};
use crate::cube::{roots_in_cube, NormalFields};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::motion::{are_parallel, beside_on, in_the_place_of, normal, parallel, MeetingFields};
use crate::system::dot;
use crate::tolerances::{BESIDE, DOUBTFUL, ONE_DIRECTION, ROUNDING};

/// Two surfaces, counted within a meeting, that touch one another: they have the same normal here, and are not in one place.
pub(super) struct Touch {
    pub pair: [usize; 2],
    /// Have they the same normal to rounding? If not, the point is beside the one where they touch.
    pub is_exact: bool,
}

/// The surfaces of a meeting that have the same normal, or none.
#[derive(Default)]
pub(super) struct Parallels {
    pub touching: Vec<Touch>,
    /// Are two in one place?
    pub coincide: bool,
}

impl Parallels {
    /// Are two in one place, or do they touch?
    pub fn are_any(&self) -> bool {
        self.coincide || !self.touching.is_empty()
    }

    /// Looks at all pairs.
    pub fn of(at: &Point, meeting: &[usize], mode: &Mode) -> Result<Self, FieldError> {
        let (signs, n) = (mode.signs(), at.x.len() + 1);
        let place = at.place(&signs);
        let mut normals = vec![0.0; n * meeting.len()];
        for (&j, row) in meeting.iter().zip(normals.chunks_exact_mut(n)) {
            row[n - 1] = at.system.gradient(j, &place, &mut row[..n - 1])?;
        }
        let row = |i: usize| &normals[i * n..(i + 1) * n];
        let squares: Values = (0..meeting.len()).map(|i| dot(row(i), row(i))).collect();
        let has_normal = |i: usize| squares[i] != 0.0;
        // Where the first and the last entry are that is not zero: normals apart are not parallel.
        let ends = |i: usize| {
            let mut entries = row(i).iter().zip(0..).filter(|(entry, _)| **entry != 0.0);
            let (_, first) = entries.next()?;
            Some((first, entries.last().map_or(first, |(_, last)| last)))
        };
        let reach: SmallVec<[_; 8]> = (0..meeting.len()).map(ends).collect();
        let are_apart = |i: usize, k: usize| match (reach[i], reach[k]) {
            (Some(one), Some(other)) => one.1 < other.0 || other.1 < one.0,
            _ => false,
        };
        let mut found = Parallels::default();
        for (i, k) in (0..meeting.len()).flat_map(|k| (0..k).map(move |i| (i, k))) {
            if are_apart(i, k) {
                continue;
            }
            let (i, k) = if has_normal(i) { (i, k) } else { (k, i) };
            let (one, other) = (row(i), row(k));
            if !has_normal(i) || !are_parallel(dot(one, other), squares[i] * squares[k]) {
                continue;
            }
            let units = at.units();
            if !parallel(one, other, &place, units) {
                continue;
            }
            let (j, others) = (meeting[i], [meeting[k]]);
            if !in_the_place_of(at.system, (&place, units), j, &others)?.is_empty() {
                found.coincide = true;
            } else if has_normal(k) {
                let ratio = dot(one, other) / squares[i];
                let noise = ROUNDING * squares[k].sqrt();
                let mut pairs = other.iter().zip(one);
                found.touching.push(Touch {
                    pair: [i, k],
                    is_exact: pairs.all(|(b, a)| (b - ratio * a).abs() <= noise),
                });
            }
        }
        Ok(found)
    }
}

/// Do multipliers hold a motion on two surfaces that touch?
pub(super) enum Together {
    /// Whatever they are, it parts the surfaces.
    Never,
    Perhaps,
    /// They do, and within rounding of the point the motion has no field: it divides by the power of the second surface.
    Lost,
    /// They solve the equations with these normal components: those of the second surface are divided by their power.
    By(NormalFields),
}

/// Sliding on two surfaces that touch: to first order they are one, and the equation of the second is that of what they have
/// in common beside the point.
pub(super) fn together(
    at: &Point,
    notes: &mut Notes,
    candidate: &Candidate,
    [i, k]: [usize; 2],
) -> Result<Together, FieldError> {
    let Candidate {
        meeting,
        entries,
        mode,
        ..
    } = *candidate;
    let pair = [i, k].map(|i| meeting.surfaces[i]);
    let Some((normal, is_odd)) = parting(at, pair, mode)? else {
        return Ok(Together::Perhaps);
    };
    let mut corners = at.corners(notes, meeting.surfaces, mode)?;
    corners.set_normal(k, &normal);
    let Ok(fields) = corners.normal_fields() else {
        return Ok(Together::Perhaps);
    };
    let end = 1.0 + ONE_DIRECTION;
    let face = fields.restrict(entries.entries());
    let face = (0..face.m()).fold(face, |face, axis| face.on_range(axis, [-end, end]));
    let noise = DOUBTFUL * face.size();
    let ranges: Vec<[f64; 2]> = (0..face.m()).map(|row| face.row_range(row)).collect();
    if ranges
        .iter()
        .any(|[low, high]| *low > noise || *high < -noise)
    {
        return Ok(Together::Never);
    }
    let roots = roots_in_cube(&face);
    let has_field = |velocity: Vec<f64>| velocity.iter().all(|v| v.is_finite());
    Ok(match roots.complete && roots.points.is_empty() {
        true => Together::Never,
        // After an even power no region lies between the surfaces on one side.
        false if !is_odd => Together::Perhaps,
        false if !has_field(at.velocity(notes, mode, &[])?) => Together::Lost,
        false => Together::By(fields),
    })
}

/// Does a velocity in this mode keep a motion on two surfaces that touch, where these are the fields around them?
pub(super) fn keeps_together(
    at: &Point,
    pair: [usize; 2],
    (mode, velocity): (&Mode, &[f64]),
    corners: &MeetingFields,
) -> Result<bool, FieldError> {
    let (found, n) = (parting(at, pair, mode)?, velocity.len());
    Ok(found.is_some_and(|(normal, _)| {
        let rate = normal[n] + dot(&normal[..n], velocity);
        let (units, entries) = (at.units(), normal[..n].iter().enumerate());
        let size: f64 = entries
            .map(|(i, entry)| entry.abs() * units.of_state(i))
            .sum();
        let pace = corners.pace(&|i| units.of_state(i));
        rate.abs() <= DOUBTFUL * (normal[n].abs() + pace * size)
    }))
}

/// Two surfaces that touch have functions that differ by a power of another one: its normal, along the surfaces, and whether
/// the power is odd. `None` if what they differ by depends on where one looks beside the point.
fn parting(
    at: &Point,
    [j, k]: [usize; 2],
    mode: &Mode,
) -> Result<Option<(Vec<f64>, bool)>, FieldError> {
    let signs = mode.signs();
    let [one, other] = [j, k].map(|j| normal(at.system, &at.place(&signs), j));
    let (one, other) = (one?, other?);
    let square = dot(&one, &one);
    let ratio = dot(&one, &other) / square;
    // Of a high power nothing but rounding is seen near the point.
    for distance in BESIDE {
        let mut found: Vec<Vec<f64>> = Vec::new();
        for side in [-1.0, 1.0] {
            let (t, x) = beside_on(
                at.system,
                (&at.place(&signs), at.units()),
                j,
                side * distance,
            )?;
            let (near, far) = (
                normal(at.system, &at.place_at(t, &x, &signs), j)?,
                normal(at.system, &at.place_at(t, &x, &signs), k)?,
            );
            let pairs = far.iter().zip(&near);
            let mut row: Vec<f64> = pairs.map(|(far, near)| far - ratio * near).collect();
            // Along the surfaces.
            let along = dot(&row, &one) / square;
            row.iter_mut()
                .zip(&one)
                .for_each(|(row, one)| *row -= along * one);
            let size = dot(&row, &row).sqrt();
            if size > ROUNDING * dot(&other, &other).sqrt() {
                row.iter_mut().for_each(|v| *v /= size);
                found.push(row);
            }
        }
        if let [before, later] = &found[..] {
            let product = dot(before, later);
            let is_one = product.abs() >= 1.0 - ONE_DIRECTION;
            return Ok(is_one.then(|| (found.swap_remove(1), product > 0.0)));
        }
    }
    Ok(None)
}
