//! Independent runs on native threads; signals are looked at by the thread that called.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use pyo3::prelude::*;

/// How often the interpreter is asked for signals and told the progress.
pub const POLL_EVERY: Duration = Duration::from_millis(20);

/// Runs that one thread takes before signals are looked at and results handed over.
pub const CHUNK_PER_THREAD: usize = 256;

/// What a run asks now and then with the time reached: is it to stop?
pub type Interrupt<'a> = &'a mut dyn FnMut(f64) -> bool;

/// Does `work` for every job, each thread taking the next one that is left; the results are in the order of the
/// jobs. To be called without the interpreter's lock.
///
/// # Errors
/// What a signal raised, Ctrl-C for instance.
pub fn on_threads<J: Sync, R: Send>(
    jobs: &[J],
    threads: usize,
    work: impl Fn(&J, Interrupt) -> R + Sync,
) -> PyResult<Vec<R>> {
    let next = AtomicUsize::new(0);
    let is_interrupted = AtomicBool::new(false);
    let signal: Mutex<Option<PyErr>> = Mutex::new(None);
    let results: Vec<Mutex<Option<R>>> = jobs.iter().map(|_| Mutex::new(None)).collect();
    let go = |asks: bool| {
        let mut asked = Instant::now();
        let mut interrupt = |_: f64| {
            if asks && asked.elapsed() >= POLL_EVERY {
                asked = Instant::now();
                if let Err(raised) = Python::attach(|py| py.check_signals()) {
                    *signal.lock().unwrap_or_else(PoisonError::into_inner) = Some(raised);
                    is_interrupted.store(true, Ordering::Relaxed);
                }
            }
            is_interrupted.load(Ordering::Relaxed)
        };
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(job) = jobs.get(index) else {
                break;
            };
            let result = work(job, &mut interrupt);
            *results[index]
                .lock()
                .unwrap_or_else(PoisonError::into_inner) = Some(result);
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..threads {
            scope.spawn(|| go(false));
        }
        go(true);
    });
    if let Some(raised) = signal.into_inner().unwrap_or_else(PoisonError::into_inner) {
        return Err(raised);
    }
    let taken = results.into_iter().map(|result| {
        result
            .into_inner()
            .unwrap_or_else(PoisonError::into_inner)
            .expect("every job was taken by a thread")
    });
    Ok(taken.collect())
}
