//! Outward spirals: infinitely many laps from an intersection, started at a small distance.

use super::germ::{surfaces_left, Found};
use super::point::{Leap, Lefts, Notes, Point};
use super::surroundings::Surroundings;
use crate::cube::Lap;
use crate::error::FieldError;
use crate::mode::Mode;
use crate::tolerances::SPIRAL_START;

/// Where a leap ends.
pub(crate) struct Landing {
    pub t: f64,
    pub x: Vec<f64>,
    /// What the motion leaves there.
    pub left: Lefts,
}

/// How the motion leaves the intersection of two surfaces by an outward spiral, which starts at a distance of
/// [`SPIRAL_START`] tolerances. `None` if the fields do not spiral outwards.
pub(super) fn outward_leap(
    at: &Point,
    meeting: &[usize],
    mode: &Mode,
    around: &Surroundings,
) -> Option<Leap> {
    let lap = Lap::around(&around.fields, [-1, -1])?;
    if lap.gamma <= 1.0 {
        return None;
    }
    let pattern = |k: [i8; 2]| usize::from(k[0] > 0) + 2 * usize::from(k[1] > 0);
    let scales = at.x.iter().enumerate();
    let scales = scales.map(|(i, x)| at.scale.tolerance(i, *x, *x));
    // The free parameter of the family: a distance in units of the switching functions.
    let distance = SPIRAL_START * scales.fold(f64::INFINITY, f64::min);
    let [first, .., last] = lap.regions;
    let mut region = mode.clone();
    let entries = meeting.iter().zip(first);
    entries.for_each(|(&j, entry)| region.set(j, entry));
    let shift = lap.displacement(lap.regions.map(|k| around.corners.field(pattern(k))));
    Some(Leap {
        region,
        border: meeting[usize::from(first[0] == last[0])],
        duration: distance * lap.duration,
        shift: shift.into_iter().map(|s| distance * s).collect(),
    })
}

/// Where it ends if there is `room` of time for it; nearer where it would take longer.
pub(crate) fn landing(
    leap: &Leap,
    at: &Point,
    notes: &mut Notes,
    room: f64,
) -> Result<Landing, FieldError> {
    let share = if leap.duration > room {
        0.5 * room / leap.duration
    } else {
        1.0
    };
    let mut x = at.along(&leap.shift, share);
    let t = at.t + share * leap.duration;
    let signs = leap.region.signs();
    let mut projector = at.projector();
    projector.project(at.system, leap.border, t, &mut x, at.setting(&signs))?;
    let left = surfaces_left(
        &at.moved(t, &x),
        notes,
        &leap.region,
        &[leap.border],
        Found::default(),
    )?;
    Ok(Landing { t, x, left })
}
