//! Whether pages of `docs/results` have all columns of the tables of benches, for tests.

use super::results::Column;
use std::collections::BTreeSet;
use std::path::Path;

/// That no page leaves out a column of a table of a bench: a line `<!-- bench NAME TABLE -->` stands above each.
/// `tables`: all of the bench's, with their columns' heads; returns those that are published.
pub fn published(bench: &str, tables: &[(&str, Vec<&str>)]) -> BTreeSet<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/results");
    let mut found = BTreeSet::new();
    for page in std::fs::read_dir(&folder).expect("the pages").map(|entry| entry.expect("a page").path()) {
        if page.extension().is_none_or(|extension| extension != "md") {
            continue;
        }
        let text = std::fs::read_to_string(&page).expect("a page");
        for part in text.split(&format!("<!-- bench {bench} ")).skip(1) {
            let (name, rest) = part.split_once(" -->").expect("the end of a comment");
            let own = tables.iter().find(|(own, _)| *own == name);
            let (_, wanted) = own.unwrap_or_else(|| panic!("{}: no table {name}", page.display()));
            let head = rest.trim_start().lines().next().unwrap_or_default();
            let heads: Vec<&str> = head.trim().trim_matches('|').split('|').map(str::trim).collect();
            assert_eq!(heads, *wanted, "{}: columns of {name}", page.display());
            found.insert(name.to_owned());
        }
    }
    found
}

/// The heads of columns.
pub fn heads<R>(columns: &[Column<R>]) -> Vec<&'static str> {
    columns.iter().map(|(head, _)| *head).collect()
}
