//! What is counted, and the records of a walk. A counter is one row of the [table](COLUMNS): its name, unit, kind,
//! source and meaning. [`Counters`], the words that kernels count in, the fields of `records.jsonl` and
//! `docs/records.md` follow from it.

mod declare;
#[cfg(test)]
mod page;
mod table;

pub(crate) use table::device_words;
pub use table::{COLUMNS, Counters};

use serde::ser::{Serialize, SerializeMap, Serializer};
use serde_json::Value;
use std::collections::BTreeSet;
use std::fmt;
use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, PoisonError};

/// A field of records.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Column {
    /// Its name.
    pub name: &'static str,
    /// Of its values.
    pub unit: &'static str,
    /// Whether values have fractions.
    pub is_float: bool,
    /// How values of several passes become one.
    pub kind: Kind,
    /// Who counts.
    pub source: Source,
    /// In which records it is not zero; empty: in any.
    pub only: &'static str,
    /// What it says, each line with a space before it.
    pub meaning: &'static str,
    /// Whether records have it.
    pub is_written: bool,
}

impl Column {
    /// Its meaning, and in which records it is not zero.
    pub fn description(&self) -> String {
        let only = if self.only.is_empty() { String::new() } else { format!(" Only {}; else 0.", self.only) };
        self.meaning.trim().to_string() + &only
    }
}

/// How values of several round trips or passes become one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// They add up.
    Sum,
    /// The most of them.
    Max,
    /// Said once of an effect, when it ends: nothing to add.
    State,
    /// A set of bricks; records have how many there are.
    Distinct,
    /// Names, each once; records have a text.
    Names,
    /// Follows from other counters.
    Derived,
}

/// Who counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The host.
    Host,
    /// Kernels.
    Device,
}

/// Bricks that something is true of. Samples and directions name some several times.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Bricks {
    numbers: Vec<u32>,
    /// How many there are, where it is forgotten which.
    count: u64,
    is_known: bool,
}

impl Bricks {
    /// Adds bricks, which may be none: from now on they are known.
    pub fn extend(&mut self, numbers: impl IntoIterator<Item = u32>) {
        self.numbers.extend(numbers);
        self.is_known = true;
    }

    /// Adds those of more work.
    pub fn add(&mut self, other: &Self) {
        self.numbers.extend(&other.numbers);
        self.is_known |= other.is_known;
    }

    /// Whether it was asked which they are.
    pub fn is_known(&self) -> bool {
        self.is_known
    }

    /// Their numbers, ascending, each once.
    pub fn distinct(&self) -> Vec<u32> {
        let mut numbers = self.numbers.clone();
        numbers.sort_unstable();
        numbers.dedup();
        numbers
    }

    /// How many there are.
    pub fn count(&self) -> u64 {
        self.count.max(self.distinct().len() as u64)
    }

    /// Those of a value that they were written as: their numbers, or how many there are.
    fn of_value(value: &Value) -> Option<Self> {
        let number = |one: &Value| one.as_u64()?.try_into().ok();
        match value {
            Value::Array(values) => {
                let numbers = values.iter().map(number).collect::<Option<_>>()?;
                Some(Self { numbers, count: 0, is_known: true })
            }
            count => Some(Self { numbers: Vec::new(), count: count.as_u64()?, is_known: true }),
        }
    }

    /// Keeps each number once.
    fn settle(&mut self) {
        self.numbers = self.distinct();
    }

    /// Keeps how many there are, and forgets which.
    fn forget(&mut self) {
        self.count = self.count();
        self.numbers = Vec::new();
    }
}

/// Names, each once, in the order in which they came.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Names(Vec<&'static str>);

impl Names {
    /// Adds a name.
    pub fn push(&mut self, name: &'static str) {
        if !self.0.contains(&name) {
            self.0.push(name);
        }
    }

    /// Those of a text that they were written as.
    fn of_text(text: &str) -> Self {
        Self(text.split('+').filter(|name| !name.is_empty()).map(kept).collect())
    }

    /// Adds those of more work.
    pub fn add(&mut self, other: &Self) {
        other.0.iter().for_each(|name| self.push(name));
    }
}

/// A name that was read, for as long as the process lives: there are few of them.
fn kept(name: &str) -> &'static str {
    static NAMES: Mutex<BTreeSet<&'static str>> = Mutex::new(BTreeSet::new());
    let mut names = NAMES.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(known) = names.get(name) {
        return known;
    }
    let name: &'static str = String::leak(name.to_owned());
    names.insert(name);
    name
}

impl fmt::Display for Names {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.join("+"))
    }
}

impl AsRef<Counters> for Counters {
    fn as_ref(&self) -> &Self {
        self
    }
}

impl Counters {
    /// Adds times of the three phases, milliseconds.
    pub fn add_phases(&mut self, ms: [f64; 3]) {
        self.ms_phase1 += ms[0];
        self.ms_phase2 += ms[1];
        self.ms_phase3 += ms[2];
    }
}

/// One frame and pass: a line of `records.jsonl`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Record {
    /// Frame, from 0.
    pub frame: u32,
    /// The effect: `primary`, `shadow`, `environment`, `ao`, `diffuse`, `glossy`, and of the rays to lamps from the
    /// hits of bounces `diffuse-shadow`, `diffuse-environment`, `glossy-shadow`, `glossy-environment`; of bounces
    /// after the first `bounce-2`, `bounce-2-shadow`, `bounce-2-environment` and so on; `rsm`, where
    /// reflective shadow maps are made; `dvf`, where the cells of a field of visibility are made anew for what moves.
    pub pass: &'static str,
    counters: Counters,
}

