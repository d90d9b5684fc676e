//! What was repaired in the parts that were read, told alike in whatever order and however often they are read.

use super::warnings::describe;
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

/// Collects repairs of one input.
#[derive(Debug)]
pub(super) struct Repairs {
    /// The input as messages show it.
    file: String,
    kinds: Mutex<BTreeMap<&'static str, Places>>,
}

/// Where a repair was made: mesh, primitive, and how messages show it.
type Places = BTreeMap<(usize, u32), String>;

impl Repairs {
    /// No repairs yet of `file`.
    pub fn new(file: String) -> Self {
        Self { file, kinds: Mutex::default() }
    }

    /// Notes that `what` was done to a primitive of a mesh.
    pub fn add(&self, what: &'static str, at: (usize, u32), place: impl FnOnce() -> String) {
        let mut kinds = self.kinds.lock().unwrap_or_else(PoisonError::into_inner);
        kinds.entry(what).or_default().entry(at).or_insert_with(place);
    }

    /// One line for each kind.
    pub fn lines(&self) -> Vec<String> {
        let kinds = self.kinds.lock().unwrap_or_else(PoisonError::into_inner);
        let line = |(what, places): (&&str, &Places)| {
            let first = places.values().next().map_or("", String::as_str);
            describe(&self.file, what, first, places.len() as u64)
        };
        kinds.iter().map(line).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_do_not_depend_on_the_order_of_reading() {
        let orders: [&[usize]; 2] = [&[2, 0, 1, 0], &[0, 1, 1, 2]];
        for order in orders {
            let repairs = Repairs::new("a.ply".into());
            for &mesh in order {
                repairs.add("set to zero", (mesh, 0), || format!("mesh {mesh}"));
            }
            assert_eq!(repairs.lines(), ["a.ply: mesh 0 and 2 more: set to zero"]);
        }
    }
}
