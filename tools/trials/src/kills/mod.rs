//! Kinds of kills: a command that writes is ended at a random moment, and run again. Then the files are those of a run
//! that nobody ended, nothing is left beside them, and what was there before was whole all the time.

pub mod all;
mod end;
mod files;

use crate::kind::{Fault, Kind, Limits, Outcome, Trial};
use crate::random::Random;
use end::End;
use files::Snapshot;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A kind of kills.
#[derive(Debug)]
pub struct Kills {
    /// `kills/` and a word.
    pub name: &'static str,
    /// What is ended.
    pub about: &'static str,
    /// Commands that make the inputs, words with spaces between them; `*` begins one that makes rays.
    pub before: &'static [&'static str],
    /// The command; `@` begins one of another program, which is looked for on PATH.
    pub words: &'static str,
    /// Further words of the command that is run again.
    pub again: &'static str,
    /// A file that the command replaces: it is old or new at all times.
    pub output: Option<&'static str>,
    /// Folders that an orderly end may leave, to go on from.
    pub keeps: &'static [&'static str],
}

/// What a run that nobody ended makes, and of what.
#[derive(Clone, Debug)]
struct Whole {
    inputs: Snapshot,
    files: Snapshot,
    duration: Duration,
}

/// What was made of a kind in this process.
static WHOLE: Mutex<Option<(&'static str, Whole)>> = Mutex::new(None);

/// How a run ended: its status, none of one that was killed, and what it said.
#[derive(Debug)]
struct Run {
    status: Option<i32>,
    said: String,
}

impl Kind for Kills {
    fn name(&self) -> &'static str {
        self.name
    }

    fn about(&self) -> &'static str {
        self.about
    }

    fn limits(&self) -> Limits {
        Limits { seconds: 1000.0, bytes: 1 << 30 }
    }

    fn lacks(&self) -> Option<String> {
        let name = self.words.split_whitespace().next()?.strip_prefix('@')?;
        let folders = std::env::var_os("PATH").unwrap_or_default();
        let is_there = std::env::split_paths(&folders).any(|folder| folder.join(name).is_file());
        (!is_there).then(|| format!("{name} is not on PATH; tools/cluster/test.sh installs it"))
    }

    fn trial(&self, trial: &Trial) -> Result<Outcome, Fault> {
        let whole = self.whole(trial)?;
        let mut random = Random::new(self.name, trial.seed);
        let folder = trial.folder;
        whole.inputs.write(folder)?;
        let end = End::random(&mut random, whole.duration, whole.files.largest());
        // What was there before: of another run, or nothing.
        let old = self.output.filter(|_| random.chance(50));
        let inputs_have_it = self.output.is_some_and(|name| whole.inputs.get(name).is_some());
        if let Some(name) = old.filter(|_| !inputs_have_it) {
            std::fs::write(folder.join(name), b"old").map_err(|error| Fault::new("set up", error.to_string()))?;
        }
        let before = Snapshot::read(folder)?;
        let run = end.run(self.command(trial, folder, ""))?;
        let about = |text: String| format!("{end}: {text}; status {:?}: {}", run.status, run.said);
        self.judge(&end, &run, &whole, &before, folder)
            .map_err(|Fault { what, text }| Fault { what, text: about(text) })?;
        let is_done = run.status == Some(0);
        let again = if random.chance(75) { self.again } else { "" };
        let start = Instant::now();
        let last = End::None.run(self.command(trial, folder, again))?;
        if again.is_empty() {
            self.note(start.elapsed());
        }
        if last.status != Some(0) {
            let text = about(format!("then status {:?}: {}", last.status, last.said));
            return Err(Fault::new("it does not run again", text));
        }
        if let Some(difference) = Snapshot::read(folder)?.difference(&whole.files) {
            return Err(Fault::new("other files than of a run that nobody ended", about(difference)));
        }
        Ok(if is_done { Outcome::Passed } else { Outcome::Stopped })
    }
}

