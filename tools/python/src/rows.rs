//! Rows of arrays as rays and points, and what is wrong with them.

use crate::errors::wrong;
use brickwalk::query;
use brickwalk::session::Ray;
use brickwalk::session::trace::check;
use numpy::ndarray::ArrayView2;
use numpy::{PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use std::ops::Range;

/// Rows that are read and then checked, while they are near.
const CHECKED: usize = 1 << 10;

/// Rows after which signals are asked for, a multiple of those.
const BETWEEN: usize = 1 << 20;

/// Refuses rows of which one is bad.
pub type Check<'py> = fn(&Rows<'py>, Range<usize>, &Named) -> PyResult<()>;

/// An array of float32 or float64 with two axes, of any strides.
pub enum Rows<'py> {
    /// Of float32.
    Single(Bound<'py, PyArray2<f32>>),
    /// Of float64.
    Double(Bound<'py, PyArray2<f64>>),
}

/// Rays that were read.
pub enum Rays {
    /// With intervals.
    Whole(Vec<Ray>),
    /// As they were given: origin and direction in f32.
    Short(Vec<[f32; 6]>),
}

impl Rays {
    /// As queries take them.
    pub fn given(&self) -> query::Rays<'_> {
        match self {
            Self::Whole(rays) => rays.into(),
            Self::Short(rays) => rays.as_slice().into(),
        }
    }
}

/// What rows stand for: their name in messages, and the shape that they have without their last axis.
pub struct Named {
    /// As "ray".
    pub name: &'static str,
    /// The shape.
    pub shape: Vec<usize>,
}

impl Named {
    /// A row as people count it: by its indices in the array that was given.
    fn row(&self, row: usize) -> String {
        let mut indices = vec![0; self.shape.len()];
        let mut left = row;
        for (index, &length) in indices.iter_mut().zip(&self.shape).rev() {
            (*index, left) = (left % length.max(1), left / length.max(1));
        }
        let indices: Vec<String> = indices.iter().map(usize::to_string).collect();
        match indices.len() {
            0 => format!("the {}", self.name),
            1 => format!("{} {row}", self.name),
            _ => format!("{} ({})", self.name, indices.join(", ")),
        }
    }
}

/// What `make` makes of `rows`, each of `N` numbers, as many as there are columns.
fn read<const N: usize, T: Copy + Into<f64>, R>(
    view: ArrayView2<T>,
    rows: Range<usize>,
    make: impl Fn([f64; N]) -> R,
) -> Vec<R> {
    if let Some(numbers) = view.as_slice() {
        let (rows, _) = numbers[rows.start * N..rows.end * N].as_chunks();
        rows.iter().map(|row| make(row.map(T::into))).collect()
    } else {
        rows.map(|row| make(std::array::from_fn(|column| view[(row, column)].into()))).collect()
    }
}

/// Whether all numbers of `rows`, of which `N` make one, are finite, and `has` holds for each row. Of rows that do not
/// lie one after the other it is not said.
fn are_plain<const N: usize, T: Copy + Into<f64>>(
    view: ArrayView2<T>,
    rows: Range<usize>,
    has: impl Fn([f64; N]) -> bool,
) -> bool {
    let Some(numbers) = view.as_slice().and_then(|all| all.get(rows.start * N..rows.end * N)) else { return false };
    let (rows, _) = numbers.as_chunks();
    // Without branches, of which compilers make vectors.
    rows.iter().fold(true, |all, row| {
        let row: [f64; N] = row.map(T::into);
        all & row.iter().fold(true, |all, x| all & x.is_finite()) & has(row)
    })
}

impl<'py> Rows<'py> {
    /// The array.
    ///
    /// # Errors
    /// It is of another type, or has not two axes.
    pub fn of(array: &Bound<'py, PyAny>) -> PyResult<Self> {
        if let Ok(array) = array.cast::<PyArray2<f64>>() {
            return Ok(Self::Double(array.clone()));
        }
        let single = array.cast::<PyArray2<f32>>();
        let single =
            single.map_err(|_| PyTypeError::new_err("an array of float32 or float64 with two axes is needed"))?;
        Ok(Self::Single(single.clone()))
    }

    /// Rows and columns.
    pub fn shape(&self) -> (usize, usize) {
        let shape = match self {
            Self::Single(array) => array.shape(),
            Self::Double(array) => array.shape(),
        };
        (shape[0], shape[1])
    }

    /// What `make` makes of `rows` of them, each of `N` numbers, as many as there are columns.
    fn read<const N: usize, R>(&self, rows: Range<usize>, make: impl Fn([f64; N]) -> R) -> PyResult<Vec<R>> {
        let (count, columns) = self.shape();
        if rows.end > count || columns != N {
            return Err(wrong("the array has been resized meanwhile"));
        }
        let changed = |error: numpy::BorrowError| wrong(format!("the array cannot be read: {error}"));
        Ok(match self {
            Self::Single(array) => read(array.try_readonly().map_err(changed)?.as_array(), rows, make),
            Self::Double(array) => read(array.try_readonly().map_err(changed)?.as_array(), rows, make),
        })
    }

