//! Pixels and their neighbours.

use rayon::prelude::*;

/// The pixels of a picture, by rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    width: i32,
    height: i32,
}

impl Grid {
    /// Of width and height.
    pub fn new((width, height): (u32, u32)) -> Self {
        // Pictures have at most 16384 pixels a side.
        Self { width: width as i32, height: height as i32 }
    }

    /// The pixel at a column and a row, if it is in the picture.
    pub fn at(&self, x: i32, y: i32) -> Option<usize> {
        let inside = (0..self.width).contains(&x) && (0..self.height).contains(&y);
        inside.then(|| y as usize * self.width as usize + x as usize)
    }

    /// The pixel at a column and a row, or the nearest in the picture.
    pub fn nearest(&self, x: i32, y: i32) -> usize {
        y.clamp(0, self.height - 1) as usize * self.width as usize + x.clamp(0, self.width - 1) as usize
    }

    /// Column and row of a pixel.
    pub fn position(&self, pixel: usize) -> (i32, i32) {
        ((pixel % self.width as usize) as i32, (pixel / self.width as usize) as i32)
    }

    /// The pixels at most `radius` columns and rows from `pixel`, itself among them, row by row.
    pub fn around(self, pixel: usize, radius: i32) -> impl Iterator<Item = usize> {
        let (x, y) = self.position(pixel);
        let rows = (y - radius).max(0)..=(y + radius).min(self.height - 1);
        let columns = (x - radius).max(0)..=(x + radius).min(self.width - 1);
        rows.flat_map(move |y| columns.clone().map(move |x| y as usize * self.width as usize + x as usize))
    }

    /// What `make` gives for every pixel, which it must do from the pixel alone.
    pub fn map<T: Send>(&self, make: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
        let pixels = self.width as usize * self.height as usize;
        (0..pixels).into_par_iter().with_min_len(256).map(make).collect()
    }
}
