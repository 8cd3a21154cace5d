//! Outward spirals: infinitely many laps from an intersection, started at a small distance.

use super::departures::departures;
use super::point::{Lefts, Notes, Point};
use crate::error::FieldError;
use crate::field::{MeetingFields, Projector};
use crate::mode::Mode;
use crate::switching::codim2::Lap;
use crate::tolerances::SPIRAL_START;

/// The laps of an outward spiral up to a small distance: too many to be listed, and one straight line in the record. One
/// member of a one-parameter family.
///
/// Reference: Guglielmi, Hairer (2022), formula (6.5).
#[derive(Clone, Debug)]
pub(crate) struct Leap {
    /// The region that the motion enters at the end, and is said to be in from the start on.
    pub region: Mode,
    /// The surface on its border on which it enters.
    border: usize,
    lap: Lap,
    /// The fields of the regions of the lap.
    fields: [Vec<f64>; 4],
    /// The free parameter of the family: a distance in units of the switching functions.
    distance: f64,
}

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
    fields: &MeetingFields,
) -> Option<Leap> {
    let lap = Lap::around(&fields.normal_fields().ok()?, [-1, -1])?;
    let pattern = |k: [i8; 2]| usize::from(k[0] > 0) + 2 * usize::from(k[1] > 0);
    let scales = at.x.iter().enumerate();
    let scales = scales.map(|(i, x)| at.scale.tolerance(i, *x, *x));
    let distance = SPIRAL_START * scales.fold(f64::INFINITY, f64::min);
    lap.outward(distance)?;
    let [first, .., last] = lap.regions;
    let mut region = mode.clone();
    let entries = meeting.iter().zip(first);
    entries.for_each(|(&j, entry)| region.set(j, entry));
    Some(Leap {
        region,
        border: meeting[usize::from(first[0] == last[0])],
        fields: lap.regions.map(|k| fields.field(pattern(k)).to_vec()),
        lap,
        distance,
    })
}

impl Leap {
    /// Where it ends if there is `room` of time for it; nearer where it would take longer.
    pub fn landing(
        &self,
        at: &Point,
        notes: &mut Notes,
        room: f64,
    ) -> Result<Option<Landing>, FieldError> {
        let Some(mut jump) = self.lap.outward(self.distance) else {
            return Ok(None);
        };
        if jump.duration() > room {
            let nearer = 0.5 * self.distance * room / jump.duration();
            jump = self.lap.outward(nearer).unwrap_or(jump);
        }
        let [a, b, c, d] = &self.fields;
        let shift = jump.displacement([a, b, c, d]);
        let mut x: Vec<f64> = at.x.iter().zip(&shift).map(|(x, s)| x + s).collect();
        let t = at.t + jump.duration();
        let signs = self.region.signs();
        let mut projector = Projector::new(x.len(), at.system.n_surfaces());
        projector.project(at.system, self.border, t, &mut x, &signs)?;
        let left = departures(&at.moved(t, &x), notes, &self.region, &[self.border], &[])?;
        Ok(Some(Landing { t, x, left }))
    }
}
