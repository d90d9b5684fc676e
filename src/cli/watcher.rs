//! How far a walk is, how long it will take, and when it is to stop.

use crate::cli::output::is_quiet;
use crate::frame::{Accumulation, FrameWatch};
use crate::session::{Preview, Settings, Watch};
use crate::settings::EffectList;
use brickwalk_convert::progress::Progress;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// After so long it is known how long a walk will take: what is loaded at the start weighs little by then.
const MEASURED: Duration = Duration::from_secs(5);
/// Walks that take longer are told.
const LONG: Duration = Duration::from_secs(60);

/// Shows how far a walk or a field is, says once how long it will take if that is long, and stops it on Ctrl-C.
pub struct Watcher<'a> {
    progress: &'a Progress,
    stop: &'a AtomicBool,
    settings: &'a Settings,
    /// The frame in work.
    pub frame: u32,
    /// Where a frame is shown while it is made.
    pub preview: Option<Preview>,
    start: Instant,
    is_told: bool,
    /// How far the bar is.
    shown: Option<u64>,
}

impl<'a> Watcher<'a> {
    /// Of a walk that begins now.
    pub fn new(progress: &'a Progress, stop: &'a AtomicBool, settings: &'a Settings) -> Self {
        Self { progress, stop, settings, frame: 0, preview: None, start: Instant::now(), is_told: false, shown: None }
    }

    /// The same for the frame `frame`, shown in `preview`.
    pub fn of_frame(&mut self, frame: u32, preview: Option<Preview>) -> &mut Self {
        (self.frame, self.preview) = (frame, preview);
        self
    }

    /// Moves the bar named `name` to `done` of `all`.
    fn show(&mut self, name: &'static str, done: u64, all: u64) {
        if self.shown.is_none() {
            self.progress.phase(name, all);
        }
        self.progress.advance(done.saturating_sub(self.shown.unwrap_or(0)));
        self.shown = Some(done);
    }

    fn goes_on(&self) -> bool {
        !self.stop.load(Ordering::Relaxed)
    }
}

impl FrameWatch for Watcher<'_> {
    fn passes(&mut self, done: u32, about: u32) -> bool {
        let (frames, spp) = (self.settings.frames, self.settings.samples());
        let (done, about) = (u64::from(done), u64::from(about.max(1)));
        let (so_far, all) = (u64::from(self.frame) * about + done, u64::from(frames) * about);
        self.show("passes", so_far, all);
        let sample = if spp > 1 { format!(", sample {}", done * u64::from(spp) / about) } else { String::new() };
        self.progress.name(format!("frame {}{sample}", self.frame));
        let elapsed = self.start.elapsed();
        if !self.is_told && elapsed >= MEASURED {
            self.is_told = true;
            let whole = elapsed.mul_f64(all as f64 / so_far as f64);
            if whole >= LONG && !is_quiet() {
                self.progress.say(&format!("brickwalk: {}", long(self.settings, whole)));
            }
        }
        self.goes_on()
    }

    fn samples(&mut self, finished: u32, sum: &Accumulation) -> bool {
        let spp = self.settings.samples();
        if let Some(preview) = self.preview.as_ref().filter(|_| finished < spp && finished.is_power_of_two()) {
            // A preview that cannot be written is no reason to end the walk.
            let _ = preview.write(&sum.mean());
        }
        finished == spp || self.goes_on()
    }
}

impl Watch for Watcher<'_> {
    fn field(&mut self, rays: u64, about: u64) -> bool {
        self.show("rays of the field", rays, about);
        self.goes_on()
    }
}

/// Lets work go on until the program is to end; shows nothing of it.
pub struct UntilStopped<'a>(pub &'a AtomicBool);

impl FrameWatch for UntilStopped<'_> {
    fn passes(&mut self, _: u32, _: u32) -> bool {
        !self.0.load(Ordering::Relaxed)
    }
}

/// Says that a walk takes `whole`, and what would shorten it.
fn long(settings: &Settings, whole: Duration) -> String {
    let (frames, spp, effects) = (settings.frames, settings.samples(), settings.effects);
    let fewer = [(frames > 1, "--frames"), (spp > 1, "--spp"), (effects != EffectList::PRIMARY, "--effects")];
    let mut shorter: Vec<String> =
        fewer.into_iter().filter(|(has, _)| *has).map(|(_, option)| format!("fewer {option}")).collect();
    shorter.push("a smaller --size".into());
    let a_frame = match frames {
        1 => String::new(),
        _ => format!(", {} a frame", human(whole / frames)),
    };
    format!("this takes about {}{a_frame}; less with {}", human(whole), shorter.join(", "))
}

/// A duration as people read it.
fn human(time: Duration) -> String {
    let seconds = time.as_secs_f64();
    let [minutes, hours, days] = [60.0, 3600.0, 86400.0].map(|unit| seconds / unit);
    match () {
        () if seconds < 10.0 => format!("{seconds:.1} s"),
        () if seconds < 100.0 => format!("{seconds:.0} s"),
        () if minutes < 100.0 => format!("{minutes:.0} minutes"),
        () if hours < 48.0 => format!("{hours:.0} hours"),
        () => format!("{days:.0} days"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_read_at_a_glance() {
        let texts = [0.25, 12.0, 61.0, 1500.0, 31.0 * 3600.0, 1e6].map(|s| human(Duration::from_secs_f64(s)));
        assert_eq!(texts, ["0.2 s", "12 s", "61 s", "25 minutes", "31 hours", "12 days"]);
    }

    #[test]
    fn what_would_shorten_a_walk_is_what_it_has() {
        let said = |options: &str| long(&Settings::from_options(options).unwrap(), Duration::from_secs(300));
        let line = said("--frames 10 --spp 4 --effects ao");
        assert!(line.contains("about 5 minutes, 30 s a frame"), "{line}");
        assert!(line.contains("fewer --frames, fewer --spp, fewer --effects, a smaller --size"), "{line}");
        let line = said("--frames 1 --spp 1 --effects primary");
        assert_eq!(line, "this takes about 5 minutes; less with a smaller --size");
    }
}
