//! Rows of arrays as rays and points, and what is wrong with them.

use crate::errors::wrong;
use brickwalk::session::Ray;
use brickwalk::session::trace::check;
use numpy::ndarray::ArrayView2;
use numpy::{PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use std::ops::Range;

/// Vertices that are checked before signals are looked for.
const CHECKED: usize = 1 << 18;

/// An array of float32 or float64 with two axes, of any strides.
pub enum Rows<'py> {
    /// Of float32.
    Single(Bound<'py, PyArray2<f32>>),
    /// Of float64.
    Double(Bound<'py, PyArray2<f64>>),
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

/// Appends what `make` makes of `rows`, each of `N` numbers, as many as there are columns.
fn append<const N: usize, T: Copy + Into<f64>, R>(
    view: ArrayView2<T>,
    rows: Range<usize>,
    make: impl Fn([f64; N]) -> R,
    to: &mut Vec<R>,
) {
    if let Some(numbers) = view.as_slice() {
        let (rows, _) = numbers[rows.start * N..rows.end * N].as_chunks();
        to.extend(rows.iter().map(|row| make(row.map(T::into))));
    } else {
        to.extend(rows.map(|row| make(std::array::from_fn(|column| view[(row, column)].into()))));
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

    /// Appends what `make` makes of `rows` of them, each of `N` numbers, as many as there are columns.
    fn append<const N: usize, R>(
        &self,
        rows: Range<usize>,
        make: impl Fn([f64; N]) -> R,
        to: &mut Vec<R>,
    ) -> PyResult<()> {
        let (count, columns) = self.shape();
        if rows.end > count || columns != N {
            return Err(wrong("the array has been resized meanwhile"));
        }
        let changed = |error: numpy::BorrowError| wrong(format!("the array cannot be read: {error}"));
        match self {
            Self::Single(array) => append(array.try_readonly().map_err(changed)?.as_array(), rows, make, to),
            Self::Double(array) => append(array.try_readonly().map_err(changed)?.as_array(), rows, make, to),
        }
        Ok(())
    }

    /// Whether it is plain of `rows` of `N` numbers that all are finite and that `has` holds.
    fn are_plain<const N: usize>(&self, rows: Range<usize>, has: impl Fn([f64; N]) -> bool) -> bool {
        self.shape().1 == N
            && match self {
                Self::Single(array) => array.try_readonly().is_ok_and(|array| are_plain(array.as_array(), rows, has)),
                Self::Double(array) => array.try_readonly().is_ok_and(|array| are_plain(array.as_array(), rows, has)),
            }
    }

    /// Whether it is plain that `rows` are rays without an interval of their own.
    pub fn are_rays(&self, rows: Range<usize>) -> bool {
        self.are_plain(rows, |[_, _, _, x, y, z]| (x != 0.0) | (y != 0.0) | (z != 0.0))
    }

    /// Whether it is plain that `rows` are points.
    pub fn are_points(&self, rows: Range<usize>) -> bool {
        self.are_plain(rows, |_: [f64; 3]| true)
    }

    /// Whether it is plain that `rows` are pairs of points.
    pub fn are_pairs(&self, rows: Range<usize>) -> bool {
        self.are_plain(rows, |_: [f64; 6]| true)
    }

    /// Appends rays: origin, direction, and where there are eight columns the least and the greatest distance.
    ///
    /// # Errors
    /// There are neither six nor eight columns.
    pub fn rays(&self, rows: Range<usize>, to: &mut Vec<Ray>) -> PyResult<()> {
        let ray =
            |[a, b, c, d, e, f, t_min, t_max]: [f64; 8]| Ray { origin: [a, b, c], direction: [d, e, f], t_min, t_max };
        match self.shape().1 {
            6 => self.append(rows, |[a, b, c, d, e, f]: [f64; 6]| ray([a, b, c, d, e, f, 0.0, f64::INFINITY]), to),
            8 => self.append(rows, ray, to),
            other => Err(wrong(format!("rays have 6 or 8 numbers each, not {other}"))),
        }
    }

    /// Appends points.
    ///
    /// # Errors
    /// There are not three columns.
    pub fn points(&self, rows: Range<usize>, to: &mut Vec<[f64; 3]>) -> PyResult<()> {
        match self.shape().1 {
            3 => self.append(rows, |point| point, to),
            other => Err(wrong(format!("points have 3 numbers each, not {other}"))),
        }
    }

    /// Appends pairs of points.
    ///
    /// # Errors
    /// There are not six columns.
    pub fn pairs(&self, rows: Range<usize>, to: &mut Vec<[[f64; 3]; 2]>) -> PyResult<()> {
        match self.shape().1 {
            6 => self.append(rows, |[a, b, c, d, e, f]: [f64; 6]| [[a, b, c], [d, e, f]], to),
            other => Err(wrong(format!("pairs have 6 numbers each, not {other}"))),
        }
    }

    /// Refuses points that are none.
    ///
    /// # Errors
    /// Which one.
    pub fn check_points(&self, py: Python<'_>, named: &Named) -> PyResult<()> {
        let count = self.shape().0;
        for start in (0..count).step_by(CHECKED) {
            py.check_signals()?;
            let mut points = Vec::new();
            self.points(start..count.min(start + CHECKED), &mut points)?;
            bad_point(start, &points, named).map_or(Ok(()), |text| Err(wrong(text)))?;
        }
        Ok(())
    }
}

/// The first of pairs of points, which begin at row `start`, that is none, and why.
pub fn bad_pair(start: usize, pairs: &[[[f64; 3]; 2]], named: &Named) -> Option<String> {
    bad(start, pairs, named, |pair| not_finite(pair.as_flattened()))
}

/// The first of rays that is none, and why.
pub fn bad_ray(start: usize, rays: &[Ray], named: &Named) -> Option<String> {
    bad(start, rays, named, |ray| match check(ray) {
        Err(error) => Some(error.to_string()),
        Ok(()) if ray.t_min < 0.0 => Some(format!("t_min is {}; it must be 0 or greater", ray.t_min)),
        Ok(()) => None,
    })
}

/// The first of points that is none, and why.
pub fn bad_point(start: usize, points: &[[f64; 3]], named: &Named) -> Option<String> {
    bad(start, points, named, |point| not_finite(point))
}

fn not_finite(numbers: &[f64]) -> Option<String> {
    (!numbers.iter().all(|x| x.is_finite())).then(|| "coordinates must be finite".to_owned())
}

/// The first of `all`, which begin at row `start`, that is bad, and why.
fn bad<T>(start: usize, all: &[T], named: &Named, is_bad: impl Fn(&T) -> Option<String>) -> Option<String> {
    let mut found = all.iter().enumerate().filter_map(|(i, one)| Some((start + i, is_bad(one)?)));
    found.next().map(|(row, why)| format!("{}: {why}", named.row(row)))
}
