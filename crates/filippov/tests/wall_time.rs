//! The limit of time, by a clock that the test advances.
#![allow(clippy::unwrap_used)]

use std::sync::Arc;
use std::time::Duration;

use filippov::{Clock, ClosureSystem, ManualClock, Method, Options, Problem, Solution, Stop};

/// The harmonic oscillator for a long time, with a limit of 0.1 s; each evaluation of its field takes `per_evaluation`.
fn limited(clock: &Arc<ManualClock>, per_evaluation: Duration) -> Solution {
    let advanced = Arc::clone(clock);
    let oscillator = ClosureSystem::new(
        2,
        0,
        move |_t, x, _s, dx| {
            advanced.advance(per_evaluation);
            dx[0] = x[1];
            dx[1] = -x[0];
        },
        |_t, _x, _h| {},
    );
    let options = Options {
        method: Method::Dopri5,
        max_wall_time: Some(0.1),
        clock: Clock::Manual(Arc::clone(clock)),
        ..Options::default()
    };
    let solution = Problem::new(&oscillator, (0.0, 1e9), &[1.0, 0.0])
        .options(&options)
        .solve()
        .unwrap();
    assert!(matches!(solution.stop, Stop::MaxWallTime));
    solution
}

#[test]
fn fast_functions_are_interrupted_every_64_steps() {
    let clock = Arc::new(ManualClock::new(Duration::from_millis(1)));
    let stats = limited(&clock, Duration::ZERO).stats;
    // A hundred looks, of which the first few come after 1, 2, 4, ... steps.
    let attempts = stats.n_steps + stats.n_rejected;
    assert!((64 * 90..=64 * 101).contains(&attempts), "{attempts}");
    assert_eq!(clock.elapsed(), Duration::from_millis(102));
}

#[test]
fn slow_functions_are_interrupted_after_every_step() {
    let clock = Arc::new(ManualClock::new(Duration::ZERO));
    let per_evaluation = Duration::from_millis(3);
    let stats = limited(&clock, per_evaluation).stats;
    assert!(stats.n_steps <= 6, "{}", stats.n_steps);
    // The last step has 6 evaluations, and starts before the limit.
    assert!(clock.elapsed() <= Duration::from_millis(100) + 12 * per_evaluation);
}

#[test]
fn the_same_clock_gives_the_same_end() {
    let end = || {
        let clock = Arc::new(ManualClock::new(Duration::from_micros(700)));
        let solution = limited(&clock, Duration::from_micros(10));
        (*solution.t.last().unwrap(), solution.stats.n_steps)
    };
    assert_eq!(end(), end());
}
