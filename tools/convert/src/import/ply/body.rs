//! The rows behind the header, in all three encodings.

use super::header::{Element, Encoding, Scalar};
use crate::import::bytes::Stream;
use crate::import::text::Tokens;
use std::io::{self, BufReader, Read};

/// Why a row could not be taken.
#[derive(Debug)]
pub(super) enum Failure {
    /// The row is bad, or the file ends before it.
    Input(String),
    /// It cannot be kept.
    Spool(String),
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        Self::Input(match error.kind() {
            io::ErrorKind::UnexpectedEof => "the file ends here, but its header states more".into(),
            _ => error.to_string(),
        })
    }
}

/// Reads rows one after the other.
pub(super) enum Body {
    Text(Tokens),
    Binary { stream: BufReader<Stream>, is_big_endian: bool },
}

impl Body {
    /// The rows in what is left of `stream`.
    pub fn new(stream: BufReader<Stream>, encoding: Encoding) -> Self {
        match encoding {
            Encoding::Ascii => Self::Text(Tokens::new(stream)),
            Encoding::LittleEndian => Self::Binary { stream, is_big_endian: false },
            Encoding::BigEndian => Self::Binary { stream, is_big_endian: true },
        }
    }

    /// Reads a row of `element` and calls `take` with each value: number of its property, number in its list, value.
    pub fn row(
        &mut self,
        element: &Element,
        take: &mut dyn FnMut(usize, u64, f64) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        for (p, property) in element.properties.iter().enumerate() {
            let Some(count) = property.list else {
                take(p, 0, self.number(property.scalar)?)?;
                continue;
            };
            let count = self.number(count)?;
            // Exact: of at most 32 bits, unless it is a float, which is no count.
            if count < 0.0 || count.fract() != 0.0 || count > f64::from(u32::MAX) {
                return Err(Failure::Input(format!("{count} is not a number of items of a list")));
            }
            for i in 0..count as u64 {
                take(p, i, self.number(property.scalar)?)?;
            }
        }
        Ok(())
    }

    fn number(&mut self, scalar: Scalar) -> Result<f64, Failure> {
        match self {
            Self::Text(tokens) => tokens.number()?.map_err(Failure::Input),
            Self::Binary { stream, is_big_endian } => {
                let mut bytes = [0; 8];
                let number = &mut bytes[..scalar.bytes()];
                stream.read_exact(number)?;
                if *is_big_endian {
                    number.reverse();
                }
                Ok(scalar.read(bytes))
            }
        }
    }

    /// What is left.
    pub fn into_inner(self) -> BufReader<Stream> {
        match self {
            Self::Text(tokens) => tokens.into_inner(),
            Self::Binary { stream, .. } => stream,
        }
    }
}

impl Element {
    /// Rows that have to be run through: none of an element whose rows are empty, however many it states.
    pub fn passes(&self) -> u64 {
        if self.properties.is_empty() { 0 } else { self.count }
    }
}
