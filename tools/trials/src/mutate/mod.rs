//! Changes to inputs: to bytes, to JSON, to words, and to chunks whose lengths and checksums are then made right, so
//! that the checks behind those are reached.

pub mod bytes;
pub mod chunks;
pub mod json;
pub mod words;

use crate::random::Random;
use serde_json::Value;

/// How an input is harmed on its way from a value to bytes. Every step asks; some trials are left as they are, so that
/// what is sound is seen to be read.
#[derive(Clone, Copy, Debug)]
pub struct Harm {
    is_on: bool,
}

/// One trial of so many is not harmed.
const SOUND: u64 = 64;

impl Harm {
    /// Of trial `seed`.
    pub fn of(seed: u64) -> Self {
        Self { is_on: !seed.is_multiple_of(SOUND) }
    }

    /// Whether it does nothing.
    pub fn is_off(self) -> bool {
        !self.is_on
    }

    /// Whether to do something that is done in so many of 100 cases.
    pub fn does(self, random: &mut Random, percent: usize) -> bool {
        self.is_on && random.chance(percent)
    }

    /// Changes bytes in so many of 100 cases.
    pub fn bytes(self, random: &mut Random, bytes: &mut Vec<u8>, percent: usize) {
        if self.does(random, percent) {
            few(random, |random| bytes::change(random, bytes));
        }
    }

    /// Changes JSON in so many of 100 cases; `names` are keys and texts that the format knows.
    pub fn json(self, random: &mut Random, value: &mut Value, names: &[&str], percent: usize) {
        if self.does(random, percent) {
            few(random, |random| json::change(random, value, names));
        }
    }

    /// Changes words of a text in so many of 100 cases; `names` are words that the format knows.
    pub fn words(self, random: &mut Random, text: &mut Vec<u8>, names: &[&str], percent: usize) {
        if self.does(random, percent) {
            few(random, |random| words::change(random, text, names));
        }
    }
}

/// Does something once, mostly, or up to eight times.
fn few(random: &mut Random, mut change: impl FnMut(&mut Random)) {
    let times = random.pick([1, 1, 1, 2, 2, 3, 4, 8]);
    (0..times).for_each(|_| change(random));
}
