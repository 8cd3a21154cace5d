//! Rules look at a few surfaces together. If more of them meet, in groups that do not act on one another, the rules decide each group
//! alone.

use super::point::{Decided, Lefts, Next, Notes, Point, Start};
use super::rule::Meeting;
use super::surroundings::Surroundings;
use crate::cube::newton;
use crate::error::FieldError;
use crate::mode::Mode;
use crate::page::IS_PAGE;
use crate::tolerances::MOST_MEETING;

/// The groups of the surfaces of a meeting; none if rules look at all of them together, or a group is too large.
pub(super) struct Groups<'m> {
    meeting: &'m Meeting<'m>,
    around: &'m Surroundings,
    /// The places of each group in the meeting.
    groups: Vec<Vec<usize>>,
}

/// How the surfaces of one group are decided.
pub(super) type SettleGroup<'s> = &'s dyn Fn(&mut Notes, &Meeting) -> Result<Decided, FieldError>;

impl<'m> Groups<'m> {
    pub fn of(
        at: &Point,
        notes: &mut Notes,
        meeting: &'m Meeting<'m>,
    ) -> Result<Option<Self>, FieldError> {
        if IS_PAGE || meeting.surfaces.len() <= MOST_MEETING {
            return Ok(None);
        }
        let Ok(around) = meeting.surroundings(at, notes)? else {
            return Ok(None);
        };
        let groups = around.fields.independent_parts();
        let are_small = groups.iter().all(|group| group.len() <= MOST_MEETING);
        Ok(are_small.then_some(Groups {
            meeting,
            around,
            groups,
        }))
    }

    /// Is a normal component at a surface of some group not clear of zero?
    pub fn are_doubtful(&self) -> bool {
        let mut groups = self.groups.iter();
        groups.any(|group| self.around.is_doubtful_at(group))
    }

    /// Decides the groups one after the other. Each group knows what the groups before it have chosen.
    pub fn settle(
        &self,
        at: &Point,
        notes: &mut Notes,
        settle: SettleGroup<'_>,
    ) -> Result<Decided, FieldError> {
        // The first round finds where each group goes by itself. The candidates of a group then name these modes of the others.
        let mut first = notes.of_trial();
        first.n_choices = at.policy.choices.len();
        let mut mode = self.meeting.mode.clone();
        for group in &self.groups {
            if let Ok(next) = self.settle_group(&mut first, &mode, group, settle)? {
                mode = next.mode;
            }
        }
        notes.add_costs(&first);
        let (mut start, mut lambda) = (Start::default(), vec![f64::NAN; self.around.fields.m()]);
        let mut all_rest = true;
        for group in &self.groups {
            let next = match self.settle_group(notes, &mode, group, settle)? {
                Ok(next) => next,
                Err(stop) => return Ok(Err(stop)),
            };
            self.take_multipliers(&next, group, &mut lambda);
            let own = next.start.map_or_else(Start::default, |start| *start);
            start.oscillates |= own.oscillates;
            start.is_given |= own.is_given;
            start.is_located |= own.is_located;
            start.leap = start.leap.or(own.leap);
            start.moved = start.moved.or(own.moved);
            all_rest &= own.is_rest;
            mode = next.mode;
        }
        start.is_rest = all_rest;
        let slid = self.meeting.surfaces.iter().zip(&lambda);
        let slid = slid.filter(|(&j, _)| mode.entries()[j] == 0);
        let multipliers: Vec<f64> = slid.map(|(_, &value)| value).collect();
        if multipliers.iter().all(|value| value.is_finite()) {
            start.multipliers = multipliers;
        } else {
            start.is_given = false;
        }
        if let Some(leap) = &mut start.leap {
            // The record says that the motion is in the region of the leap from the start on.
            leap.region = mode.clone();
        }
        Ok(Ok(Next {
            mode,
            left: Lefts::new(),
            start: Some(Box::new(start)),
        }))
    }

    /// Decides a group. The entries of `mode` say where the other surfaces are.
    fn settle_group(
        &self,
        notes: &mut Notes,
        mode: &Mode,
        group: &[usize],
        settle: SettleGroup<'_>,
    ) -> Result<Decided, FieldError> {
        let Meeting {
            surfaces, fresh, ..
        } = self.meeting;
        let own: Vec<usize> = group.iter().map(|&i| surfaces[i]).collect();
        let fresh = own.iter().filter(|j| fresh.contains(j));
        let fresh: Vec<usize> = fresh.copied().collect();
        let mut before = mode.clone();
        for &j in &own {
            before.set(j, self.meeting.mode.entries()[j]);
        }
        settle(
            notes,
            &Meeting::new(&before, &own, &fresh, self.meeting.how),
        )
    }

    /// Writes the multipliers of the surfaces of a group that the motion slides on. They stay NaN if Newton's method finds none.
    fn take_multipliers(&self, next: &Next, group: &[usize], lambda: &mut [f64]) {
        let entry = |i: usize| next.mode.entries()[self.meeting.surfaces[i]];
        let slid: Vec<usize> = group.iter().copied().filter(|&i| entry(i) == 0).collect();
        let found = match next.multipliers() {
            known if known.len() == slid.len() => Some(known.to_vec()),
            _ => {
                let mut held = vec![-1; self.around.fields.m()];
                group.iter().for_each(|&i| held[i] = entry(i));
                newton(&self.around.fields.restrict(&held), &vec![0.0; slid.len()])
            }
        };
        for (&i, value) in slid.iter().zip(found.into_iter().flatten()) {
            lambda[i] = value;
        }
    }
}
