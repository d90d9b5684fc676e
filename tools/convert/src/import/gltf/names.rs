//! What the objects of a glTF document are called, in messages and in scenes.

use crate::import::error::one_line;

/// "kind 3 \"name\"", on one line.
pub(super) fn label(kind: &str, index: usize, name: Option<&str>) -> String {
    match name {
        Some(name) if !name.is_empty() => format!("{kind} {index} \"{}\"", one_line(name)),
        _ => format!("{kind} {index}"),
    }
}

/// The name of an object, or its index.
pub(super) fn display_name(index: usize, name: Option<&str>) -> String {
    match name {
        Some(name) if !name.is_empty() => one_line(name),
        _ => index.to_string(),
    }
}
