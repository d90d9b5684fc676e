//! Accessors (glTF 2.0, sections 3.6.2 and 5.1): typed, strided, possibly sparse views of buffers. They are checked
//! once; elements are read when they are wanted.

use super::file::{File, Problem, item};
use crate::import::table::Table;
use gltf::json::accessor::{self as json, ComponentType as Component, Type};
use gltf::json::validation::Checked::Valid;
use gltf::json::{Accessor as Json, Index, buffer};
use std::io;
use std::sync::atomic::Ordering;

/// The specification's name of a type of component.
fn name(component: Component) -> &'static str {
    match component {
        Component::I8 => "BYTE",
        Component::U8 => "UNSIGNED_BYTE",
        Component::I16 => "SHORT",
        Component::U16 => "UNSIGNED_SHORT",
        Component::U32 => "UNSIGNED_INT",
        Component::F32 => "FLOAT",
    }
}

/// The component at byte `at`, which the caller knows to be within `bytes`.
fn read(component: Component, bytes: &[u8], at: usize) -> f64 {
    match component {
        Component::I8 => bytes[at] as i8 as f64,
        Component::U8 => bytes[at] as f64,
        Component::I16 => i16::from_le_bytes([bytes[at], bytes[at + 1]]) as f64,
        Component::U16 => u16::from_le_bytes([bytes[at], bytes[at + 1]]) as f64,
        Component::U32 => u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]) as f64,
        Component::F32 => f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]) as f64,
    }
}

/// What an integer component stands for when normalised (glTF 2.0, section 3.11).
fn scale(component: Component) -> f64 {
    match component {
        Component::I8 => 127.0,
        Component::U8 => 255.0,
        Component::I16 => 32767.0,
        Component::U16 => 65535.0,
        Component::U32 | Component::F32 => 1.0,
    }
}

/// What an accessor may be for its use.
pub(super) struct Shape {
    /// Types of at most 4 components.
    pub kinds: &'static [Type],
    /// Component types.
    pub components: &'static [Component],
    /// Integers are normalised even if the accessor does not say so.
    pub always_normalized: bool,
}

/// An accessor whose every element is known to lie within its buffers.
#[derive(Clone, Debug)]
pub(super) struct Accessor {
    /// Number of elements.
    pub count: u64,
    /// Components of an element, at most 4.
    pub width: usize,
    /// Whether integers are fractions of their largest value.
    pub normalized: bool,
    /// What components are divided by.
    scale: f64,
    component: Component,
    /// The elements; `None`: all zeros.
    base: Option<Table>,
    sparse: Option<Box<Sparse>>,
}

/// Replaced elements: ascending indices, and values in the same order.
#[derive(Clone, Debug)]
struct Sparse {
    indices: Table,
    component: Component,
    values: Table,
}

impl Sparse {
    fn index(&self, row: &[u8]) -> u64 {
        read(self.component, row, 0) as u64
    }

    /// Which of the elements `wanted`, which ascend without repetition, are replaced: their positions in that list, and
    /// the rows of the values.
    fn find(&self, wanted: &[u64]) -> io::Result<(Vec<usize>, Vec<u64>)> {
        let (mut positions, mut rows) = (Vec::new(), Vec::new());
        let (Some(&first), Some(&last)) = (wanted.first(), wanted.last()) else { return Ok((positions, rows)) };
        let start = self.indices.partition_point(|row| self.index(row) < first)?;
        let mut position = 0;
        self.indices.run(start, self.indices.count(), |i, row| {
            let index = self.index(row);
            while wanted.get(position).is_some_and(|&element| element < index) {
                position += 1;
            }
            if wanted.get(position) == Some(&index) {
                positions.push(position);
                rows.push(i);
            }
            index < last
        })?;
        Ok((positions, rows))
    }
}

impl Accessor {
    /// Checks accessor `index` of `file` against `shape` and against its buffers.
    pub fn resolve(file: &File, index: Index<Json>, shape: &Shape) -> Result<Self, Problem> {
        let json = item(&file.document.accessors, index, "accessor")?;
        Self::check(file, index, json, shape)
            .map_err(|problem| Problem { what: format!("accessor {index}: {}", problem.what), ..problem })
    }

    /// An accessor of floats that extensions decoded, `width` components a row.
    pub fn of_floats(table: Table, width: usize) -> Self {
        let count = table.count();
        Self { count, width, component: Component::F32, normalized: false, scale: 1.0, base: Some(table), sparse: None }
    }

    /// An accessor of indices that extensions decoded.
    pub fn of_indices(table: Table) -> Self {
        let count = table.count();
        Self {
            count,
            width: 1,
            component: Component::U32,
            normalized: false,
            scale: 1.0,
            base: Some(table),
            sparse: None,
        }
    }

    /// The same values, divided by `scale` as normalised integers are.
    pub fn scaled(self, scale: f64) -> Self {
        Self { scale, ..self }
    }

