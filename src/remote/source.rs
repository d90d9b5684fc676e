//! A remote scene file as [`bricks`] reads it: what is announced is fetched at once and waits until it is read.

use super::batch;
use super::entries::Entries;
use super::fetch::{Limits, Live, Pin, fetch};
use super::held::{Failure, Held};
use super::names::Place;
use super::traffic::add;
use anyhow::{Context, Result, anyhow};
use bricks::layout::PAGE_BYTES;
use bricks::{ByteSource, SceneFile};
use bytes::Bytes;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::io::{self, ErrorKind};
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use xxhash_rust::xxh3::xxh3_64;

/// How often bytes that do not fit their checksum are fetched again.
const MOST_DISTRUSTED: u32 = 5;

/// An object that is read as a scene file.
struct RemoteSource {
    place: Place,
    limits: Limits,
    live: Mutex<Arc<Live>>,
    pin: Pin,
    entries: Option<Entries>,
    held: Mutex<Held>,
    /// The resident part, which is fetched as one span.
    resident: Mutex<Option<Range<u64>>>,
}

/// What is behind a lock is whole between any two statements that may panic.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Opens the scene at `place`.
///
/// # Errors
/// It cannot be had, or is no scene, or damaged.
pub(super) fn open(place: &Place, limits: &Limits) -> Result<SceneFile> {
    let name = || place.name.display().to_string();
    let live = Arc::new(Live::new(place, limits).with_context(name)?);
    let head = 0..PAGE_BYTES;
    let fetched = fetch(&live, std::slice::from_ref(&head), None).into_iter().next();
    let (_, fetched) = fetched.with_context(|| format!("{}: the request was not made", name()))?;
    let (bytes, pin) = fetched.map_err(|failure| anyhow!("{}: cannot open it: {}", name(), failure.text))?;
    // The header's checksum depends on every byte of the file, whatever the server says of versions.
    let scene = format!("{} {} {:016x}", name(), pin.told(), xxh3_64(&bytes));
    add(&place.counters.bytes_needed, bytes.len() as u64);
    let source = Arc::new(RemoteSource {
        place: place.clone(),
        limits: limits.clone(),
        live: Mutex::new(live),
        entries: place.disk.clone().map(|cache| Entries::new(cache, scene)),
        held: Mutex::default(),
        resident: Mutex::default(),
        pin,
    });
    let head = 0..bytes.len() as u64;
    lock(&source.held).insert(vec![(head.clone(), head.end, Ok(bytes))], limits.batch_bytes);
    let scene = SceneFile::from_source(place.name.clone(), source.clone())?;
    // The zeros between sections are read by nobody.
    lock(&source.held).clear();
    Ok(scene)
}

impl RemoteSource {
    /// What fetches; in a forked process it is opened anew.
    fn live(&self) -> Result<Arc<Live>, Failure> {
        let mut live = lock(&self.live);
        if !live.is_own() {
            let wrong = |error: anyhow::Error| Failure { kind: ErrorKind::Other, text: format!("{error:#}").into() };
            *live = Arc::new(Live::new(&self.place, &self.limits).map_err(wrong)?);
        }
        Ok(live.clone())
    }

    /// Spans, which ascend and do not overlap, each with the bytes that will be read of it: from the disk cache, or
    /// fetched together.
    fn bring(&self, spans: &[(Range<u64>, u64)]) -> Vec<(Range<u64>, u64, Result<Bytes, Failure>)> {
        let counters = &self.place.counters;
        let from_disk = |(span, left): &(Range<u64>, u64)| {
            let bytes = self.entries.as_ref().and_then(|entries| entries.get(span.start, span.end));
            (span.clone(), *left, bytes.map(Bytes::from))
        };
        let mut batch = Vec::with_capacity(spans.len());
        let mut missing = Vec::new();
        let kept: Vec<_> = match &self.entries {
            Some(_) => spans.par_iter().map(from_disk).collect(),
            None => spans.iter().map(from_disk).collect(),
        };
        for (span, left, bytes) in kept {
            match bytes {
                Some(bytes) => {
                    add(&counters.disk_cache_hits, 1);
                    add(&counters.disk_cache_bytes, bytes.len() as u64);
                    batch.push((span, left, Ok(bytes)));
                }
                None => missing.push((span, left)),
            }
        }
        if !missing.is_empty() {
            let fetched = self.fetch(&missing);
            if let Some(entries) = &self.entries {
                fetched.par_iter().for_each(|(span, _, bytes)| {
                    if let Ok(bytes) = bytes {
                        entries.put(span.start, bytes);
                    }
                });
            }
            batch.extend(fetched);
        }
        batch
    }

