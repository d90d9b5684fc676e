//! What can be wrong with a scene file, said so that the reader knows which part it is and what to do.

use crate::layout::{MAGIC, Section, VERSION};
use crate::pack::UnpackError;
use crate::payload::Payload;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// A part of a scene file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Part {
    /// The header page.
    Header,
    /// The directory of the sections.
    Directory,
    /// A section of the resident part.
    Section(Section),
    /// A record of a section, by index.
    Record(Section, u32),
    /// A payload.
    Payload(Payload),
    /// The zeros between the directory and the first section.
    PaddingAfterDirectory,
    /// The zeros between a section and the next.
    PaddingAfterSection(Section),
    /// The zeros between a payload and what follows.
    PaddingAfterPayload(Payload),
}

impl Part {
    /// What to do when it is damaged.
    fn remedy(&self) -> &'static str {
        match self {
            Part::Payload(Payload::Displacement(_)) | Part::PaddingAfterPayload(Payload::Displacement(_)) => {
                "bake displacement fields again with `brickwalk bake-displacement`, or copy the file again"
            }
            Part::Payload(_) | Part::PaddingAfterPayload(_) => {
                "run `brickwalk repair`, copy the file again, or convert again"
            }
            _ => "copy the file again, or convert again",
        }
    }
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Part::Header => write!(f, "the header"),
            Part::Directory => write!(f, "the directory"),
            Part::Section(section) => write!(f, "section {section}"),
            Part::Record(Section::Bricks, index) => write!(f, "brick {index} (section bricks)"),
            Part::Record(Section::Levels, index) => write!(f, "level {index} (section levels)"),
            Part::Record(section, index) => write!(f, "record {index} of section {section}"),
            Part::Payload(payload) => write!(f, "{payload}"),
            Part::PaddingAfterDirectory => write!(f, "the padding after the directory"),
            Part::PaddingAfterSection(section) => write!(f, "the padding after section {section}"),
            Part::PaddingAfterPayload(payload) => write!(f, "the padding after {payload}"),
        }
    }
}

/// A rule of the format that some data breaks; the file it is in, if any, is known to the caller.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{part}: found {found}, expected {expected}")]
pub struct Flaw {
    /// Where.
    pub part: Part,
    /// What is there.
    pub found: String,
    /// What the format asks for.
    pub expected: String,
}

impl Flaw {
    /// Packed bytes, which are `part` or in it, that could not be unpacked.
    pub fn packed(part: Part, error: UnpackError) -> Self {
        Self { part, found: error.found, expected: error.expected }
    }
}