impl Kills {
    /// What a run makes that nobody ends; made once a process.
    fn whole(&self, trial: &Trial) -> Result<Whole, Fault> {
        let mut known = WHOLE.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((name, whole)) = &*known
            && *name == self.name
        {
            return Ok(whole.clone());
        }
        let folder = trial.shared.join("whole");
        std::fs::create_dir_all(&folder).map_err(|error| Fault::new("set up", error.to_string()))?;
        for words in self.before {
            self.prepare(words, trial, &folder)?;
        }
        let inputs = Snapshot::read(&folder)?;
        let start = Instant::now();
        let run = End::None.run(self.command(trial, &folder, ""))?;
        if run.status != Some(0) {
            return Err(Fault::new("it does not run", format!("status {:?}: {}", run.status, run.said)));
        }
        let whole = Whole { inputs, files: Snapshot::read(&folder)?, duration: start.elapsed() };
        *known = Some((self.name, whole.clone()));
        Ok(whole)
    }

    /// Notes how long a run took that nobody ended: the first may have waited for other programs, and moments after the
    /// end of the others would then be drawn.
    fn note(&self, duration: Duration) {
        let mut known = WHOLE.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((name, whole)) = &mut *known
            && *name == self.name
        {
            whole.duration = whole.duration.min(duration);
        }
    }

    /// Makes an input.
    fn prepare(&self, words: &str, trial: &Trial, folder: &Path) -> Result<(), Fault> {
        if let Some(name) = words.strip_prefix('*') {
            return files::numbers(&folder.join(name));
        }
        if let Some(name) = words.strip_prefix('!') {
            return files::damage(&folder.join(name));
        }
        let run = End::None.run(command(trial.program, folder, words.split_whitespace().map(OsString::from)))?;
        match run.status {
            Some(0) => Ok(()),
            status => Err(Fault::new("set up", format!("{words}: status {status:?}: {}", run.said))),
        }
    }

    fn command(&self, trial: &Trial, folder: &Path, more: &str) -> Command {
        let mut words = self.words.split_whitespace().chain(more.split_whitespace()).peekable();
        let other = words.next_if(|word| word.starts_with('@')).map(|word| Path::new(&word[1..]));
        let mut command = command(other.unwrap_or(trial.program), folder, words.map(OsString::from));
        if other.is_some() {
            command.env("BRICKWALK", trial.program);
        }
        command
    }

    /// Whether a run ended as it should, and left what it should.
    fn judge(&self, end: &End, run: &Run, whole: &Whole, before: &Snapshot, folder: &Path) -> Result<(), Fault> {
        let is_own = |line: &&str| line.starts_with("brickwalk: ") || line.starts_with("brickwalk-cluster: ");
        let is_told = run.said.lines().filter(is_own).count() == 1 && !run.said.contains("panicked");
        match run.status {
            Some(0) => {}
            Some(1) if is_told && end.is_told() => {}
            None | Some(130 | 143) if end.is_signal() => {}
            None if end.is_cut(run) => {}
            _ => return Err(Fault::new("it ends neither well nor with one line", "the end")),
        }
        let after = Snapshot::read(folder)?;
        if let Some(name) = self.output {
            let (now, then, new) = (after.get(name), before.get(name), whole.files.get(name));
            if now != then && now != new {
                return Err(Fault::new(
                    "a file is neither old nor new",
                    format!("{name}: {:?} bytes", now.map(<[u8]>::len)),
                ));
            }
        }
        if let Some(broken) = after.broken(before) {
            return Err(Fault::new("a file that has its name is not whole", broken));
        }
        // Who is killed leaves what the next run takes away.
        if end.leaves_nothing() && !end.is_cut(run) {
            let is_kept = |name: &str| self.keeps.iter().any(|keeps| name.starts_with(keeps));
            let extra = after
                .names()
                .find(|name| before.get(name).is_none() && whole.files.get(name).is_none() && !is_kept(name));
            if let Some(name) = extra {
                return Err(Fault::new("a temporary file is left", name));
            }
        }
        Ok(())
    }
}

/// A command in a folder.
fn command(program: &Path, folder: &Path, words: impl Iterator<Item = OsString>) -> Command {
    let mut command = Command::new(PathBuf::from(program));
    command.args(words).current_dir(folder).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    // Of no user: neither settings nor rates of the machine count.
    command.env("BRICKWALK_CONFIG_DIR", folder.join(".config")).env_remove("BRICKWALK_ADAPTER");
    command
}
