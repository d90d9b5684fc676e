//! Reads a scene file of any bytes, once as it comes and once with its checksums made right, so that the checks behind
//! them are reached.
#![no_main]

#[path = "../../bricks/tests/it/exercise.rs"]
mod exercise;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    exercise::exercise(bytes);
    let mut sealed = bytes.to_vec();
    exercise::seal(&mut sealed);
    exercise::exercise(&sealed);
});
