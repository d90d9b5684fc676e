//! Settings files.

use super::{Files, Format, Verdict};
use crate::kind::Fault;
use crate::mutate::Harm;
use crate::random::Random;
use brickwalk::Settings;
use brickwalk::settings::Group;
use std::path::Path;

/// Words of settings files.
const NAMES: &[&str] = &[
    "true",
    "false",
    "off",
    "auto",
    "\"off\"",
    "\"auto\"",
    "\"exact\"",
    "\"1G\"",
    "\"5%\"",
    "\"640x360\"",
    "=",
    "[",
    "]",
    "[[",
    "{",
    "}",
    "\"",
    "'''",
    "\\u0000",
    "inf",
    "nan",
    "1979-05-27",
    "0x7fffffffffffffff",
    "\"4ms,2M\"",
    "\"cpu\"",
    "\"diffuse,ao\"",
    "\"roma\"",
    "\"1,2,3\"",
    "\"99999999999999999999G\"",
    "\"1e400\"",
    "#",
];

/// Settings files.
pub struct SettingsFiles;

impl Format for SettingsFiles {
    const NAME: &'static str = "inputs/settings";
    const ABOUT: &'static str = "Settings files: what is read is written and read again alike";
    const NAMES_FILE: bool = false;

    fn make(&self, random: &mut Random, harm: Harm) -> Files {
        let whole = Settings::default().to_toml();
        // Of all settings some: tables keep their heads.
        let kept = random.pick([5, 20, 60, 100]);
        let keeps = |line: &&str| line.starts_with('[') || random.chance(kept);
        let mut text = whole.lines().filter(keeps).fold(String::new(), |text, line| text + line + "\n").into_bytes();
        harm.words(random, &mut text, NAMES, 90);
        harm.bytes(random, &mut text, 20);
        Files::one("a.toml", text)
    }

    fn read(&self, _: &mut Random, files: &Files, _: &Path) -> Result<Verdict, Fault> {
        let Ok(text) = std::str::from_utf8(files.bytes()) else { return Ok(Verdict::Refused("not UTF-8".into())) };
        let settings = match Settings::from_toml(text).and_then(|settings| settings.check().map(|()| settings)) {
            Ok(settings) => settings,
            Err(error) => return Ok(Verdict::Refused(error.to_string())),
        };
        let same = |all: &Settings| {
            Settings::entries().iter().all(|entry| all.get(&entry.key()) == settings.get(&entry.key()))
        };
        for written in [settings.to_toml(), settings.to_given_toml()] {
            match Settings::from_toml(&written) {
                Ok(again) if same(&again) => {}
                Ok(_) => return Err(Fault::new("settings are not read as they were written", written)),
                Err(error) => return Err(Fault::new("settings that were written are refused", error.to_string())),
            }
        }
        Ok(Verdict::Read)
    }
}
