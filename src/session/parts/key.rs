//! What tells the parts of one walk from those of another.

use crate::session::Settings;
use crate::settings::{Entry, Environment, Group};
use anyhow::{Context, Result};
use std::path::{Path, PathBuf};
use xxhash_rust::xxh3::Xxh3;

/// Settings that change nothing before filters and exposure: where data lie, who computes, and what is done afterwards.
const WITHOUT_EFFECT: [&str; 13] = [
    "adapter",
    "cache",
    "environment",
    "evict",
    "exposure",
    "host_cache",
    "motion",
    "path",
    "progressive",
    "reference",
    "tone_map",
    "video",
    "workers",
];

/// The files that settings name, as far as pictures depend on them. They count by what is in them, not by their names.
fn files(settings: &Settings) -> Vec<PathBuf> {
    let environment = match &settings.environment {
        Some(Environment::File(file)) => Some(file.clone()),
        _ => None,
    };
    let reference = settings.reference.clone().filter(|reference| reference.is_file());
    [settings.path.clone(), settings.motion.clone(), environment, reference].into_iter().flatten().collect()
}

fn push_file(hash: &mut Xxh3, file: &Path) -> Result<()> {
    let bytes = std::fs::read(file).with_context(|| format!("{}: cannot read this file", file.display()))?;
    hash.update(&(bytes.len() as u64).to_le_bytes());
    hash.update(&bytes);
    Ok(())
}

/// 16 hexadecimal digits that only the same settings of the same scene have, with the same program.
///
/// # Errors
/// A file that the settings name cannot be read.
pub fn key(settings: &Settings, scene: u64) -> Result<String> {
    let mut hash = Xxh3::new();
    hash.update(concat!(env!("CARGO_PKG_VERSION"), " ", env!("BRICKWALK_COMMIT")).as_bytes());
    hash.update(&scene.to_le_bytes());
    let counts = |entry: &Entry| !WITHOUT_EFFECT.contains(&entry.key().as_str());
    // What is as it is by default has no part in it, so that builds with fewer settings agree.
    for entry in settings.given().iter().filter(|entry| counts(entry)) {
        let key = entry.key();
        hash.update(format!("{key} = {:?}\n", settings.get(&key)).as_bytes());
    }
    // Without a file an environment counts by its name.
    let name = settings.environment.as_ref().map(|environment| match environment {
        Environment::File(_) => "file".to_owned(),
        other => other.to_string(),
    });
    hash.update(format!("environment = {name:?}\n").as_bytes());
    files(settings).iter().try_for_each(|file| push_file(&mut hash, file))?;
    Ok(format!("{:016x}", hash.digest()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(options: &str) -> String {
        key(&Settings::from_options(options).unwrap(), 7).unwrap()
    }

    #[test]
    fn settings_without_effect_do_not_count() {
        let plain = of("");
        assert_eq!(plain.len(), 16);
        for options in ["--cache 64M", "--exposure 2", "--tone-map aces", "--video a.y4m", "--adapter cpu"] {
            assert_eq!(of(options), plain, "{options}");
        }
        for options in ["--spp 5", "--denoise", "--size 64x36", "--frames 7", "--seed 1", "--environment none"] {
            assert_ne!(of(options), plain, "{options}");
        }
        assert_ne!(key(&Settings::default(), 8).unwrap(), plain, "another scene");
        let known: Vec<String> = Settings::entries().iter().map(Entry::key).collect();
        assert!(WITHOUT_EFFECT.iter().all(|key| known.iter().any(|known| known == key)));
    }

    #[test]
    fn files_count_by_what_is_in_them() {
        let folder = tempfile::tempdir().unwrap();
        let [one, same, other] = ["a.json", "b.json", "c.json"].map(|name| folder.path().join(name));
        std::fs::write(&one, "x").unwrap();
        std::fs::write(&same, "x").unwrap();
        std::fs::write(&other, "y").unwrap();
        let of = |path: &PathBuf| key(&Settings { path: Some(path.clone()), ..Settings::default() }, 7);
        assert_eq!(of(&one).unwrap(), of(&same).unwrap());
        assert_ne!(of(&one).unwrap(), of(&other).unwrap());
        assert!(of(&folder.path().join("none")).unwrap_err().to_string().contains("none"));
    }
}
