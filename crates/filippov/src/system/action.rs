//! Actions: what changes the state, or a discrete state, in an instant.
//!
//! A run has, beside x, a vector q of *discrete states* that the functions of a system read like parameters:
//! constant between actions. An action has a trigger (a switching function and a direction, known times, or a
//! clock) and a map (t, x, s, q) -> (x+, q+). Impacts, impulses, sampled controllers, relays with hysteresis and
//! quantisers are all made of these.

use super::Clock;
use crate::error::FieldError;
use crate::switch::Kind;
use crate::system::{dot, TracedSystem};

/// When an action happens.
#[derive(Clone, Debug, PartialEq)]
pub enum Trigger {
    /// The motion reaches h_j = 0.
    Surface {
        /// The surface j.
        index: usize,
        /// -1: from the side h > 0; +1: from h < 0; 0: from both.
        direction: i8,
        /// +1 or -1: the side of a start on the surface, if the direction is 0.
        side: i8,
    },
    /// At these times, in increasing order. They are ends of steps and never searched for.
    Times(Vec<f64>),
    /// At the ticks of a clock, ends of steps too.
    Clock {
        /// The clock.
        clock: Clock,
        /// Does a tick at the start of the run count?
        at_start: bool,
    },
    /// After the other actions of an instant, before it is asked what these have triggered.
    Jump,
}

/// What an action does.
///
/// Duties of an implementer:
///
/// 1. [`apply`](Self::apply) is pure: the same arguments give the same bits.
/// 2. A map that leaves x and q as they are is allowed.
pub trait ActionMap: Sync {
    /// Changes the state x and the discrete states q; `signs` are those of the motion that ends here.
    ///
    /// # Errors
    /// If a function of the user raises.
    fn apply(&self, t: f64, x: &mut [f64], signs: &[f64], q: &mut [f64]) -> Result<(), FieldError>;

    /// Does it change x? A map that says no changes discrete states only, so that its surface becomes positive again.
    fn moves_state(&self) -> bool {
        true
    }

    /// The expressions of the new state, as the field of a system, if the map is traced.
    fn expressions(&self) -> Option<&TracedSystem> {
        None
    }

    /// The law whose discrete state it changes, if it is the action of a law.
    fn law(&self) -> Option<usize> {
        None
    }

    /// Brings discrete states that are functions of the point up to date, which were not watched; nothing by default.
    fn follow(&self, _t: f64, _x: &[f64], _signs: &[f64], _q: &mut [f64]) {}

    /// Writes the derivative of x+ - x in the direction `along`, on the side of kinks to which that leads: the direction of the
    /// impulse, where the map leaves x alone at zero speed. By differences unless overridden.
    ///
    /// # Errors
    /// If a function of the user raises.
    fn impulse(
        &self,
        t: f64,
        x: &[f64],
        along: &[f64],
        signs: &[f64],
        q: &[f64],
        impulse: &mut [f64],
    ) -> Result<(), FieldError> {
        impulse_by_differences(self, (t, x), along, signs, q, impulse)
    }
}

impl<F: Fn(f64, &mut [f64], &mut [f64]) + Sync> ActionMap for F {
    fn apply(&self, t: f64, x: &mut [f64], _: &[f64], q: &mut [f64]) -> Result<(), FieldError> {
        self(t, x, q);
        Ok(())
    }
}

/// The change of x by the map, at a point and at two beside it, on one side. Maps that are linear in the velocity, as
/// almost all are, have no error but rounding, however long the way between the points.
fn impulse_by_differences<M: ActionMap + ?Sized>(
    map: &M,
    (t, x): (f64, &[f64]),
    along: &[f64],
    signs: &[f64],
    q: &[f64],
    impulse: &mut [f64],
) -> Result<(), FieldError> {
    const STEP: f64 = 1e-3;
    let norm = dot(along, along).sqrt();
    let d = STEP / if norm > 0.0 { norm } else { 1.0 };
    let change = |scale: f64| -> Result<Vec<f64>, FieldError> {
        let start: Vec<f64> = x.iter().zip(along).map(|(x, a)| x + scale * a).collect();
        let (mut end, mut q) = (start.clone(), q.to_vec());
        map.apply(t, &mut end, signs, &mut q)?;
        Ok(end.iter().zip(&start).map(|(e, s)| e - s).collect())
    };
    let (here, near, far) = (change(0.0)?, change(d)?, change(2.0 * d)?);
    for (i, out) in impulse.iter_mut().enumerate() {
        *out = (4.0 * (near[i] - here[i]) - (far[i] - here[i])) / (2.0 * d);
    }
    Ok(())
}

