//! Outward spirals: infinitely many laps from an intersection, started at a small distance.

use smallvec::SmallVec;

use crate::error::FieldError;
use crate::field::{MeetingFields, Projector};
use crate::integrate::decisions::transition::Lefts;
use crate::integrate::integrator::Integrator;
use crate::mode::Mode;
use crate::switching::codim2::Lap;
use crate::tolerances::SPIRAL_START;

/// The laps of an outward spiral up to a small distance: too many to be listed, and one straight line in the record.
pub(in crate::integrate) struct Leap {
    /// The region that the motion enters at the end, and is said to be in from the start on.
    pub region: Mode,
    /// The surface on its border on which it enters.
    pub border: usize,
    /// The time of the end.
    pub t: f64,
    /// The state there.
    pub x: Vec<f64>,
}

impl Integrator<'_> {
    /// How the motion leaves the intersection of two surfaces by an outward spiral: one member of a one-parameter family,
    /// which starts at a distance of [`SPIRAL_START`] tolerances; nearer where the run ends before. `None` if the fields do
    /// not spiral outwards.
    ///
    /// Reference: Guglielmi, Hairer (2022), formula (6.5).
    pub(in crate::integrate) fn outward_leap(
        &mut self,
        meeting: &[usize],
        mode: &Mode,
        fields: &MeetingFields,
    ) -> Result<Option<Leap>, FieldError> {
        let components = fields.normal_fields().ok();
        let lap = components.and_then(|components| Lap::around(&components, [-1, -1]));
        let distance = self.spiral_distance();
        let Some(lap) = lap else { return Ok(None) };
        let Some(mut jump) = lap.outward(distance) else {
            return Ok(None);
        };
        let room = self.horizon - self.t;
        if jump.duration() > room {
            let nearer = lap.outward(0.5 * distance * room / jump.duration());
            jump = nearer.unwrap_or(jump);
        }
        let pattern = |k: [i8; 2]| usize::from(k[0] > 0) + 2 * usize::from(k[1] > 0);
        let shift = jump.displacement(jump.regions.map(|k| fields.field(pattern(k))));
        let mut x: Vec<f64> = self.x.iter().zip(&shift).map(|(x, s)| x + s).collect();
        let [first, .., last] = jump.regions;
        let border = meeting[usize::from(first[0] == last[0])];
        let mut region = mode.clone();
        let entries = meeting.iter().zip(first);
        entries.for_each(|(&j, entry)| region.set(j, entry));
        let t = self.t + jump.duration();
        let mut projector = Projector::new(x.len(), self.system.n_surfaces());
        projector.project(self.system, border, t, &mut x, &region.signs())?;
        Ok(Some(Leap {
            region,
            border,
            t,
            x,
        }))
    }

    /// What the motion leaves at the end of a leap.
    pub(in crate::integrate) fn departures_after(
        &mut self,
        leap: &Leap,
    ) -> Result<Lefts, FieldError> {
        let here = (self.t, std::mem::replace(&mut self.x, leap.x.clone()));
        self.t = leap.t;
        let left = self.departures(&leap.region, &[leap.border], &[]);
        (self.t, self.x) = here;
        left
    }

    /// Begins the segment of a motion that starts with a leap, and makes that. Is there one?
    pub(in crate::integrate) fn begin_with_leap(&mut self) -> Result<bool, FieldError> {
        let Some(leap) = self.decided.leap.take() else {
            return Ok(false);
        };
        let region = leap.region.clone();
        self.motion.restart(self.system, self.t, region, &[]);
        let discrete = &self.motion.discrete;
        self.recorder
            .begin_segment(self.t, &leap.region, SmallVec::new(), discrete);
        self.move_straight(leap.t, leap.x)?;
        Ok(true)
    }

    /// The free parameter of the family: a distance in units of the switching functions.
    fn spiral_distance(&self) -> f64 {
        let scales = self
            .x
            .iter()
            .enumerate()
            .map(|(i, x)| self.scale.tolerance(i, *x, *x));
        SPIRAL_START * scales.fold(f64::INFINITY, f64::min)
    }

    /// Records a straight line to a later point: the motion in between has more switches than can be listed.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub(in crate::integrate) fn move_straight(
        &mut self,
        t: f64,
        end: Vec<f64>,
    ) -> Result<(), FieldError> {
        self.stepper.set_straight(self.t, t - self.t, &self.x, &end);
        self.sample(t)?;
        self.recorder.step(self.stepper.interpolant(), t, &end);
        (self.t, self.x) = (t, end);
        Ok(())
    }
}
