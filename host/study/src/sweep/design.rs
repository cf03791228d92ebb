//! Designs combine the values of the axes. Each combination follows from its index alone.

use super::axis::{Axis, Values};
use super::sobol;

/// Largest number of points of a sweep.
pub const MAX_POINTS: u64 = 10_000_000;

/// A way to combine the values of the axes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[expect(missing_docs, reason = "the variants say what their fields are")]
pub enum Design {
    /// Every value of each axis with every value of all other axes.
    AllCombinations,
    /// The unchanged robot, and each value of each axis alone.
    OneAtATime,
    /// Points of Sobol's sequence within the ranges of the axes.
    Sobol { count: u32, seed: u64 },
}

impl Design {
    /// Returns the number of combinations. It may exceed the range of integers.
    pub fn count(&self, axes: &[Axis]) -> f64 {
        let counts = axes.iter().map(|axis| axis.values.count() as f64);
        match self {
            Self::AllCombinations => counts.product(),
            Self::OneAtATime => 1.0 + counts.sum::<f64>(),
            Self::Sobol { count, .. } => f64::from(*count),
        }
    }

    /// Returns the value of each axis in the combination with this index, below the count; `None` for an axis that
    /// keeps the robot's value.
    pub fn values(&self, axes: &[Axis], index: u64) -> Vec<Option<f64>> {
        match self {
            Self::AllCombinations => {
                let mut rest = index;
                let mut values: Vec<_> = (axes.iter().rev())
                    .map(|axis| {
                        let count = axis.values.count();
                        let value = axis.values.value(rest % count);
                        rest /= count;
                        Some(value)
                    })
                    .collect();
                values.reverse();
                values
            }
            Self::OneAtATime => {
                // The first combination is the unchanged robot.
                let mut rest = index.checked_sub(1);
                (axes.iter())
                    .map(|axis| {
                        let count = axis.values.count();
                        let at = rest.filter(|at| *at < count);
                        rest = rest.and_then(|at| at.checked_sub(count));
                        at.map(|at| axis.values.value(at))
                    })
                    .collect()
            }
            Self::Sobol { seed, .. } => {
                let axes = axes.iter().enumerate();
                axes.map(|(dimension, axis)| match &axis.values {
                    Values::Range(range) => Some(range.at(sobol::coordinate(index as u32, dimension, *seed))),
                    Values::List(_) => None,
                })
                .collect()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::axis::{Range, Scale};
    use super::super::key::{Group, Key};
    use super::*;

    fn axes() -> [Axis; 2] {
        let list = |group, values: &[f64]| Axis { key: Key::Group(group), values: Values::List(values.to_vec()) };
        [list(Group::Pitch, &[1.0, 2.0]), list(Group::Radius, &[3.0, 4.0, 5.0])]
    }

    fn all(design: Design, axes: &[Axis]) -> Vec<Vec<Option<f64>>> {
        (0..design.count(axes) as u64).map(|index| design.values(axes, index)).collect()
    }

    #[test]
    fn combinations_are_all_there_once() {
        let found = all(Design::AllCombinations, &axes());
        let wanted: Vec<Vec<_>> =
            [1.0, 2.0].iter().flat_map(|a| [3.0, 4.0, 5.0].map(|b| vec![Some(*a), Some(b)])).collect();
        assert_eq!(found, wanted);
        assert_eq!(all(Design::AllCombinations, &[]), [[]], "a sweep over speeds alone");
    }

    #[test]
    fn one_at_a_time_changes_one_value() {
        let found = all(Design::OneAtATime, &axes());
        let (one, two) = (|v| vec![Some(v), None], |v| vec![None, Some(v)]);
        assert_eq!(found, [vec![None, None], one(1.0), one(2.0), two(3.0), two(4.0), two(5.0)]);
    }

    #[test]
    fn sobol_points_are_within_the_ranges() {
        let range = |from, to, scale| Values::Range(Range { from, to, count: 0, scale });
        let axes = [
            Axis { key: Key::Speed(0), values: range(-90.0, 90.0, Scale::Linear) },
            Axis { key: Key::Group(Group::Stiffness), values: range(0.25, 4.0, Scale::Log) },
        ];
        let found = all(Design::Sobol { count: 64, seed: 7 }, &axes);
        let share = |axis: usize, test: &dyn Fn(f64) -> bool| found.iter().filter(|v| test(v[axis].unwrap())).count();
        assert_eq!(share(0, &|v| (-90.0..0.0).contains(&v)), 32);
        assert_eq!(share(1, &|v| (0.25..0.5).contains(&v)), 16, "a quarter of a logarithmic range");
        assert_eq!(share(1, &|v| (0.25..4.0).contains(&v)), 64);
    }
}
