//! A line through points by least squares.

use sim::functions::powi;

/// The line y = level + slope (x - middle) that is nearest to points.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Line {
    /// Number of points.
    pub count: f64,
    /// Mean of the abscissas.
    pub middle: f64,
    /// Mean of the ordinates.
    pub level: f64,
    /// Slope; not a number if all abscissas are the same.
    pub slope: f64,
    /// Sum of the squared abscissas about their mean.
    pub spread: f64,
    /// Sum of the squared residuals.
    pub squares: f64,
}

impl Line {
    /// Fits the line to points with equal weights.
    pub fn through(points: impl Iterator<Item = (f64, f64)> + Clone) -> Self {
        let (count, x, y) =
            points.clone().fold((0.0, 0.0, 0.0), |(count, x, y), point| (count + 1.0, x + point.0, y + point.1));
        let (middle, level) = (x / count, y / count);
        let (spread, along) = points.clone().fold((0.0, 0.0), |(spread, along), (x, y)| {
            (spread + powi(x - middle, 2), along + (x - middle) * (y - level))
        });
        let line = Self { count, middle, level, slope: along / spread, spread, squares: 0.0 };
        Self { squares: points.map(|point| powi(line.off(point), 2)).sum(), ..line }
    }

    /// Returns the residual of a point.
    pub fn off(&self, (x, y): (f64, f64)) -> f64 {
        y - self.level - self.slope * (x - self.middle)
    }
}
