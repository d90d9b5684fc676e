//! The header of a PLY file (G. Turk, "The PLY Polygon File Format", 1994).

use crate::import::bytes::Stream;
use crate::import::error::one_line;
use std::io::{BufRead, BufReader, Read};

/// Most kinds of rows.
const MAX_ELEMENTS: usize = 256;

/// Longest header.
const MAX_HEADER: u64 = 1 << 20;

/// How the body is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// Type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn of(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes in a binary body.
    pub fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The largest value of an integer type, for which 1 stands in a colour; 1 for the others.
    pub fn one(self) -> f64 {
        match self {
            Self::I8 => i8::MAX.into(),
            Self::U8 => u8::MAX.into(),
            Self::I16 => i16::MAX.into(),
            Self::U16 => u16::MAX.into(),
            Self::I32 => i32::MAX.into(),
            Self::U32 => u32::MAX.into(),
            Self::F32 | Self::F64 => 1.0,
        }
    }

    /// The number in the first bytes of little-endian `bytes`.
    pub fn read(self, bytes: [u8; 8]) -> f64 {
        let [a, b, c, d, ..] = bytes;
        match self {
            Self::I8 => f64::from(a as i8),
            Self::U8 => f64::from(a),
            Self::I16 => f64::from(i16::from_le_bytes([a, b])),
            Self::U16 => f64::from(u16::from_le_bytes([a, b])),
            Self::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            Self::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            Self::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Self::F64 => f64::from_le_bytes(bytes),
        }
    }
}

/// A named value of an element.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Property {
    pub name: String,
    /// Type of the value, or of the items of a list.
    pub scalar: Scalar,
    /// Type of the number of items; `None`: no list.
    pub list: Option<Scalar>,
}

/// A kind of rows.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Element {
    pub name: String,
    pub count: u64,
    pub properties: Vec<Property>,
}

impl Element {
    /// The place of a property by one of its `names`.
    pub fn find(&self, names: &[&str]) -> Option<usize> {
        self.properties.iter().position(|property| names.contains(&property.name.as_str()))
    }
}

/// What the body holds.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Header {
    pub encoding: Encoding,
    pub elements: Vec<Element>,
}

/// Reads the header, up to the line break behind `end_header`; the error says what is wrong.
pub(super) fn read(stream: &mut BufReader<Stream>) -> Result<Header, String> {
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut left = MAX_HEADER;
    let mut line = Vec::new();
    let mut number = 0;
    loop {
        line.clear();
        let n = stream.take(left).read_until(b'\n', &mut line).map_err(|e| e.to_string())? as u64;
        left -= n;
        number += 1;
        if line.last() != Some(&b'\n') {
            return Err("the header does not end".into());
        }
        let text = String::from_utf8_lossy(&line);
        let mut words = text.split_ascii_whitespace();
        let bad = |what: &str| format!("line {number} of the header: {what}");
        let keyword = words.next().unwrap_or_default();
        if number == 1 {
            if keyword != "ply" {
                return Err("the file does not begin with \"ply\"".into());
            }
            continue;
        }
        match keyword {
            "format" => {
                encoding = Some(match words.next() {
                    Some("ascii") => Encoding::Ascii,
                    Some("binary_little_endian") => Encoding::LittleEndian,
                    Some("binary_big_endian") => Encoding::BigEndian,
                    other => return Err(bad(&format!("unknown format \"{}\"", one_line(other.unwrap_or_default())))),
                });
            }
            "element" => {
                let name = words.next().ok_or_else(|| bad("an element has no name"))?.to_owned();
                let count = words.next().and_then(|count| count.parse().ok());
                let count = count.ok_or_else(|| bad("the number of an element's rows is not a count"))?;
                if elements.len() == MAX_ELEMENTS {
                    return Err(bad("there are too many elements"));
                }
                if elements.iter().any(|element| element.name == name) {
                    return Err(bad("an element of this name was there before"));
                }
                elements.push(Element { name, count, properties: Vec::new() });
            }
            "property" => {
                let element = elements.last_mut().ok_or_else(|| bad("a property comes before any element"))?;
                let scalar = |name: Option<&str>| {
                    let name = name.unwrap_or_default();
                    Scalar::of(name).ok_or_else(|| bad(&format!("unknown type \"{}\"", one_line(name))))
                };
                let (list, scalar) = match words.next() {
                    Some("list") => (Some(scalar(words.next())?), scalar(words.next())?),
                    name => (None, scalar(name)?),
                };
                let name = words.next().ok_or_else(|| bad("a property has no name"))?.to_owned();
                element.properties.push(Property { name, scalar, list });
            }
            "end_header" => break,
            // Comments, object information, empty lines.
            _ => {}
        }
    }
    Ok(Header { encoding: encoding.ok_or("the header states no format")?, elements })
}
