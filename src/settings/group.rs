//! Settings, described, and groups of them.

use super::names::names;
use super::value::{Plain, Rule};

names! {
    /// What a setting is about: the heading that it stands under, in the order of pages.
    Heading {
        /// Where the camera goes.
        Camera = "Camera",
        /// What is traced.
        Effects = "Effects",
        /// What shines.
        Light = "Light",
        /// Samples and pictures.
        Quality = "Quality",
        /// What is written.
        Output = "Output",
        /// Memory, and how bricks come into it.
        Cache = "Cache",
        /// How rays find what they hit.
        Schedule = "Schedule",
        /// Approximations of secondary rays.
        Methods = "Methods",
        /// What is measured beside the picture.
        Measurement = "Measurement",
        /// The device.
        Device = "Device",
    }
}

/// Who needs a setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// Everybody: shown by `-h`.
    Common,
    /// Many: shown by `--help`.
    Usual,
    /// Few: shown by `--help-all`.
    Expert,
}

/// A setting, described.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    /// Its name in a group and in a settings file.
    pub key: &'static str,
    /// As on the command line: `--flag VALUE`, or `--flag` for a switch; other names of the flag follow after `|`.
    pub usage: &'static str,
    /// What it does, a line each.
    pub doc: &'static [&'static str],
    /// What its numbers count; empty where that is clear.
    pub unit: &'static str,
    /// What its values must be.
    pub rule: Rule,
    /// The names that it can have, where these are all.
    pub names: &'static [&'static str],
    /// Several may be given.
    pub is_list: bool,
    /// Values may begin with a minus sign.
    pub is_signed: bool,
    /// Choosing it chooses other settings as well.
    pub is_preset: bool,
    /// What it is about.
    pub heading: Heading,
    /// Who needs it.
    pub level: Level,
    /// Its default.
    pub default: fn() -> Plain,
}

impl Field {
    fn flags(&self) -> impl Iterator<Item = &'static str> {
        let flags = self.usage.split(' ').next().unwrap_or_default();
        flags.split('|').map(|flag| flag.trim_start_matches("--"))
    }

    /// The flag, without its dashes.
    pub fn flag(&self) -> &'static str {
        self.flags().next().unwrap_or_default()
    }

    /// Other names of the flag, without dashes.
    pub fn aliases(&self) -> Vec<&'static str> {
        self.flags().skip(1).collect()
    }

    /// What stands for the value; `None` of a switch.
    pub fn value_name(&self) -> Option<&'static str> {
        self.usage.split_once(' ').map(|(_, name)| name)
    }

    /// What it does, and its default where that is said in words.
    fn words(&self) -> (String, Option<String>) {
        let text = self.doc.iter().map(|line| line.trim()).collect::<Vec<_>>().join(" ");
        match text.split_once(" [default: ") {
            Some((help, default)) => (help.into(), Some(default.trim_end_matches(']').into())),
            None => (text, None),
        }
    }

    /// What it does.
    pub fn help(&self) -> String {
        self.words().0
    }

    /// What its values must be, with their unit; empty where anything will do.
    pub fn range(&self) -> String {
        let range = self.rule.text();
        match self.rule {
            Rule::Any | Rule::Bytes(_) => range,
            _ => format!("{range} {}", self.unit).trim_end().into(),
        }
    }

    /// What it does, in a sentence.
    pub fn summary(&self) -> String {
        let help = self.help();
        let end = help.find(". ").or_else(|| help.strip_suffix('.').map(str::len));
        end.map_or(help.clone(), |end| help[..end].into())
    }

    /// Its default in words; empty of switches that are off.
    pub fn default_text(&self) -> String {
        match (self.words().1, (self.default)()) {
            (Some(default), _) => default,
            (None, Plain::Bool(false)) if self.value_name().is_none() => String::new(),
            (None, default) => default.to_string(),
        }
    }
}

/// A setting and the table of a settings file that it is in.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// The table; empty at the top.
    pub table: &'static str,
    /// The setting.
    pub field: &'static Field,
}

impl Entry {
    /// `table.key`, or `key` at the top.
    pub fn key(&self) -> String {
        if self.table.is_empty() { self.field.key.into() } else { format!("{}.{}", self.table, self.field.key) }
    }
}

/// Why settings are refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SettingsError {
    /// There is no such setting.
    #[error("{key}: there is no such setting; known: {known}")]
    Unknown {
        /// What was asked for.
        key: String,
        /// What there is.
        known: String,
    },
    /// A value that the setting cannot have.
    #[error("{key}: {why}")]
    Wrong {
        /// The setting.
        key: String,
        /// What is right.
        why: String,
    },
    /// Settings that do not go together.
    #[error("{0}")]
    Conflict(String),
    /// A file that is no TOML.
    #[error("{0}")]
    Syntax(String),
}