/// Why a scene file could not be opened, read or written. Every message names the file, the part of it, what was found
/// and expected, and what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What was being done: "open the file", "read brick 17 geometry".
        action: String,
        /// Where it was being done, when in a part of the file.
        part: Option<Part>,
        /// The system's reason.
        source: io::Error,
    },
    /// The file does not start like a scene file.
    #[error(
        "{}: not a .bricks scene file: found \"{}\" at its start, expected \"{}\"; give a file that `convert` wrote",
        path.display(), found.escape_ascii(), MAGIC.escape_ascii()
    )]
    NotSceneFile {
        /// The file.
        path: PathBuf,
        /// Its first bytes, up to 8.
        found: Vec<u8>,
    },
    /// The file has a version of the format that this program does not read.
    #[error(
        "{}: the file has format version {found}, this program reads version {VERSION}; {}",
        path.display(), if *found < VERSION { "convert again" } else { "use a newer brickwalk, or convert again" }
    )]
    Version {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: u32,
    },
    /// The file is shorter or longer than its header says.
    #[error(
        "{}: the file is too {}: found {found} bytes, expected {expected}; copy it again, or convert again",
        path.display(), if found < expected { "short" } else { "long" }
    )]
    Length {
        /// The file.
        path: PathBuf,
        /// Length of the file in bytes.
        found: u64,
        /// Length that the header states; for a file shorter than a header, the header's length.
        expected: u64,
    },
    /// Bytes of the file are not those that were written.
    #[error(
        "{}: {part} is damaged: found checksum {found:016x}, expected {expected:016x}; {}",
        path.display(), part.remedy()
    )]
    Corrupt {
        /// The file.
        path: PathBuf,
        /// The damaged part.
        part: Part,
        /// Checksum of the bytes.
        found: u64,
        /// Checksum that the file states.
        expected: u64,
    },
    /// A byte of padding, which is zero when written, is not.
    #[error(
        "{}: {part} is damaged: found {found:#04x} at byte {offset}, expected zero; {}",
        path.display(), part.remedy()
    )]
    Padding {
        /// The file.
        path: PathBuf,
        /// The padding, by what it follows.
        part: Part,
        /// Where in the file the first such byte is.
        offset: u64,
        /// The byte.
        found: u8,
    },
    /// The bytes are those that were written, but they break a rule of the format.
    #[error(
        "{}: {} is not valid: found {}, expected {}; convert again",
        path.display(), flaw.part, flaw.found, flaw.expected
    )]
    Invalid {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        flaw: Flaw,
    },
    /// A payload was asked for that the scene does not have, or with a buffer of the wrong length.
    #[error(
        "{}: {payload}: asked for {found}, expected {expected}; this is a bug of the caller",
        path.display()
    )]
    Request {
        /// The file.
        path: PathBuf,
        /// The payload.
        payload: Payload,
        /// What was asked for.
        found: String,
        /// What can be asked for.
        expected: String,
    },
    /// A part of a texture or a level of detail is at fault.
    #[error("{error} ({place})")]
    Within {
        /// What is wrong.
        error: Box<Error>,
        /// Which part of which texture, by its name in the source; which level.
        place: String,
    },
}

impl Error {
    /// The part of the file that is at fault, if one is.
    pub fn part(&self) -> Option<Part> {
        match self {
            Error::Io { part, .. } => *part,
            Error::NotSceneFile { .. } | Error::Version { .. } | Error::Length { .. } => Some(Part::Header),
            Error::Corrupt { part, .. } | Error::Padding { part, .. } => Some(*part),
            Error::Invalid { flaw, .. } => Some(flaw.part),
            Error::Request { payload, .. } => Some(Part::Payload(*payload)),
            Error::Within { error, .. } => error.part(),
        }
    }

    /// The file that the error is about.
    pub fn path(&self) -> &Path {
        match self {
            Error::Io { path, .. }
            | Error::NotSceneFile { path, .. }
            | Error::Version { path, .. }
            | Error::Length { path, .. }
            | Error::Corrupt { path, .. }
            | Error::Padding { path, .. }
            | Error::Invalid { path, .. }
            | Error::Request { path, .. } => path,
            Error::Within { error, .. } => error.path(),
        }
    }

    /// What is wrong, without the texture or level that it is about.
    pub fn cause(&self) -> &Error {
        match self {
            Error::Within { error, .. } => error.cause(),
            other => other,
        }
    }

    /// The same error, said to be about a part of a texture or a level if `place` says which.
    pub(crate) fn within(self, place: Option<String>) -> Self {
        match (place, self) {
            (
                Some(place),
                error @ (Error::Io { .. } | Error::Corrupt { .. } | Error::Padding { .. } | Error::Invalid { .. }),
            ) => Error::Within { error: Box::new(error), place },
            (_, error) => error,
        }
    }
}

/// `text` with every run of control characters and white space as one space.
///
/// What others say of a file may quote the file, whose names may hold anything.
pub fn one_line(text: &str) -> String {
    text.split(|c: char| c.is_whitespace() || c.is_control())
        .filter(|word| !word.is_empty())
        .collect::<Vec<_>>()
        .join(" ")
}

#[cfg(test)]
mod tests {
    use super::one_line;

    #[test]
    fn runs_of_control_characters_and_spaces_are_one_space() {
        assert_eq!(one_line("a\r\n\tb \u{7}c\n"), "a b c");
        assert_eq!(one_line("keyframe 2"), "keyframe 2");
    }
}
