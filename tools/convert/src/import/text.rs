//! Text that is run through in bounded memory: words and lines.

use super::bytes::Stream;
use super::error::one_line;
use std::io::{self, BufRead, BufReader, Read};

/// Longest word.
const MAX_WORD: usize = 4096;

/// Longest line, with its continuations.
const MAX_LINE: usize = 16 << 20;

/// Words separated by white space.
pub(super) struct Tokens {
    stream: BufReader<Stream>,
    word: Vec<u8>,
    line: u64,
}

impl Tokens {
    /// The words of what is left of `stream`.
    pub fn new(stream: BufReader<Stream>) -> Self {
        Self { stream, word: Vec::new(), line: 1 }
    }

    /// The next word, cut to 4096 bytes; `None` at the end.
    pub fn next(&mut self) -> io::Result<Option<&[u8]>> {
        self.word.clear();
        loop {
            let block = self.stream.fill_buf()?;
            if block.is_empty() {
                break;
            }
            let mut used = 0;
            let mut is_complete = false;
            for &byte in block {
                if byte.is_ascii_whitespace() {
                    is_complete = !self.word.is_empty();
                    if is_complete {
                        break;
                    }
                    self.line += u64::from(byte == b'\n');
                } else if self.word.len() < MAX_WORD {
                    self.word.push(byte);
                }
                used += 1;
            }
            self.stream.consume(used);
            if is_complete {
                break;
            }
        }
        Ok((!self.word.is_empty()).then_some(&self.word[..]))
    }

    /// The next word as a number; the inner error says why it is none.
    pub fn number(&mut self) -> io::Result<Result<f64, String>> {
        Ok(match self.next()? {
            Some(word) => number(word),
            None => Err("the file ends where a number should be".into()),
        })
    }

    /// "line 3".
    pub fn place(&self) -> String {
        format!("line {}", self.line)
    }

    /// What is left.
    pub fn into_inner(self) -> BufReader<Stream> {
        self.stream
    }
}

/// A number in text; `inf` and `nan` are numbers.
pub(super) fn number(word: &[u8]) -> Result<f64, String> {
    let text = std::str::from_utf8(word).ok().and_then(|text| text.parse().ok());
    text.ok_or_else(|| format!("\"{}\" is not a number", one_line(&String::from_utf8_lossy(word))))
}

/// Lines; a line that ends in a backslash goes on in the next.
pub(super) struct Lines {
    stream: BufReader<Stream>,
    line: Vec<u8>,
    number: u64,
}

impl Lines {
    /// The lines of what is left of `stream`.
    pub fn new(stream: BufReader<Stream>) -> Self {
        Self { stream, line: Vec::new(), number: 0 }
    }

    /// The next line without its end; `None` at the end of the file.
    pub fn next(&mut self) -> io::Result<Option<&[u8]>> {
        self.line.clear();
        loop {
            let room = (MAX_LINE - self.line.len()) as u64;
            if room == 0 {
                let what = format!("line {} is longer than {MAX_LINE} bytes", self.number);
                return Err(io::Error::new(io::ErrorKind::InvalidData, what));
            }
            if (&mut self.stream).take(room).read_until(b'\n', &mut self.line)? == 0 {
                return Ok((!self.line.is_empty()).then_some(&self.line[..]));
            }
            let is_whole = self.line.pop_if(|byte| *byte == b'\n').is_some();
            self.number += u64::from(is_whole);
            self.line.pop_if(|byte| *byte == b'\r');
            let goes_on = self.line.pop_if(|byte| *byte == b'\\').is_some();
            if goes_on {
                self.line.push(b' ');
            } else if is_whole {
                return Ok(Some(&self.line[..]));
            }
        }
    }

    /// Number of lines so far.
    pub fn count(&self) -> u64 {
        self.number
    }

    /// What is left.
    pub fn into_inner(self) -> BufReader<Stream> {
        self.stream
    }
}