impl Record {
    /// The record of a pass.
    pub fn of(frame: u32, pass: &'static str, mut counters: Counters) -> Self {
        if !counters.bricks_needed.is_known() {
            counters.bricks_needed = counters.bricks_entered.clone();
        }
        counters.each_set(Bricks::settle);
        Self { frame, pass, counters }
    }

    /// Adds what later passes of the same effect did.
    pub fn go_on(&mut self, later: &Self) {
        let Counters { bricks_resident_end, cache_used_bytes, .. } = later.counters;
        self.counters.add(&later.counters);
        self.counters.each_set(Bricks::settle);
        (self.bricks_resident_end, self.cache_used_bytes) = (bricks_resident_end, cache_used_bytes);
    }

    /// Keeps of sets of bricks how many there are, for as long as records are kept.
    pub fn forget_bricks(&mut self) {
        self.counters.each_set(Bricks::forget);
    }

    /// With the numbers of bricks in place of how many there are: what [`Record::go_on`] needs.
    ///
    /// # Errors
    /// None that is known.
    pub fn with_bricks(&self) -> serde_json::Result<Value> {
        let mut value = serde_json::to_value(self)?;
        for (name, bricks) in self.counters.sets() {
            value[name] = serde_json::to_value(bricks.distinct())?;
        }
        Ok(value)
    }

    /// A line of `records.jsonl`, or what [`Record::with_bricks`] made; `None`: it is neither.
    pub fn read(line: &Value) -> Option<Self> {
        let record = line.as_object()?;
        let frame = record.get("frame")?.as_u64()?.try_into().ok()?;
        Some(Self { frame, pass: kept(record.get("pass")?.as_str()?), counters: Counters::read(record)? })
    }

    /// Bytes that were loaded: bricks, attributes, textures.
    pub fn loaded_bytes(&self) -> u64 {
        self.bytes_bvh + self.bytes_geometry + self.bytes_attributes + self.bytes_textures
    }
}

impl Deref for Record {
    type Target = Counters;

    fn deref(&self) -> &Counters {
        &self.counters
    }
}

impl DerefMut for Record {
    fn deref_mut(&mut self) -> &mut Counters {
        &mut self.counters
    }
}

impl Serialize for Record {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("frame", &self.frame)?;
        map.serialize_entry("pass", &self.pass)?;
        self.counters.write(&mut map)?;
        map.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_have_the_columns_in_their_order() {
        let value = serde_json::to_value(Record::of(3, "ao", Counters::default())).expect("a record");
        let fields: Vec<&str> = value.as_object().expect("an object").keys().map(String::as_str).collect();
        let columns = COLUMNS.iter().filter(|column| column.is_written).map(|column| column.name);
        assert_eq!(fields, ["frame", "pass"].into_iter().chain(columns).collect::<Vec<_>>());
        for column in COLUMNS.iter().filter(|column| column.is_written) {
            assert_eq!(value[column.name].is_f64(), column.is_float, "{}", column.name);
        }
    }

    #[test]
    fn records_come_back_as_they_were_written() {
        let mut counters = Counters { rays_traced: 7, ms: 0.1 + 0.2, cache_passes: 3, ..Counters::default() };
        counters.bricks_hit.extend([4, 1, 4]);
        ["chc", "demand"].into_iter().for_each(|name| counters.schedule.push(name));
        let written = serde_json::to_value(Record::of(3, "ao", counters)).expect("a record");
        let read = Record::read(&written).expect("a record");
        assert_eq!((read.frame, read.pass, read.rays_traced, read.ms), (3, "ao", 7, 0.1 + 0.2));
        assert_eq!(serde_json::to_value(read).expect("a record"), written);
        let mut other = written;
        other["rays_traced"] = "7".into();
        assert_eq!(Record::read(&other), None);
    }

    #[test]
    fn values_add_up_as_their_kind_says() {
        let of = |rays_traced, cache_passes, cells_left, bricks: &[u32]| {
            let mut counters = Counters { rays_traced, cache_passes, cells_left, ms: 2.0, ..Counters::default() };
            counters.bricks_hit.extend(bricks.iter().copied());
            counters
        };
        let mut sum = of(3, 2, 7, &[4, 1]);
        sum.add(of(5, 1, 9, &[1, 6]));
        for names in [["chc", "demand"], ["demand", "plain"]] {
            let mut other = Counters::default();
            names.into_iter().for_each(|name| other.schedule.push(name));
            sum.add(other);
        }
        assert_eq!(sum.schedule.to_string(), "chc+demand+plain");
        sum.rays_answered += 10;
        assert_eq!((sum.rays_traced, sum.cache_passes, sum.cells_left), (8, 2, 7));
        assert_eq!((sum.rays(), sum.mrays_per_s(), sum.bricks_hit.distinct()), (18, 0.002, vec![1, 4, 6]));
        let record = Record::of(0, "ao", sum);
        assert_eq!(record.bricks_hit.count(), 3);
    }

    #[test]
    fn bricks_entered_stand_for_those_needed_until_these_are_known() {
        let mut counters = Counters::default();
        counters.bricks_entered.extend([2, 3, 2]);
        assert_eq!(Record::of(0, "ao", counters.clone()).bricks_needed.count(), 2);
        counters.bricks_needed.extend([]);
        assert_eq!(Record::of(0, "ao", counters).bricks_needed.count(), 0);
    }
}