    fn check(file: &File, index: Index<Json>, json: &Json, shape: &Shape) -> Result<Self, Problem> {
        let types = (json.type_, json.component_type);
        let (Valid(kind), Valid(json::GenericComponentType(component))) = types else {
            return Err(Problem::new("its type or that of its components is not one of glTF"));
        };
        if !shape.kinds.contains(&kind) || !shape.components.contains(&component) {
            let upper = |kind: &Type| format!("{kind:?}").to_uppercase();
            let kinds: Vec<_> = shape.kinds.iter().map(upper).collect();
            let components: Vec<_> = shape.components.iter().map(|&c| name(c)).collect();
            return Err(Problem::new(format!(
                "is {} of {}, but must be {} of {}",
                upper(&kind),
                name(component),
                kinds.join(" or "),
                components.join(", ")
            )));
        }
        let width = kind.multiplicity();
        let element = component.size() * width;
        let count = json.count.0;
        let base = match json.buffer_view {
            Some(view) => {
                let (bytes, stride) = file.view(view)?;
                let stride = stride.filter(|&s| s != 0).unwrap_or(element as u64);
                if stride < element as u64 {
                    return Err(Problem::new(format!("stride {stride} is less than an element of {element} bytes")));
                }
                let held = bytes.len();
                let offset = json.byte_offset.unwrap_or_default().0;
                let rows = bytes.slice(offset, held);
                let table = rows.and_then(|rows| Table::new(rows, count, stride, element));
                Some(table.ok_or_else(|| {
                    Problem::new(format!(
                        "{count} elements at byte {offset} do not fit buffer view {view} of {held} bytes"
                    ))
                })?)
            }
            // Without a buffer view nothing in the file backs the count. An element that anything uses is named by an
            // index or accompanied by other attributes, of at least a byte each.
            None if count > file.input_bytes => {
                let what = format!("states {count} elements, more than the file and its buffers can hold");
                return Err(Problem::new(what));
            }
            None => None,
        };
        let sparse = match &json.sparse {
            Some(sparse) => Some(Box::new(check_sparse(file, index, sparse, count, element)?)),
            None => None,
        };
        let normalized = json.normalized || shape.always_normalized;
        let scale = if normalized { self::scale(component) } else { 1.0 };
        Ok(Self { count, width, normalized, scale, component, base, sparse })
    }

    /// Whether no buffer holds any of its elements: all are zero.
    pub fn is_empty_of_data(&self) -> bool {
        self.base.is_none() && self.sparse.is_none()
    }

    /// The elements `wanted`, which ascend without repetition; components beyond the width are zero. Fails when they
    /// are not below the count, or when the file has changed.
    pub fn gather<const N: usize>(&self, wanted: &[u64]) -> io::Result<Vec<[f64; N]>> {
        if wanted.last().is_some_and(|&last| last >= self.count) {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        let mut elements = vec![[0.0; N]; wanted.len()];
        if let Some(base) = &self.base {
            base.gather(wanted, |position, row| elements[position] = self.decode(row))?;
        }
        if let Some(sparse) = &self.sparse {
            let (positions, rows) = sparse.find(wanted)?;
            sparse.values.gather(&rows, |i, row| elements[positions[i]] = self.decode(row))?;
        }
        Ok(elements)
    }

    fn decode<const N: usize>(&self, row: &[u8]) -> [f64; N] {
        let mut element = [0.0; N];
        let component = self.component.size();
        for (c, value) in element.iter_mut().enumerate().take(self.width) {
            *value = read(self.component, row, c * component);
            if self.scale != 1.0 {
                *value = (*value / self.scale).max(-1.0);
            }
        }
        element
    }
}

/// Checks the replaced elements of accessor `index` of `count` elements of `element` bytes.
fn check_sparse(
    file: &File,
    index: Index<Json>,
    json: &json::sparse::Sparse,
    count: u64,
    element: usize,
) -> Result<Sparse, Problem> {
    let Valid(json::IndexComponentType(component)) = json.indices.component_type else {
        return Err(Problem::new("sparse indices are of no type of unsigned integers"));
    };
    let replaced = json.count.0;
    if replaced > count {
        return Err(Problem::new(format!("replaces {replaced} of {count} elements")));
    }
    let part = |view: Index<buffer::View>, offset: u64, size: usize, what: &str| {
        let (bytes, _) = file.view(view)?;
        let held = bytes.len();
        let rows = bytes.slice(offset, held);
        rows.and_then(|rows| Table::new(rows, replaced, size as u64, size)).ok_or_else(|| {
            Problem::new(format!(
                "{replaced} sparse {what} at byte {offset} do not fit buffer view {view} of {held} bytes"
            ))
        })
    };
    let indices = part(json.indices.buffer_view, json.indices.byte_offset.0, component.size(), "indices")?;
    let values = part(json.values.buffer_view, json.values.byte_offset.0, element, "values")?;
    let sparse = Sparse { indices, component, values };
    // In range: `item` found the accessor. Many primitives may use it; once is enough to know that indices ascend.
    let checked = &file.checked_sparse[index.value()];
    if checked.load(Ordering::Relaxed) {
        return Ok(sparse);
    }
    let (mut next, mut wrong) = (0, None);
    let run = sparse.indices.run(0, replaced, |i, row| {
        let index = sparse.index(row);
        if index < next || index >= count {
            wrong = Some((i, index));
        }
        next = index + 1;
        wrong.is_none()
    });
    run.map_err(|e| Problem::new(format!("sparse indices cannot be read: {e}")))?;
    if let Some((i, index)) = wrong {
        let what = format!("sparse index {i} is {index}, but must ascend and be below the {count} elements");
        return Err(Problem::new(what));
    }
    checked.store(true, Ordering::Relaxed);
    Ok(sparse)
}
