//! Warnings of one input: repeated ones are counted, so that their number stays small however large the file.

use std::borrow::Cow;

/// Collects what was ignored or repaired in one input.
#[derive(Debug)]
pub(super) struct Warnings {
    /// The input as messages show it.
    file: String,
    entries: Vec<Entry>,
}

#[derive(Debug)]
struct Entry {
    what: Cow<'static, str>,
    /// Where it happened first; empty when it concerns the whole file.
    first: String,
    count: u64,
}

impl Warnings {
    /// No warnings yet about `file`.
    pub fn new(file: String) -> Self {
        Self { file, entries: Vec::new() }
    }

    /// Notes that `what` happened at `place` (empty: in the file as a whole). Kinds must be few: they are searched
    /// linearly.
    pub fn add(&mut self, what: impl Into<Cow<'static, str>>, place: impl FnOnce() -> String) {
        let what = what.into();
        match self.entries.iter_mut().find(|entry| entry.what == what) {
            Some(entry) => entry.count += 1,
            None => self.entries.push(Entry { what, first: place(), count: 1 }),
        }
    }

    /// One line for each kind, in the order of first occurrence.
    pub fn into_lines(self) -> Vec<String> {
        let line = |entry: &Entry| describe(&self.file, &entry.what, &entry.first, entry.count);
        self.entries.iter().map(line).collect()
    }
}

/// The line that says that `what` happened in `file`, `count` times, the first time at `first` (empty: in the file as a
/// whole).
pub(super) fn describe(file: &str, what: &str, first: &str, count: u64) -> String {
    match (first.is_empty(), count) {
        (true, _) => format!("{file}: {what}"),
        (false, 1) => format!("{file}: {first}: {what}"),
        (false, _) => format!("{file}: {first} and {} more: {what}", count - 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeated_warnings_are_counted() {
        let mut warnings = Warnings::new("a.gltf".into());
        for i in 0..3 {
            warnings.add("left out", || format!("mesh {i}"));
        }
        warnings.add("white", || "image 1".into());
        warnings.add("animated", String::new);
        assert_eq!(
            warnings.into_lines(),
            ["a.gltf: mesh 0 and 2 more: left out", "a.gltf: image 1: white", "a.gltf: animated"]
        );
    }
}