/// Something that happens in an instant.
#[derive(Clone)]
pub struct Action<'a> {
    /// When.
    pub trigger: Trigger,
    /// What.
    pub map: &'a dyn ActionMap,
    /// The name in tables and messages.
    pub name: String,
    /// How it is recorded: [`Kind::Reset`] or [`Kind::Clock`]; an action that changes nothing but the way
    /// in which the same field is written is not recorded.
    pub kind: Option<Kind>,
}

/// An action that is done in an instant, and what it is done on.
#[derive(Clone, Debug)]
pub struct Act {
    /// The place of the action in the list.
    pub index: usize,
    /// The state before.
    pub x: Vec<f64>,
    /// The discrete states before.
    pub discrete: Vec<f64>,
}

/// The actions of a run, and the discrete states at its start.
#[derive(Default)]
pub struct Actions<'a> {
    /// In the order in which they are done where several happen at one instant.
    pub list: Vec<Action<'a>>,
    /// The discrete states q.
    pub discrete: Vec<f64>,
}

impl Actions<'_> {
    /// No actions.
    pub const fn none() -> Self {
        Actions {
            list: Vec::new(),
            discrete: Vec::new(),
        }
    }

    /// The first action that surface `j` triggers, and the direction of all of them: 0 if they have several.
    pub fn at_surface(&self, j: usize) -> Option<(&Action<'_>, i8)> {
        let mut found = self.all_at_surface(j);
        let (first, direction, _) = found.next()?;
        let is_same = found.all(|(_, other, _)| other == direction);
        Some((first, if is_same { direction } else { 0 }))
    }

    /// The actions, by their place in the list, that follow every jump.
    pub fn after_jumps(&self) -> impl Iterator<Item = usize> + '_ {
        let list = self.list.iter().enumerate();
        list.filter(|(_, action)| action.trigger == Trigger::Jump)
            .map(|(index, _)| index)
    }

    /// The side of surface `j` from which its actions are triggered; where both sides do, the side `last` on which
    /// the motion is, or was last.
    pub fn trigger_side(&self, j: usize, last: i8) -> i8 {
        match self.at_surface(j) {
            Some((_, direction)) if direction != 0 => -direction,
            _ => last,
        }
    }

    /// The actions that surface `j` triggers for a motion from `side`, in order; if there are none, those from the other side.
    pub fn from_side(&self, j: usize, side: i8) -> impl Iterator<Item = &Action<'_>> {
        let meant = move |direction: i8| direction == 0 || direction == -side;
        let is_any = self
            .all_at_surface(j)
            .any(|(_, direction, _)| meant(direction));
        let found = self.all_at_surface(j);
        found.filter_map(move |(action, direction, _)| {
            (!is_any || meant(direction)).then_some(action)
        })
    }

    /// The actions, by their place in the list, that surface `j` triggers for a motion that comes from `side`.
    pub fn triggered_at(&self, j: usize, side: i8) -> impl Iterator<Item = usize> + '_ {
        let fires = move |trigger: &Trigger| match trigger {
            Trigger::Surface {
                index, direction, ..
            } => *index == j && (*direction == 0 || *direction == -side),
            _ => false,
        };
        let list = self.list.iter().enumerate();
        list.filter(move |(_, action)| fires(&action.trigger))
            .map(|(index, _)| index)
    }

    /// The side of each of `n` surfaces on which a start counts that lies on it: that of the first action there, else +1.
    pub fn sides_at_start(&self, n: usize) -> impl Iterator<Item = i8> + '_ {
        let side = move |j| self.all_at_surface(j).next().map_or(1, |(.., side)| side);
        (0..n).map(side)
    }

    /// The actions that surface `j` triggers, with direction and side.
    fn all_at_surface(&self, j: usize) -> impl Iterator<Item = (&Action<'_>, i8, i8)> {
        self.list
            .iter()
            .filter_map(move |action| match action.trigger {
                Trigger::Surface {
                    index,
                    direction,
                    side,
                } if index == j => Some((action, direction, side)),
                _ => None,
            })
    }
}
