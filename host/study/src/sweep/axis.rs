//! The values of a key in `[vary]`.

use super::key::Key;
use sim::functions::pow;

/// A key and its values.
#[derive(Clone, PartialEq, Debug)]
pub struct Axis {
    /// The key that varies.
    pub key: Key,
    /// Its values.
    pub values: Values,
}

/// The values of an axis.
#[derive(Clone, PartialEq, Debug)]
pub enum Values {
    /// A list.
    List(Vec<f64>),
    /// Evenly spaced values from the first to the last one.
    Range(Range),
}

/// A range of values.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Range {
    /// The smallest value.
    pub from: f64,
    /// The largest value.
    pub to: f64,
    /// Number of values; 0 in a Sobol design, which chooses its own values.
    pub count: u64,
    /// Spacing of the values.
    pub scale: Scale,
}

/// Spacing of the values of a range.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Scale {
    /// Equal differences.
    Linear,
    /// Equal ratios.
    Log,
}

impl Values {
    /// Returns the number of values.
    pub fn count(&self) -> u64 {
        match self {
            Self::List(values) => values.len() as u64,
            Self::Range(range) => range.count,
        }
    }

    /// Returns the value at an index below the count.
    pub fn value(&self, index: u64) -> f64 {
        match self {
            Self::List(values) => values[index as usize],
            Self::Range(range) => range.at(index as f64 / (range.count - 1) as f64),
        }
    }

    /// Returns all values; none in a Sobol design.
    pub fn all(&self) -> impl Iterator<Item = f64> {
        (0..self.count()).map(|index| self.value(index))
    }

    /// Returns values that bound all others: the whole list, or the ends of a range.
    pub fn bounds(&self) -> Vec<f64> {
        match self {
            Self::List(values) => values.clone(),
            Self::Range(range) => vec![range.from, range.to],
        }
    }
}

impl Range {
    /// Returns the value at a fraction of the range, 0 to 1.
    pub fn at(&self, share: f64) -> f64 {
        let Self { from, to, .. } = *self;
        match (share, self.scale) {
            (0.0, _) => from,
            (1.0, _) => to,
            (share, Scale::Linear) => rounded(from + (to - from) * share),
            (share, Scale::Log) => rounded(from * pow(to / from, share)),
        }
    }
}

/// Rounds to twelve significant digits, which removes the rounding errors of the spacing. The names of the points depend on these
/// digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.11e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(from: f64, to: f64, count: u64, scale: Scale) -> Vec<f64> {
        Values::Range(Range { from, to, count, scale }).all().collect()
    }

    #[test]
    fn ranges_hold_both_ends() {
        assert_eq!(values(0.1, 0.7, 4, Scale::Linear), [0.1, 0.3, 0.5, 0.7]);
        assert_eq!(values(0.5, 2.0, 3, Scale::Log), [0.5, 1.0, 2.0]);
        assert_eq!(values(0.5, 2.0, 7, Scale::Log)[1], 0.629960524947);
        assert_eq!(values(-90.0, 90.0, 2, Scale::Linear), [-90.0, 90.0]);
    }
}
