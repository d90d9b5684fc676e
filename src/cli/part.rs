//! `walk --part` and `walk --join`: frames, or bands of them, that are rendered apart, and what makes a walk of them.

use super::options::job_args::PartRange;
use super::watcher::Watcher;
use crate::cli::output::{Usage, note, warn};
use crate::output::atomic;
use crate::session::parts::{self, Made, Part};
use crate::session::{Frame, Preview, Session, Settings};
use crate::settings::sizes::counted;
use anyhow::{Result, bail};
use brickwalk_convert::progress::Progress;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Renders parts of a walk, those that are not there already.
///
/// # Errors
/// Settings with which frames cannot be rendered apart; parts that the walk does not have; as of a walk.
pub fn render(scene: &Path, output: &Path, settings: &Settings, wanted: PartRange) -> Result<()> {
    parts::check(settings).map_err(|error| Usage(error.to_string()))?;
    let all = parts::count(settings);
    if wanted.last >= all {
        let what = if all == settings.frames { "frame" } else { "band" };
        return Err(Usage(format!("--part {wanted}: the walk has {}, from 0", counted(all.into(), what))).into());
    }
    let key = parts::key_of(scene, settings)?;
    let missing: Vec<u32> =
        (wanted.first..=wanted.last).filter(|&number| !parts::is_whole(output, number, &key)).collect();
    let (first, last) = (parts::file(output, wanted.first), parts::file(output, wanted.last));
    if missing.is_empty() {
        return note(&format!("{} to {}: they are there already\n", first.display(), last.display()));
    }
    atomic::create_folder(&parts::folder(output))?;
    let mut session = Session::open(scene, settings)?;
    warn(session.take_warnings());
    let (progress, stop) = (Progress::new(), super::interrupt::flag());
    session.prepare(&mut Watcher::new(&progress, stop, settings))?;
    progress.finish();
    let progress = Progress::new();
    let as_long = Settings { frames: missing.len() as u32, ..settings.clone() };
    let mut watcher = Watcher::new(&progress, stop, &as_long);
    for (done, &number) in (0..).zip(&missing) {
        let Some(part) = session.part(number, watcher.of_frame(done, None))? else {
            bail!("interrupted after {done} of {} parts; the same command renders the others", missing.len());
        };
        warn(session.take_warnings());
        part.write(output, &key)?;
    }
    progress.finish();
    note(&format!("{} to {}: {} rendered\n", first.display(), last.display(), counted(missing.len() as u64, "part")))
}

/// Parts that a walk is joined of.
pub struct Joined {
    output: PathBuf,
    key: String,
    made: Vec<Made>,
}

impl Joined {
    /// Of the walk `key` in this folder.
    pub fn new(output: &Path, key: Result<String>) -> Result<Self> {
        Ok(Self { output: output.to_owned(), key: key?, made: Vec::new() })
    }

    /// The next frame, of its parts; what is missing of it is rendered. `None`: it was stopped.
    pub fn frame(
        &mut self,
        session: &mut Session,
        (frame, preview): (u32, Option<Preview>),
        watcher: &mut Watcher,
    ) -> Result<Option<Frame>> {
        session.frame_of_parts(frame, |session, number| match self.part(session, number) {
            Some(part) => Ok(Some(part)),
            None => session.part(number, watcher.of_frame(number, preview.clone())),
        })
    }

    /// The part `number`, if it is there and whole.
    fn part(&mut self, session: &Session, number: u32) -> Option<Part> {
        if !parts::file(&self.output, number).exists() {
            return None;
        }
        match session.read_part(&self.output, number, &self.key) {
            Ok(part) => {
                self.made.push(part.made.clone());
                Some(part)
            }
            Err(error) => {
                warn([format!("{error:#}; part {number} is rendered here")]);
                None
            }
        }
    }

    /// What summaries say: what the parts are known by, and what each worker did.
    pub fn summary(&self) -> Value {
        let mut workers: BTreeMap<&str, (u64, Made)> = BTreeMap::new();
        for made in &self.made {
            let (parts, all) = workers.entry(&made.worker).or_default();
            *parts += 1;
            all.add(made);
        }
        let row = |(worker, (parts, made)): (&str, (u64, Made))| {
            json!({
                "worker": worker,
                "parts": parts,
                "seconds": made.seconds,
                "bytes_loaded": made.bytes_loaded,
                "requests": made.requests,
                "bytes_fetched": made.bytes_fetched,
                "seconds_waiting": made.seconds_waiting,
            })
        };
        let workers: Vec<Value> = workers.into_iter().map(row).collect();
        json!({ "key": self.key, "joined": self.made.len(), "workers": workers })
    }

    /// Removes the parts of a walk with these settings, which is finished.
    pub fn remove(self, settings: &Settings) {
        for number in 0..parts::count(settings) {
            // One that stays is in nobody's way: it belongs to this walk alone.
            let _ = std::fs::remove_file(parts::file(&self.output, number));
        }
        let _ = std::fs::remove_dir(parts::folder(&self.output));
    }
}
