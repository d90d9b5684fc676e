//! A thread that owns what is open, and jobs for it. Whoever waits for a job looks for signals meanwhile: Ctrl-C ends
//! the waiting at once, and the job as soon as it can. Jobs are done one after the other, in the order of their coming.
//!
//! A process that was forked has none of its parent's threads. There a worker has a thread pool of its own, since the
//! one that all share is the parent's.

use crate::errors::{exception, failed};
use anyhow::{Result, anyhow};
use brickwalk::remote;
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::any::Any;
use std::ffi::CString;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

/// How often signals are looked for and progress is told.
const POLL: Duration = Duration::from_millis(50);

/// Stack of a worker: building trees recurses.
const STACK_BYTES: usize = 16 << 20;

/// The process that loaded this module.
static PROCESS: OnceLock<u32> = OnceLock::new();

/// Notes which process this is, before any thread is started.
pub fn note_process() {
    PROCESS.get_or_init(process::id);
}

fn is_forked() -> bool {
    PROCESS.get().is_some_and(|&first| first != process::id())
}

/// How far a job is, and whether it is to stop.
#[derive(Debug, Default)]
pub struct Task {
    stop: AtomicBool,
    done: AtomicU64,
    total: AtomicU64,
}

impl Task {
    /// Whether nobody waits for it any more.
    pub fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// So many more steps are done.
    pub fn advance(&self, steps: u64) {
        self.done.fetch_add(steps, Ordering::Relaxed);
    }

    /// So many steps of so many are done.
    pub fn note(&self, done: u64, total: u64) {
        self.done.store(done, Ordering::Relaxed);
        self.total.store(total, Ordering::Relaxed);
    }
}

/// Who is told how far the work is: a callable that takes the steps that are done, and all; and what of these was done
/// before the job at hand.
pub struct Progress<'py> {
    call: Option<Bound<'py, PyAny>>,
    before: u64,
    /// 0: the job says it.
    total: u64,
    last: Option<(u64, u64)>,
}

impl<'py> Progress<'py> {
    /// `call` may be `None`: then nobody is told.
    pub fn new(call: Option<Bound<'py, PyAny>>, total: u64) -> Self {
        Self { call, before: 0, total, last: None }
    }

    /// So many steps are done by jobs that have ended.
    ///
    /// # Errors
    /// The callable's.
    pub fn reached(&mut self, done: u64) -> PyResult<()> {
        self.before = done;
        self.tell(&Task::default())
    }

    fn tell(&mut self, task: &Task) -> PyResult<()> {
        let Some(call) = &self.call else { return Ok(()) };
        let total = if self.total > 0 { self.total } else { task.total.load(Ordering::Relaxed) };
        let done = self.before + task.done.load(Ordering::Relaxed);
        let done = if total > 0 { done.min(total) } else { done };
        if self.last != Some((done, total)) {
            self.last = Some((done, total));
            call.call1((done, total))?;
        }
        Ok(())
    }
}

/// What a worker owns.
pub trait State: 'static {
    /// Gives up whatever a job that panicked may have left half done.
    fn reset(&mut self);
}

impl State for () {
    fn reset(&mut self) {}
}

type Job<S> = Box<dyn FnOnce(&mut S) + Send>;

/// A thread that owns a state and does jobs on it. Dropped, it ends after the jobs that it has.
pub struct Worker<S> {
    jobs: Sender<Job<S>>,
    ended: Receiver<()>,
    /// In a forked process, where the thread is one of these.
    _pool: Option<ThreadPool>,
    process: u32,
}

impl<S: State> Worker<S> {
    /// Starts the thread, which makes its state by `make`.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn start(make: impl FnOnce() -> S + Send + 'static) -> Result<Self> {
        let (jobs, receiver) = channel::<Job<S>>();
        let (end, ended) = channel();
        let serve = move || {
            let _end: Sender<()> = end;
            let mut state = make();
            for job in receiver {
                job(&mut state);
            }
        };
        let pool = match is_forked() {
            true => {
                let cores = std::thread::available_parallelism().map_or(1, usize::from);
                let pool = ThreadPoolBuilder::new().num_threads(cores + 1).stack_size(STACK_BYTES).build()?;
                pool.spawn(serve);
                Some(pool)
            }
            false => {
                std::thread::Builder::new().name("brickwalk".into()).stack_size(STACK_BYTES).spawn(serve)?;
                None
            }
        };
        Ok(Self { jobs, ended, _pool: pool, process: process::id() })
    }

    /// Whether it is another process's, which this one was forked from: then there is no thread.
    pub fn is_lost(&self) -> bool {
        self.process != process::id()
    }

    /// A way to hand it jobs, which any thread may use.
    pub fn desk(&self) -> Desk<S> {
        Desk { jobs: self.jobs.clone() }
    }

    /// Lets it end, and waits until what it owns is closed.
    ///
    /// # Errors
    /// A signal came; it then ends by itself.
    pub fn finish(self, py: Python<'_>) -> PyResult<()> {
        if self.is_lost() {
            // There is no thread that could end.
            std::mem::forget(self);
            return Ok(());
        }
        let Self { jobs, mut ended, .. } = self;
        drop(jobs);
        while wait(py, &mut ended) == Err(RecvTimeoutError::Timeout) {
            py.check_signals()?;
        }
        Ok(())
    }
}

