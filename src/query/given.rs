//! Rays as callers have them.

use crate::output::npy::Ray;
use crate::session::trace::check;

/// Rays that are asked about.
#[derive(Clone, Copy, Debug)]
pub enum Rays<'a> {
    /// With intervals, in f64.
    Whole(&'a [Ray]),
    /// Origin and direction in f32; t from 0 to infinity.
    Short(&'a [[f32; 6]]),
}

/// Rays side by side, by axes.
pub(super) struct Columns<const N: usize> {
    pub(super) origin: [[f64; N]; 3],
    pub(super) direction: [[f64; N]; 3],
    pub(super) t_min: [f64; N],
    pub(super) t_max: [f64; N],
}

impl<'a> From<&'a [Ray]> for Rays<'a> {
    fn from(rays: &'a [Ray]) -> Self {
        Self::Whole(rays)
    }
}

impl<'a> From<&'a Vec<Ray>> for Rays<'a> {
    fn from(rays: &'a Vec<Ray>) -> Self {
        Self::Whole(rays)
    }
}

impl<'a, const N: usize> From<&'a [Ray; N]> for Rays<'a> {
    fn from(rays: &'a [Ray; N]) -> Self {
        Self::Whole(rays)
    }
}

impl<'a> From<&'a [[f32; 6]]> for Rays<'a> {
    fn from(rays: &'a [[f32; 6]]) -> Self {
        Self::Short(rays)
    }
}

impl Rays<'_> {
    /// How many.
    pub fn len(self) -> usize {
        match self {
            Self::Whole(rays) => rays.len(),
            Self::Short(rays) => rays.len(),
        }
    }

    /// Whether there is none.
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// One of them.
    #[inline]
    pub fn get(self, number: usize) -> Ray {
        match self {
            Self::Whole(rays) => rays[number],
            Self::Short(rays) => {
                let [a, b, c, d, e, f] = rays[number].map(f64::from);
                Ray { origin: [a, b, c], direction: [d, e, f], t_min: 0.0, t_max: f64::INFINITY }
            }
        }
    }

    /// The first that is none, of those from `first` to `end`.
    pub(super) fn first_bad(self, first: usize, end: usize) -> Option<usize> {
        if let Self::Short(rays) = self
            && rays[first..end].iter().fold(true, |all, ray| all & is_plain(ray))
        {
            return None;
        }
        (first..end).find(|&number| check(&self.get(number)).is_err())
    }

    /// Those from `first` on, the last again where there are fewer.
    #[inline(always)]
    pub(super) fn columns<const N: usize>(self, first: usize) -> Columns<N> {
        let mut columns =
            Columns { origin: [[0.0; N]; 3], direction: [[0.0; N]; 3], t_min: [0.0; N], t_max: [f64::INFINITY; N] };
        let last = self.len() - 1;
        match self {
            Self::Whole(rays) => {
                for i in 0..N {
                    columns.set(i, &rays[(first + i).min(last)]);
                }
            }
            Self::Short(rays) => {
                for i in 0..N {
                    let ray = &rays[(first + i).min(last)];
                    for k in 0..3 {
                        (columns.origin[k][i], columns.direction[k][i]) = (ray[k].into(), ray[3 + k].into());
                    }
                }
            }
        }
        columns
    }
}

impl<const N: usize> Columns<N> {
    #[inline(always)]
    fn set(&mut self, i: usize, ray: &Ray) {
        for k in 0..3 {
            (self.origin[k][i], self.direction[k][i]) = (ray.origin[k], ray.direction[k]);
        }
        (self.t_min[i], self.t_max[i]) = (ray.t_min, ray.t_max);
    }
}

impl Columns<1> {
    /// One ray.
    #[inline(always)]
    pub(super) fn of(ray: &Ray) -> Self {
        let [origin, direction] = [ray.origin, ray.direction].map(|of| of.map(|x| [x]));
        Self { origin, direction, t_min: [ray.t_min], t_max: [ray.t_max] }
    }
}

/// Whether all numbers are finite, and the direction is not zero. Without branches, of which compilers make vectors.
fn is_plain(ray: &[f32; 6]) -> bool {
    let [.., x, y, z] = *ray;
    ray.iter().fold(true, |all, number| all & number.is_finite()) & ((x != 0.0) | (y != 0.0) | (z != 0.0))
}
