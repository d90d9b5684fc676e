//! Scene files that change, shrink or go away while they are read.

use super::frames::{FRAMES, MOST_BYTES, Sound, sound};
use super::{NAME, told};
use crate::kind::{Fault, Kind, Limits, Outcome, Trial};
use crate::random::Random;
use crate::scenes;
use anyhow::Result;
use bricks::{Access, SceneFile};
use std::fs::{File, OpenOptions};
use std::io;
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// What becomes of a file.
#[derive(Clone, Copy, Debug)]
enum Way {
    /// It ends sooner.
    Shortened,
    /// It goes on.
    Longer,
    /// Some of its bytes are others.
    Written,
    /// All of its bytes are others.
    Emptied,
    /// It is removed.
    Removed,
    /// Another takes its name, as where a scene is converted again.
    Replaced,
}

/// Scene files.
pub struct Changed;

impl Way {
    /// Whether a map of the file has fewer pages behind it afterwards. A copy that is under way then ends the process,
    /// so this happens between frames.
    fn shrinks(self) -> bool {
        matches!(self, Self::Shortened | Self::Emptied)
    }

    /// Whether whoever has the file open still reads what it was.
    fn is_harmless(self) -> bool {
        matches!(self, Self::Removed | Self::Replaced | Self::Longer)
    }

    fn happen(self, file: &Path, length: u64, random: &mut Random) -> io::Result<()> {
        let open = || OpenOptions::new().write(true).open(file);
        match self {
            Self::Shortened => open()?.set_len((length as f64 * random.share()) as u64),
            Self::Longer => open()?.set_len(length + random.within(1, 1 << 16) as u64),
            Self::Emptied => File::create(file).map(|_| ()),
            Self::Removed => std::fs::remove_file(file),
            Self::Replaced => {
                let other = file.with_extension("new");
                std::fs::write(&other, b"another file")?;
                std::fs::rename(other, file)
            }
            Self::Written => {
                let open = open()?;
                for _ in 0..random.pick([1, 4, 64]) {
                    let at = random.below(length as usize) as u64;
                    let most = random.pick([1, 8, 4096]).min((length - at) as usize);
                    let bytes: Vec<u8> = (0..most).map(|_| random.word() as u8).collect();
                    open.write_all_at(&bytes, at)?;
                }
                Ok(())
            }
        }
    }
}

impl Kind for Changed {
    fn name(&self) -> &'static str {
        "faults/files"
    }

    fn about(&self) -> &'static str {
        "Frames of a file that is changed, shortened, removed or replaced: right pixels or one line, then right pixels"
    }

    fn limits(&self) -> Limits {
        Limits { seconds: 60.0, bytes: MOST_BYTES }
    }

    fn trial(&self, trial: &Trial) -> Result<Outcome, Fault> {
        let mut random = Random::new(self.name(), trial.seed);
        let sound = sound(&mut random, trial.folder)?;
        let path = trial.folder.join(NAME);
        let made = std::fs::write(&path, &**sound.bytes);
        made.map_err(|error| Fault::new("no file for a trial", error.to_string()))?;
        let way = match random.below(6) {
            0 => Way::Shortened,
            1 => Way::Longer,
            2 => Way::Written,
            3 => Way::Emptied,
            4 => Way::Removed,
            _ => Way::Replaced,
        };
        let is_mapped = random.chance(50);
        let options = format!("{} {}", sound.view, scenes::schedule(&mut random));
        let explained = |fault: Fault| {
            let Fault { what, text } = fault;
            Fault { what, text: format!("{way:?}, mapped: {is_mapped}, {options}: {text}") }
        };
        trial_of(&sound, &path, way, is_mapped, &options, &mut random).map_err(explained)
    }
}

fn trial_of(
    sound: &Sound,
    path: &Path,
    way: Way,
    is_mapped: bool,
    options: &str,
    random: &mut Random,
) -> Result<Outcome, Fault> {
    let access = if is_mapped { Access::Map } else { Access::Read };
    let refused = |error: anyhow::Error| Fault::new("a sound scene is refused", format!("{error:#}"));
    let file = Arc::new(SceneFile::open_with(path, access).map_err(|error| refused(error.into()))?);
    let length = sound.bytes.len() as u64;
    // Before anything is read, or before the second frame; or while the first is rendered.
    let is_early = random.chance(50);
    let is_beside = !(is_mapped && way.shrinks()) && random.chance(50);
    let mut happen = || {
        way.happen(path, length, random).map_err(|error| Fault::new("no change of a file", format!("{way:?}: {error}")))
    };
    let mut outcome = Outcome::Passed;
    let mut renderer = scenes::open(file, path, options).map_err(refused)?;
    let mut note = |frame: Result<()>| match frame {
        Ok(()) => Ok(()),
        Err(error) if way.is_harmless() => {
            Err(Fault::new("a file that is open is not read to its end", format!("{error:#}")))
        }
        Err(error) => told(&error).map(|stopped| outcome = stopped),
    };
    if is_early && !is_beside {
        happen()?;
    }
    if is_beside {
        let wait = Duration::from_micros(if is_early { 500 } else { 3000 });
        let frame = std::thread::scope(|scope| {
            let beside = scope.spawn(|| {
                std::thread::sleep(wait);
                happen()
            });
            let frame = sound.frame(&mut renderer, 0);
            beside.join().unwrap_or_else(|_| Err(Fault::new("no change of a file", "a panic"))).and(frame)
        })?;
        note(frame)?;
    } else {
        note(sound.frame(&mut renderer, 0)?)?;
        if !is_early {
            happen()?;
        }
    }
    for number in 1..FRAMES {
        note(sound.frame(&mut renderer, number)?)?;
    }
    if !way.is_harmless() {
        let again = OpenOptions::new().write(true).open(path).and_then(|file| {
            file.set_len(length)?;
            file.write_all_at(&sound.bytes, 0)
        });
        again.map_err(|error| Fault::new("no file for a trial", error.to_string()))?;
    }
    sound.all(&mut renderer)?;
    Ok(outcome)
}