/// Settings that belong together.
pub trait Group: Clone + Default + Send + Sync + 'static {
    /// All settings, those of tables after those of the group itself.
    fn entries() -> Vec<Entry>;

    /// The value of a setting; `None`: there is none of this name.
    fn get(&self, key: &str) -> Option<Plain>;

    /// Gives a setting the value that a text stands for.
    ///
    /// # Errors
    /// There is no such setting, or the text is none of its values.
    fn set(&mut self, key: &str, text: &str) -> Result<(), SettingsError>;

    /// Gives settings the values that texts stand for. Presets come first, so that single settings win over them
    /// whatever their order.
    ///
    /// # Errors
    /// As of [`Group::set`].
    fn set_all(&mut self, given: &[(String, String)]) -> Result<(), SettingsError> {
        let entries = Self::entries();
        let is_preset = |key: &str| entries.iter().any(|entry| entry.field.is_preset && entry.key() == key);
        let (presets, single): (Vec<_>, Vec<_>) = given.iter().partition(|(key, _)| is_preset(key));
        presets.into_iter().chain(single).try_for_each(|(key, text)| self.set(key, text))
    }

    /// The defaults, with the presets of this group: what its single settings differ from.
    fn base(&self) -> Self {
        let mut base = Self::default();
        for entry in Self::entries().iter().filter(|entry| entry.field.is_preset) {
            // A value that the group has is one of the setting.
            let _ = self.get(&entry.key()).map(|value| base.set(&entry.key(), &value.to_string()));
        }
        base
    }

    /// The settings that are not as in [`Group::base`].
    fn chosen(&self) -> Vec<Entry> {
        let base = self.base();
        let mut entries = Self::entries();
        entries.retain(|entry| self.get(&entry.key()) != base.get(&entry.key()));
        entries
    }

    /// The setting with this flag, which is without dashes.
    fn by_flag(flag: &str) -> Option<Entry> {
        Self::entries().into_iter().find(|entry| entry.field.flag() == flag)
    }

    /// Gives settings the values that options of the command line have in `text`, words separated by spaces.
    ///
    /// # Errors
    /// There is no such option, or its value is none of the setting.
    fn set_options(&mut self, text: &str) -> Result<(), SettingsError> {
        let mut words = text.split_whitespace();
        let mut all = Vec::new();
        while let Some(word) = words.next() {
            let (flag, given) = word.split_once('=').map_or((word, None), |(flag, value)| (flag, Some(value)));
            let known = || Self::entries().iter().map(|entry| format!("--{}", entry.field.flag())).collect::<Vec<_>>();
            let unknown = || SettingsError::Unknown { key: flag.into(), known: known().join(", ") };
            let entry = flag.strip_prefix("--").and_then(Self::by_flag).ok_or_else(unknown)?;
            let value = match (given, entry.field.value_name()) {
                (Some(value), _) => value,
                (None, None) => "on",
                (None, Some(_)) => words.next().ok_or_else(|| SettingsError::wrong(flag, "it needs a value".into()))?,
            };
            all.push((entry.key(), value.to_string()));
        }
        self.set_all(&all)
    }

    /// The settings that are not as they are by default: presets, then what differs from these.
    fn given(&self) -> Vec<Entry> {
        let presets = Self::entries().into_iter().filter(|entry| entry.field.is_preset);
        let presets = presets.filter(|entry| self.get(&entry.key()) != Some((entry.field.default)()));
        presets.chain(self.chosen()).collect()
    }

    /// The settings that are not as they are by default, as options of the command line.
    fn options(&self) -> String {
        let of = |entry: Entry| {
            let value = self.get(&entry.key())?;
            let flag = entry.field.flag();
            Some(match entry.field.value_name() {
                Some(_) => format!("--{flag} {value}"),
                None => format!("--{flag}"),
            })
        };
        self.given().into_iter().filter_map(of).collect::<Vec<_>>().join(" ")
    }
}

impl SettingsError {
    /// Of a value.
    pub fn wrong(key: &str, why: String) -> Self {
        Self::Wrong { key: key.into(), why }
    }

    /// Of a key that the group does not have; names those of its table.
    pub fn unknown<G: Group>(key: &str) -> Self {
        let table = key.split_once('.').map_or("", |(table, _)| table);
        let entries = G::entries();
        let is_known = entries.iter().any(|entry| entry.table == table);
        let of_table = entries.iter().filter(|entry| entry.table == table || !is_known);
        let known = of_table.map(Entry::key).collect::<Vec<_>>().join(", ");
        Self::Unknown { key: key.into(), known }
    }

    /// The same of a table in a group.
    pub fn within(self, table: &str) -> Self {
        let inner = |key: String| format!("{table}.{key}");
        match self {
            Self::Unknown { key, known } => {
                let known = known.split(", ").map(|key| inner(key.into())).collect::<Vec<_>>().join(", ");
                Self::Unknown { key: inner(key), known }
            }
            Self::Wrong { key, why } => Self::Wrong { key: inner(key), why },
            other => other,
        }
    }
}
