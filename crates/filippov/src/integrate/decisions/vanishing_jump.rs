//! Sliding on several surfaces where the jump across one of them vanishes: nothing holds the motion there any more.
//!
//! Seen from the others, which are slid on, it is a two-fold of that surface: the normal components of both sides vanish
//! at once. First-order data say nothing there, and the multiplier is 0/0; both are taken a moment away.

use smallvec::smallvec;

use crate::error::FieldError;
use crate::event::EventFunction;
use crate::field::{IntersectionExit, MeetingFields, SmoothField};
use crate::integrate::decisions::transition::{Decided, Left, Lefts};
use crate::integrate::detection::detect::Found;
use crate::integrate::integrator::Integrator;
use crate::integrate::motion::ModeField;
use crate::mode::Mode;
use crate::switching::{admissible, Leading};
use crate::system::dot;
use crate::tolerances::{EPS, MOST_LISTED, VANISHED};

/// The sliding motion as it was a moment before the jump vanished.
struct Before {
    /// The surface.
    surface: usize,
    /// Its multiplier.
    multiplier: f64,
    velocity: Vec<f64>,
    /// How long a moment is.
    moment: f64,
}

/// A motion that goes on from there.
struct Way {
    mode: Mode,
    multipliers: Vec<f64>,
    /// The rate at which the normal component of the surface grows along it.
    rate: f64,
}

