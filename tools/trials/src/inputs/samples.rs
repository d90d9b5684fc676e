//! Files of the folder that BRICKWALK_SCENES names: what cannot be made here, such as Draco and KTX2.

use super::{Files, Format, Verdict, imported};
use crate::kind::Fault;
use crate::mutate::Harm;
use crate::random::Random;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Most bytes of a model with all that lies beside it: trials are to be fast.
const MOST_BYTES: u64 = 400_000;

/// Most triangles for a byte.
const TRIANGLES_A_BYTE: u64 = 4096;

/// Folders of small models below the folder of scenes, sorted, with the names of models in each.
fn models() -> &'static [PathBuf] {
    static MODELS: OnceLock<Vec<PathBuf>> = OnceLock::new();
    MODELS.get_or_init(|| {
        let mut found = Vec::new();
        let mut open: Vec<PathBuf> = std::env::var_os("BRICKWALK_SCENES").map(PathBuf::from).into_iter().collect();
        while let Some(folder) = open.pop() {
            let entries: Vec<_> = std::fs::read_dir(&folder).into_iter().flatten().flatten().collect();
            let lengths = entries.iter().filter_map(|entry| entry.metadata().ok()).filter(std::fs::Metadata::is_file);
            let is_small = lengths.map(|metadata| metadata.len()).sum::<u64>() <= MOST_BYTES;
            for path in entries.iter().map(std::fs::DirEntry::path) {
                let extension = path.extension().and_then(|extension| extension.to_str());
                if path.is_dir() {
                    open.push(path);
                } else if is_small && matches!(extension, Some("gltf" | "glb")) {
                    found.push(path);
                }
            }
        }
        found.sort();
        found
    })
}

/// Models of others.
pub struct Samples;

impl Format for Samples {
    const NAME: &'static str = "inputs/samples";
    const ABOUT: &'static str = "Small models of BRICKWALK_SCENES, Draco and KTX2 among them: any byte of any file";
    const MOST_BYTES: u64 = 256 << 20;
    // Some are bad on purpose.
    const IS_SOUND: bool = false;

    fn make(&self, random: &mut Random, harm: Harm) -> Files {
        let Some(model) = random.pick_from(models()) else { return Files::default() };
        let folder = model.parent().unwrap_or(Path::new("."));
        let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let mut files = vec![(name(model), std::fs::read(model).unwrap_or_default())];
        let mut others: Vec<PathBuf> =
            std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path()).collect();
        others.sort();
        for other in others.iter().filter(|other| *other != model && other.is_file()) {
            files.push((name(other), std::fs::read(other).unwrap_or_default()));
        }
        let at = random.below(files.len());
        harm.bytes(random, &mut files[at].1, 100);
        Files(files)
    }

    fn read(&self, random: &mut Random, files: &Files, folder: &Path) -> Result<Verdict, Fault> {
        imported::read(random, files, folder, TRIANGLES_A_BYTE)
    }

    fn lacks(&self) -> Option<String> {
        models().is_empty().then(|| "BRICKWALK_SCENES names no folder with small models".into())
    }
}
