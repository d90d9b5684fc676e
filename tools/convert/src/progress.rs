//! Progress of long work: a bar on a terminal, silence in a pipe.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use std::fmt::Write;
use std::io::{IsTerminal, Write as _};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether nothing is drawn.
static IS_SILENT: AtomicBool = AtomicBool::new(false);

/// Somebody asked a job to stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("interrupted")]
pub struct Interrupted;

/// Progress of one job through named phases, and the wish that it stop. Cheap to clone; any thread may report.
#[derive(Clone, Debug)]
pub struct Progress {
    bar: ProgressBar,
    interrupted: Arc<AtomicBool>,
}

impl Progress {
    /// Draws on standard error when it is a terminal, else nothing.
    pub fn new() -> Self {
        let is_drawn = std::io::stderr().is_terminal() && !IS_SILENT.load(Ordering::Relaxed);
        let target = if is_drawn { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        Self { bar: ProgressBar::with_draw_target(None, target), interrupted: Arc::default() }
    }

    /// From now on nothing is drawn in this process.
    pub fn silence() {
        IS_SILENT.store(true, Ordering::Relaxed);
    }

    /// Draws nothing.
    pub fn hidden() -> Self {
        Self { bar: ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden()), interrupted: Arc::default() }
    }

    /// Starts the phase `name` of `total` steps (0: unknown).
    pub fn phase(&self, name: &'static str, total: u64) {
        // The templates are constants that indicatif accepts; falling back to the default style loses only looks.
        let template = match total {
            0 => "{msg:>12} {spinner} {human_pos}  {rate}  {elapsed}",
            _ => "{msg:>12} [{bar:32}] {human_pos}/{human_len}  {rate}  {eta} left",
        };
        let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
        let style = style.with_key("rate", |state: &ProgressState, out: &mut dyn Write| {
            let _ = out.write_str(&rate(state.per_sec()));
        });
        self.bar.reset();
        self.bar.set_style(style);
        self.bar.set_length(total);
        self.bar.set_message(name);
    }

    /// Names what is under way in the current phase.
    pub fn name(&self, name: String) {
        self.bar.set_message(name);
    }

    /// Prints a line on standard error, beside the bar.
    pub fn say(&self, line: &str) {
        self.bar.suspend(|| {
            // Whoever closed standard error does not want to know.
            let _ = writeln!(std::io::stderr(), "{line}");
        });
    }

    /// Advances the current phase by `steps`.
    pub fn advance(&self, steps: u64) {
        self.bar.inc(steps);
    }

    /// How far the current phase is: its name, the steps that are done, and all; 0: not known.
    pub fn so_far(&self) -> (String, u64, u64) {
        (self.bar.message(), self.bar.position(), self.bar.length().unwrap_or(0))
    }

    /// Asks the job to stop as soon as it can; what it has begun it takes back or leaves so that it can be continued.
    pub fn interrupt(&self) {
        self.interrupted.store(true, Ordering::Relaxed);
    }

    /// Whether to go on.
    ///
    /// # Errors
    /// Somebody asked to stop.
    pub fn check(&self) -> Result<(), Interrupted> {
        if self.interrupted.load(Ordering::Relaxed) { Err(Interrupted) } else { Ok(()) }
    }

    /// Ends the job and clears the bar.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// Steps a second as people read them: three digits, with a unit of 1000.
fn rate(per_second: f64) -> String {
    let unit = [(1e9, "G"), (1e6, "M"), (1e3, "K"), (1.0, "")].into_iter().find(|(unit, _)| per_second >= *unit);
    let (unit, name) = unit.unwrap_or((1.0, ""));
    let value = per_second / unit;
    let decimals = if value >= 100.0 {
        0
    } else if value >= 10.0 {
        1
    } else {
        2
    };
    format!("{value:.decimals$}{name}/s")
}

impl Default for Progress {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::rate;

    #[test]
    fn rates_have_three_digits() {
        let texts = [346_391.5, 0.25, 12.345, 1e6, 999.6, 0.0].map(rate);
        assert_eq!(texts, ["346K/s", "0.25/s", "12.3/s", "1.00M/s", "1000/s", "0.00/s"]);
    }
}
