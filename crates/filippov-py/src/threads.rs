//! Independent runs on native threads; signals are looked at by the thread that called.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use filippov::Reached;
use pyo3::prelude::*;

/// How often the interpreter is asked for signals and told the progress.
pub const POLL_EVERY: Duration = Duration::from_millis(20);

/// Runs that one thread takes before signals are looked at and results handed over.
pub const CHUNK_PER_THREAD: usize = 256;

/// What a run asks now and then with the place reached: is it to stop?
pub type Interrupt<'a> = &'a mut dyn FnMut(Reached) -> bool;

/// What threads have done of some jobs.
pub struct Done<R> {
    /// The results in the order of the jobs: of all, or where a signal came of the first ones.
    pub results: Vec<R>,
    /// What a signal raised, Ctrl-C for instance.
    pub raised: Option<PyErr>,
}

/// Does `work` for every job, each thread taking the next one that is left; no other one after a signal, or after a
/// result that `is_last`. To be called without the interpreter's lock.
pub fn on_threads<J: Sync, R: Send>(
    jobs: &[J],
    threads: usize,
    work: impl Fn(&J, Interrupt) -> R + Sync,
    is_last: impl Fn(&R) -> bool + Sync,
) -> Done<R> {
    let next = AtomicUsize::new(0);
    let is_interrupted = AtomicBool::new(false);
    let signal: Mutex<Option<PyErr>> = Mutex::new(None);
    let results: Vec<Mutex<Option<R>>> = jobs.iter().map(|_| Mutex::new(None)).collect();
    let go = |asks: bool| {
        let mut asked = Instant::now();
        let mut interrupt = |_: Reached| {
            if asks && asked.elapsed() >= POLL_EVERY {
                asked = Instant::now();
                if let Err(raised) = Python::attach(|py| py.check_signals()) {
                    *signal.lock().unwrap_or_else(PoisonError::into_inner) = Some(raised);
                    is_interrupted.store(true, Ordering::Relaxed);
                }
            }
            is_interrupted.load(Ordering::Relaxed)
        };
        while !is_interrupted.load(Ordering::Relaxed) {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(job) = jobs.get(index) else {
                break;
            };
            let result = work(job, &mut interrupt);
            if is_last(&result) {
                is_interrupted.store(true, Ordering::Relaxed);
            }
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
    // Jobs are taken in their order, and every one that was taken has a result.
    let results = results.into_iter().map_while(|result| {
        let result = result.into_inner();
        result.unwrap_or_else(PoisonError::into_inner)
    });
    Done {
        results: results.collect(),
        raised: signal.into_inner().unwrap_or_else(PoisonError::into_inner),
    }
}