impl Integrator<'_> {
    /// Sliding on several surfaces whose steps shrink to nothing has come to where the jump across one of them vanishes.
    pub(in crate::integrate) fn lost_jump(&mut self) -> Result<Option<Found>, FieldError> {
        let ModeField::Intersection(field) = &self.motion.field else {
            return Ok(None);
        };
        let stability = field.n_exits() - 1;
        let found = Found {
            theta: 0.0,
            functions: smallvec![EventFunction::Exit(stability)],
            touch: false,
        };
        Ok(self.before_jump_vanished()?.map(|_| found))
    }

    /// What follows where the root of sliding on all of `meeting` is lost because the jump across one of them vanishes; `None` if
    /// it is lost for another reason.
    pub(in crate::integrate) fn decide_where_jump_vanishes(
        &mut self,
        event: &Found,
        mode: &Mode,
        meeting: &[usize],
    ) -> Result<Option<Decided>, FieldError> {
        let ModeField::Intersection(field) = &self.motion.field else {
            return Ok(None);
        };
        let is_end_of_root = |function: &EventFunction| match function {
            EventFunction::Exit(index) => {
                !matches!(field.exit(*index), IntersectionExit::Side { .. })
            }
            _ => false,
        };
        if !event.functions.iter().any(is_end_of_root) || meeting.len() > MOST_LISTED {
            return Ok(None);
        }
        let Some(before) = self.before_jump_vanished()? else {
            return Ok(None);
        };
        let ways = self.ways_on(mode, meeting, &before)?;
        // It stays on as many surfaces as it can; where it has to leave, to the side whose field had the larger share.
        let side = if before.multiplier < 0.0 { -1 } else { 1 };
        let preferred = ways.iter().max_by_key(|way| {
            let is_that_side = way.mode.entries()[before.surface] == side;
            (
                way.mode.codimension() == meeting.len(),
                is_that_side,
                way.mode.codimension(),
            )
        });
        let Some(preferred) = preferred.map(|way| way.mode.clone()) else {
            return Ok(None);
        };
        let modes: Vec<Mode> = ways.iter().map(|way| way.mode.clone()).collect();
        let chosen = match modes.as_slice() {
            [only] => only.clone(),
            _ => match self.choose(&[before.surface], preferred, modes) {
                Ok(chosen) => chosen,
                Err(stop) => return Ok(Some(Err(stop))),
            },
        };
        let Some(way) = ways.into_iter().find(|way| way.mode == chosen) else {
            return Ok(None);
        };
        let others: Vec<usize> = meeting
            .iter()
            .copied()
            .filter(|&j| j != before.surface)
            .collect();
        let mut left: Lefts = self.departures(&way.mode, &others, &way.multipliers)?;
        if way.mode.entries()[before.surface] != 0 {
            let leading = Leading {
                order: 2,
                value: way.rate,
            };
            left.push(Left::Surface(before.surface, leading));
        }
        self.decided.multipliers = way.multipliers;
        Ok(Some(Ok((way.mode, left))))
    }

    /// The motion a moment before, if here all normal components of one surface vanish compared with it.
    fn before_jump_vanished(&mut self) -> Result<Option<Before>, FieldError> {
        let (mode, meeting) = (self.motion.mode.clone(), self.motion.sliding().to_vec());
        let moment = EPS.sqrt() * self.t.abs().max(self.t_end - self.t);
        let here = self.corners(&meeting, &mode)?;
        // Here the multipliers may be lost in rounding, and with them the velocity: a moment before they are not.
        let mut velocity = self.stepper.start_derivative().to_vec();
        let mut past = self.x.clone();
        let back = |past: &mut [f64], x: &[f64], velocity: &[f64]| {
            let pairs = past.iter_mut().zip(x.iter().zip(velocity));
            pairs.for_each(|(past, (x, v))| *past = x - moment * v);
        };
        for _ in 0..2 {
            back(&mut past, &self.x, &velocity);
            self.motion
                .field
                .eval(self.t - moment, &mut past, &mut velocity)?;
        }
        let multipliers = self.motion.multipliers();
        if multipliers.len() != meeting.len() || velocity.iter().any(|v| !v.is_finite()) {
            return Ok(None);
        }
        let mut earlier = MeetingFields::new(self.system, &meeting);
        self.stats.n_field_evaluations +=
            earlier.evaluate(self.system, self.t - moment, &past, &mode.signs())?;
        let (Ok(here), Ok(earlier)) = (here.normal_fields(), earlier.normal_fields()) else {
            return Ok(None);
        };
        let vanishes = |row: usize| {
            let sticks = self.system.sticks_at(meeting[row]);
            !sticks && here.row_size(row) <= VANISHED * earlier.row_size(row)
        };
        let found = (0..meeting.len()).find(|&row| vanishes(row));
        Ok(found.map(|row| Before {
            surface: meeting[row],
            multiplier: multipliers[row],
            velocity,
            moment,
        }))
    }

    /// The motions that a moment later lead on, each along its own velocity.
    fn ways_on(
        &mut self,
        mode: &Mode,
        meeting: &[usize],
        before: &Before,
    ) -> Result<Vec<Way>, FieldError> {
        let pairs = self.x.iter().zip(&before.velocity);
        let ahead: Vec<f64> = pairs.map(|(x, v)| x + before.moment * v).collect();
        let mut later = MeetingFields::new(self.system, meeting);
        self.stats.n_field_evaluations +=
            later.evaluate(self.system, self.t + before.moment, &ahead, &mode.signs())?;
        let Ok(fields) = later.normal_fields() else {
            return Ok(Vec::new());
        };
        let mut ways = Vec::new();
        for found in admissible(&fields) {
            let Some(entries) = found.continuation.as_mode() else {
                continue;
            };
            let mut mode = mode.clone();
            for (&j, &entry) in meeting.iter().zip(entries.entries()) {
                mode.set(j, entry);
            }
            let rate = self.rate_along(&mode, &found.multipliers, before)?;
            let side = f64::from(mode.entries()[before.surface]);
            if side == 0.0 || side * rate > 0.0 {
                ways.push(Way {
                    mode,
                    multipliers: found.multipliers,
                    rate,
                });
            }
        }
        Ok(ways)
    }

    /// The rate at which the normal component of the surface grows along the motion in `mode`.
    fn rate_along(
        &mut self,
        mode: &Mode,
        multipliers: &[f64],
        before: &Before,
    ) -> Result<f64, FieldError> {
        let (x, signs, t) = (self.x.clone(), mode.signs(), self.t + before.moment);
        let mut velocity = vec![0.0; x.len()];
        self.velocity_in(mode, multipliers, self.t, &x, &mut velocity)?;
        let pairs = x.iter().zip(&velocity);
        let ahead: Vec<f64> = pairs.map(|(x, v)| x + before.moment * v).collect();
        self.velocity_in(mode, multipliers, t, &ahead, &mut velocity)?;
        let mut gradient = vec![0.0; x.len()];
        let time = self
            .system
            .gradient(before.surface, t, &ahead, &signs, &mut gradient)?;
        Ok((time + dot(&gradient, &velocity)) / before.moment)
    }
}
