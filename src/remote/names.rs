//! Names of scenes by URL, and what is known of each: the URL itself, its disk cache, its counters.

use super::disk::DiskCache;
use super::traffic::{Counters, Traffic};
use anyhow::{Result, bail};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// What a scene's place may begin with.
const SCHEMES: [&str; 5] = ["s3", "gs", "az", "http", "https"];

/// Where a scene is.
#[derive(Clone)]
#[cfg_attr(not(feature = "remote"), allow(dead_code))]
pub(super) struct Place {
    /// As people see it.
    pub name: PathBuf,
    /// With all that is secret.
    pub url: String,
    /// Where its parts are kept.
    pub disk: Option<DiskCache>,
    /// What was fetched of it.
    pub counters: Arc<Counters>,
}

/// The places of this process, by name.
#[derive(Default)]
struct Places {
    known: HashMap<PathBuf, Place>,
    /// Where parts of scenes are kept of which nothing else was said.
    disk: Option<DiskCache>,
    /// What a person should know.
    told: Vec<String>,
}

static PLACES: Mutex<Option<Places>> = Mutex::new(None);

/// Every change is complete before anything can panic.
fn places() -> MutexGuard<'static, Option<Places>> {
    PLACES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Whether `path` is a URL rather than a file.
pub fn is_url(path: &Path) -> bool {
    let scheme = path.to_str().and_then(|text| text.split_once("://"));
    scheme.is_some_and(|(scheme, _)| SCHEMES.contains(&scheme.to_ascii_lowercase().as_str()))
}

/// What `path` is called where it is printed and opened: of a URL what is not secret, of a file its path.
pub fn name(path: &Path) -> PathBuf {
    if is_url(path) { place(path).name } else { path.into() }
}

/// As [`name`], of a scene whose parts are kept in `disk`.
pub fn name_with(path: &Path, disk: Option<DiskCache>) -> PathBuf {
    if !is_url(path) {
        return path.into();
    }
    let name = place(path).name;
    if let Some(place) = places().get_or_insert_default().known.get_mut(&name) {
        place.disk = disk.or(place.disk.take());
    }
    name
}

/// Keeps parts of scenes that are opened from now on in `disk`, where nothing else is said.
pub fn keep_on_disk(disk: Option<DiskCache>) {
    places().get_or_insert_default().disk = disk;
}

/// Notes what a person should know.
#[cfg(feature = "remote")]
pub(super) fn tell(line: String) {
    tracing::warn!("{line}");
    places().get_or_insert_default().told.push(line);
}

/// What a person should know since this was asked last, a line each.
pub fn take_warnings() -> Vec<String> {
    places().as_mut().map(|places| std::mem::take(&mut places.told)).unwrap_or_default()
}

/// What was fetched of a scene by all who opened it in this process; `None` of files.
pub fn traffic(path: &Path) -> Option<Traffic> {
    is_url(path).then(|| place(path).counters.now())
}

/// Refuses a URL where only a file will do.
///
/// # Errors
/// `path` is a URL.
pub fn refuse(path: &Path, what: &str) -> Result<()> {
    if is_url(path) {
        bail!("{}: {what} needs a file of this machine; download it", name(path).display());
    }
    Ok(())
}

/// The place that a URL or a name stands for.
pub(super) fn place(path: &Path) -> Place {
    let mut places = places();
    let places = places.get_or_insert_default();
    let disk = places.disk.clone();
    if let Some(place) = places.known.get(path) {
        return Place { disk: place.disk.clone().or(disk), ..place.clone() };
    }
    let url = path.to_string_lossy().into_owned();
    let base = without_secrets(&url);
    // URLs that differ in what is secret are different scenes.
    let numbered = |number: u32| PathBuf::from(if number == 1 { base.clone() } else { format!("{base}#{number}") });
    let mut number = 1;
    while places.known.get(&numbered(number)).is_some_and(|place| place.url != url) {
        number += 1;
    }
    let made = || Place { name: numbered(number), url, disk: None, counters: Arc::default() };
    let place = places.known.entry(numbered(number)).or_insert_with(made);
    Place { disk: place.disk.clone().or(disk), ..place.clone() }
}

/// A URL without user, password, query and fragment.
fn without_secrets(url: &str) -> String {
    let (scheme, rest) = url.split_once("://").unwrap_or(("", url));
    let end = rest.find(['?', '#']).unwrap_or(rest.len());
    let rest = rest.get(..end).unwrap_or(rest);
    // A password may hold a slash that nobody encoded.
    let host = rest.rfind('@').map_or(0, |at| at + 1);
    format!("{}://{}", scheme.to_ascii_lowercase(), rest.get(host..).unwrap_or(rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn urls_are_told_from_files() {
        for url in ["s3://b/k", "gs://b/k", "az://c/k", "http://h/k", "HTTPS://h/k"] {
            assert!(is_url(Path::new(url)), "{url}");
        }
        for file in ["a.bricks", "/a/b", "file:///a", "s3:/b", "C:\\a", "ftp://h/k"] {
            assert!(!is_url(Path::new(file)), "{file}");
        }
    }

    #[test]
    fn names_hold_no_secrets_and_stand_for_their_urls() {
        let url = "https://ann:pass/word@host.test:8080/a/b%20c.bricks?X-Amz-Signature=5ec2e7#part";
        let name = name(Path::new(url));
        assert_eq!(name, Path::new("https://host.test:8080/a/b%20c.bricks"));
        assert_eq!(place(&name).url, url);
        assert_eq!(place(Path::new(url)).name, name);
        // The same but for its signature is another place, and does not take the first one's.
        let other = super::name(Path::new("https://host.test:8080/a/b%20c.bricks?X-Amz-Signature=07he2"));
        assert_ne!(other, name);
        assert!(!other.to_string_lossy().contains("07he2") && place(&name).url == url);
        assert_eq!(super::name(Path::new("a/b.bricks")), Path::new("a/b.bricks"));
        let refused = refuse(Path::new(url), "repair").unwrap_err().to_string();
        assert!(refused.contains("repair needs a file") && !refused.contains("5ec2e7"), "{refused}");
        assert!(refuse(Path::new("a.bricks"), "repair").is_ok());
    }
}
