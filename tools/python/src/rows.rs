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

fn numbers<const N: usize, T: Copy + Into<f64>>(view: ArrayView2<T>, rows: Range<usize>) -> Vec<[f64; N]> {
    let columns = view.ncols().min(N);
    let mut all = Vec::with_capacity(rows.len());
    if let (Some(numbers), true) = (view.as_slice(), columns == view.ncols() && columns > 0) {
        let rows = numbers[rows.start * columns..rows.end * columns].chunks_exact(columns);
        all.extend(rows.map(|row| {
            let mut numbers = [0.0; N];
            for (&from, to) in row.iter().zip(&mut numbers) {
                *to = from.into();
            }
            numbers
        }));
        return all;
    }
    for row in rows {
        let mut numbers = [0.0; N];
        for (column, number) in numbers[..columns].iter_mut().enumerate() {
            *number = view[(row, column)].into();
        }
        all.push(numbers);
    }
    all
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

    /// `rows` of them, each of `N` numbers; those that there are no columns for are 0.
    fn numbers<const N: usize>(&self, rows: Range<usize>) -> PyResult<Vec<[f64; N]>> {
        if rows.end > self.shape().0 {
            return Err(wrong("the array has been resized meanwhile"));
        }
        let changed = |error: numpy::BorrowError| wrong(format!("the array cannot be read: {error}"));
        Ok(match self {
            Self::Single(array) => numbers(array.try_readonly().map_err(changed)?.as_array(), rows),
            Self::Double(array) => numbers(array.try_readonly().map_err(changed)?.as_array(), rows),
        })
    }

    /// Rays: origin, direction, and where there are eight columns the least and the greatest distance.
    ///
    /// # Errors
    /// There are neither six nor eight columns.
    pub fn rays(&self, rows: Range<usize>) -> PyResult<Vec<Ray>> {
        let has_interval = match self.shape().1 {
            6 => false,
            8 => true,
            other => return Err(wrong(format!("rays have 6 or 8 numbers each, not {other}"))),
        };
        let ray = |[a, b, c, d, e, f, near, far]: [f64; 8]| Ray {
            origin: [a, b, c],
            direction: [d, e, f],
            t_min: near,
            t_max: if has_interval { far } else { f64::INFINITY },
        };
        Ok(self.numbers(rows)?.into_iter().map(ray).collect())
    }

    /// Points.
    ///
    /// # Errors
    /// There are not three columns.
    pub fn points(&self, rows: Range<usize>) -> PyResult<Vec<[f64; 3]>> {
        match self.shape().1 {
            3 => self.numbers(rows),
            other => Err(wrong(format!("points have 3 numbers each, not {other}"))),
        }
    }

    /// Pairs of points.
    ///
    /// # Errors
    /// There are not six columns.
    pub fn pairs(&self, rows: Range<usize>) -> PyResult<Vec<[[f64; 3]; 2]>> {
        match self.shape().1 {
            6 => {
                Ok(self.numbers(rows)?.into_iter().map(|[a, b, c, d, e, f]: [f64; 6]| [[a, b, c], [d, e, f]]).collect())
            }
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
            bad_point(start, &self.points(start..count.min(start + CHECKED))?, named)
                .map_or(Ok(()), |text| Err(wrong(text)))?;
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
