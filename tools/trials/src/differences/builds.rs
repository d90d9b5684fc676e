//! Conversions of one source that differ in what changes no byte.

use super::MOST_BYTES;
use crate::kind::{Fault, Kind, Limits, Outcome, Trial};
use crate::random::Random;
use crate::scenes;
use brickwalk_convert::build::BuildSettings;

/// Conversions.
pub struct Builds;

impl Kind for Builds {
    fn name(&self) -> &'static str {
        "differences/builds"
    }

    fn about(&self) -> &'static str {
        "Conversions with other threads and less memory: the same bytes, and what reads them finds nothing wrong"
    }

    fn limits(&self) -> Limits {
        Limits { seconds: 60.0, bytes: MOST_BYTES }
    }

    fn trial(&self, trial: &Trial) -> Result<Outcome, Fault> {
        let mut random = Random::new(self.name(), trial.seed);
        let source = scenes::source(&mut random);
        let mut settings = scenes::settings(&mut random, &source);
        settings.lod = random.chance(30);
        settings.proxies = random.chance(30);
        let others = [
            BuildSettings { threads: Some(random.within(2, 4)), ..settings.clone() },
            BuildSettings { memory_bytes: Some(96 << 20), ..settings.clone() },
        ];
        let read = |settings: &BuildSettings, name: &str| {
            let file = trial.folder.join(name);
            scenes::convert(source.scene.clone(), settings, &file)?;
            std::fs::read(&file).map_err(|error| Fault::new("no file was made", error.to_string()))
        };
        let first = read(&settings, "a.bricks")?;
        for other in &others {
            if read(other, "b.bricks")? != first {
                return Err(Fault::new("other bytes", format!("{other:?}")));
            }
        }
        let report = bricks::verify_file(trial.folder.join("a.bricks"), &mut |_, _| ());
        match report {
            Ok(report) if report.is_ok() => Ok(Outcome::Passed),
            Ok(report) => Err(Fault::new("a new scene is damaged", format!("{:?}", report.problems))),
            Err(error) => Err(Fault::new("a new scene is damaged", error.to_string())),
        }
    }
}
