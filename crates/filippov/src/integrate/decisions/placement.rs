//! Where a motion starts: the mode at a given point, at the start of a run and after actions.

use crate::action::Trigger;
use crate::error::FieldError;
use crate::field::{ContactField, Projector, SmoothField};
use crate::integrate::decisions::transition::{Decided, Left, Lefts};
use crate::integrate::integrator::Integrator;
use crate::integrate::Stop;
use crate::mode::Mode;
use crate::switching::{decide, first_nonzero, Arrival, Leading};
use crate::system::{dot, dot_magnitude, surfaces_that_matter};
use crate::tolerances::{DEPARTS_TANGENTIALLY, SLIPPED, SLOW, SURFACE_NOISE};

/// The sides that a point is on.
pub(in crate::integrate) struct Sides {
    /// No entry is 0.
    pub mode: Mode,
    /// Which surfaces the point lies on, to rounding.
    pub on_surface: Vec<bool>,
}

/// A surface that triggers actions and switches nothing, on which the point lies.
struct Touched {
    surface: usize,
    /// The side from which the action is triggered.
    side: i8,
    /// The first derivative of h that does not vanish.
    leading: Leading,
}

impl Integrator<'_> {
    /// The mode in which a motion goes on from the current point, and what vanishes there. `memory` is the mode
    /// before.
    pub(in crate::integrate) fn place(
        &mut self,
        memory: Option<&Mode>,
    ) -> Result<Decided, FieldError> {
        let Some(Sides { mode, on_surface }) = self.sides(memory)? else {
            return Ok(Err(Stop::NotFinite));
        };
        // What only a law of the system sees has the side that is known: its action has been done, or will be.
        let zeros = (0..on_surface.len()).filter(|&j| on_surface[j] && !self.is_internal(j));
        let (smooth, zeros): (Vec<usize>, Vec<usize>) =
            zeros.partition(|&j| self.is_only_trigger(j));
        let meeting = surfaces_that_matter(self.system, &mode, zeros.clone());
        if !smooth.is_empty() {
            return self.place_on_triggers(mode, &smooth, meeting, memory);
        }
        let decided = self.place_on(mode.clone(), &meeting, memory)?;
        let decided = self.follow_jumps(&mode, &meeting, decided)?;
        let is_new = |j: &usize| memory.is_none_or(|memory| memory.entries()[*j] == 0);
        let inactive = zeros.into_iter().filter(|j| !meeting.contains(j));
        self.take_sides(decided, inactive.filter(is_new))
    }

    /// Gives surfaces that do not matter the sides that a motion in a region moves to.
    fn take_sides(
        &self,
        decided: Decided,
        inactive: impl Iterator<Item = usize>,
    ) -> Result<Decided, FieldError> {
        let Ok((mut after, left)) = decided else {
            return Ok(decided);
        };
        if after.codimension() == 0 {
            let signs = after.signs();
            for j in inactive {
                let side = after.entries()[j];
                let leading = first_nonzero(self.system, j, side, 0, self.t, &self.x, &signs)?;
                if leading.order > 0 {
                    after.set(j, leading.sign());
                }
            }
        }
        Ok(Ok((after, left)))
    }

    /// The mode where these surfaces matter and vanish.
    pub(in crate::integrate) fn place_on(
        &mut self,
        mode: Mode,
        meeting: &[usize],
        memory: Option<&Mode>,
    ) -> Result<Decided, FieldError> {
        match meeting {
            [] => Ok(Ok((mode, Lefts::new()))),
            [j] => {
                // Of several continuations that which stays on its side.
                let arrival = match memory.map(|before| before.entries()[*j]) {
                    Some(side) if side != 0 => Arrival::Region(side),
                    _ => Arrival::Start,
                };
                let signs = mode.signs();
                let decision = decide(self.system, *j, arrival, self.t, &self.x, &signs)?;
                Ok(self.follow_at_surface(&mode, *j, decision))
            }
            _ => {
                let mut left = self.leave_at_bends(&mode, meeting)?;
                if left.is_none() {
                    left = self.leave_along_bends(&mode, meeting)?;
                }
                match left {
                    Some(left) => Ok(Ok(left)),
                    None => {
                        let decided = self.decide_at_start(&mode, meeting)?;
                        self.unless_not_held(decided, meeting)
                    }
                }
            }
        }
    }

    /// Does the surface trigger actions and switch nothing?
    pub(in crate::integrate) fn is_only_trigger(&self, j: usize) -> bool {
        self.actions.at_surface(j).is_some() && !self.system.switches_at(j)
    }

    /// Does the surface trigger nothing but laws of the system, which move no state?
    pub(in crate::integrate) fn is_internal(&self, j: usize) -> bool {
        let mut actions = self.actions.list.iter().filter(
            |action| matches!(action.trigger, Trigger::Surface { index, .. } if index == j),
        );
        let first = actions.next();
        first.is_some_and(|first| first.kind.is_none())
            && actions.all(|action| action.kind.is_none())
            && !self.system.switches_at(j)
    }

    /// Does the surface trigger changes of discrete states by laws of the system only?
    pub(in crate::integrate) fn follows_law(&self, j: usize) -> bool {
        let mut maps = self.actions.list.iter().filter(
            |action| matches!(action.trigger, Trigger::Surface { index, .. } if index == j),
        );
        self.is_only_trigger(j) && maps.all(|action| !action.map.moves_state())
    }

    /// The side of every surface at the current point; a surface that the point lies on has the side of the mode
    /// before, or that which rounding says. `None` if a switching function is not a number.
    pub(in crate::integrate) fn sides(
        &mut self,
        memory: Option<&Mode>,
    ) -> Result<Option<Sides>, FieldError> {
        let d = self.system.n_surfaces();
        let mut mode = Mode::new(vec![1; d]);
        // Switching functions may contain signs of others: repeat until nothing changes.
        let mut on_surface = vec![false; d];
        for _ in 0..=d {
            let before = mode.clone();
            let signs = mode.signs();
            let h = self.surface_values(&signs)?;
            if h.iter().any(|h| h.is_nan()) {
                return Ok(None);
            }
            for j in 0..d {
                let size = self.system.surface_size(j, self.t, &self.x, &signs)?;
                let residual = self.residuals.get(j).copied().unwrap_or(0.0);
                let noise = (SURFACE_NOISE * size).max(2.0 * residual);
                on_surface[j] = h[j].abs() <= noise;
                let known = memory.map_or(0, |memory| memory.entries()[j]);
                if let Some(side) = self.slipped_through(j, h[j], &signs, memory)? {
                    on_surface[j] = true;
                    mode.set(j, side);
                    continue;
                }
                let entry = match known {
                    side if on_surface[j] && side != 0 => side,
                    _ if h[j] < 0.0 => -1,
                    _ => 1,
                };
                mode.set(j, entry);
            }
            if mode == before {
                break;
            }
        }
        Ok(Some(Sides { mode, on_surface }))
    }

    /// The free side of a trigger that the motion came from and that the point lies beyond by less than the
    /// tolerance: errors of jumps to a limit, and of impacts at nearly the same time. It counts as there.
    fn slipped_through(
        &self,
        j: usize,
        h: f64,
        signs: &[f64],
        memory: Option<&Mode>,
    ) -> Result<Option<i8>, FieldError> {
        let is_solid = self.is_only_trigger(j) && !self.is_internal(j);
        let Some(memory) = memory.filter(|_| is_solid) else {
            return Ok(None);
        };
        let side = self.trigger_side(j, Some(memory));
        let came_from = memory.entries()[j] == side || memory.entries()[j] == 0;
        if !came_from || h * f64::from(side) >= 0.0 {
            return Ok(None);
        }
        let mut gradient = vec![0.0; self.x.len()];
        self.system
            .gradient(j, self.t, &self.x, signs, &mut gradient)?;
        let tolerance = self.scale.along(&gradient, &self.x);
        let is_near = h.abs() <= SLIPPED * tolerance;
        Ok((is_near && self.leaves_point_alone(j, signs)?).then_some(side))
    }

    /// Does the action at surface `j` leave h_j as it is, as an impact does? It does not move bodies, but their velocities.
    pub(in crate::integrate) fn leaves_point_alone(
        &self,
        j: usize,
        signs: &[f64],
    ) -> Result<bool, FieldError> {
        let Some((action, _)) = self.actions.at_surface(j) else {
            return Ok(false);
        };
        let (mut moved, mut q) = (self.x.clone(), self.motion.discrete.clone());
        action.map.apply(self.t, &mut moved, signs, &mut q)?;
        let mut h = [(); 2].map(|()| vec![0.0; signs.len()]);
        self.system.surfaces(self.t, &self.x, signs, &mut h[0])?;
        self.system.surfaces(self.t, &moved, signs, &mut h[1])?;
        let size = self.system.surface_size(j, self.t, &self.x, signs)?;
        Ok((h[0][j] - h[1][j]).abs() <= SURFACE_NOISE * size)
    }

    /// Moves the point back onto the triggers that it slipped through.
    pub(in crate::integrate) fn push_back(&mut self, memory: &Mode) -> Result<(), FieldError> {
        let signs = memory.signs();
        let h = self.surface_values(&signs)?;
        let mut beyond = Vec::new();
        for (j, h) in h.iter().enumerate() {
            if self.slipped_through(j, *h, &signs, Some(memory))?.is_some() {
                beyond.push(j);
            }
        }
        if !beyond.is_empty() {
            let mut projector = Projector::new(self.x.len(), self.system.n_surfaces());
            projector.project_onto(self.system, &beyond, self.t, &mut self.x, &signs)?;
        }
        Ok(())
    }

    /// The mode on surfaces of which some trigger actions and switch nothing: contact, where the impact has no
    /// velocity left and the motion would go through; else the side that the motion leads to.
    fn place_on_triggers(
        &mut self,
        mut mode: Mode,
        smooth: &[usize],
        meeting: Vec<usize>,
        memory: Option<&Mode>,
    ) -> Result<Decided, FieldError> {
        let mut touched = Vec::with_capacity(smooth.len());
        let mut contacts = Vec::new();
        for &j in smooth {
            let side = self.trigger_side(j, memory);
            mode.set(j, side);
            let leading = self.leading_along(j, &mode, &meeting, memory)?;
            let is_slow = leading.order == 1 && self.is_slow(j, leading.value, &mode)?;
            let is_still = leading.order != 1 || is_slow;
            let stays = leading.sign() != side || is_slow;
            if is_still && stays && self.can_stay(j, &mode)? {
                contacts.push(j);
                continue;
            }
            let came_from = memory.map_or(side, |memory| memory.entries()[j]);
            let crosses = self.passing.contains(&j) || came_from == -side;
            if leading.sign() == -side && !crosses {
                // Its action comes first: the next event is here.
                continue;
            }
            if leading.order > 0 {
                mode.set(j, leading.sign());
            }
            touched.push(Touched {
                surface: j,
                side,
                leading,
            });
        }
        let decided = if contacts.is_empty() {
            self.place_on(mode, &meeting, memory)?
        } else {
            self.place_in_contact(mode, &contacts, &meeting, &[])?
        };
        Ok(decided.map(|(mode, mut left)| {
            let departing = touched.iter().filter(|touched| {
                let entry = mode.entries()[touched.surface];
                touched.leading.sign() == entry || touched.side == entry
            });
            left.extend(departing.map(|t| Left::Surface(t.surface, t.leading)));
            (mode, left)
        }))
    }

    /// The first derivative of h_j that does not vanish along the motion that follows on the surfaces of `meeting`.
    pub(in crate::integrate) fn leading_along(
        &mut self,
        j: usize,
        mode: &Mode,
        meeting: &[usize],
        memory: Option<&Mode>,
    ) -> Result<Leading, FieldError> {
        let (side, mut after) = (mode.entries()[j], mode.clone());
        if !meeting.is_empty() {
            // A trial: what is not unique is told when it is decided.
            let (n_warnings, n_choices) = (self.warnings.len(), self.n_choices);
            let decided = self.place_on(mode.clone(), meeting, memory)?;
            self.warnings.truncate(n_warnings);
            self.n_choices = n_choices;
            let multipliers = std::mem::take(&mut self.decided).multipliers;
            if let Ok((decided, _)) = decided {
                after = decided;
            }
            if after.codimension() > 0 {
                if let Some(value) = self.rate_in(j, &after, &multipliers)? {
                    return Ok(Leading { order: 1, value });
                }
            }
        }
        first_nonzero(self.system, j, side, 0, self.t, &self.x, &after.signs())
    }

    /// The rate of h_j along sliding in a mode, where that is not tangent to it.
    fn rate_in(
        &mut self,
        j: usize,
        after: &Mode,
        multipliers: &[f64],
    ) -> Result<Option<f64>, FieldError> {
        let (x, mut velocity) = (self.x.clone(), vec![0.0; self.x.len()]);
        self.velocity_in(after, multipliers, self.t, &x, &mut velocity)?;
        let mut gradient = vec![0.0; x.len()];
        let signs = after.signs();
        let ht = self
            .system
            .gradient(j, self.t, &self.x, &signs, &mut gradient)?;
        let rate = ht + dot(&gradient, &velocity);
        let size = ht.abs() + dot_magnitude(&gradient, &velocity);
        Ok((rate.abs() > DEPARTS_TANGENTIALLY * size).then_some(rate))
    }

    /// The side from which the action at surface `j` is triggered.
    pub(in crate::integrate) fn trigger_side(&self, j: usize, memory: Option<&Mode>) -> i8 {
        let known = memory.map_or(0, |memory| memory.entries()[j]);
        let last = if known == 0 {
            self.motion.sides[j]
        } else {
            known
        };
        self.actions.trigger_side(j, last)
    }

    /// Is this speed at surface j below the tolerance?
    pub(in crate::integrate) fn is_slow(
        &self,
        j: usize,
        speed: f64,
        mode: &Mode,
    ) -> Result<bool, FieldError> {
        let mut row = vec![0.0; self.x.len()];
        self.system
            .rate_gradient(j, self.t, &self.x, &mode.signs(), &mut row)?;
        let tolerance = self.scale.along(&row, &self.x);
        Ok(speed.abs() <= SLOW * tolerance)
    }

    /// Can a body stay in contact at h_j = 0? The action there leaves the point alone and acts on the velocity.
    pub(in crate::integrate) fn can_stay(&self, j: usize, mode: &Mode) -> Result<bool, FieldError> {
        let side = mode.entries()[j];
        let Some(action) = self.actions.from_side(j, side) else {
            return Ok(false);
        };
        let (mut moved, mut q) = (self.x.clone(), self.motion.discrete.clone());
        action
            .map
            .apply(self.t, &mut moved, &mode.signs(), &mut q)?;
        let size = dot(&self.x, &self.x).sqrt();
        let shift: Vec<f64> = moved.iter().zip(&self.x).map(|(m, x)| m - x).collect();
        if q != self.motion.discrete || dot(&shift, &shift).sqrt() > 1e-9 * (1.0 + size) {
            return Ok(false);
        }
        let resting = mode.with(j, 0);
        let mut sides = self.motion.sides.clone();
        sides[j] = side;
        let discrete = &self.motion.discrete;
        let Some(mut field) =
            ContactField::new(self.system, self.actions, &resting, &sides, discrete)
        else {
            return Ok(false);
        };
        let (mut x, mut dx) = (self.x.clone(), vec![0.0; self.x.len()]);
        field.eval(self.t, &mut x, &mut dx)?;
        Ok(dx.iter().all(|v| v.is_finite()))
    }
}
