//! What a studio has been told and not yet looked at.

use super::{Ask, Wish};
use crate::stream::sync::{AtomicBool, Condvar, Mutex, MutexGuard};
use bricks::planted::{self, Defect};
use brickwalk_convert::progress::Progress;
use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::PoisonError;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

#[derive(Default)]
struct Waiting {
    wish: Option<Wish>,
    asks: VecDeque<Ask>,
    /// Of an open question: the scene file that a model became, or why it did not.
    converted: Option<(PathBuf, Result<PathBuf, String>)>,
    conversion: Option<(PathBuf, Progress)>,
    has_quit: bool,
}

/// The next thing to do.
#[derive(Debug)]
pub enum Turn {
    /// End.
    Quit,
    /// Answer.
    Ask(Ask),
    /// A conversion came to its end.
    Converted(PathBuf, Result<PathBuf, String>),
    /// This is wished now.
    Wish(Box<Wish>),
    /// Nothing new came in time.
    Nothing,
}

/// Wishes, of which the latest counts, and questions, all of which do.
#[derive(Default)]
pub struct Inbox {
    waiting: Mutex<Waiting>,
    changed: Condvar,
    /// Whether there is something that a picture in work should give way to.
    is_newer: AtomicBool,
}

impl Inbox {
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn put(&self, change: impl FnOnce(&mut Waiting)) {
        let mut waiting = self.lock();
        change(&mut waiting);
        // Before whoever takes it can say that there is nothing more.
        self.is_newer.store(true, Ordering::Relaxed);
        drop(waiting);
        if !planted::is(Defect::Unnotified) {
            self.changed.notify_all();
        }
    }

    /// Replaces the wish.
    pub fn wish(&self, wish: Wish) {
        self.put(|waiting| waiting.wish = Some(wish));
    }

    /// One more question.
    pub fn ask(&self, ask: Ask) {
        self.put(|waiting| waiting.asks.push_back(ask));
    }

    /// The end of everything, and of a conversion that is under way.
    pub fn quit(&self) {
        self.put(|waiting| {
            waiting.has_quit = true;
            if let Some((_, progress)) = &waiting.conversion {
                progress.interrupt();
            }
        });
    }

    /// A conversion begins; one before it ends.
    pub fn begin_conversion(&self, path: PathBuf, progress: Progress) {
        let before = self.lock().conversion.replace((path, progress));
        if let Some((_, before)) = before {
            before.interrupt();
        }
    }

    /// The conversion of `path` has ended.
    pub fn end_conversion(&self, path: PathBuf, made: Result<PathBuf, String>) {
        self.put(|waiting| {
            // Of another one that is no longer waited for nothing is told.
            if waiting.conversion.as_ref().is_some_and(|(own, _)| *own == path) {
                waiting.conversion = None;
                waiting.converted = Some((path, made));
            }
        });
    }

    /// The conversion that is under way.
    pub fn conversion(&self) -> Option<(PathBuf, Progress)> {
        self.lock().conversion.clone()
    }

    /// Whether a picture in work should give way.
    pub fn is_newer(&self) -> bool {
        self.is_newer.load(Ordering::Relaxed)
    }

    /// The next thing to do, waited for at most so long; `None`: for ever.
    pub fn next(&self, most: Option<Duration>) -> Turn {
        let end = most.map(|most| Instant::now() + most);
        let mut waiting = self.lock();
        loop {
            if let Some(turn) = waiting.take() {
                let is_more = waiting.has_quit || waiting.wish.is_some() || !waiting.asks.is_empty();
                self.is_newer.store(is_more, Ordering::Relaxed);
                return turn;
            }
            self.is_newer.store(false, Ordering::Relaxed);
            waiting = match end {
                None => self.changed.wait(waiting).unwrap_or_else(PoisonError::into_inner),
                Some(end) => {
                    let Some(left) = end.checked_duration_since(Instant::now()).filter(|left| !left.is_zero()) else {
                        return Turn::Nothing;
                    };
                    self.changed.wait_timeout(waiting, left).unwrap_or_else(PoisonError::into_inner).0
                }
            };
        }
    }
}

impl Waiting {
    fn take(&mut self) -> Option<Turn> {
        if self.has_quit {
            return Some(Turn::Quit);
        }
        if let Some((path, made)) = self.converted.take() {
            return Some(Turn::Converted(path, made));
        }
        if let Some(ask) = self.asks.pop_front() {
            return Some(Turn::Ask(ask));
        }
        self.wish.take().map(|wish| Turn::Wish(Box::new(wish)))
    }
}
