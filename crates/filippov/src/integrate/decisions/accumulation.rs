//! Accumulations: infinitely many switches in finite time, jumped to their limit.

use smallvec::SmallVec;

use crate::error::FieldError;
use crate::field::{MeetingFields, Projector};
use crate::integrate::decisions::transition::Decided;
use crate::integrate::integrator::Integrator;
use crate::integrate::Stop;
use crate::mode::Mode;
use crate::solution::Switch;
use crate::switching::{accumulate, admissible, least_multipliers, Kind, Return, Undecided};
use crate::system::dot;
use crate::tolerances::{
    LONGEST_TURN, MOST_MEETING, NEAREST_ACCUMULATION, SURFACE_NOISE, TANGENT_FOR,
};

/// The limit of accumulating switches.
pub(in crate::integrate) struct Limit {
    t: f64,
    x: Vec<f64>,
    /// The surfaces that meet there.
    meeting: Vec<usize>,
}

/// Does a later switch repeat an earlier one?
fn repeats(a: &Switch, b: &Switch) -> bool {
    a.surfaces == b.surfaces && a.mode_before == b.mode_before && a.mode_after == b.mode_after
}

impl Integrator<'_> {
    /// The limit that the last switches tend to: turns of equally many switches, each turn shorter and nearer to
    /// an intersection than the one before by the same ratio (`docs/theory/intersections.md`).
    pub(in crate::integrate) fn accumulation(&self) -> Result<Option<Limit>, FieldError> {
        if self.system.n_surfaces() < 2 {
            // Nothing can meet.
            return Ok(None);
        }
        let switches = self.recorder.switches();
        let Some(turn) = turn_of(switches) else {
            return Ok(None);
        };
        let last = switches.len() - 1;
        let at = [3, 2, 1, 0].map(|k| &switches[last - k * turn]);
        let intervals = [1, 2, 3].map(|k| at[k].t - at[k - 1].t);
        if !(intervals[2] < intervals[1] && intervals[1] < intervals[0]) {
            return Ok(None);
        }
        let Some(meeting) = meeting_of(&switches[last + 1 - turn..]) else {
            return Ok(None);
        };
        let mut returns = [Return {
            time: 0.0,
            distance: 0.0,
        }; 4];
        for (found, switch) in returns.iter_mut().zip(at) {
            found.time = switch.t;
            found.distance = self.distance(&meeting, switch)?;
        }
        let Some(limit) = accumulate(&returns, self.reach()) else {
            return Ok(None);
        };
        if limit.time > self.horizon || limit.time <= self.t {
            return Ok(None);
        }
        let share = limit.ratio / (1.0 - limit.ratio);
        let states = at[3].y_after.iter().zip(&at[2].y_after);
        let mut x: Vec<f64> = states.map(|(y, before)| y + share * (y - before)).collect();
        let mut projector = Projector::new(x.len(), self.system.n_surfaces());
        let signs = self.motion.mode.signs();
        projector.project_onto(self.system, &meeting, limit.time, &mut x, &signs)?;
        let limit = Limit {
            t: limit.time,
            x,
            meeting,
        };
        Ok(self.is_on_all(&limit)?.then_some(limit))
    }

    /// Do the surfaces meet at the limit? Three lines in a plane need not.
    fn is_on_all(&self, limit: &Limit) -> Result<bool, FieldError> {
        let (signs, mut h) = (
            self.motion.mode.signs(),
            vec![0.0; self.system.n_surfaces()],
        );
        self.system.surfaces(limit.t, &limit.x, &signs, &mut h)?;
        for &j in &limit.meeting {
            let size = self.system.surface_size(j, limit.t, &limit.x, &signs)?;
            if h[j].abs() > SURFACE_NOISE * size {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The current point as a limit: crossings of several surfaces follow one another without any progress of
    /// time, as the last turns of a spiral do that shrinks a thousandfold with each.
    pub(in crate::integrate) fn limit_here(&self) -> Result<Option<Limit>, FieldError> {
        let meeting = self.recorder.surfaces_switched_at(self.t);
        let now = self.recorder.switches().iter().rev();
        let mut now = now.take_while(|s| s.t == self.t);
        let only_crosses = now.all(|s| s.kind == Kind::Crossing);
        if !only_crosses || !(2..=MOST_MEETING).contains(&meeting.len()) {
            return Ok(None);
        }
        let mut x = self.x.clone();
        let mut projector = Projector::new(x.len(), self.system.n_surfaces());
        let signs = self.motion.mode.signs();
        projector.project_onto(self.system, &meeting, self.t, &mut x, &signs)?;
        Ok(Some(Limit {
            t: self.t,
            x,
            meeting,
        }))
    }

    /// Moves to the limit and goes on from there.
    pub(in crate::integrate) fn jump_to(
        &mut self,
        limit: Limit,
        before: Mode,
    ) -> Result<Option<Stop>, FieldError> {
        self.recorder
            .begin_segment(self.t, &before, SmallVec::new(), &self.motion.discrete);
        self.motion.mode = before.clone();
        self.move_straight(limit.t, limit.x)?;
        self.stats.n_switches += 1;
        let decided = self.decide_at_limit(&before, &limit.meeting)?;
        // Where nothing is decided the run ends at the limit, having come there all the same.
        let after = decided.as_ref().map_or(&before, |(after, _)| after).clone();
        self.recorder.switch(Switch {
            t: self.t,
            y_before: SmallVec::from_slice(&self.x),
            y_after: SmallVec::from_slice(&self.x),
            kind: Kind::Accumulation,
            surfaces: limit.meeting.into(),
            mode_before: before,
            mode_after: after,
            note: String::new(),
        });
        match decided {
            Ok((after, left)) => self.begin(after, &left),
            Err(stop) => Ok(Some(stop)),
        }
    }

    /// What follows at the limit: sliding on all surfaces if that is possible.
    fn decide_at_limit(&mut self, mode: &Mode, meeting: &[usize]) -> Result<Decided, FieldError> {
        if let Some(decided) = self.decide_where_others_jump(mode, meeting)? {
            return Ok(decided);
        }
        let without_kinks = self.decide_without_kinks(mode, meeting, |this, others| {
            this.decide_at_limit(mode, others)
        })?;
        if let Some(decided) = without_kinks {
            return Ok(decided);
        }
        let fields = self.corners(meeting, mode)?;
        let telling = fields.telling();
        let silent = (0..meeting.len()).find(|place| !telling.contains(place));
        if let Some(surface) = silent {
            if !self.stays_tangent(mode, meeting, &telling)? {
                return Ok(Err(Stop::Intersection {
                    surfaces: meeting.to_vec(),
                    candidates: Vec::new(),
                    reason: Undecided::Tangent { surface },
                }));
            }
        }
        let stays = fields.normal_fields().is_ok_and(|fields| {
            if silent.is_some() {
                return least_multipliers(&fields, &telling).is_some();
            }
            let found = admissible(&fields);
            let mut modes = found
                .iter()
                .filter_map(|found| found.continuation.as_mode());
            modes.any(|mode| mode.codimension() == meeting.len())
        });
        if stays {
            let mut after = mode.clone();
            meeting.iter().for_each(|&j| after.set(j, 0));
            return Ok(Ok((
                after,
                crate::integrate::decisions::transition::Lefts::new(),
            )));
        }
        self.decide_at_start(mode, meeting)
    }

    /// Do the equations that say nothing at the limit say nothing either a moment later, along the motion on all surfaces?
    fn stays_tangent(
        &mut self,
        mode: &Mode,
        meeting: &[usize],
        telling: &[usize],
    ) -> Result<bool, FieldError> {
        let mut after = mode.clone();
        meeting.iter().for_each(|&j| after.set(j, 0));
        let (x, mut velocity) = (self.x.clone(), vec![0.0; self.x.len()]);
        self.velocity_in(&after, &[], self.t, &x, &mut velocity)?;
        let moment = TANGENT_FOR * (self.t_end - self.t);
        let pairs = x.iter().zip(&velocity);
        let mut ahead: Vec<f64> = pairs.map(|(x, v)| x + moment * v).collect();
        let t = self.t + moment;
        let mut projector = Projector::new(x.len(), self.system.n_surfaces());
        projector.project_onto(self.system, meeting, t, &mut ahead, &after.signs())?;
        let mut later = MeetingFields::new(self.system, meeting);
        self.stats.n_field_evaluations += later.evaluate(self.system, t, &ahead, &after.signs())?;
        Ok(later.telling() == telling)
    }

    /// Distance of a switch to the intersection, h_j in units of its gradient.
    fn distance(&self, meeting: &[usize], switch: &Switch) -> Result<f64, FieldError> {
        let (signs, n) = (switch.mode_after.signs(), switch.y_after.len());
        let mut h = vec![0.0; self.system.n_surfaces()];
        let mut gradient = vec![0.0; n];
        self.system
            .surfaces(switch.t, &switch.y_after, &signs, &mut h)?;
        let mut square = 0.0;
        for &j in meeting {
            self.system
                .gradient(j, switch.t, &switch.y_after, &signs, &mut gradient)?;
            square += h[j] * h[j] / dot(&gradient, &gradient);
        }
        Ok(square.sqrt())
    }

    /// From where the limit is known to the tolerance: its error is a multiple of the square of the distance.
    pub(in crate::integrate) fn reach(&self) -> f64 {
        let scales = self
            .x
            .iter()
            .enumerate()
            .map(|(i, x)| self.scale.tolerance(i, *x, *x));
        scales
            .fold(f64::INFINITY, f64::min)
            .max(NEAREST_ACCUMULATION)
            .sqrt()
    }
}

/// How many switches a turn has, if the last three turns repeat.
fn turn_of(switches: &[Switch]) -> Option<usize> {
    let last = switches.last()?;
    let earlier = switches.iter().rev().skip(1).take(LONGEST_TURN);
    let turn = earlier
        .take_while(|s| !matches!(s.kind, Kind::Accumulation | Kind::Reset | Kind::Clock))
        .position(|s| repeats(s, last))?
        + 1;
    let index = switches.len() - 1;
    let again = |k: usize| {
        index
            .checked_sub(k * turn)
            .is_some_and(|i| repeats(&switches[i], last))
    };
    (again(2) && again(3)).then_some(turn)
}

/// The surfaces of a turn, with those slid on all along; at least two, and not too many.
fn meeting_of(turn: &[Switch]) -> Option<Vec<usize>> {
    let mut meeting: Vec<usize> = turn
        .iter()
        .flat_map(|s| s.surfaces.iter().copied())
        .collect();
    let (first, rest) = turn.split_first()?;
    let always = first.mode_after.sliding_set();
    meeting.extend(always.filter(|&j| rest.iter().all(|s| s.mode_after.entries()[j] == 0)));
    meeting.sort_unstable();
    meeting.dedup();
    (2..=MOST_MEETING)
        .contains(&meeting.len())
        .then_some(meeting)
}
