//! Points where several continuations are Filippov solutions: which is taken, and who is told.

use crate::error::FieldError;
use crate::field::eval_on_side;
use crate::integrate::decisions::transition::{Decided, Left};
use crate::integrate::integrator::Integrator;
use crate::integrate::{Stop, Warning, WarningCode};
use crate::mode::Mode;
use crate::options::NonUnique;
use crate::switching::{
    decide_intersection, first_nonzero, normal_component, Decision, Leading, Resolution, Undecided,
};
use crate::system::dot;
use crate::tolerances::DEPARTS_TANGENTIALLY;

/// How the warning begins.
pub(in crate::integrate) const NOT_UNIQUE_AT: &str = "the continuation at ";

impl Integrator<'_> {
    /// The motion after the decision at one surface.
    pub(in crate::integrate) fn follow_at_surface(
        &mut self,
        mode: &Mode,
        j: usize,
        mut decision: Decision,
    ) -> Decided {
        if decision.turns_back() {
            return Err(Stop::InvisibleTwoFold {
                surface: j,
                sliding: decision.two_fold,
            });
        }
        let mut after = mode.with(j, decision.entry);
        if decision.candidates.len() > 1 {
            let candidates = decision.candidates.iter();
            let candidates = candidates.map(|&entry| mode.with(j, entry)).collect();
            after = self.choose(&[j], after, candidates)?;
            decision.entry = after.entries()[j];
        }
        if let Some(motion) = decision.starts_at_two_fold() {
            self.decided.at_two_fold = Some(motion.multiplier());
        }
        Ok((after, Left::after(j, &decision)))
    }

    /// Where the motion in `mode` touches surface j: the first derivative of h along the field beyond, if that
    /// leaves the surface too, or stays on it. Then the solution is not unique.
    pub(in crate::integrate) fn goes_on_beyond(
        &self,
        mode: &Mode,
        j: usize,
        vanishing: [usize; 2],
    ) -> Result<Option<Leading>, FieldError> {
        let (beyond, signs) = (-mode.entries()[j], mode.signs());
        let along = normal_component(self.system, j, j, beyond, self.t, &self.x, &signs)?;
        let mut field = vec![0.0; self.x.len()];
        let mut gradient = field.clone();
        let other = mode.with(j, beyond).signs();
        eval_on_side(self.system, self.t, &self.x, &other, &mut field)?;
        self.system
            .gradient(j, self.t, &self.x, &signs, &mut gradient)?;
        let size = (dot(&field, &field) * dot(&gradient, &gradient)).sqrt();
        // A touch is located to the square root of rounding: a component of that size vanishes.
        let vanishing = vanishing[usize::from(beyond > 0)].max(usize::from(
            along.value.abs() <= DEPARTS_TANGENTIALLY * size,
        ));
        let leading = first_nonzero(self.system, j, beyond, vanishing, self.t, &self.x, &signs)?;
        let goes_on = leading.sign() == beyond || leading.order == 0;
        Ok(goes_on.then_some(leading))
    }

    /// What follows at an intersection of which first-order data do not tell enough: the only mode of codimension 0 or 1 that
    /// attracts. `rest` is a region whose field is at rest, which is a solution in any case.
    pub(in crate::integrate) fn decide_by_higher_order(
        &mut self,
        mode: &Mode,
        meeting: &[usize],
        resolution: Result<Resolution, Undecided>,
        rest: Option<Mode>,
    ) -> Result<Decided, FieldError> {
        let ends = meeting.iter().all(|j| self.motion.sliding().contains(j));
        let decision = decide_intersection(self.system, meeting, mode, ends, (self.t, &self.x))?;
        let only = decision.unique();
        let (after, left) = match (only, rest) {
            (Some((after, left)), rest) => {
                let mut candidates = vec![after.clone()];
                candidates.extend(rest.filter(|rest| rest != after));
                let left = left.iter().map(|&(j, l)| Left::Surface(j, l)).collect();
                let mut chosen = after.clone();
                if candidates.len() > 1 {
                    chosen = match self.choose(meeting, chosen, candidates) {
                        Ok(chosen) => chosen,
                        Err(stop) => return Ok(Err(stop)),
                    };
                }
                match &chosen == after {
                    true => (chosen, left),
                    false => self.rest_in(chosen, meeting)?,
                }
            }
            // What stays on as many surfaces as there are states stays at the point.
            (None, Some(rest))
                if decision.candidates.is_empty() && meeting.len() == self.x.len() =>
            {
                self.rest_in(rest, meeting)?
            }
            _ => {
                if decision.candidates.is_empty() {
                    if let Some(decided) = self.decide_by_trial(mode, meeting)? {
                        return Ok(decided);
                    }
                }
                return Ok(Err(Stop::Intersection {
                    surfaces: meeting.to_vec(),
                    candidates: decision.candidates,
                    reason: resolution.err().unwrap_or(Undecided::NoOutcome),
                }));
            }
        };
        Ok(Ok((after, left)))
    }

    /// The mode that [`crate::Options::choices`] asks for at the next non-unique point.
    pub(in crate::integrate) fn asked(&self) -> Option<&Mode> {
        self.options.choices.get(self.n_choices)
    }

    /// The continuation that is taken among several: the one asked for; else `preferred`, or none at all if the
    /// policy is to stop.
    pub(in crate::integrate) fn choose(
        &mut self,
        surfaces: &[usize],
        preferred: Mode,
        candidates: Vec<Mode>,
    ) -> Result<Mode, Stop> {
        let asked = self.asked().cloned();
        self.n_choices += 1;
        let chosen = match asked {
            Some(asked) if candidates.contains(&asked) => Some(asked),
            Some(_) => None,
            None if self.options.nonunique == NonUnique::Error => None,
            None => Some(preferred),
        };
        let Some(chosen) = chosen else {
            return Err(Stop::NonUnique {
                surfaces: surfaces.to_vec(),
                candidates,
            });
        };
        self.warn_non_unique(surfaces, &chosen, candidates);
        Ok(chosen)
    }

    fn warn_non_unique(&mut self, surfaces: &[usize], chosen: &Mode, mut candidates: Vec<Mode>) {
        let modes: Vec<String> = candidates.iter().map(|m| format!("({m})")).collect();
        let names = surfaces
            .iter()
            .map(|&j| self.system.surface_name(j) + " = 0");
        let names: Vec<String> = names.collect();
        let text = format!(
            "{NOT_UNIQUE_AT}{} is not unique: {}; ({chosen}) was chosen",
            names.join(", "),
            modes.join(", ")
        );
        // The chosen one first, the others in their order.
        candidates.sort_by_key(|mode| mode != chosen);
        self.warnings.push(Warning {
            t: self.t,
            code: WarningCode::NonUnique,
            text,
            candidates,
            surfaces: surfaces.to_vec(),
        });
    }
}
