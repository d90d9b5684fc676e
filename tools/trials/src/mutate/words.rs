//! Changes to the words and lines of a text.

use crate::random::Random;

/// Most bytes of a text: words are repeated.
const MOST_BYTES: usize = 1 << 16;

/// Words that stand where others should.
const WORDS: [&str; 18] = [
    "0",
    "1",
    "-1",
    "255",
    "256",
    "65536",
    "4294967295",
    "4294967296",
    "-9223372036854775808",
    "18446744073709551616",
    "1e308",
    "1e999",
    "nan",
    "inf",
    "-0.0",
    "0x10",
    "",
    "\u{feff}",
];

/// Changes one word or line of `text`; `names` are words that the format knows.
pub fn change(random: &mut Random, text: &mut Vec<u8>, names: &[&str]) {
    let is_of_lines = random.chance(30);
    let is_end = |c: &u8| *c == b'\n' || (!is_of_lines && matches!(c, b' ' | b'/' | b','));
    let mut pieces: Vec<Vec<u8>> = text.split_inclusive(is_end).map(<[u8]>::to_vec).collect();
    if pieces.is_empty() {
        text.extend_from_slice(b"0 ");
        return;
    }
    let (at, to) = (random.below(pieces.len()), random.below(pieces.len()));
    match random.below(8) {
        0 => {
            pieces.remove(at);
        }
        1 => {
            let copy = pieces[at].clone();
            pieces.insert(to, copy);
        }
        2 => pieces.swap(at, to),
        3 => {
            // Two words become one, or a word ends otherwise.
            let end = pieces[at].len().saturating_sub(1);
            match random.below(3) {
                0 => pieces[at].truncate(end),
                1 => pieces[at].splice(end.., *b"\r\n").for_each(drop),
                _ => pieces[at].splice(end.., *b" \\\n").for_each(drop),
            }
        }
        4 => {
            let copy = pieces[at].repeat(random.within(2, 200));
            pieces[at] = copy;
        }
        _ => {
            let known = random.pick_from(names).copied().filter(|_| random.chance(40));
            let word = known.unwrap_or_else(|| random.pick(WORDS));
            let end = pieces[at].last().copied().unwrap_or(b' ');
            pieces[at] = [word.as_bytes(), &[end]].concat();
        }
    }
    *text = pieces.concat();
    text.truncate(MOST_BYTES);
}
