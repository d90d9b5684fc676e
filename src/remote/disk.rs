//! Where parts of remote scenes are kept: a folder and its limit, as `--disk-cache DIR,SIZE` names them.

use crate::settings::sizes::size_bytes;
use std::path::PathBuf;
use std::str::FromStr;

/// A folder that keeps parts of remote scenes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DiskCache {
    /// The folder; it is made if missing, and may be shared by processes.
    pub folder: PathBuf,
    /// Most bytes of files in it.
    pub bytes: u64,
}

impl FromStr for DiskCache {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (folder, size) = text.rsplit_once(',').ok_or("give a folder and a size, as in cache,20G")?;
        if folder.is_empty() {
            return Err("give a folder before the comma, as in cache,20G".into());
        }
        Ok(Self { folder: folder.into(), bytes: size_bytes(size)? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_and_a_size_are_read() {
        let read = |text: &str| text.parse::<DiskCache>();
        assert_eq!(read("a,b,2G"), Ok(DiskCache { folder: "a,b".into(), bytes: 2 << 30 }));
        for wrong in ["a", "a,", ",2G", "a,2x"] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }
}
