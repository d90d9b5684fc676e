//! The frames of a walk: which are embedded in the page and which are linked.

use crate::{ReportError, walk::Walk};
use std::path::Path;

/// At most so many frames are embedded.
const EMBEDDED_FRAMES: usize = 12;
/// At most so many bytes of PNG are embedded (a third more as text), so that a page of large frames still opens
/// on a phone.
const EMBEDDED_BYTES: u64 = 32 << 20;
/// The first bytes of every PNG.
const SIGNATURE: &[u8; 8] = b"\x89PNG\r\n\x1a\n";

/// A frame's picture in the page.
#[derive(Debug)]
pub struct Picture {
    /// Frame, from 0.
    pub frame: u64,
    /// The file's name in `frames/`: digits and `.png`.
    pub name: String,
    /// The PNG as read; `None` where the page only links to the file.
    pub png: Option<Vec<u8>>,
}

/// The pictures by ascending frame.
#[derive(Debug)]
pub struct Gallery {
    /// Every frame's picture.
    pub pictures: Vec<Picture>,
    /// Files of `frames/` that belong to no record of this walk, or hold no PNG, in order.
    pub left_out: Vec<String>,
}

impl Gallery {
    /// Lists `frames/*.png` and reads those that the page embeds: evenly chosen, the first and the last among them. A
    /// folder that does not exist holds no frames.
    ///
    /// # Errors
    /// The folder or a chosen file cannot be read.
    pub fn read(dir: &Path, walk: &Walk) -> Result<Self, ReportError> {
        let folder = dir.join("frames");
        let mut gallery = Self { pictures: Vec::new(), left_out: Vec::new() };
        let unreadable = |source| ReportError::Read { path: folder.clone(), source };
        let entries = match std::fs::read_dir(&folder) {
            Ok(entries) => entries,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(gallery),
            Err(error) => return Err(unreadable(error)),
        };
        let mut sizes = Vec::new();
        for entry in entries {
            let entry = entry.map_err(unreadable)?;
            let name = entry.file_name().to_string_lossy().into_owned();
            let Some(stem) = name.strip_suffix(".png") else { continue };
            let number = stem.parse::<u64>().ok().filter(|_| stem.bytes().all(|b| b.is_ascii_digit()));
            match number.filter(|frame| walk.frames.contains(frame)) {
                Some(frame) => sizes.push((frame, name, entry.metadata().map_err(unreadable)?.len())),
                None => gallery.left_out.push(name),
            }
        }
        sizes.sort();
        let chosen = choose(&sizes.iter().map(|s| s.2).collect::<Vec<_>>());
        for (index, (frame, name, _)) in sizes.into_iter().enumerate() {
            let mut picture = Picture { frame, name, png: None };
            if chosen.contains(&index) {
                let path = folder.join(&picture.name);
                let png = std::fs::read(&path).map_err(|source| ReportError::Read { path, source })?;
                if !png.starts_with(SIGNATURE) {
                    gallery.left_out.push(picture.name);
                    continue;
                }
                picture.png = Some(png);
            }
            gallery.pictures.push(picture);
        }
        gallery.left_out.sort();
        Ok(gallery)
    }
}

/// Width and height in pixels that a PNG's header tells.
pub fn dimensions(png: &[u8]) -> Option<(u32, u32)> {
    let field = |at: usize| Some(u32::from_be_bytes(png.get(at..at + 4)?.try_into().ok()?));
    Some((field(16)?, field(20)?))
}

/// Indices of the files to embed, evenly over all, within the limits of count and bytes.
fn choose(sizes: &[u64]) -> Vec<usize> {
    for wanted in (1..=sizes.len().min(EMBEDDED_FRAMES)).rev() {
        let chosen: Vec<usize> = match wanted {
            1 => vec![sizes.len() / 2],
            _ => (0..wanted).map(|k| k * (sizes.len() - 1) / (wanted - 1)).collect(),
        };
        if chosen.iter().map(|&i| sizes[i]).sum::<u64>() <= EMBEDDED_BYTES {
            return chosen;
        }
    }
    Vec::new()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chosen_frames_are_distinct_and_span_the_walk() {
        for frames in 1..200 {
            let chosen = choose(&vec![1; frames]);
            assert_eq!(chosen.len(), frames.min(EMBEDDED_FRAMES));
            assert!(chosen.is_sorted_by(|a, b| a < b), "{chosen:?}");
            if frames > 1 {
                assert_eq!((chosen[0], chosen[chosen.len() - 1]), (0, frames - 1));
            }
        }
        assert!(choose(&[]).is_empty());
    }

    #[test]
    fn large_frames_are_embedded_less_often() {
        assert_eq!(choose(&[EMBEDDED_BYTES / 3; 100]).len(), 3);
        assert_eq!(choose(&[EMBEDDED_BYTES; 5]), [2]);
        assert!(choose(&[EMBEDDED_BYTES + 1; 5]).is_empty());
    }
}
