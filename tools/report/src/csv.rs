//! Records as comma-separated values (RFC 4180).

use crate::walk::Walk;
use std::fmt::Write as _;

/// `text` as a field.
pub fn quoted(text: &str) -> String {
    let special = text.contains([',', '"', '\n', '\r']);
    if special { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_string() }
}

/// All records: `frame`, `pass`, `schedule`, `methods`, then the numeric fields; empty where a record lacks one.
pub fn records(walk: &Walk) -> String {
    let mut text = String::from("frame,pass,schedule,methods");
    for field in &walk.fields {
        text.push(',');
        text.push_str(&quoted(field));
    }
    text.push('\n');
    for frame in &walk.frames {
        for pass in &walk.passes {
            // Rows are in the order of their frames.
            let start = pass.rows.partition_point(|row| row.frame < *frame);
            for row in pass.rows[start..].iter().take_while(|row| row.frame == *frame) {
                // Writing to a string does not fail.
                let _ =
                    write!(text, "{frame},{},{},{}", quoted(&pass.name), quoted(&row.schedule), quoted(&row.methods));
                for field in &walk.fields {
                    let _ = match row.get(field) {
                        Some(value) => write!(text, ",{value}"),
                        None => write!(text, ","),
                    };
                }
                text.push('\n');
            }
        }
    }
    text
}
