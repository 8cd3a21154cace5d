//! Where surfaces meet: what follows at an intersection, from the switching stage.

use crate::error::FieldError;
use crate::event::EventFunction;
use crate::field::{IntersectionExit, MeetingFields};
use crate::integrate::decisions::spiral::Leap;
use crate::integrate::decisions::transition::Decided;
use crate::integrate::detection::detect::Found;
use crate::integrate::integrator::Integrator;
use crate::integrate::motion::{Law, ModeField};
use crate::integrate::Stop;
use crate::mode::Mode;
use crate::switching::{
    admissible, decide, has_one_mode_only, merged_root, region_at_rest, resolve, Arrival,
    Continuation, ExitKind, Incoming, NormalFields, Resolution, Undecided,
};
use crate::tolerances::{DRIFT_SHARE, EPS, MOST_LISTED, MOST_MEETING};

/// The root at which a motion on an intersection begins.
#[derive(Default)]
pub(in crate::integrate) struct DecidedRoot {
    /// The multipliers; none if they are not known.
    pub multipliers: Vec<f64>,
    /// The regularised motion oscillates around it.
    pub oscillates: bool,
    /// The multiplier of sliding on one surface that begins at a two-fold.
    pub at_two_fold: Option<f64>,
    /// The motion begins with the laps of an outward spiral.
    pub leap: Option<Leap>,
}

