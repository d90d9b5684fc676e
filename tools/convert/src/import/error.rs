//! Errors of importing: one line each, naming the file, the thing in it and the remedy.

use std::path::Path;

/// What is read, as error messages list it.
pub(super) const ACCEPTED: &str = ".gltf, .glb, .obj, .ply, .stl and tileset.json";

/// The usual remedy for a defect that only the producer of a file can repair.
pub(super) const EXPORT_AGAIN: &str = "export the file again";

/// Most characters of a name or foreign message that a line repeats.
const LINE_CHARS: usize = 200;
/// Most characters of a path in a message: a file may name others by anything.
const PATH_CHARS: usize = 500;

/// Why an input could not be imported. The text is one line.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// The extension is not one that is read.
    #[error("{file}: unsupported file type; give {ACCEPTED}")]
    Format {
        /// The input as given.
        file: String,
    },
    /// A file is missing or cannot be read.
    #[error("{file}: cannot read the file: {reason}; check its path and permissions")]
    Read {
        /// The input as given.
        file: String,
        /// What the system says.
        reason: String,
    },
    /// The bytes are not glTF JSON, or not a GLB container around it.
    #[error("{file}: not a readable glTF 2.0 file: {problem}; {remedy}")]
    Syntax {
        /// The input as given.
        file: String,
        /// What is wrong, with line and column where known.
        problem: String,
        /// What to do.
        remedy: &'static str,
    },
    /// The file requires extensions without which its geometry cannot be read.
    #[error("{file}: requires {extensions}, which is not supported; export the file without it")]
    Extensions {
        /// The input as given.
        file: String,
        /// Names, comma-separated.
        extensions: String,
    },
    /// Something within the file is wrong.
    #[error("{file}: {place}: {problem}; {remedy}")]
    Content {
        /// The input as given.
        file: String,
        /// The thing: kind, index and name.
        place: String,
        /// What is wrong with it.
        problem: String,
        /// What to do.
        remedy: &'static str,
    },
    /// The triangles of all placements do not fit global ids of 32 bits.
    #[error(
        "{file}: the scene has {triangles} triangles up to here, more than the 4294967294 that ids can \
         number; convert it in parts"
    )]
    TooManyTriangles {
        /// The input with which the limit is passed.
        file: String,
        /// Triangles of all inputs up to and including `file`, placements multiplied out.
        triangles: u64,
    },
    /// Somebody asked to stop.
    #[error(transparent)]
    Interrupted(crate::progress::Interrupted),
    /// The worker threads could not be started.
    #[error("cannot start {threads} worker threads: {reason}; use fewer threads")]
    Threads {
        /// The number asked for.
        threads: usize,
        /// What the system says.
        reason: String,
    },
}

/// `text` without control characters and of bounded length, fit for one line.
pub(super) fn one_line(text: &str) -> String {
    let mut line: String = text.chars().take(LINE_CHARS).map(|c| if c.is_control() { ' ' } else { c }).collect();
    if text.chars().nth(LINE_CHARS).is_some() {
        line.push('…');
    }
    line
}

/// `path` as messages show it: of one that is too long its beginning and its end.
pub(super) fn show(path: &Path) -> String {
    let shown = |c: char| if c.is_control() { '\u{fffd}' } else { c };
    let path: Vec<char> = path.to_string_lossy().chars().map(shown).collect();
    match path.len() > PATH_CHARS {
        true => path[..PATH_CHARS / 2].iter().chain(&['…']).chain(&path[path.len() - PATH_CHARS / 2..]).collect(),
        false => path.into_iter().collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_one_line_and_bounded() {
        assert_eq!(one_line("a\nb\tc"), "a b c");
        let long = one_line(&"é".repeat(1000));
        assert_eq!(long.chars().count(), LINE_CHARS + 1);
        assert!(long.ends_with('…'));
        assert_eq!(one_line(&"é".repeat(LINE_CHARS)).chars().count(), LINE_CHARS);
    }

    #[test]
    fn a_path_is_bounded() {
        assert_eq!(show(Path::new("a/b\n.png")), "a/b\u{fffd}.png");
        let long = show(&Path::new("folder").join("é".repeat(5000)).join("b.png"));
        assert!(long.starts_with("folder/é") && long.contains("é…é") && long.ends_with("é/b.png"), "{long}");
        assert_eq!(long.chars().count(), PATH_CHARS + 1);
        assert_eq!(show(Path::new(&"é".repeat(PATH_CHARS))).chars().count(), PATH_CHARS);
    }
}
