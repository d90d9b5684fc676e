//! Files of rates, by which `--secondary auto` decides.

use super::{Files, Format, Verdict, refused};
use crate::kind::Fault;
use crate::mutate::Harm;
use crate::random::Random;
use brickwalk::session::auto::rates::RateFile;
use serde_json::json;
use std::path::Path;

/// Keys of the file.
const NAMES: &[&str] = &[
    "version",
    "devices",
    "any",
    "scenes",
    "name",
    "rates",
    "primary",
    "byte",
    "flip",
    "exact",
    "methods",
    "effect",
    "making",
    "sample",
    "ray",
    "percent",
    "flip_error",
    "diffuse",
];

/// Files of rates.
pub struct RateFiles;

impl Format for RateFiles {
    const NAME: &'static str = "inputs/rates";
    const ABOUT: &'static str = "Files of rates: what is read is written and read again alike";

    fn make(&self, random: &mut Random, harm: Harm) -> Files {
        let method = json!({"effect": "diffuse", "name": "roma", "making": 0.5, "sample": 0.1, "ray": 1e-7,
            "percent": [1, 2], "flip_error": [0.01, 0.02]});
        let rates =
            json!({"primary": 1e-7, "byte": 1e-9, "flip": 1e-8, "exact": {"diffuse": 2e-7}, "methods": [method]});
        let scenes = json!({"0123456789abcdef": {"name": "a", "rates": rates}});
        let mut root = json!({"version": 1, "devices": {"cpu": {"any": rates, "scenes": scenes}}});
        harm.json(random, &mut root, NAMES, 90);
        let mut bytes = root.to_string().into_bytes();
        harm.bytes(random, &mut bytes, 15);
        Files::one("rates.json", bytes)
    }

    fn read(&self, _: &mut Random, files: &Files, folder: &Path) -> Result<Verdict, Fault> {
        let path = files.write(folder)?;
        let rates = match RateFile::read(&path) {
            Ok(Some(rates)) => rates,
            Ok(None) => return Err(Fault::new("a file of rates is not seen", files.name())),
            Err(error) => return refused(&error),
        };
        let again = folder.join("again.json");
        let read = rates.write(&again).and_then(|()| RateFile::read(&again));
        match read {
            Ok(Some(read)) if read == rates => Ok(Verdict::Read),
            other => Err(Fault::new("rates are not read as they were written", format!("{other:?}"))),
        }
    }
}
