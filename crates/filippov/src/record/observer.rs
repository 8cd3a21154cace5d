//! What an observer of a run is handed: accepted steps, and instants.
//!
//! Derivatives of a run are a pass over these (`docs/theory/`, P. C. Mueller, *Chaos, Solitons & Fractals* 5 (1995) 1671):
//! with the gradient dg of the guard g that fixed the time of an instant, the fields F- and F+ before and after, and the
//! derivative DR of the map, the saltation matrix S = DR + (F+ - DR F-) dg / (dg . F-) maps a small change of the state before
//! the instant to the change of the state after it.

use smallvec::SmallVec;

use crate::error::FieldError;
use crate::mode::{Mode, Signs};
use crate::motion::{Guard, Run, SmoothField};
use crate::stepper::Interpolant;
use crate::system::Act;

/// An accepted step, or its part before an event.
#[derive(Clone, Copy, Debug)]
pub struct ObservedStep<'s> {
    /// The mode.
    pub mode: &'s Mode,
    /// The time at its end.
    pub t_end: f64,
    /// The state at its end.
    pub x_end: &'s [f64],
    /// The discrete states.
    pub discrete: &'s [f64],
    extension: &'s Interpolant,
}

impl<'s> ObservedStep<'s> {
    pub(crate) fn new(
        (mode, discrete): (&'s Mode, &'s [f64]),
        (t_end, x_end): (f64, &'s [f64]),
        extension: &'s Interpolant,
    ) -> Self {
        ObservedStep {
            mode,
            t_end,
            x_end,
            discrete,
            extension,
        }
    }

    /// The time at its start.
    pub fn t_start(&self) -> f64 {
        self.extension.t0
    }

    /// Writes the state at a time in the step, by the continuous extension.
    pub fn at(&self, t: f64, x: &mut [f64]) {
        let step = self.extension;
        step.at((t - step.t0) / step.dt, x);
    }
}

/// The gradient of a function of (t, x).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gradient {
    /// Its derivative by time.
    pub time: f64,
    /// Its derivatives by the states.
    pub state: Vec<f64>,
}

impl Gradient {
    /// The derivative by time, and behind it those by the states.
    pub fn by_all(&self) -> Vec<f64> {
        [&[self.time], &self.state[..]].concat()
    }
}

