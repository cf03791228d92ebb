//! The values of a steady state's quantities, and their record in a log and in JSON.

use super::OverPhases::{self, Largest, Least};
use super::{Column, FLAGELLA, FORCE, PITCH, Quantity, ROLL, Shape, THRUST, TILT, YAW, columns, steady};
use crate::body::attitude::tilt_deg;
use crate::trial::Summary;
use crate::trial::means::Level;
use serde::de::{Deserialize, Deserializer, Error as _, IgnoredAny, MapAccess, Visitor};
use serde::ser::{Serialize, SerializeMap, Serializer};
use std::fmt;

/// The quantities of a steady state, just computed or from a log.
#[derive(Clone, PartialEq, Debug)]
pub struct Values {
    /// The numbers, in the order of [`columns`].
    pub numbers: Vec<f64>,
    /// The standard errors, in the order of [`columns`]; `None` where one is unknown.
    pub errors: Vec<Option<f64>>,
}

impl Default for Values {
    /// No value is known.
    fn default() -> Self {
        let parts = columns(FLAGELLA).count();
        Self { numbers: vec![f64::NAN; parts], errors: vec![None; parts] }
    }
}

impl Values {
    /// Returns the values of a trial.
    pub fn of(summary: &Summary) -> Self {
        let level =
            |column: Column| column.quantity.level.map_or_else(Level::default, |level| level(summary, column.part));
        let levels = columns(FLAGELLA).map(level);
        let (numbers, errors) = levels.map(|level| (level.mean, level.standard_error)).unzip();
        Self { numbers, errors }
    }

    /// Returns the combined values of several starting phases. There must be at least one.
    pub fn over_phases(phases: &[Self]) -> Self {
        let (numbers, errors) = columns(FLAGELLA)
            .map(|column| {
                let i = column.index();
                let number = column.quantity.over_phases.of(phases.iter().map(|phase| phase.numbers[i]));
                (number, error_of_mean(phases.iter().map(|phase| phase.errors[i])))
            })
            .unzip();
        Self { numbers, errors }
    }

    /// Returns the largest less the smallest value of several starting phases, for each column; NaN if one value is NaN.
    pub fn spreads(phases: &[Self]) -> Vec<f64> {
        let spread = |i: usize| {
            let of = || phases.iter().map(|phase| phase.numbers[i]);
            let spread = Largest.of(of()) - Least.of(of());
            if of().any(f64::is_nan) { f64::NAN } else { spread }
        };
        (0..columns(FLAGELLA).count()).map(spread).collect()
    }

    /// Returns the value of a quantity, or its first part (flagellum 1, x axis) if it has several. NaN if it is unknown.
    pub fn get(&self, quantity: &Quantity) -> f64 {
        self.numbers[quantity.start()]
    }

    /// Returns all parts of a quantity; NaN where they are unknown.
    pub fn parts(&self, quantity: &Quantity) -> &[f64] {
        &self.numbers[quantity.start()..][..quantity.shape.parts(FLAGELLA)]
    }

    /// Returns yaw, pitch and roll, degrees.
    pub fn angles_deg(&self) -> [f64; 3] {
        [YAW, PITCH, ROLL].map(|angle| self.get(&angle))
    }

    /// Returns the 95 % uncertainties of yaw, pitch and roll, degrees: twice their standard errors.
    pub fn angle_uncertainties_deg(&self) -> [Option<f64>; 3] {
        [YAW, PITCH, ROLL].map(|angle| self.errors[angle.start()].map(|error| 2.0 * error))
    }

    /// Computes quantities that older logs lack from others.
    fn completed(mut self) -> Self {
        let [_, pitch, roll] = self.angles_deg();
        let thrust = self.parts(&FORCE).chunks(3).map(|force| force[2]).sum();
        for (quantity, value) in [(TILT, tilt_deg(pitch, roll)), (THRUST, thrust)] {
            let number = &mut self.numbers[quantity.start()];
            *number = if number.is_nan() { value } else { *number };
        }
        self
    }
}

impl OverPhases {
    /// Returns the combined value; NaN if one value is NaN.
    fn of(self, values: impl ExactSizeIterator<Item = f64>) -> f64 {
        let count = values.len() as f64;
        match self {
            Self::Mean => values.sum::<f64>() / count,
            Self::Sum => values.sum(),
            Self::Least => {
                values.fold(f64::INFINITY, |least, value| if value.is_nan() || value < least { value } else { least })
            }
            Self::Largest => {
                values.fold(f64::NEG_INFINITY, |most, value| if value.is_nan() || value > most { value } else { most })
            }
        }
    }
}

