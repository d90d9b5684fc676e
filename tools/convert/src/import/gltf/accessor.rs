//! Accessors (glTF 2.0, sections 3.6.2 and 5.1): typed, strided, possibly sparse views of buffers, checked once and then
//! read by index.

use super::document::{Accessor as Json, Index};
use super::file::{File, Problem, item, slice};
use crate::import::error::one_line;

/// Type of one component.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn of(code: u64) -> Result<Self, Problem> {
        Ok(match code {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return Err(Problem::new(format!("component type {code} is not one of glTF"))),
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::I8 => "BYTE",
            Self::U8 => "UNSIGNED_BYTE",
            Self::I16 => "SHORT",
            Self::U16 => "UNSIGNED_SHORT",
            Self::U32 => "UNSIGNED_INT",
            Self::F32 => "FLOAT",
        }
    }

    /// The component at byte `at`, which the caller knows to be within `bytes`.
    fn read(self, bytes: &[u8], at: usize) -> f64 {
        match self {
            Self::I8 => bytes[at] as i8 as f64,
            Self::U8 => bytes[at] as f64,
            Self::I16 => i16::from_le_bytes([bytes[at], bytes[at + 1]]) as f64,
            Self::U16 => u16::from_le_bytes([bytes[at], bytes[at + 1]]) as f64,
            Self::U32 => u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]) as f64,
            Self::F32 => f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]) as f64,
        }
    }

    /// What an integer component stands for when normalised (glTF 2.0, section 3.11).
    fn scale(self) -> f64 {
        match self {
            Self::I8 => 127.0,
            Self::U8 => 255.0,
            Self::I16 => 32767.0,
            Self::U16 => 65535.0,
            Self::U32 | Self::F32 => 1.0,
        }
    }
}

/// What an accessor may be for its use.
pub(super) struct Shape {
    /// Type names with their numbers of components.
    pub kinds: &'static [(&'static str, usize)],
    /// Component types.
    pub components: &'static [Component],
    /// Integers are normalised even if the accessor does not say so.
    pub always_normalized: bool,
}

/// An accessor whose every element is known to lie within its buffers.
#[derive(Clone, Debug)]
pub(super) struct Accessor<'a> {
    /// Number of elements.
    pub count: usize,
    /// Components of an element, at most 4.
    pub width: usize,
    component: Component,
    normalized: bool,
    /// Element `i` begins at `i * stride`; `None`: all zeros.
    base: Option<&'a [u8]>,
    stride: usize,
    sparse: Option<Sparse<'a>>,
}

/// Replaced elements: ascending indices and, tightly packed, values.
#[derive(Clone, Debug)]
struct Sparse<'a> {
    count: usize,
    indices: &'a [u8],
    component: Component,
    values: &'a [u8],
}

impl Sparse<'_> {
    fn index(&self, i: usize) -> usize {
        self.component.read(self.indices, i * self.component.bytes()) as usize
    }

    /// Position of element `element` among the replaced ones.
    fn find(&self, element: usize) -> Option<usize> {
        let (mut low, mut high) = (0, self.count);
        while low < high {
            let middle = low + (high - low) / 2;
            if self.index(middle) < element { low = middle + 1 } else { high = middle }
        }
        (low < self.count && self.index(low) == element).then_some(low)
    }
}

impl<'a> Accessor<'a> {
    /// Checks accessor `index` of `file` against `shape` and against its buffers.
    pub fn resolve(file: &'a File, index: Index, shape: &Shape) -> Result<Self, Problem> {
        let json = item(&file.document.accessors, index, "accessor")?;
        Self::check(file, json, shape)
            .map_err(|problem| Problem { what: format!("accessor {index}: {}", problem.what), ..problem })
    }

