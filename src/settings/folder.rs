//! The user's folders: for settings, and for what can be made again.

use std::path::PathBuf;

/// Name the folders; without them they are the folder `brickwalk` of the platform's.
const SETTINGS_VARIABLE: &str = "BRICKWALK_CONFIG_DIR";
/// The other one.
pub const CACHE_VARIABLE: &str = "BRICKWALK_CACHE_DIR";

fn of(name: &str) -> Option<PathBuf> {
    std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from)
}

/// The folder of settings, which may not exist; `None`: the system names none.
pub fn settings() -> Option<PathBuf> {
    let of_platform = || match () {
        () if cfg!(windows) => of("APPDATA"),
        () if cfg!(target_os = "macos") => of("HOME").map(|home| home.join("Library/Application Support")),
        () => of("XDG_CONFIG_HOME").or_else(|| of("HOME").map(|home| home.join(".config"))),
    };
    of(SETTINGS_VARIABLE).or_else(|| of_platform().map(|folder| folder.join("brickwalk")))
}

/// The folder of what can be made again, likewise.
pub fn cache() -> Option<PathBuf> {
    let of_platform = || match () {
        () if cfg!(windows) => of("LOCALAPPDATA"),
        () if cfg!(target_os = "macos") => of("HOME").map(|home| home.join("Library/Caches")),
        () => of("XDG_CACHE_HOME").or_else(|| of("HOME").map(|home| home.join(".cache"))),
    };
    of(CACHE_VARIABLE).or_else(|| of_platform().map(|folder| folder.join("brickwalk")))
}
