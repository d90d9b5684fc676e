//! What a page tells the server.

use super::{Files, Format, Verdict};
use crate::kind::Fault;
use crate::mutate::Harm;
use crate::random::Random;
use brickwalk::Settings;
use brickwalk::view::serve::told::{Told, open, set};
use serde_json::json;
use std::path::Path;

/// Keys and texts of messages.
const NAMES: &[&str] = &[
    "do",
    "taken",
    "size",
    "thrust",
    "look",
    "orbit",
    "dolly",
    "click",
    "measure",
    "home",
    "find",
    "node",
    "overlay",
    "set",
    "key",
    "value",
    "width",
    "height",
    "at",
    "right",
    "up",
    "steps",
    "double",
    "text",
    "act",
    "go",
    "hide",
    "number",
    "effects",
    "ao_rays",
    "diffuse_rays",
    "sun",
    "environment",
    "spp",
    "lod",
    "exposure",
    "tone_map",
    "denoise",
    "primary,diffuse",
    "auto",
    "sky",
    "off",
    "/etc/passwd",
    "1e9",
    "-1",
    "aces",
    "0.5",
    "1,2,3",
    "cache",
];

/// Messages.
pub struct Messages;

impl Format for Messages {
    const NAME: &'static str = "inputs/messages";
    const ABOUT: &'static str = "Messages of a page to the server: no setting changes but those that a page may set";
    const IS_LINE: bool = false;
    const NAMES_FILE: bool = false;

    fn make(&self, random: &mut Random, harm: Harm) -> Files {
        let key = random.pick_from(open()).copied().unwrap_or("spp");
        let value = random.pick_from(NAMES).copied().unwrap_or("1");
        let mut message = match random.below(6) {
            0 => json!({"do": "look", "right": 0.5, "up": -1}),
            1 => json!({"do": "orbit", "at": [0.5, 0.25], "right": 0, "up": 0}),
            2 => json!({"do": "size", "width": 640, "height": 360}),
            _ => json!({"do": "set", "key": key, "value": value}),
        };
        harm.json(random, &mut message, NAMES, 70);
        let mut text = message.to_string().into_bytes();
        harm.bytes(random, &mut text, 20);
        Files::one("message", text)
    }

    fn read(&self, _: &mut Random, files: &Files, _: &Path) -> Result<Verdict, Fault> {
        let told = match serde_json::from_slice::<Told>(files.bytes()) {
            Ok(told) => told,
            Err(error) => return Ok(Verdict::Refused(error.to_string())),
        };
        let Told::Set { key, value } = told else { return Ok(Verdict::Read) };
        let before = Settings::default();
        let mut settings = before.clone();
        let done = set(&mut settings, &key, &value);
        if !open().contains(&key.as_str()) && settings != before {
            return Err(Fault::new("a page changes what it may not", format!("{key} = {value}")));
        }
        match done {
            Ok(()) if settings.check().is_err() => {
                Err(Fault::new("a page sets what is wrong", format!("{key} = {value}")))
            }
            Ok(()) => Ok(Verdict::Read),
            Err(_) if settings != before => Err(Fault::new("a refusal changes settings", format!("{key} = {value}"))),
            // A value of a sound message may be none of its setting.
            Err(_) => Ok(Verdict::Read),
        }
    }
}