    /// Fetches spans, joined to ranges.
    fn fetch(&self, missing: &[(Range<u64>, u64)]) -> Vec<(Range<u64>, u64, Result<Bytes, Failure>)> {
        let spans: Vec<Range<u64>> = missing.iter().map(|(span, _)| span.clone()).collect();
        add(&self.place.counters.bytes_needed, spans.iter().map(|span| span.end - span.start).sum());
        let fetched = self.live().map(|live| fetch(&live, &batch::ranges(&spans), Some(&self.pin)));
        let fetched: BTreeMap<u64, _> = match fetched {
            Ok(fetched) => fetched.into_iter().map(|(range, bytes)| (range.start, bytes)).collect(),
            Err(failure) => BTreeMap::from([(0, Err(failure))]),
        };
        let of_span = |(span, left): &(Range<u64>, u64)| {
            let bytes = match fetched.range(..=span.start).next_back() {
                Some((start, Ok((bytes, _)))) if span.end - start <= bytes.len() as u64 => {
                    Ok(bytes.slice((span.start - start) as usize..(span.end - start) as usize))
                }
                Some((_, Err(failure))) => Err(failure.clone()),
                _ => Err(Failure { kind: ErrorKind::Other, text: "the request was not made; try again".into() }),
            };
            (span.clone(), *left, bytes)
        };
        missing.iter().map(of_span).collect()
    }
}

impl ByteSource for RemoteSource {
    fn length(&self) -> io::Result<u64> {
        Ok(self.pin.bytes)
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let range = offset..offset.saturating_add(out.len() as u64);
        if range.is_empty() {
            return Ok(());
        }
        if range.end > self.pin.bytes {
            return Err(ErrorKind::UnexpectedEof.into());
        }
        let held = lock(&self.held).take(&range);
        let bytes = held.unwrap_or_else(|| {
            let missing = || Failure { kind: ErrorKind::Other, text: "the request was not made; try again".into() };
            let brought = self.bring(&[(range, out.len() as u64)]).pop();
            brought.map_or_else(|| Err(missing()), |(_, _, bytes)| bytes)
        });
        out.copy_from_slice(&bytes?);
        Ok(())
    }

    fn announce(&self, spans: &[Range<u64>]) {
        if let [span] = spans
            && span.end == self.pin.bytes
        {
            *lock(&self.resident) = Some(span.clone());
        }
        let mut wanted: BTreeMap<u64, (u64, u64)> = BTreeMap::new();
        let mut sum = 0u64;
        let held = lock(&self.held);
        for span in spans.iter().filter(|span| !span.is_empty() && span.end <= self.pin.bytes && !held.has(span)) {
            sum = sum.saturating_add(span.end - span.start);
            // The rest is fetched when it is read.
            if sum > self.limits.batch_bytes && !wanted.is_empty() {
                break;
            }
            let (end, left) = wanted.entry(span.start).or_insert((span.end, 0));
            *end = span.end.max(*end);
            *left += span.end - span.start;
        }
        drop(held);
        let mut spans: Vec<(Range<u64>, u64)> = Vec::with_capacity(wanted.len());
        for (start, (end, left)) in wanted {
            match spans.last_mut() {
                // Payloads of a sound file do not overlap.
                Some((last, all)) if start < last.end => {
                    last.end = end.max(last.end);
                    *all += left;
                }
                _ => spans.push((start..end, left)),
            }
        }
        if !spans.is_empty() {
            let batch = self.bring(&spans);
            lock(&self.held).insert(batch, 2 * self.limits.batch_bytes);
        }
    }

    fn announced_bytes(&self) -> Option<u64> {
        Some(self.limits.batch_bytes)
    }

    fn distrust(&self, span: Range<u64>, times: u32) -> bool {
        if let Some(entries) = &self.entries {
            let padded = span.end.next_multiple_of(PAGE_BYTES);
            // With what it may have been fetched together with.
            for end in [span.end, padded] {
                entries.drop_entry(span.start, end);
            }
            if let Some(resident) = lock(&self.resident).clone().filter(|resident| resident.contains(&span.start)) {
                entries.drop_entry(resident.start, resident.end);
            }
        }
        add(&self.place.counters.retries, u64::from(times < MOST_DISTRUSTED));
        times < MOST_DISTRUSTED
    }

    fn is_file(&self) -> bool {
        false
    }
}
