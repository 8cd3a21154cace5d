//! More surfaces than rules look at together, in groups that do not act on one another: each group by its own rules.

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

    /// What follows, one group after the other. A choice of one is known to the next.
    pub fn settle(
        &self,
        at: &Point,
        notes: &mut Notes,
        settle: SettleGroup<'_>,
    ) -> Result<Decided, FieldError> {
        // The candidates of a group have the others where these go if no choice is asked for.
        let mut first = notes.of_trial();
        first.n_choices = at.policy.choices.len();
        let mut mode = self.meeting.mode.clone();
        for group in &self.groups {
            if let Ok(next) = self.settle_group(&mut first, &mode, group, settle)? {
                mode = next.mode;
            }
        }
        notes.add_costs(&first);
        // As a guess 0 does for a group that is affine.
        let (mut start, mut lambda) = (Start::default(), vec![0.0; self.around.fields.m()]);
        for group in &self.groups {
            let next = match self.settle_group(notes, &mode, group, settle)? {
                Ok(next) => next,
                Err(stop) => return Ok(Err(stop)),
            };
            let entries = next.mode.entries();
            let slid = group
                .iter()
                .filter(|&&i| entries[self.meeting.surfaces[i]] == 0);
            slid.zip(next.multipliers())
                .for_each(|(&i, value)| lambda[i] = *value);
            if let Some(own) = next.start {
                start.oscillates |= own.oscillates;
                start.is_given |= own.is_given;
                start.is_located |= own.is_located;
                start.leap = start.leap.or(own.leap);
                start.moved = start.moved.or(own.moved);
            }
            mode = next.mode;
        }
        let entries = self.meeting.surfaces.iter().map(|&j| mode.entries()[j]);
        let entries: Vec<i8> = entries.collect();
        let slid = (0..entries.len()).filter(|&i| entries[i] == 0);
        let guess: Vec<f64> = slid.map(|i| lambda[i]).collect();
        let face = self.around.fields.restrict(&entries);
        start.multipliers = match start.is_given {
            true => guess,
            false => newton(&face, &guess).unwrap_or_default(),
        };
        if let Some(leap) = &mut start.leap {
            // The motion is said to be in the region of the leap from the start on.
            leap.region = mode.clone();
        }
        Ok(Ok(Next {
            mode,
            left: Lefts::new(),
            start: Some(Box::new(start)),
        }))
    }

    /// What follows on a group, the other surfaces being where a mode says.
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
}