    fn check(file: &'a File, json: &Json, shape: &Shape) -> Result<Self, Problem> {
        let component = Component::of(json.component_type.0)?;
        let width = shape.kinds.iter().find(|(name, _)| *name == json.kind).map(|(_, width)| *width);
        let (Some(width), true) = (width, shape.components.contains(&component)) else {
            let kinds: Vec<_> = shape.kinds.iter().map(|(name, _)| *name).collect();
            let components: Vec<_> = shape.components.iter().map(|c| c.name()).collect();
            return Err(Problem::new(format!(
                "is {} of {}, but must be {} of {}",
                one_line(&json.kind),
                component.name(),
                kinds.join(" or "),
                components.join(", ")
            )));
        };
        let too_long =
            || Problem::new(format!("states {} elements, more than the file and its buffers can hold", json.count));
        let element = (component.bytes() * width) as u64;
        let (base, stride) = match json.buffer_view {
            Some(view) => {
                let (bytes, stride) = file.view(view)?;
                let stride = stride.filter(|&s| s != 0).unwrap_or(element);
                if stride < element {
                    return Err(Problem::new(format!("stride {stride} is less than an element of {element} bytes")));
                }
                let span = match json.count.0 {
                    0 => Some(0),
                    n => (n - 1).checked_mul(stride).and_then(|bytes| bytes.checked_add(element)),
                };
                let bytes = span
                    .and_then(|span| json.byte_offset.0.checked_add(span))
                    .and_then(|end| slice(bytes, json.byte_offset.0, end))
                    .ok_or_else(|| {
                        Problem::new(format!(
                            "{} elements at byte {} do not fit buffer view {view} of {} bytes",
                            json.count,
                            json.byte_offset,
                            bytes.len()
                        ))
                    })?;
                (Some(bytes), stride)
            }
            // Without a buffer view nothing in the file backs the count. An element that anything uses is named by an
            // index or accompanied by other attributes, of at least a byte each.
            None if json.count.0 > file.input_bytes => return Err(too_long()),
            None => (None, element),
        };
        let count = usize::try_from(json.count.0).map_err(|_| too_long())?;
        let stride = usize::try_from(stride).map_err(|_| too_long())?;
        let sparse = json.sparse.as_deref().map(|sparse| check_sparse(file, sparse, count, element)).transpose()?;
        let normalized = (json.normalized || shape.always_normalized) && component.scale() != 1.0;
        Ok(Self { count, width, component, normalized, base, stride, sparse })
    }

    /// Whether no buffer holds any of its elements: all are zero.
    pub fn is_empty_of_data(&self) -> bool {
        self.base.is_none() && self.sparse.is_none()
    }

    /// Element `i`, below the count; components beyond its width are zero.
    pub fn get<const N: usize>(&self, i: usize) -> [f64; N] {
        let mut element = [0.0; N];
        let component = self.component.bytes();
        let replaced = self.sparse.as_ref().and_then(|sparse| Some((sparse.values, sparse.find(i)?)));
        let (bytes, start) = match (replaced, self.base) {
            (Some((values, at)), _) => (values, at * component * self.width),
            (None, Some(base)) => (base, i * self.stride),
            (None, None) => return element,
        };
        for (c, value) in element.iter_mut().enumerate().take(self.width) {
            *value = self.component.read(bytes, start + c * component);
            if self.normalized {
                *value = (*value / self.component.scale()).max(-1.0);
            }
        }
        element
    }
}

/// Checks the replaced elements of an accessor of `count` elements of `element` bytes.
fn check_sparse<'a>(
    file: &'a File,
    json: &super::document::Sparse,
    count: usize,
    element: u64,
) -> Result<Sparse<'a>, Problem> {
    let component = Component::of(json.indices.component_type.0)?;
    if !matches!(component, Component::U8 | Component::U16 | Component::U32) {
        return Err(Problem::new(format!("sparse indices are {}, but must be unsigned integers", component.name())));
    }
    if json.count.0 > count as u64 {
        return Err(Problem::new(format!("replaces {} of {count} elements", json.count)));
    }
    let part = |view: Index, offset: u64, size: u64, what: &str| {
        let (bytes, _) = file.view(view)?;
        let end = json.count.0.checked_mul(size).and_then(|span| span.checked_add(offset));
        end.and_then(|end| slice(bytes, offset, end)).ok_or_else(|| {
            let held = bytes.len();
            Problem::new(format!(
                "{} sparse {what} at byte {offset} do not fit buffer view {view} of {held} bytes",
                json.count
            ))
        })
    };
    let indices = part(json.indices.buffer_view, json.indices.byte_offset.0, component.bytes() as u64, "indices")?;
    let values = part(json.values.buffer_view, json.values.byte_offset.0, element, "values")?;
    let sparse = Sparse { count: json.count.0 as usize, indices, component, values };
    let mut next = 0;
    for i in 0..sparse.count {
        let index = sparse.index(i);
        if index < next || index >= count {
            return Err(Problem::new(format!(
                "sparse index {i} is {index}, but must ascend and be below the {count} elements"
            )));
        }
        next = index + 1;
    }
    Ok(sparse)
}
