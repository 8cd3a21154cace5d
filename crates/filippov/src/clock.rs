//! The clock that limits of time are measured by.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::Arc;
use std::time::Duration;

/// The clock by which [`crate::Options::max_wall_time`] is measured.
#[derive(Clone, Debug, Default)]
pub enum Clock {
    /// The monotonic clock of the computer. There is none on `wasm32-unknown-unknown`.
    #[default]
    Computer,
    /// A clock that the caller advances.
    Manual(Arc<ManualClock>),
}

impl Clock {
    /// The time of this clock, since it was first read; zero if it does not run.
    pub fn now(&self) -> Duration {
        match self {
            Clock::Computer => since_first_read(),
            Clock::Manual(clock) => clock.look(),
        }
    }

    /// Does this clock measure time? The clock of the computer does not on `wasm32-unknown-unknown`.
    pub fn runs(&self) -> bool {
        matches!(self, Clock::Manual(_)) || HAS_MONOTONIC_CLOCK
    }
}

const HAS_MONOTONIC_CLOCK: bool = !cfg!(all(target_arch = "wasm32", target_os = "unknown"));

fn since_first_read() -> Duration {
    use std::sync::OnceLock;
    use std::time::Instant;

    static START: OnceLock<Instant> = OnceLock::new();
    if !HAS_MONOTONIC_CLOCK {
        return Duration::ZERO; // `Instant::now` panics there.
    }
    START.get_or_init(Instant::now).elapsed()
}

/// A clock that stands still unless it is advanced, by [`advance`](Self::advance) and by every look at it. With it, what
/// a run does at a limit of time does not depend on the speed or the load of the computer.
///
/// # Example
/// ```
/// use std::time::Duration;
///
/// let clock = filippov::ManualClock::new(Duration::from_millis(1));
/// let start = clock.look();
/// clock.advance(Duration::from_secs(2));
/// assert_eq!(clock.look() - start, Duration::from_millis(2001));
/// assert_eq!(clock.elapsed(), Duration::from_millis(2002));
/// ```
#[derive(Debug)]
pub struct ManualClock {
    nanoseconds: AtomicU64,
    per_look: Duration,
}

impl ManualClock {
    /// A clock that every look advances by `per_look`.
    pub fn new(per_look: Duration) -> Self {
        ManualClock {
            nanoseconds: AtomicU64::new(0),
            per_look,
        }
    }

    /// Advances the clock.
    pub fn advance(&self, by: Duration) {
        let by = u64::try_from(by.as_nanos()).unwrap_or(u64::MAX);
        self.nanoseconds.fetch_add(by, Ordering::SeqCst);
    }

    /// The time of the clock, which this look advances.
    pub fn look(&self) -> Duration {
        self.advance(self.per_look);
        self.elapsed()
    }

    /// How far the clock was advanced. This is no look at it.
    pub fn elapsed(&self) -> Duration {
        Duration::from_nanos(self.nanoseconds.load(Ordering::SeqCst))
    }
}