/// Returns the standard error of the mean over starting phases from those of the phases; `None` where one is unknown.
///
/// It is the mean of these errors, as for fully correlated values. Most standard errors are those of the solver
/// ([`crate::trial::means`]), whose error mostly has one sign in all phases: more phases do not average it away.
fn error_of_mean(errors: impl ExactSizeIterator<Item = Option<f64>>) -> Option<f64> {
    let count = errors.len() as f64;
    let sum: Option<f64> = errors.sum();
    sum.map(|sum| sum / count)
}

/// A record has a key for each number, a list for the parts of a vector or of all flagella, and keys with `_se` for the standard
/// errors. Unknown values are `null`.
impl Serialize for Values {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for quantity in steady() {
            let start = quantity.start();
            for (key, parts) in quantity.keys("") {
                let numbers = &self.numbers[start + parts.start..start + parts.end];
                match quantity.shape {
                    Shape::Count => map.serialize_entry(&key, &numbers[0].is_finite().then_some(numbers[0] as u64))?,
                    _ if quantity.is_single() => map.serialize_entry(&key, &numbers[0])?,
                    _ => map.serialize_entry(&key, numbers)?,
                }
            }
            for (key, parts) in quantity.keys("_se").into_iter().filter(|_| quantity.shape.has_error()) {
                let errors = &self.errors[start + parts.start..start + parts.end];
                if quantity.is_single() {
                    map.serialize_entry(&key, &errors[0])?;
                } else {
                    map.serialize_entry(&key, &errors.iter().copied().collect::<Option<Vec<f64>>>())?;
                }
            }
        }
        map.end()
    }
}

/// Missing keys leave their values unknown; other keys are ignored.
impl<'de> Deserialize<'de> for Values {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Record;
        impl<'de> Visitor<'de> for Record {
            type Value = Values;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the quantities of a steady state")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Values, A::Error> {
                let mut values = Values::default();
                while let Some(key) = map.next_key::<String>()? {
                    let place = |of: &str| {
                        steady().find_map(|quantity| {
                            let (_, parts) = quantity.keys(of).into_iter().find(|(name, _)| *name == key)?;
                            Some((quantity, quantity.start() + parts.start..quantity.start() + parts.end))
                        })
                    };
                    if let Some((quantity, at)) = place("") {
                        let numbers = numbers(&quantity, at.len(), &mut map)?;
                        values.numbers[at].iter_mut().zip(numbers).for_each(|(number, read)| *number = read);
                    } else if let Some((quantity, at)) = place("_se").filter(|(quantity, _)| quantity.shape.has_error())
                    {
                        let errors = numbers(&quantity, at.len(), &mut map)?;
                        values.errors[at].iter_mut().zip(errors).for_each(|(error, read)| *error = Some(read));
                    } else {
                        map.next_value::<IgnoredAny>()?;
                    }
                }
                Ok(values.completed())
            }
        }
        deserializer.deserialize_map(Record)
    }
}

/// Reads the numbers of a key, as many as it has parts; no number for `null`.
fn numbers<'de, A: MapAccess<'de>>(quantity: &Quantity, parts: usize, map: &mut A) -> Result<Vec<f64>, A::Error> {
    if quantity.is_single() {
        return Ok(map.next_value::<Option<f64>>()?.into_iter().collect());
    }
    let Some(numbers) = map.next_value::<Option<Vec<Option<f64>>>>()? else { return Ok(Vec::new()) };
    if numbers.len() != parts {
        return Err(A::Error::invalid_length(numbers.len(), &format!("{parts} numbers").as_str()));
    }
    Ok(numbers.into_iter().map(|number| number.unwrap_or(f64::NAN)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_solver_misses_stays_in_a_mean_over_phases() {
        let least = 0.075;
        let of = |errors: &[Option<f64>]| error_of_mean(errors.iter().copied());
        assert_eq!(of(&[Some(least); 4]), Some(least));
        assert_eq!(of(&[Some(1.0), Some(3.0)]), Some(2.0));
        assert_eq!(of(&[Some(least), None]), None);
    }
}
