//! When a run has to end before its time: the limit of wall time, and the caller's wish.

use std::cell::{Cell, RefCell};
use std::time::Duration;

use crate::integrate::progress::Reached;
use crate::options::Options;
use crate::status::Stop;

/// What the caller is asked every now and then, with the place reached: should the run end?
pub(super) type Interrupt<'a> = &'a mut (dyn FnMut(Reached) -> bool + 'a);

/// Most steps between two looks at the clock and at the caller's wish to stop.
const LONGEST_POLL: u64 = 64;
/// Seconds between two looks from which on they come at every step, for slow functions.
const SLOW_POLL: f64 = 0.002;

/// Which limit was reached.
#[derive(Clone, Copy)]
enum Over {
    WallTime,
    Interrupted,
}

/// Looks at the clock and at the caller's wish.
pub(super) struct Watch<'a> {
    options: &'a Options,
    started: Cell<Option<Duration>>,
    interrupt: RefCell<Option<Interrupt<'a>>>,
    over: Cell<Option<Over>>,
    /// When it looked last, after how many steps it looks again, and at which attempt.
    looked: Option<Duration>,
    interval: u64,
    next: u64,
}

impl<'a> Watch<'a> {
    pub fn new(options: &'a Options) -> Self {
        Watch {
            options,
            started: Cell::new(None),
            interrupt: RefCell::new(None),
            over: Cell::new(None),
            looked: None,
            interval: 1,
            next: 0,
        }
    }

    /// Asks this of the caller from now on.
    pub fn ask(&mut self, interrupt: Interrupt<'a>) {
        self.interrupt = RefCell::new(Some(interrupt));
    }

    /// The time by the clock of the run.
    pub fn now(&self) -> Duration {
        self.options.clock.now()
    }

    /// The run starts now.
    pub fn start(&mut self) {
        let now = self.now();
        self.started.set(Some(now));
        self.looked = Some(now);
    }

    /// The run is at another of its places, maybe at its start; it is looked at again at once.
    pub fn begin_anew(&mut self, is_started: bool) {
        self.started.set(is_started.then(|| self.now()));
        (self.looked, self.interval, self.next) = (self.started.get(), 1, 0);
    }

    /// Has the run started?
    pub fn is_started(&self) -> bool {
        self.started.get().is_some()
    }

    /// Looks now and then, after so many attempts at a step: the seldomer the faster they are.
    #[inline(always)]
    pub fn look(&mut self, attempts: u64, reached: Reached) {
        if attempts >= self.next {
            self.look_now(attempts, reached);
        }
    }

    #[cold]
    fn look_now(&mut self, attempts: u64, reached: Reached) {
        let now = self.now();
        let is_slow = |looked: Duration| (now - looked).as_secs_f64() > SLOW_POLL;
        self.interval = match self.looked.is_some_and(is_slow) {
            true => 1,
            false => (2 * self.interval).min(LONGEST_POLL),
        };
        (self.looked, self.next) = (Some(now), attempts + self.interval);
        self.is_over(now, reached);
    }

    /// Has a limit been reached, now or before? `reached` is the place that the run has come to.
    pub fn is_over(&self, now: Duration, reached: Reached) -> bool {
        if self.over.get().is_none() {
            let elapsed = self.started.get().map(|started| now - started);
            let most = self.options.max_wall_time;
            let is_late = elapsed
                .zip(most)
                .is_some_and(|(elapsed, most)| elapsed.as_secs_f64() > most);
            let wants_to_stop = || {
                let mut interrupt = self.interrupt.borrow_mut();
                interrupt
                    .as_mut()
                    .is_some_and(|interrupt| interrupt(reached))
            };
            if is_late {
                self.over.set(Some(Over::WallTime));
            } else if wants_to_stop() {
                self.over.set(Some(Over::Interrupted));
            }
        }
        self.over.get().is_some()
    }

    /// Was a limit reached when it looked?
    #[inline(always)]
    pub fn has_ended(&self) -> bool {
        self.over.get().is_some()
    }

    /// Why the run ends, if a limit has been reached.
    pub fn stop(&self) -> Option<Stop> {
        self.over.get().map(|over| match over {
            Over::WallTime => Stop::MaxWallTime,
            Over::Interrupted => Stop::Interrupted,
        })
    }
}
