//! What a studio has been told and not yet looked at.

use super::{Ask, Wish};
use brickwalk_convert::progress::Progress;
use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
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
        change(&mut self.lock());
        self.is_newer.store(true, Ordering::Relaxed);
        self.changed.notify_all();
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Camera;
    use crate::session::Settings;
    use crate::view::studio::Overlay;
    use glam::DVec3;

    fn wish(x: f64) -> Wish {
        let camera = Camera { position: DVec3::X * x, target: DVec3::ZERO, up: DVec3::Y, fov_y: 1.0 };
        Wish { camera, settings: Settings::default(), overlay: Overlay::None }
    }

    #[test]
    fn the_latest_wish_counts_and_every_question_does() {
        let inbox = Inbox::default();
        assert!(matches!(inbox.next(Some(Duration::ZERO)), Turn::Nothing) && !inbox.is_newer());
        inbox.wish(wish(1.0));
        inbox.ask(Ask::Compare);
        inbox.wish(wish(2.0));
        inbox.ask(Ask::Save("a.png".into()));
        assert!(inbox.is_newer());
        assert!(matches!(inbox.next(None), Turn::Ask(Ask::Compare)));
        assert!(matches!(inbox.next(None), Turn::Ask(Ask::Save(_))) && inbox.is_newer());
        assert!(matches!(inbox.next(None), Turn::Wish(latest) if latest.camera.position.x == 2.0));
        assert!(!inbox.is_newer() && matches!(inbox.next(Some(Duration::from_millis(1))), Turn::Nothing));
        inbox.quit();
        assert!(matches!(inbox.next(None), Turn::Quit) && inbox.is_newer());
    }

    #[test]
    fn a_conversion_that_was_replaced_is_stopped_and_not_told() {
        let inbox = Inbox::default();
        let [first, second] = [Progress::hidden(), Progress::hidden()];
        inbox.begin_conversion("a.obj".into(), first.clone());
        inbox.begin_conversion("b.obj".into(), second.clone());
        assert!(first.check().is_err() && second.check().is_ok());
        inbox.end_conversion("a.obj".into(), Err("interrupted".into()));
        assert!(matches!(inbox.next(Some(Duration::ZERO)), Turn::Nothing));
        inbox.end_conversion("b.obj".into(), Ok("b.bricks".into()));
        assert!(matches!(inbox.next(None), Turn::Converted(path, Ok(_)) if path.ends_with("b.obj")));
        assert!(inbox.conversion().is_none());
    }
}
