//! `docs/options.md`: every setting, as the table of settings says it.

use super::group::{Entry, Group, Heading, Level};

/// Most characters of a line.
const COLUMNS: usize = 120;

const HEAD: &str = "\
# Options

Made from `src/session/settings.rs` and the methods' settings; do not edit.
`BRICKWALK_WRITE_OPTIONS=1 cargo test --release --lib options_page` writes it anew.

Each option of `brickwalk walk` is a setting of `brickwalk::Settings` and a key of a settings file
(`--settings F.toml`; `--print-settings` prints one). The command line wins over the file. `-h` shows the options in
bold, `--help` those without \"expert\", `--help-all` all. Sizes take K, M, G (powers of 1024), counts K, M (powers of
1000).
";

/// The page of a group.
pub fn options_page<G: Group>() -> String {
    let mut text = String::from(HEAD);
    for &heading in Heading::ALL {
        let mut entries: Vec<Entry> = G::entries().into_iter().filter(|e| e.field.heading == heading).collect();
        entries.sort_by_key(|entry| entry.table);
        text += &format!("\n## {}\n\n", heading.name());
        entries.iter().for_each(|entry| text += &item(entry));
    }
    text
}

/// An option, wrapped.
fn item(entry: &Entry) -> String {
    let field = entry.field;
    let usage = match field.value_name() {
        Some(name) => format!("`--{} {name}`", field.flag()),
        None => format!("`--{}`", field.flag()),
    };
    let usage = if field.level == Level::Common { format!("**{usage}**") } else { usage };
    let mut notes = vec![format!("key `{}`", entry.key())];
    notes.extend(Some(field.range()).filter(|range| !range.is_empty()));
    if !field.names.is_empty() && field.value_name().is_some() {
        notes.push(field.names.join(", "));
    }
    let default = field.default_text();
    if !default.is_empty() {
        notes.push(format!("default {default}"));
    }
    if field.level == Level::Expert {
        notes.push("expert".into());
    }
    let mut text = wrapped(&format!("- {usage} ({}). {}", notes.join("; "), field.help()));
    text.push('\n');
    text
}

/// `text` in lines, those after the first indented.
fn wrapped(text: &str) -> String {
    let mut lines = vec![String::new()];
    let mut length = 0;
    for word in text.split(' ') {
        let more = word.chars().count() + 1;
        if length + more > COLUMNS {
            lines.push(" ".to_string());
            length = 1;
        }
        if let Some(line) = lines.last_mut() {
            if !line.is_empty() {
                line.push(' ');
            }
            line.push_str(word);
        }
        length += more;
    }
    lines.join("\n")
}