/// An instant in which a motion ends and another one starts. Pairs are before and after.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct InstantRecord<'i> {
    /// The time; the two differ where the limit of infinitely many switches is jumped to.
    pub t: [f64; 2],
    /// The state.
    pub x: [&'i [f64]; 2],
    /// The discrete states.
    pub discrete: [&'i [f64]; 2],
    /// The mode.
    pub mode: [&'i Mode; 2],
    /// The velocity of the motion.
    pub field: [&'i [f64]; 2],
    /// The guards of the motion before that vanish, the one that fixed the time first; none at a known time.
    pub guards: &'i [Guard],
    /// The gradient of the first of them in the sense of the guard, which is positive before; by time alone at a known time.
    pub gradient: &'i Gradient,
    /// The derivative of the map of the actions by x, in rows; none where nothing was done.
    pub map: Option<&'i [f64]>,
    /// The actions that are done, in their order.
    pub acts: &'i [Act],
    /// Does the next motion stand for another one, which equals it up to the tolerance? Then nobody knows what a small change of the
    /// state becomes.
    pub replaces: bool,
}

/// The record of an instant, for later.
#[derive(Clone, Debug)]
pub(crate) struct KeptInstant {
    t: [f64; 2],
    x: [Vec<f64>; 2],
    discrete: [Vec<f64>; 2],
    mode: [Mode; 2],
    field: [Vec<f64>; 2],
    guards: SmallVec<[Guard; 2]>,
    gradient: Gradient,
    map: Option<Vec<f64>>,
    acts: Vec<Act>,
    replaces: bool,
}

impl KeptInstant {
    /// What is kept of a record.
    pub fn of(record: &InstantRecord) -> Self {
        KeptInstant {
            t: record.t,
            x: record.x.map(<[f64]>::to_vec),
            discrete: record.discrete.map(<[f64]>::to_vec),
            mode: record.mode.map(Mode::clone),
            field: record.field.map(<[f64]>::to_vec),
            guards: record.guards.into(),
            gradient: record.gradient.clone(),
            map: record.map.map(<[f64]>::to_vec),
            acts: record.acts.to_vec(),
            replaces: record.replaces,
        }
    }

    /// With the first discrete states, so many of them, as further states that rest.
    pub fn with_discrete_as_states(record: &InstantRecord, count: usize) -> Self {
        let mut kept = KeptInstant::of(record);
        for (x, q) in kept.x.iter_mut().zip(&kept.discrete) {
            x.extend_from_slice(&q[..count]);
        }
        for field in &mut kept.field {
            field.resize(field.len() + count, 0.0);
        }
        for act in &mut kept.acts {
            act.x.extend_from_slice(&act.discrete[..count]);
        }
        kept
    }

    /// How many bytes it takes, spare room not counted.
    pub fn n_bytes(&self) -> usize {
        let rows = [&self.x, &self.discrete, &self.field];
        let entries: usize = rows.into_iter().flatten().map(Vec::len).sum();
        let map = self.map.as_ref().map_or(0, Vec::len);
        let acts = self.acts.iter().map(|act| act.x.len() + act.discrete.len());
        let numbers = entries + self.gradient.state.len() + map + acts.sum::<usize>();
        // Each vector has a head of the allocator.
        let n_vectors = 8 + 2 * self.acts.len();
        let (numbers, heads) = (
            numbers * size_of::<f64>(),
            n_vectors * 2 * size_of::<usize>(),
        );
        size_of::<Self>() + self.acts.len() * size_of::<Act>() + numbers + heads
    }

    /// The record.
    pub fn record(&self) -> InstantRecord<'_> {
        InstantRecord {
            t: self.t,
            x: [&self.x[0], &self.x[1]],
            discrete: [&self.discrete[0], &self.discrete[1]],
            mode: [&self.mode[0], &self.mode[1]],
            field: [&self.field[0], &self.field[1]],
            guards: &self.guards,
            gradient: &self.gradient,
            map: self.map.as_deref(),
            acts: &self.acts,
            replaces: self.replaces,
        }
    }
}

/// What watches a run.
pub trait Observer {
    /// A step was accepted.
    fn step(&mut self, step: &ObservedStep) {
        let _ = step;
    }

    /// A motion ended, and another one has started.
    fn instant(&mut self, instant: &InstantRecord);
}

/// An observer, with what is known of the motion that ended last.
pub(crate) struct Observed<'a> {
    observer: &'a mut dyn Observer,
    /// An instant goes on.
    has_ended: bool,
    t: f64,
    x: Vec<f64>,
    discrete: Vec<f64>,
    mode: Mode,
    field: Vec<f64>,
    guards: SmallVec<[Guard; 2]>,
    gradient: Gradient,
    map: Option<Vec<f64>>,
    acts: Vec<Act>,
    replaces: bool,
}

impl<'a> Observed<'a> {
    pub fn by(observer: &'a mut dyn Observer) -> Self {
        Observed {
            observer,
            has_ended: false,
            t: f64::NAN,
            x: Vec::new(),
            discrete: Vec::new(),
            mode: Mode::default(),
            field: Vec::new(),
            guards: SmallVec::new(),
            gradient: Gradient::default(),
            map: None,
            acts: Vec::new(),
            replaces: false,
        }
    }

    /// A step was accepted. The straight line to the limit of infinitely many switches is part of their instant.
    pub fn step(&mut self, step: &ObservedStep) {
        if !self.has_ended {
            self.observer.step(step);
        }
    }

    /// A motion ends where these guards vanish, or at a known time.
    ///
    /// # Errors
    /// If a function of the user raises.
    #[cold]
    #[inline(never)]
    pub fn leave(&mut self, run: &mut Run, guards: &[Guard]) -> Result<(), FieldError> {
        if std::mem::replace(&mut self.has_ended, true) {
            return Ok(());
        }
        self.t = run.t;
        self.x.clone_from(&run.x);
        self.discrete.clone_from(&run.motion.discrete);
        self.mode = run.motion.mode.clone();
        self.guards = SmallVec::from_slice(guards);
        self.map = None;
        self.acts.clear();
        self.replaces = false;
        let n = run.x.len();
        self.field.resize(n, 0.0);
        self.gradient.state.resize(n, 0.0);
        // The end of a motion lies on the surfaces slid on.
        let field = &mut run.motion.field;
        field.eval_unprojected(run.t, &mut run.x, &mut self.field)?;
        let gradient = &mut self.gradient.state;
        self.gradient.time = match guards.first() {
            Some(&guard) => gradient_of(run, guard, gradient)?,
            None => {
                gradient.fill(0.0);
                1.0
            }
        };
        Ok(())
    }

    /// Actions with this derivative were done.
    pub fn act(&mut self, derivative: Option<Vec<f64>>, acts: Vec<Act>) {
        self.map = derivative.or(self.map.take());
        self.acts.extend(acts);
    }

    /// The motion that follows is the same as that of the system up to the tolerance only.
    pub fn replace(&mut self) {
        self.replaces = true;
    }

    /// Is it between the end of a motion and the start of the next one?
    pub fn is_in_instant(&self) -> bool {
        self.has_ended
    }

    /// Nothing has happened: the motion goes on.
    pub fn stay(&mut self) {
        self.has_ended = false;
    }

    /// The run ends. In an instant no motion follows: that of the mode before stands for it.
    pub fn end(&mut self, run: &mut Run) {
        if self.has_ended {
            let mut velocity = vec![f64::NAN; run.x.len()];
            let field = &mut run.motion.field;
            if field
                .eval_unprojected(run.t, &mut run.x, &mut velocity)
                .is_err()
            {
                velocity.fill(f64::NAN);
            }
            self.arrive(run, &velocity);
        }
    }

    /// The next motion has started with this velocity.
    #[cold]
    #[inline(never)]
    pub fn arrive(&mut self, run: &Run, velocity: &[f64]) {
        if !std::mem::take(&mut self.has_ended) {
            return;
        }
        self.observer.instant(&InstantRecord {
            t: [self.t, run.t],
            x: [&self.x, &run.x],
            discrete: [&self.discrete, &run.motion.discrete],
            mode: [&self.mode, &run.motion.mode],
            field: [&self.field, velocity],
            guards: &self.guards,
            gradient: &self.gradient,
            map: self.map.as_deref(),
            acts: &self.acts,
            replaces: self.replaces,
        });
    }
}

/// The gradient of a guard of the motion at its end: writes its derivatives by the states, and returns that by time. Beside the
/// surfaces slid on a guard is that of the natural extension of the field, which moves no point onto them.
fn gradient_of(run: &mut Run, guard: Guard, state: &mut [f64]) -> Result<f64, FieldError> {
    let (system, signs) = (run.system, &run.motion.signs);
    let place = run.motion.setting().at(run.t, &run.x);
    let (sense, time) = match (guard, run.motion.sliding()) {
        (Guard::Surface(j), _) => (signs[j], system.gradient(j, &place, state)?),
        // The normal component of f-, or minus that of f+.
        (Guard::Multiplier { surface: j, end }, [_]) if !system.sticks_at(j) => {
            let mut side = Signs::from_slice(signs);
            side[j] = f64::from(end);
            let rate = system.rate_gradient(j, &place.with_signs(&side), state)?;
            (-f64::from(end), rate.time)
        }
        _ => return run.motion.field.gradient_of(guard, run.t, &run.x, state),
    };
    state.iter_mut().for_each(|entry| *entry *= sense);
    Ok(sense * time)
}