    /// Whether it is plain of `rows` of `N` numbers that all are finite and that `has` holds.
    fn are_plain<const N: usize>(&self, rows: Range<usize>, has: impl Fn([f64; N]) -> bool) -> bool {
        self.shape().1 == N
            && match self {
                Self::Single(array) => array.try_readonly().is_ok_and(|array| are_plain(array.as_array(), rows, has)),
                Self::Double(array) => array.try_readonly().is_ok_and(|array| are_plain(array.as_array(), rows, has)),
            }
    }

    /// Rows as rays: origin, direction, and where there are eight columns the least and the greatest distance.
    ///
    /// # Errors
    /// There are neither six nor eight columns.
    pub fn rays(&self, rows: Range<usize>) -> PyResult<Rays> {
        if let (Self::Single(array), 6) = (self, self.shape().1)
            && let Ok(array) = array.try_readonly()
            && let Ok(numbers) = array.as_slice()
            && let Some(numbers) = numbers.get(6 * rows.start..6 * rows.end)
        {
            return Ok(Rays::Short(numbers.as_chunks().0.to_vec()));
        }
        self.whole_rays(rows).map(Rays::Whole)
    }

    fn whole_rays(&self, rows: Range<usize>) -> PyResult<Vec<Ray>> {
        let ray =
            |[a, b, c, d, e, f, t_min, t_max]: [f64; 8]| Ray { origin: [a, b, c], direction: [d, e, f], t_min, t_max };
        match self.shape().1 {
            6 => self.read(rows, |[a, b, c, d, e, f]: [f64; 6]| ray([a, b, c, d, e, f, 0.0, f64::INFINITY])),
            8 => self.read(rows, ray),
            other => Err(wrong(format!("rays have 6 or 8 numbers each, not {other}"))),
        }
    }

    /// Rows as points.
    ///
    /// # Errors
    /// There are not three columns.
    pub fn points(&self, rows: Range<usize>) -> PyResult<Vec<[f64; 3]>> {
        match self.shape().1 {
            3 => self.read(rows, |point| point),
            other => Err(wrong(format!("points have 3 numbers each, not {other}"))),
        }
    }

    /// Rows as pairs of points.
    ///
    /// # Errors
    /// There are not six columns.
    pub fn pairs(&self, rows: Range<usize>) -> PyResult<Vec<[[f64; 3]; 2]>> {
        match self.shape().1 {
            6 => self.read(rows, |[a, b, c, d, e, f]: [f64; 6]| [[a, b, c], [d, e, f]]),
            other => Err(wrong(format!("pairs have 6 numbers each, not {other}"))),
        }
    }

    /// Has `check` look at all rows, some at a time, while they are near. Signals are looked for meanwhile.
    ///
    /// # Errors
    /// That of `check`; what a signal raises.
    pub fn check(&self, py: Python<'_>, check: Check<'py>, named: &Named) -> PyResult<()> {
        let (count, _) = self.shape();
        for start in (0..count).step_by(CHECKED) {
            check(self, start..count.min(start + CHECKED), named)?;
            if start % BETWEEN == 0 {
                py.check_signals()?;
            }
        }
        Ok(())
    }

    /// Refuses rows of which one is no ray.
    ///
    /// # Errors
    /// Which is the first, and why.
    pub fn check_rays(&self, rows: Range<usize>, named: &Named) -> PyResult<()> {
        let is_direction = |[.., x, y, z]: [f64; 6]| (x != 0.0) | (y != 0.0) | (z != 0.0);
        if self.are_plain(rows.clone(), is_direction) {
            return Ok(());
        }
        let start = rows.start;
        refuse(start, &self.whole_rays(rows)?, named, |ray| match check(ray) {
            Err(error) => Some(error.to_string()),
            Ok(()) if ray.t_min < 0.0 => Some(format!("t_min is {}; it must be 0 or greater", ray.t_min)),
            Ok(()) => None,
        })
    }

    /// Refuses rows of which one is no point.
    ///
    /// # Errors
    /// Which is the first, and why.
    pub fn check_points(&self, rows: Range<usize>, named: &Named) -> PyResult<()> {
        if self.are_plain(rows.clone(), |_: [f64; 3]| true) {
            return Ok(());
        }
        let start = rows.start;
        refuse(start, &self.points(rows)?, named, |point| not_finite(point))
    }

    /// Refuses rows of which one is no pair of points.
    ///
    /// # Errors
    /// Which is the first, and why.
    pub fn check_pairs(&self, rows: Range<usize>, named: &Named) -> PyResult<()> {
        if self.are_plain(rows.clone(), |_: [f64; 6]| true) {
            return Ok(());
        }
        let start = rows.start;
        refuse(start, &self.pairs(rows)?, named, |pair| not_finite(pair.as_flattened()))
    }
}

fn not_finite(numbers: &[f64]) -> Option<String> {
    (!numbers.iter().all(|x| x.is_finite())).then(|| "coordinates must be finite".to_owned())
}

/// Says which is the first of `all`, which begin at row `start`, that is bad, and why.
fn refuse<T>(start: usize, all: &[T], named: &Named, is_bad: impl Fn(&T) -> Option<String>) -> PyResult<()> {
    let mut found = all.iter().enumerate().filter_map(|(i, one)| Some((start + i, is_bad(one)?)));
    found.next().map_or(Ok(()), |(row, why)| Err(wrong(format!("{}: {why}", named.row(row)))))
}
