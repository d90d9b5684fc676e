//! Spans that were fetched and wait to be read.

use bytes::Bytes;
use std::collections::BTreeMap;
use std::io;
use std::ops::Range;
use std::sync::Arc;

/// A span that was fetched, or why it could not be.
struct Fetched {
    end: u64,
    /// Bytes that are still to be read; none: it is not kept.
    left: u64,
    /// The batch that it came with.
    batch: u64,
    bytes: Result<Bytes, Failure>,
}

/// Why bytes could not be had, for everyone who asks for them.
#[derive(Clone, Debug)]
pub(super) struct Failure {
    /// As of an error of reading.
    pub kind: io::ErrorKind,
    /// What went wrong, and what to do.
    pub text: Arc<str>,
}

impl From<Failure> for io::Error {
    fn from(failure: Failure) -> Self {
        io::Error::new(failure.kind, failure.text.to_string())
    }
}

/// The spans that wait.
#[derive(Default)]
pub(super) struct Held {
    spans: BTreeMap<u64, Fetched>,
    bytes: u64,
    batch: u64,
}

impl Held {
    /// Whether all of `range` waits in one span.
    pub fn has(&self, range: &Range<u64>) -> bool {
        self.spans.range(..=range.start).next_back().is_some_and(|(_, span)| range.end <= span.end)
    }

    /// The bytes of `range`, if they wait in one span. A span that was read as often as it was asked for goes.
    pub fn take(&mut self, range: &Range<u64>) -> Option<Result<Bytes, Failure>> {
        let (&start, span) = self.spans.range_mut(..=range.start).next_back()?;
        if range.end > span.end {
            return None;
        }
        let bytes = match &span.bytes {
            Ok(bytes) => Ok(bytes.slice((range.start - start) as usize..(range.end - start) as usize)),
            Err(failure) => Err(failure.clone()),
        };
        span.left = span.left.saturating_sub(range.end - range.start);
        if span.left == 0 {
            self.remove(start);
        }
        Some(bytes)
    }

    fn remove(&mut self, start: u64) {
        if let Some(span) = self.spans.remove(&start) {
            self.bytes -= span.bytes.map_or(0, |bytes| bytes.len() as u64);
        }
    }

    /// Spans that begin at these bytes, each to be read `left` bytes of. What waits of earlier batches goes if there
    /// are more than `most` bytes.
    pub fn insert(&mut self, batch: Vec<(Range<u64>, u64, Result<Bytes, Failure>)>, most: u64) {
        self.batch += 1;
        for (range, left, bytes) in batch {
            self.remove(range.start);
            self.bytes += bytes.as_ref().map_or(0, |bytes| bytes.len() as u64);
            self.spans.insert(range.start, Fetched { end: range.end, left, batch: self.batch, bytes });
        }
        if self.bytes > most {
            let own = self.batch;
            self.spans.retain(|_, span| span.batch == own);
            self.bytes = self.spans.values().filter_map(|span| Some(span.bytes.as_ref().ok()?.len() as u64)).sum();
        }
    }

    /// Forgets all that waits.
    pub fn clear(&mut self) {
        self.spans.clear();
        self.bytes = 0;
    }
}
