//! The thread that compiles programs beside the runs that wait for none of them.

use std::process;
use std::sync::mpsc::{channel, Sender};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread;

/// As much as a main thread usually has.
const STACK: usize = 8 << 20;

type Job = Box<dyn FnOnce() + Send>;

/// Something that another thread makes.
pub(super) struct Late<P> {
    made: Arc<Mutex<Option<P>>>,
    process: u32,
}

impl<P> Late<P> {
    /// It, once it is made.
    pub fn take(&self) -> Option<P> {
        self.made.try_lock().ok()?.take()
    }

    /// Is this a fork of the process whose thread makes it? Then it will never be there.
    pub fn is_lost(&self) -> bool {
        self.process != process::id()
    }
}

/// Makes something in another thread. Where there is none it is made at once.
pub(super) fn compile_later<P: Send + 'static>(
    make: impl FnOnce() -> P + Send + 'static,
) -> Late<P> {
    let made = Arc::new(Mutex::new(None));
    let place = Arc::clone(&made);
    hand_over(Box::new(move || {
        let found = make();
        *place.lock().unwrap_or_else(PoisonError::into_inner) = Some(found);
    }));
    Late {
        made,
        process: process::id(),
    }
}

/// Hands a job to the thread, or does it.
fn hand_over(job: Job) {
    /// The thread that was begun, in the process that began it: it does not live on in a fork.
    static THREAD: Mutex<Option<(u32, Sender<Job>)>> = Mutex::new(None);
    // Who would have to wait does the job.
    let Ok(mut thread) = THREAD.try_lock() else {
        return job();
    };
    let here = process::id();
    if has_second_processor() && !matches!(&*thread, Some((process, _)) if *process == here) {
        let (sender, jobs) = channel::<Job>();
        let work = move || jobs.into_iter().for_each(|job| job());
        let begun = thread::Builder::new()
            .name("compiler".into())
            .stack_size(STACK);
        *thread = begun.spawn(work).ok().map(|_| (here, sender));
    }
    let undone = match &*thread {
        Some((_, sender)) => sender.send(job).err().map(|refused| refused.0),
        None => Some(job),
    };
    drop(thread);
    if let Some(job) = undone {
        job();
    }
}

/// On a single processor a thread would only take its time from the run.
fn has_second_processor() -> bool {
    static COUNTED: OnceLock<bool> = OnceLock::new();
    *COUNTED.get_or_init(|| thread::available_parallelism().is_ok_and(|n| n.get() > 1))
}
