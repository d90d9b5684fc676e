//! What every check is made of: a rule that holds, or a flaw that says what was found and expected.

use crate::error::{Flaw, Part};
use crate::layout::MAX_PAYLOAD_BYTES;
use crate::payload::Payload;
use crate::records::Span;
use std::fmt::Display;

/// A flaw in `part` unless `ok`. The texts are made only then: (found, expected).
#[inline]
pub(super) fn rule<F: Display, E: Display>(ok: bool, part: Part, texts: impl FnOnce() -> (F, E)) -> Result<(), Flaw> {
    if ok { Ok(()) } else { Err(broken(part, texts)) }
}

#[cold]
#[inline(never)]
fn broken<F: Display, E: Display>(part: Part, texts: impl FnOnce() -> (F, E)) -> Flaw {
    let (found, expected) = texts();
    Flaw { part, found: found.to_string(), expected: expected.to_string() }
}

/// Checks the length of a payload that counts imply.
pub(super) fn length(payload: Payload, span: Span, bytes: u64) -> Result<(), Flaw> {
    rule(span.bytes == bytes && bytes <= MAX_PAYLOAD_BYTES, Part::Payload(payload), || {
        let expected = format!("{bytes} bytes as its counts say, at most {MAX_PAYLOAD_BYTES}");
        (format!("{} bytes", span.bytes), expected)
    })
}

/// Checks the length of a payload that is stored encoded and has `bytes` when loaded.
pub(super) fn encoded(payload: Payload, span: Span, bytes: u64) -> Result<(), Flaw> {
    let valid = span.bytes > 0 && span.bytes.is_multiple_of(16) && span.bytes.max(bytes) <= MAX_PAYLOAD_BYTES;
    rule(valid, Part::Payload(payload), || {
        let expected = format!("a multiple of 16 from 16 to {MAX_PAYLOAD_BYTES} bytes, stored and loaded");
        (format!("{} bytes, {bytes} when loaded", span.bytes), expected)
    })
}