/// Hands jobs to a worker.
pub struct Desk<S> {
    jobs: Sender<Job<S>>,
}

impl<S: State> Desk<S> {
    /// Has the worker do `work`, and waits for it, as of [`Pending::wait`].
    ///
    /// # Errors
    /// As of [`Pending::wait`].
    pub fn run<T: Send + 'static>(
        &self,
        py: Python<'_>,
        progress: &mut Progress,
        work: impl FnOnce(&mut S, &Arc<Task>) -> Result<T> + Send + 'static,
    ) -> PyResult<T> {
        self.begin(py, work)?.wait(py, progress)
    }

    /// Gives the worker `work`, which it does after what it was given before.
    ///
    /// # Errors
    /// What a signal raises; the worker has ended.
    pub fn begin<T: Send + 'static>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut S, &Arc<Task>) -> Result<T> + Send + 'static,
    ) -> PyResult<Pending<T>> {
        py.check_signals()?;
        let (sender, receiver) = channel();
        let task = Arc::new(Task::default());
        let its = task.clone();
        let job = move |state: &mut S| {
            let result = if its.is_stopped() { Err(anyhow!("interrupted")) } else { guarded(state, &its, work) };
            // Who has been interrupted does not wait for it.
            let _ = sender.send(result);
        };
        self.jobs.send(Box::new(job)).map_err(|_| failed("the scene's thread has ended"))?;
        Ok(Pending { receiver, task })
    }
}

/// A job that a worker has. Dropped, it ends as soon as it can.
pub struct Pending<T> {
    receiver: Receiver<Result<T>>,
    task: Arc<Task>,
}

impl<T> Drop for Pending<T> {
    fn drop(&mut self) {
        self.task.stop.store(true, Ordering::Relaxed);
    }
}

impl<T: Send> Pending<T> {
    /// Waits for what the job returns without holding Python's lock. What a person should know of a scene by URL is a
    /// warning of Python's.
    ///
    /// # Errors
    /// The job's; what a signal or `progress` raises.
    pub fn wait(mut self, py: Python<'_>, progress: &mut Progress) -> PyResult<T> {
        let result = loop {
            match wait(py, &mut self.receiver) {
                Ok(result) => break result,
                Err(RecvTimeoutError::Disconnected) => return Err(failed("the scene's thread has ended")),
                Err(RecvTimeoutError::Timeout) => {
                    py.check_signals().and_then(|()| progress.tell(&self.task))?;
                }
            }
        };
        for line in remote::take_warnings() {
            let line = CString::new(line).unwrap_or_default();
            PyErr::warn(py, &py.get_type::<PyUserWarning>(), &line, 1)?;
        }
        result.map_err(|error| exception(&error))
    }
}

/// Waits for a while, without Python's lock.
fn wait<T: Send>(py: Python<'_>, receiver: &mut Receiver<T>) -> std::result::Result<T, RecvTimeoutError> {
    py.detach(move || receiver.recv_timeout(POLL))
}

/// What `work` returns. A panic is an error, after which the state begins anew.
fn guarded<S: State, T>(
    state: &mut S,
    task: &Arc<Task>,
    work: impl FnOnce(&mut S, &Arc<Task>) -> Result<T>,
) -> Result<T> {
    let result = catch_unwind(AssertUnwindSafe(|| work(state, task)));
    result.unwrap_or_else(|panic| {
        // What is dropped may panic, too.
        let _ = catch_unwind(AssertUnwindSafe(|| state.reset()));
        Err(anyhow!("{}; this is a defect of brickwalk", text(&*panic)))
    })
}

fn text(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "a panic".into())
}

/// Does `work` on a thread of its own and waits for it.
///
/// # Errors
/// As of [`Desk::run`].
pub fn run_alone<T: Send + 'static>(
    py: Python<'_>,
    progress: &mut Progress,
    work: impl FnOnce(&Arc<Task>) -> Result<T> + Send + 'static,
) -> PyResult<T> {
    let worker = Worker::start(|| ()).map_err(|error| exception(&error))?;
    worker.desk().run(py, progress, |(), task| work(task))
}
