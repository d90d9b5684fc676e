//! The user's folder for settings.

use std::path::PathBuf;

/// Names the folder; without it it is the folder `brickwalk` of the platform's.
const VARIABLE: &str = "BRICKWALK_CONFIG_DIR";

/// The folder, which may not exist; `None`: the system names none.
pub fn settings() -> Option<PathBuf> {
    let of = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let of_platform = || match () {
        () if cfg!(windows) => of("APPDATA"),
        () if cfg!(target_os = "macos") => of("HOME").map(|home| home.join("Library/Application Support")),
        () => of("XDG_CONFIG_HOME").or_else(|| of("HOME").map(|home| home.join(".config"))),
    };
    of(VARIABLE).or_else(|| of_platform().map(|folder| folder.join("brickwalk")))
}