impl Integrator<'_> {
    /// What follows where the surfaces of `meeting` vanish; `fresh` are those among them that were reached now.
    pub(in crate::integrate) fn decide_at_intersection(
        &mut self,
        event: &Found,
        mode: &Mode,
        meeting: &[usize],
        fresh: &[usize],
    ) -> Result<Decided, FieldError> {
        let without_kinks = self.decide_without_kinks(mode, meeting, |this, others| {
            let is_other = |j: &usize| others.contains(j);
            let fresh: Vec<usize> = fresh.iter().copied().filter(is_other).collect();
            this.decide_at_intersection(event, mode, others, &fresh)
        })?;
        if let Some(decided) = without_kinks {
            return Ok(decided);
        }
        if let Some(decided) = self.decide_apart(mode, meeting)? {
            return Ok(decided);
        }
        if let Some(decided) = self.decide_where_two_touch(mode, meeting)? {
            return Ok(decided);
        }
        let decided = self.decide_with_static_friction(event, mode, meeting, fresh)?;
        self.decide_with_kinetic_friction(decided, meeting)
    }

    /// Where a body has broken away, or has not been held, its friction is the kinetic one: what the other surfaces do
    /// is decided once more.
    fn decide_with_kinetic_friction(
        &mut self,
        decided: Decided,
        meeting: &[usize],
    ) -> Result<Decided, FieldError> {
        let Ok((after, left)) = decided else {
            return Ok(decided);
        };
        let slips = |j: &usize| self.system.sticks_at(*j) && after.entries()[*j] != 0;
        let (slipping, others): (Vec<usize>, Vec<usize>) = meeting.iter().partition(|j| slips(j));
        if slipping.is_empty() || others.is_empty() {
            return Ok(Ok((after, left)));
        }
        let multipliers = std::mem::take(&mut self.decided);
        Ok(match self.place_on(after.clone(), &others, Some(&after))? {
            Ok((again, _)) if again != after => {
                self.decided = DecidedRoot::default();
                let left = self.departures(&again, meeting, &[])?;
                Ok((again, left))
            }
            _ => {
                self.decided = multipliers;
                Ok((after, left))
            }
        })
    }

    fn decide_with_static_friction(
        &mut self,
        event: &Found,
        mode: &Mode,
        meeting: &[usize],
        fresh: &[usize],
    ) -> Result<Decided, FieldError> {
        if fresh.is_empty() && self.slides_by_rule() {
            return self.leave_by_rule(mode, meeting);
        }
        if fresh.is_empty() {
            let decided = self.decide_where_jump_vanishes(event, mode, meeting)?;
            if let Some(decided) = decided {
                return Ok(decided);
            }
        }
        if let Some(decided) = self.decide_by_relay(Some(event), mode, meeting)? {
            return Ok(decided);
        }
        if let Some(stop) = self.too_many(meeting) {
            return Ok(Err(stop));
        }
        let corners = self.corners(meeting, mode)?;
        let mut others = Vec::new();
        let resolution = match corners.normal_fields() {
            Ok(fields) => {
                let incoming = self.incoming(event, mode, fresh, (&corners, &fields))?;
                others = other_solutions(&fields, &incoming);
                let kappa = self.kappa(meeting);
                match resolve(&fields, &incoming, &kappa) {
                    // The last of many turns is within rounding of all surfaces: its region leads past one of
                    // them, and has no meaning any more.
                    Err(Undecided::NotArriving { .. })
                        if matches!(incoming, Incoming::Corner { .. }) =>
                    {
                        resolve(&fields, &Incoming::Start, &kappa)
                    }
                    decided => decided,
                }
            }
            Err(undecided) => Err(undecided),
        };
        self.follow(mode, meeting, &corners, resolution, &others)
    }

    /// What follows at a start where the surfaces of `meeting` vanish.
    pub(in crate::integrate) fn decide_at_start(
        &mut self,
        mode: &Mode,
        meeting: &[usize],
    ) -> Result<Decided, FieldError> {
        let without_kinks = self.decide_without_kinks(mode, meeting, |this, others| {
            this.decide_at_start(mode, others)
        })?;
        if let Some(decided) = without_kinks {
            return Ok(decided);
        }
        if let Some(decided) = self.decide_apart(mode, meeting)? {
            return Ok(decided);
        }
        if let Some(decided) = self.decide_by_relay(None, mode, meeting)? {
            return Ok(decided);
        }
        if let Some(stop) = self.too_many(meeting) {
            return Ok(Err(stop));
        }
        let corners = self.corners(meeting, mode)?;
        let resolution = corners
            .normal_fields()
            .and_then(|fields| resolve(&fields, &Incoming::Start, &self.kappa(meeting)));
        self.follow(mode, meeting, &corners, resolution, &[])
    }

    /// More surfaces whose signs multiply one another than all of whose fields can be looked at.
    fn too_many(&self, meeting: &[usize]) -> Option<Stop> {
        let groups = self.system.sign_groups(meeting).into_iter();
        let surfaces = groups
            .filter(|group| group.len() > MOST_MEETING)
            .max_by_key(Vec::len)?;
        Some(Stop::Intersection {
            reason: Undecided::TooMany { n: surfaces.len() },
            surfaces,
            candidates: Vec::new(),
        })
    }

    /// All fields around the current point of an intersection.
    pub(in crate::integrate) fn corners(
        &mut self,
        meeting: &[usize],
        mode: &Mode,
    ) -> Result<MeetingFields, FieldError> {
        let mut corners = MeetingFields::new(self.system, meeting);
        self.stats.n_field_evaluations +=
            corners.evaluate(self.system, self.t, &self.x, &mode.signs())?;
        Ok(corners)
    }

    /// The scaling of the surfaces of an intersection in the regularisation that decides.
    pub(in crate::integrate) fn kappa(&self, meeting: &[usize]) -> Vec<f64> {
        Law::from(self.options).scaling(meeting)
    }

    /// How the motion came to the intersection.
    fn incoming(
        &mut self,
        event: &Found,
        mode: &Mode,
        fresh: &[usize],
        (corners, fields): (&MeetingFields, &NormalFields),
    ) -> Result<Incoming, FieldError> {
        let meeting = corners.set();
        let entries: Vec<i8> = meeting.iter().map(|&j| mode.entries()[j]).collect();
        if self.motion.sliding().is_empty() {
            return Ok(Incoming::Corner { region: entries });
        }
        self.motion.field.exits(self.t, &mut self.x)?;
        let multipliers = match &self.motion.field {
            ModeField::Intersection(field) => field.tracked(self.t).to_vec(),
            _ => self.motion.multipliers().into_vec(),
        };
        let exit = event.functions.iter().find_map(|function| match function {
            EventFunction::Exit(index) => Some(*index),
            _ => None,
        });
        match (exit, &self.motion.field) {
            (Some(index), ModeField::Intersection(field)) if fresh.is_empty() => {
                let kind = match field.exit(index) {
                    IntersectionExit::Side { .. } => ExitKind::Side,
                    IntersectionExit::Fold => ExitKind::Fold,
                    IntersectionExit::Stability => ExitKind::Stability,
                };
                let mut lambda = multipliers;
                if let IntersectionExit::Side { position, end } = field.exit(index) {
                    lambda[position] = f64::from(end);
                }
                if kind == ExitKind::Fold && meeting.len() > 2 {
                    let merged = merged_root(fields, &lambda);
                    lambda = merged.map_or(lambda, |merged| merged.lambda);
                }
                let drift = self.drift(mode, corners, fields, &lambda)?;
                Ok(Incoming::Exit {
                    kind,
                    lambda,
                    drift: Some(drift),
                })
            }
            _ => Ok(Incoming::Face {
                mode: entries,
                multipliers,
            }),
        }
    }

    /// The rate at which the normal components change along the motion at fixed multipliers.
    fn drift(
        &mut self,
        mode: &Mode,
        corners: &MeetingFields,
        fields: &NormalFields,
        lambda: &[f64],
    ) -> Result<Vec<f64>, FieldError> {
        let meeting = corners.set();
        let (mut velocity, mut weights) = (vec![0.0; self.x.len()], Vec::new());
        corners.fill_product_weights(lambda, &mut weights);
        corners.combine(&weights, &mut velocity);
        // Towards a fold steps shrink to nothing.
        let shortest = EPS.sqrt() * self.t.abs().max(self.t_end - self.t);
        let dt = (DRIFT_SHARE * self.stepper.interpolant().dt).max(shortest);
        let pairs = self.x.iter().zip(&velocity);
        let ahead: Vec<f64> = pairs.map(|(x, v)| x + dt * v).collect();
        let mut corners = MeetingFields::new(self.system, meeting);
        self.stats.n_field_evaluations +=
            corners.evaluate(self.system, self.t + dt, &ahead, &mode.signs())?;
        let (now, then) = (fields.interpolate(lambda), corners.normal_fields());
        Ok(match then {
            Ok(then) => {
                let pairs = then.interpolate(lambda).into_iter().zip(now);
                pairs.map(|(then, now)| (then - now) / dt).collect()
            }
            Err(_) => vec![f64::NAN; meeting.len()],
        })
    }

    /// Turns a resolution into the motion that follows. Where first-order data do not decide, the first
    /// derivatives that do not vanish may still leave only one way. `others` are further Filippov solutions.
    fn follow(
        &mut self,
        mode: &Mode,
        meeting: &[usize],
        fields: &MeetingFields,
        resolution: Result<Resolution, Undecided>,
        others: &[Continuation],
    ) -> Result<Decided, FieldError> {
        let rest = region_at_rest(self.system, fields, mode, self.t, &self.x)?;
        let resolution = match resolution {
            Ok(resolution) if !resolution.degenerate => resolution,
            // Both say the same, and vanish somewhere in between: higher derivatives do not make them two.
            Err(Undecided::Proportional)
                if fields.telling().len() == meeting.len()
                    && rest.is_none()
                    && !fields.lead_to_one_side() =>
            {
                return Ok(Err(Stop::Intersection {
                    surfaces: meeting.to_vec(),
                    candidates: Vec::new(),
                    reason: Undecided::Proportional,
                }));
            }
            other => return self.decide_by_higher_order(mode, meeting, other, rest),
        };
        let on_all = |k: &Mode| {
            let mut full = mode.clone();
            for (&j, &entry) in meeting.iter().zip(k.entries()) {
                full.set(j, entry);
            }
            full
        };
        let mut candidates: Vec<Mode> = Vec::new();
        for mode in resolution.candidates.iter().chain(others) {
            let mode = mode.as_mode().map(on_all);
            candidates.extend(mode.filter(|mode| !candidates.contains(mode)));
        }
        candidates.extend(rest.clone().filter(|mode| !candidates.contains(mode)));
        let is_spiral = matches!(resolution.chosen, Some(Continuation::OutwardSpiral));
        let asked = self.asked().filter(|asked| candidates.contains(asked));
        let (mut after, leap) = match &resolution.chosen {
            Some(Continuation::Mode(chosen)) => (on_all(chosen), None),
            Some(Continuation::OutwardSpiral) => match asked {
                Some(asked) => (asked.clone(), None),
                None => match self.outward_leap(meeting, mode, fields)? {
                    Some(leap) => (leap.region.clone(), Some(leap)),
                    None => {
                        return self.decide_by_higher_order(mode, meeting, Ok(resolution), rest)
                    }
                },
            },
            None => return self.decide_by_higher_order(mode, meeting, Ok(resolution), rest),
        };
        let preferred = after.clone();
        if !resolution.unique || is_spiral || candidates.len() > 1 {
            if !candidates.contains(&after) {
                candidates.push(after.clone());
            }
            after = match self.choose(meeting, after, candidates) {
                Ok(after) => after,
                Err(stop) => return Ok(Err(stop)),
            };
        }
        let multipliers: &[f64] = if after == preferred && !is_spiral {
            &resolution.multipliers
        } else {
            &[]
        };
        if let Some(decided) = self.decide_at_tangency(&after, meeting)? {
            return Ok(decided);
        }
        let left = match &leap {
            Some(leap) => self.departures_after(leap)?,
            None => self.departures(&after, meeting, multipliers)?,
        };
        self.decided = DecidedRoot {
            multipliers: multipliers.to_vec(),
            oscillates: after == preferred && resolution.oscillates,
            at_two_fold: None,
            leap,
        };
        Ok(Ok((after, left)))
    }

    /// Where the motion is to slide on one of the surfaces and both of its fields are tangent there: what higher
    /// derivatives say of that surface.
    fn decide_at_tangency(
        &mut self,
        after: &Mode,
        meeting: &[usize],
    ) -> Result<Option<Decided>, FieldError> {
        let mut slid_on = after.sliding_set();
        let (Some(j), None) = (slid_on.next(), slid_on.next()) else {
            return Ok(None);
        };
        let decision = decide(
            self.system,
            j,
            Arrival::Start,
            self.t,
            &self.x,
            &after.signs(),
        )?;
        let is_tangent = decision.minus.order != 1 && decision.plus.order != 1;
        if !is_tangent || decision.entry == 0 || self.system.sticks_at(j) {
            return Ok(None);
        }
        let (after, mut left) = match self.follow_at_surface(after, j, decision) {
            Ok(followed) => followed,
            Err(stop) => return Ok(Some(Err(stop))),
        };
        let others: Vec<usize> = meeting.iter().copied().filter(|&k| k != j).collect();
        left.extend(self.departures(&after, &others, &[])?);
        Ok(Some(Ok((after, left))))
    }
}

/// All attracting continuations at an intersection that is reached, whatever the regularisation selects: Filippov
/// solutions, and several if the solution is not unique. Not looked for where many surfaces meet.
fn other_solutions(fields: &NormalFields, incoming: &Incoming) -> Vec<Continuation> {
    let is_exit = matches!(incoming, Incoming::Exit { .. });
    if is_exit || fields.m() > MOST_LISTED || has_one_mode_only(fields) {
        return Vec::new();
    }
    let found = admissible(fields).into_iter();
    found.map(|found| found.continuation).collect()
}
