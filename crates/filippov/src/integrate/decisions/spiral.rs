//! Outward spirals: infinitely many laps from an intersection, started at a small distance.

use smallvec::SmallVec;

use crate::error::FieldError;
use crate::field::{MeetingFields, Projector};
use crate::integrate::integrator::Integrator;
use crate::mode::Mode;
use crate::switching::codim2::Lap;
use crate::tolerances::SPIRAL_START;

impl Integrator<'_> {
    /// Leaves the intersection of two surfaces by an outward spiral: one member of a one-parameter family, which
    /// starts at a distance of [`SPIRAL_START`] tolerances. Returns the region that the motion enters then and
    /// the surface on its border; `None` if the fields do not spiral outwards.
    ///
    /// Reference: Guglielmi, Hairer (2022), formula (6.5).
    pub(in crate::integrate) fn start_spiral(
        &mut self,
        meeting: &[usize],
        mode: &Mode,
        fields: &MeetingFields,
    ) -> Result<Option<(Mode, usize)>, FieldError> {
        let components = fields.normal_fields().ok();
        let lap = components.and_then(|components| Lap::around(&components, [-1, -1]));
        let Some(jump) = lap.and_then(|lap| lap.outward(self.spiral_distance())) else {
            return Ok(None);
        };
        let pattern = |k: [i8; 2]| usize::from(k[0] > 0) + 2 * usize::from(k[1] > 0);
        let shift = jump.displacement(jump.regions.map(|k| fields.field(pattern(k))));
        let mut end: Vec<f64> = self.x.iter().zip(&shift).map(|(x, s)| x + s).collect();
        let [first, .., last] = jump.regions;
        let border = meeting[usize::from(first[0] == last[0])];
        let mut region = mode.clone();
        let entries = meeting.iter().zip(first);
        entries.for_each(|(&j, entry)| region.set(j, entry));
        let t = self.t + jump.duration();
        let mut projector = Projector::new(end.len(), self.system.n_surfaces());
        projector.project(self.system, border, t, &mut end, &region.signs())?;
        if !self.recorder.has_segments() {
            // The run starts here: what follows belongs to the first region.
            let discrete = &self.motion.discrete;
            self.recorder
                .begin_segment(self.t, &region, SmallVec::new(), discrete);
        }
        self.move_straight(t, end)?;
        Ok(Some((region, border)))
    }

    /// The free parameter of the family: a distance in units of the switching functions.
    fn spiral_distance(&self) -> f64 {
        let scales = self
            .x
            .iter()
            .enumerate()
            .map(|(i, x)| self.scale.of(i, *x, *x));
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
