//! The returns of a run to its section, taken down as it goes on.

use std::collections::VecDeque;

use super::cycle::Cycle;
use super::returns::{Return, Returns};
use super::{Place, Section};
use crate::mode::Mode;
use crate::motion::Piece;
use crate::status::Stop;
use crate::switch::Kind;
use crate::switch::Switch;
use crate::system::Clock;
use crate::tolerances::SAME_TICK;

/// Watches a run; the recorder tells it what happens.
pub(crate) struct Visits {
    surface: Option<(usize, i8, Option<Kind>)>,
    /// The clock and its next tick.
    clock: Option<(Clock, f64)>,
    transient: u64,
    most: u64,
    cycle: Option<Cycle>,
    returns: Returns,
    /// The last returns, as many as the test of periodicity needs and at least one: the oldest makes room for the next.
    latest: VecDeque<Return>,
    remembered: usize,
    /// Time of the start, and of the last return.
    t_start: f64,
    t_return: f64,
    /// Since when the mode is what it is, or since the last return.
    since: f64,
    slides: bool,
    slid: f64,
    modes: Vec<Mode>,
    has_ended: bool,
    is_periodic: bool,
    /// The present piece, if pieces are kept.
    piece: Option<Piece>,
}

impl Visits {
    pub fn new(section: &Section, t_start: f64) -> Self {
        let surface = match section.place {
            Place::Surface {
                index,
                direction,
                kind,
            } => Some((index, direction, kind)),
            _ => None,
        };
        let clock = match section.place {
            Place::Ticks(clock) => Some((clock, clock.last_up_to(t_start) + 1.0)),
            _ => None,
        };
        let longest = section.cycle.as_ref().map_or(0, |cycle| cycle.longest);
        Visits {
            surface,
            clock,
            transient: section.transient,
            most: section.most,
            cycle: section.cycle.clone(),
            returns: Returns::default(),
            latest: VecDeque::new(),
            remembered: longest.saturating_mul(4).max(1),
            t_start,
            t_return: t_start,
            since: t_start,
            slides: false,
            slid: 0.0,
            modes: Vec::new(),
            has_ended: section.most == 0,
            is_periodic: false,
            piece: section.keeps_pieces.then(Piece::default),
        }
    }

    /// The next tick, if the section is a clock.
    pub fn next_tick(&self) -> Option<f64> {
        self.clock.map(|(clock, tick)| clock.time(tick))
    }

    /// Is the next tick reached at `t`, up to rounding?
    pub fn has_tick_up_to(&self, t: f64) -> bool {
        self.next_tick()
            .is_some_and(|tick| tick <= t + SAME_TICK * t.abs())
    }

    /// Goes on to the tick after the next one, `k` ticks further on; returns its time.
    pub fn tick_after(&self, k: usize) -> Option<f64> {
        self.clock.map(|(clock, tick)| clock.time(tick + k as f64))
    }

    /// A tick was recorded.
    pub fn pass_tick(&mut self) {
        if let Some((_, tick)) = &mut self.clock {
            *tick += 1.0;
        }
    }

    /// A piece of constant mode begins.
    pub fn begin(&mut self, t: f64, mode: &Mode) {
        self.pass_time(t);
        // A piece of zero duration is dropped: the next mode takes its place.
        match self.modes.last_mut() {
            Some(last) if t <= self.since => *last = mode.clone(),
            _ => self.modes.push(mode.clone()),
        }
        self.since = t;
        self.slides = mode.codimension() > 0;
    }

    /// The piece that begins, if pieces are kept.
    pub fn set_piece(&mut self, mode: &Mode, near: &[f64], discrete: &[f64]) {
        let Some(piece) = &mut self.piece else {
            return;
        };
        piece.sides.resize(mode.entries().len(), 0);
        let entries = piece.sides.iter_mut().zip(mode.entries());
        entries
            .filter(|(_, &entry)| entry != 0)
            .for_each(|(side, &entry)| *side = entry);
        piece.mode = mode.clone();
        piece.near = near.to_vec();
        piece.discrete = discrete.to_vec();
    }

    /// A switch: a return, if it lies on the section.
    pub fn switched(&mut self, switch: &Switch) {
        let Some((j, direction, kind)) = self.surface else {
            return;
        };
        let before = switch.mode_before.entries()[j];
        let after = switch.mode_after.entries()[j];
        let is_meant = match kind {
            Some(kind) => switch.kind == kind,
            None => before != 0 && switch.kind != Kind::Grazing,
        };
        // From h < 0 the motion comes up, and it leaves the surface upwards to h > 0.
        let heading = if before != 0 { -before } else { after };
        if is_meant && switch.surfaces.contains(&j) && heading * direction >= 0 {
            self.note(switch.t, &switch.y_before);
            self.modes.clear();
        }
    }

    /// A return in the flow.
    pub fn returned(&mut self, t: f64, y: &[f64]) {
        let mode = self.modes.last().cloned();
        self.note(t, y);
        self.modes.clear();
        self.modes.extend(mode);
    }

    fn note(&mut self, t: f64, y: &[f64]) {
        if t <= self.t_start || self.has_ended {
            return;
        }
        self.pass_time(t);
        if t <= self.since && self.modes.len() > 1 {
            // It begins here, and belongs to what follows.
            self.modes.pop();
        }
        let mut found = if self.latest.len() < self.remembered {
            Return::default()
        } else {
            self.latest.pop_front().unwrap_or_default()
        };
        found.t = t;
        found.y.clear();
        found.y.extend_from_slice(y);
        found.piece = self.piece.clone().map(Box::new);
        found.duration = t - self.t_return;
        found.sliding = std::mem::take(&mut self.slid);
        std::mem::swap(&mut found.modes, &mut self.modes);
        self.modes.clear();
        self.modes.reserve(found.modes.len());
        (self.t_return, self.since) = (t, t);
        self.returns.count += 1;
        if self.returns.count > self.transient {
            self.returns.kept.push(found.clone());
            self.has_ended = self.returns.kept.len() as u64 >= self.most;
        }
        self.latest.push_back(found);
        if self.cycle.as_ref().is_some_and(|cycle| cycle.ends_run) {
            self.find_period();
            if self.returns.period > 0 {
                let first = self.latest.len() - self.returns.period;
                self.returns.kept = self.latest.drain(first..).collect();
                (self.has_ended, self.is_periodic) = (true, true);
            }
        }
    }

    fn find_period(&mut self) {
        let period = self.cycle.as_ref().and_then(|c| c.period(&self.latest));
        self.returns.period = period.unwrap_or(0);
    }

    fn pass_time(&mut self, t: f64) {
        if self.slides {
            self.slid += t - self.since;
        }
    }

    /// Why the run is to end now.
    pub fn stop(&self) -> Option<Stop> {
        let reason = if self.is_periodic {
            Stop::Periodic
        } else {
            Stop::Returned
        };
        self.has_ended.then_some(reason)
    }

    pub fn into_returns(mut self) -> Returns {
        if !self.is_periodic {
            self.find_period();
        }
        self.returns
    }
}
