//! A place in a run from which it goes on, step by step as it did.

use super::progress::Progress;
use super::Integrator;
use crate::action::Timetable;
use crate::event::search::Detector;
use crate::mode::Mode;
use crate::motion::{Run, Slacks};
use crate::record::{Recorder, Solution};
use crate::status::Stop;
use crate::stepper::{StepControl, Steppers};

/// A place in a run: all that its next steps depend on, and nothing of its record but the latest switches.
pub(super) struct Checkpoint<'a> {
    run: Run<'a>,
    t_end: f64,
    timetable: Timetable,
    horizon: f64,
    stepper: Steppers,
    control: StepControl,
    detector: Detector,
    recorder: Recorder<'a>,
    n_choices: usize,
    progress: Progress,
    slacks: Slacks,
    held: Option<&'a Mode>,
    /// The run has started: its first mode is known.
    is_started: bool,
}

impl<'a> Checkpoint<'a> {
    /// The place that a run has come to.
    pub fn of(run: &Integrator<'a>) -> Self {
        Checkpoint {
            run: run.run.clone(),
            t_end: run.t_end,
            timetable: run.timetable.clone(),
            horizon: run.horizon,
            stepper: run.stepper.clone(),
            control: run.control.clone(),
            detector: run.detector.clone(),
            recorder: run.recorder.without_record(run.run.t, &run.run.x),
            n_choices: run.n_choices,
            progress: run.progress.clone(),
            slacks: run.slacks.clone(),
            held: run.held,
            is_started: run.watch.is_started(),
        }
    }

    /// Takes its run back, or forth, to this place; what was recorded is forgotten.
    pub fn return_to(&self, run: &mut Integrator<'a>) {
        run.run = self.run.clone();
        run.t_end = self.t_end;
        run.held = self.held;
        run.timetable = self.timetable.clone();
        run.horizon = self.horizon;
        run.stepper = self.stepper.clone();
        run.control = self.control.clone();
        run.detector = self.detector.clone();
        run.n_choices = self.n_choices;
        run.progress = self.progress.clone();
        run.slacks = self.slacks.clone();
        run.warnings.clear();
        run.watch.begin_anew(self.is_started);
        let recorder = self.recorder.without_record(self.run.t, &self.run.x);
        exchange_recorder(run, recorder);
    }

    /// About how many bytes it takes: the vectors of steppers, motions and searches by their usual lengths.
    pub fn n_bytes(&self) -> usize {
        let (n, d) = (self.run.x.len(), self.run.system.n_surfaces());
        let numbers = ROWS_OF_STATES * n + ROWS_OF_SURFACES * d;
        // The heap keeps room beside what is asked for, the more the larger the vectors are.
        let of_motion = 2 * (numbers * size_of::<f64>() + self.stepper.n_bytes());
        size_of::<Self>() + of_motion + self.recorder.n_bytes()
    }

    /// How many bytes more the latest switches may take when there are as many as are kept.
    pub fn room_for_switches(&self) -> usize {
        self.recorder.room_for_switches()
    }
}

/// So many vectors of one number for each state a place has, coefficients of steps not counted, and for each surface: upper bounds.
const ROWS_OF_STATES: usize = 64;
const ROWS_OF_SURFACES: usize = 128;

/// What was recorded since the start or the last return, as a solution that ends here.
pub(super) fn take_record(integrator: &mut Integrator) -> Solution {
    if let Some(observed) = &mut integrator.recorder.observed {
        observed.end(&mut integrator.run);
    }
    let run = &integrator.run;
    let next = integrator.recorder.without_record(run.t, &run.x);
    let recorder = exchange_recorder(integrator, next);
    let run = &integrator.run;
    let motion = &run.motion;
    recorder.finish(
        (run.t, &run.x, run.options),
        (motion.mode.clone(), motion.discrete.clone(), Vec::new()),
        Stop::End,
        run.stats,
        Vec::new(),
    )
}

/// Puts another recorder, with the observer of the present one, in its place.
fn exchange_recorder<'a>(run: &mut Integrator<'a>, other: Recorder<'a>) -> Recorder<'a> {
    let mut before = std::mem::replace(&mut run.recorder, other);
    run.recorder.observed = before.observed.take();
    before
}
