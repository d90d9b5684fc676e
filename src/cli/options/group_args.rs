//! The command line as a view of settings: each is an option, with the text, the range and the default that the table
//! of settings has for it.

use crate::session::{Settings, TRACE};
#[cfg(any(feature = "serve", feature = "viewer"))]
use crate::settings::Heading;
use crate::settings::value::LINE;
use crate::settings::{Entry, Group, Level, file};
use clap::builder::StyledStr;
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};
use std::marker::PhantomData;
use std::path::Path;

/// Which settings a command has.
pub trait View: Clone + Send + Sync + 'static {
    /// The settings.
    type Group: Group;

    /// Whether a setting is an option.
    fn has(_: &Entry) -> bool {
        true
    }

    /// What settings are where nothing is given.
    fn base() -> Self::Group {
        Self::Group::default()
    }

    /// Who is shown a setting; `None`: nobody, it is known to be refused.
    fn level(entry: &Entry) -> Option<Level> {
        Some(entry.field.level)
    }
}

/// All settings of a group.
#[derive(Clone, Copy, Debug)]
pub struct Of<G>(PhantomData<G>);

impl<G: Group> View for Of<G> {
    type Group = G;
}

/// The settings of `walk`.
pub type OfWalk = Of<Settings>;

/// Those of `trace`.
#[derive(Clone, Copy, Debug)]
pub struct OfTrace;

impl View for OfTrace {
    type Group = Settings;

    // There is no picture.
    fn base() -> Settings {
        Settings::exact()
    }

    fn level(entry: &Entry) -> Option<Level> {
        TRACE.contains(&entry.key().as_str()).then_some(Level::Common)
    }
}

/// Those of `view` and `serve`: what a walk through frames is about, files and measurements, has no place there.
#[cfg(any(feature = "serve", feature = "viewer"))]
#[derive(Clone, Copy, Debug)]
pub struct OfView;

#[cfg(any(feature = "serve", feature = "viewer"))]
impl View for OfView {
    type Group = Settings;

    fn has(entry: &Entry) -> bool {
        let is_about_files = matches!(entry.field.heading, Heading::Output | Heading::Measurement);
        !is_about_files && !["frames", "motion", "requests_out"].contains(&entry.key().as_str())
    }
}

/// The settings that were given on a command line.
#[derive(Debug)]
pub struct GroupArgs<V: View> {
    /// Keys and values.
    given: Vec<(String, String)>,
    view: PhantomData<V>,
}

impl<V: View> Clone for GroupArgs<V> {
    fn clone(&self) -> Self {
        Self { given: self.given.clone(), view: PhantomData }
    }
}

impl<V: View> GroupArgs<V> {
    /// The settings: what was given, else what `file` says, else the defaults.
    ///
    /// # Errors
    /// A bad file.
    pub fn over(&self, file: Option<&Path>) -> anyhow::Result<V::Group> {
        let mut group = V::base();
        if let Some(file) = file {
            file::read_file(&mut group, file)?;
        }
        group.set_all(&self.given)?;
        Ok(group)
    }

    fn of(matches: &ArgMatches) -> Self {
        let given = |entry: &Entry| {
            let (flag, separator) = (entry.field.flag(), LINE.to_string());
            let source = matches.value_source(flag)?;
            let is_given = matches!(source, ValueSource::CommandLine | ValueSource::EnvVariable);
            let values: Vec<&str> = matches.get_many::<String>(flag)?.map(String::as_str).collect();
            is_given.then(|| (entry.key(), values.join(&separator)))
        };
        Self { given: entries::<V>().iter().filter_map(given).collect(), view: PhantomData }
    }
}

impl<V: View> FromArgMatches for GroupArgs<V> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        Ok(Self::of(matches))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        self.given.extend(Self::of(matches).given);
        Ok(())
    }
}

impl<V: View> Args for GroupArgs<V> {
    fn augment_args(command: Command) -> Command {
        entries::<V>().iter().fold(command, |command, entry| command.arg(argument::<V>(entry)))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

/// The settings of a view, those under one heading together.
fn entries<V: View>() -> Vec<Entry> {
    let mut entries = V::Group::entries();
    entries.retain(V::has);
    entries.sort_by_key(|entry| (entry.field.heading, entry.table));
    entries
}

/// A setting as an option.
fn argument<V: View>(entry: &Entry) -> Arg {
    let (field, key) = (entry.field, entry.key());
    let level = V::level(entry);
    let check = move |text: &str| -> Result<String, String> {
        use crate::settings::SettingsError::Wrong;
        V::Group::default().set(&key, text).map(|()| text.to_string()).map_err(|error| match error {
            Wrong { why, .. } => why,
            error => error.to_string(),
        })
    };
    let mut argument = Arg::new(field.flag())
        .long(field.flag())
        .aliases(field.aliases())
        .help_heading(field.heading.name())
        .help(with_notes(field.summary(), &[], field.default_text()))
        .long_help(with_notes(field.help().trim_end_matches('.').into(), &[field.range()], field.default_text()))
        .allow_hyphen_values(field.is_signed || field.rule.is_signed())
        // So that the range is what is said of `--spp -1`, and not that there is no option -1.
        .allow_negative_numbers(true)
        .hide_short_help(level != Some(Level::Common))
        .hide_long_help(level.is_none_or(|level| level == Level::Expert))
        .hide(level.is_none())
        .value_parser(check);
    argument = match field.value_name() {
        Some(name) => match name.strip_suffix("...") {
            Some(name) => argument.value_name(name).num_args(1..),
            None => argument.value_name(name),
        },
        // A file may switch on what is to be off: --denoise=off.
        None => argument.num_args(0..=1).require_equals(true).default_missing_value("on").value_name("on|off"),
    };
    if field.is_list {
        argument = argument.action(ArgAction::Append);
    }
    if entry.key() == "adapter" { argument.env("BRICKWALK_ADAPTER") } else { argument }
}

/// `text` with what is said in brackets after it.
fn with_notes(text: String, notes: &[String], default: String) -> StyledStr {
    let default = (!default.is_empty()).then(|| format!("default: {default}"));
    let notes = notes.iter().filter(|note| !note.is_empty()).cloned().chain(default);
    notes.fold(text, |text, note| format!("{text} [{note}]")).into()
}
