//! A square matrix with a band of 21 diagonals: a node's bending stencil spans 11 degrees of freedom.

/// Diagonals on either side of the main one.
pub const HALF_WIDTH: usize = 10;
const WIDTH: usize = 2 * HALF_WIDTH + 1;

/// Banded matrix, stored row by row.
#[derive(Clone, Debug)]
pub struct Band {
    size: usize,
    values: Vec<f64>,
}

impl Band {
    /// Returns a zero matrix of `size` rows.
    pub fn new(size: usize) -> Self {
        Self { size, values: vec![0.0; size * WIDTH] }
    }

    /// Sets every entry to zero.
    pub fn clear(&mut self) {
        self.values.fill(0.0);
    }

    /// Adds to an entry inside the band.
    #[inline(always)]
    pub fn add(&mut self, row: usize, column: usize, value: f64) {
        self.values[row * WIDTH + HALF_WIDTH + column - row] += value;
    }

    /// Returns an entry; zero outside the band.
    #[inline(always)]
    pub fn get(&self, row: usize, column: usize) -> f64 {
        if row.abs_diff(column) > HALF_WIDTH { 0.0 } else { self.values[row * WIDTH + HALF_WIDTH + column - row] }
    }

    /// Returns the columns inside the band of a row.
    pub fn columns(&self, row: usize) -> std::ops::Range<usize> {
        row.saturating_sub(HALF_WIDTH)..(row + HALF_WIDTH + 1).min(self.size)
    }
}
