//! Ctrl-C: asks what is under way to come to a good end.

use brickwalk_convert::progress::Progress;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, Once, PoisonError};

static FLAG: AtomicBool = AtomicBool::new(false);
static JOB: Mutex<Option<Progress>> = Mutex::new(None);

/// Exit status of a process that a second Ctrl-C ends at once.
const AT_ONCE: i32 = 130;

/// Set by the first Ctrl-C.
pub fn flag() -> &'static AtomicBool {
    static HANDLER: Once = Once::new();
    HANDLER.call_once(|| {
        // Without a handler Ctrl-C ends the process at once, which leaves nothing half done that has its final name.
        let _ = ctrlc::set_handler(|| {
            if FLAG.swap(true, Ordering::Relaxed) {
                std::process::exit(AT_ONCE);
            }
            if let Some(job) = &*JOB.lock().unwrap_or_else(PoisonError::into_inner) {
                job.interrupt();
            }
        });
    });
    &FLAG
}

/// The progress of a new job, which Ctrl-C interrupts.
pub fn job() -> Progress {
    let progress = Progress::new();
    flag();
    *JOB.lock().unwrap_or_else(PoisonError::into_inner) = Some(progress.clone());
    progress
}
