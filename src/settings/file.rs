//! Settings files: TOML in which every key is a setting. What is printed can be read again.

use super::group::{Entry, Group, SettingsError};
use super::value::Plain;
use serde::Deserialize;
use serde::de::{Deserializer, Error as _};
use serde::ser::{SerializeMap, Serializer};
use std::collections::BTreeMap;
use std::path::Path;

/// What a key of a file holds.
#[derive(Deserialize)]
#[serde(untagged)]
enum Held {
    Plain(Plain),
    Table(BTreeMap<String, Plain>),
}

/// As a file or a summary has a value: what is absent although it is not so in `base` is written as `off`.
fn shown<G: Group>(group: &G, base: &G, entry: &Entry) -> Option<Plain> {
    let key = entry.key();
    match group.get(&key)? {
        Plain::Absent if base.get(&key) == Some(Plain::Absent) => None,
        Plain::Absent => Some(Plain::Text(Plain::Absent.to_string())),
        value => Some(value),
    }
}

/// Serialises a group as a map, tables as maps in it.
///
/// # Errors
/// The serialiser's.
pub fn serialize<G: Group, S: Serializer>(group: &G, serializer: S) -> Result<S::Ok, S::Error> {
    let (entries, base) = (G::entries(), group.base());
    let value = |entry: &Entry| shown(group, &base, entry);
    let mut map = serializer.serialize_map(None)?;
    let mut tables: Vec<&'static str> = Vec::new();
    for entry in &entries {
        match (entry.table, value(entry)) {
            ("", Some(value)) => map.serialize_entry(entry.field.key, &value)?,
            ("", None) => {}
            (table, _) if tables.contains(&table) => {}
            (table, _) => {
                tables.push(table);
                let inner = entries.iter().filter(|entry| entry.table == table);
                let inner: serde_json::Map<String, serde_json::Value> = inner
                    .filter_map(|entry| Some((entry.field.key.to_string(), serde_json::to_value(value(entry)?).ok()?)))
                    .collect();
                map.serialize_entry(table, &inner)?;
            }
        }
    }
    map.end()
}

/// Reads a group from a map: what it lacks is as it is by default, what is unknown is refused.
///
/// # Errors
/// The deserialiser's; an unknown key; a value that is none of the setting.
pub fn deserialize<'de, G: Group, D: Deserializer<'de>>(deserializer: D) -> Result<G, D::Error> {
    let mut group = G::default();
    fill(&mut group, BTreeMap::deserialize(deserializer)?).map_err(D::Error::custom)?;
    Ok(group)
}

fn fill<G: Group>(group: &mut G, held: BTreeMap<String, Held>) -> Result<(), SettingsError> {
    let mut all = Vec::new();
    for (key, held) in held {
        match held {
            Held::Plain(value) => all.push((key, value.to_string())),
            Held::Table(table) => {
                all.extend(table.into_iter().map(|(inner, value)| (format!("{key}.{inner}"), value.to_string())));
            }
        }
    }
    group.set_all(&all)
}

/// Gives a group what the TOML in `text` says.
///
/// # Errors
/// It is no TOML; an unknown key; a value that is none of the setting.
pub fn read_toml<G: Group>(group: &mut G, text: &str) -> Result<(), SettingsError> {
    // One line, as all errors are.
    let line = |error: toml::de::Error| {
        let before = error.span().and_then(|span| text.get(..span.start)).unwrap_or_default();
        let at = before.lines().count().max(1);
        SettingsError::Syntax(format!("line {at}: {}", error.message().replace('\n', ", ")))
    };
    fill(group, toml::from_str(text).map_err(line)?)
}

/// Gives a group what a settings file says.
///
/// # Errors
/// It cannot be read; as of [`read_toml`].
pub fn read_file<G: Group>(group: &mut G, file: &Path) -> anyhow::Result<()> {
    let context = || file.display().to_string();
    let text = std::fs::read_to_string(file).map_err(|error| anyhow::Error::new(error).context(context()))?;
    read_toml(group, &text).map_err(|error| anyhow::Error::new(error).context(context()))
}

/// A group as a settings file: every setting with what it does, its unit and its range.
pub fn to_toml<G: Group>(group: &G) -> String {
    let mut text = String::from("# Settings of brickwalk; read them with --settings FILE.\n");
    let (mut table, mut heading) = ("", None);
    let (mut entries, base) = (G::entries(), group.base());
    entries.sort_by_key(|entry| (entry.table, entry.field.heading));
    for entry in entries {
        let field = entry.field;
        if entry.table != table {
            table = entry.table;
            text += &format!("\n[{table}]\n");
        } else if table.is_empty() && heading != Some(field.heading) {
            text += &format!("\n# {}\n", field.heading.name());
        }
        heading = Some(field.heading);
        let mut notes = vec![field.summary()];
        notes.extend(Some(field.range()).filter(|note| !note.is_empty()));
        if !field.names.is_empty() {
            notes.push(field.names.join(", "));
        }
        text += &format!("# {}\n", notes.join("; "));
        text += &match shown(group, &base, &entry) {
            Some(value) => format!("{} = {}\n", field.key, toml_value(&value)),
            None => format!("# {} =\n", field.key),
        };
    }
    text
}

/// A group as a settings file of what is not as it is by default: builds with fewer settings read it as well.
pub fn given_toml<G: Group>(group: &G) -> String {
    let line = |entry: &Entry| Some(format!("{} = {}\n", entry.key(), toml_value(&group.get(&entry.key())?)));
    group.given().iter().filter_map(line).collect()
}

fn toml_value(value: &Plain) -> String {
    match value {
        Plain::Bool(is_on) => is_on.to_string(),
        Plain::Whole(number) => number.to_string(),
        Plain::Real(number) => format!("{number:?}"),
        Plain::Text(text) => quoted(text),
        Plain::List(all) => format!("[{}]", all.iter().map(toml_value).collect::<Vec<_>>().join(", ")),
        Plain::Absent => quoted(&Plain::Absent.to_string()),
    }
}

/// A basic string of TOML.
fn quoted(text: &str) -> String {
    let escaped: String = text
        .chars()
        .map(|c| match c {
            '"' | '\\' => format!("\\{c}"),
            c if c.is_control() => format!("\\u{:04X}", u32::from(c)),
            c => c.to_string(),
        })
        .collect();
    format!("\"{escaped}\"")
}
