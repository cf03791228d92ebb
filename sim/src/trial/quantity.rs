//! The quantities of a steady state: the only list of their names, units, descriptions, rules and values.
//!
//! A log, `--json`, sweeps, exports, pages and Python take their columns from [`QUANTITIES`]. A new row appears in all of them.
//!
//! ```
//! use sim::trial::quantity::{YAW, columns};
//!
//! assert_eq!(YAW.key(), "yaw_deg");
//! assert_eq!(columns(3).map(|column| column.name).nth(14), Some("force3_z_n".to_owned()));
//! ```

use super::Summary;
use super::means::Level;
use crate::body::attitude::tilt_deg;
use serde::de::{Deserialize, Deserializer, IgnoredAny, MapAccess, Visitor};
use serde::ser::{Serialize, SerializeMap, Serializer};
use std::fmt;

/// Number of flagella.
pub const FLAGELLA: usize = 2;

/// A quantity of a steady state.
#[derive(Clone, Copy, Debug)]
pub struct Quantity {
    /// Its name without the unit.
    stem: &'static str,
    /// The unit in its name; empty for a pure number.
    suffix: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// What it is; `#` is the number of the flagellum.
    about: &'static str,
    /// Its parts.
    pub shape: Shape,
    /// How it is stated for several starting phases.
    pub over_phases: OverPhases,
    /// Where it is not stated, because it is stated there in another form or was not asked for.
    not_in: &'static [Place],
    /// The level of a part.
    level: fn(&Summary, usize) -> Level,
}

/// The parts of a quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// A number of the robot.
    Number,
    /// A whole number of the robot.
    Count,
    /// A number of the robot with a standard error.
    Mean,
    /// A mean of each flagellum.
    OfEach,
    /// The mean of a vector of each flagellum, in body axes.
    VectorOfEach,
}

/// How a quantity is stated for several starting phases.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OverPhases {
    /// By its mean.
    Mean,
    /// By its least value.
    Least,
    /// By its largest value.
    Largest,
    /// By the sum.
    Sum,
}

/// A table of steady states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The table of a sweep.
    Sweep,
    /// The table of the trials of a session, and the page of a trial. Both state angles with their uncertainties, for
    /// measured trials too.
    Trials,
}

use OverPhases::{Largest, Least, Mean, Sum};
use Place::{Sweep, Trials};

/// Yaw.
pub const YAW: Quantity = Quantity {
    not_in: &[Trials],
    ..angle("yaw", "steady yaw about the vertical, unwrapped", |s, _| degrees(s.steady.attitude[0]))
};

/// Pitch.
pub const PITCH: Quantity = Quantity {
    not_in: &[Trials],
    ..angle("pitch", "steady pitch about the y axis after the yaw", |s, _| degrees(s.steady.attitude[1]))
};

/// Roll.
pub const ROLL: Quantity = Quantity {
    not_in: &[Trials],
    ..angle("roll", "steady roll about the x axis after yaw and pitch", |s, _| degrees(s.steady.attitude[2]))
};

/// Tilt.
pub const TILT: Quantity = Quantity {
    stem: "tilt",
    suffix: "_deg",
    unit: "deg",
    about: "angle of the robot's axis to the vertical, from the steady pitch and roll of each phase",
    shape: Shape::Number,
    over_phases: Mean,
    not_in: &[Trials],
    level: |s, _| exact(tilt_deg(degrees(s.steady.attitude[1]).mean, degrees(s.steady.attitude[2]).mean)),
};

/// Settling time.
pub const SETTLE: Quantity = Quantity {
    stem: "settle",
    suffix: "_s",
    unit: "s",
    about: "time from the start of the run after which yaw and pitch stay near their means; 0 if the steady state was solved for",
    shape: Shape::Number,
    over_phases: Largest,
    not_in: &[Sweep, Trials],
    level: |s, _| exact(s.steady.settle_s),
};

/// Length of the averaging window.
pub const WINDOW: Quantity = Quantity {
    stem: "window",
    suffix: "_s",
    unit: "s",
    about: "length of the end of the run from which the means are taken",
    shape: Shape::Number,
    over_phases: Mean,
    not_in: &[Sweep, Trials],
    level: |s, _| exact(s.steady.window_s),
};

/// Force of each flagellum on the base.
pub const FORCE: Quantity = Quantity {
    stem: "force",
    suffix: "_n",
    unit: "N",
    about: "mean force of flagellum # on the base, body axes, contact included",
    shape: Shape::VectorOfEach,
    over_phases: Mean,
    not_in: &[Trials],
    level: |s, part| s.steady.force[part / 3][part % 3],
};

/// Thrust of all flagella.
pub const THRUST: Quantity = Quantity {
    stem: "thrust",
    suffix: "_n",
    unit: "N",
    about: "thrust of all flagella: their force on the base along z_B",
    shape: Shape::Number,
    over_phases: Mean,
    not_in: &[Sweep, Trials],
    level: |s, _| exact(s.steady.force.iter().map(|force| force[2].mean).sum()),
};

/// Reaction torque of each flagellum.
pub const AXIAL_TORQUE: Quantity = Quantity {
    stem: "axial_torque",
    suffix: "_nm",
    unit: "N m",
    about: "mean reaction torque of flagellum # on the base about its shaft",
    shape: Shape::OfEach,
    over_phases: Mean,
    not_in: &[Trials],
    level: |s, part| s.steady.axial_torque[part],
};

/// Share of contact.
pub const CONTACT_SHARE: Quantity = Quantity {
    stem: "contact_share",
    suffix: "",
    unit: "1",
    about: "share of the time in which the flagella touch: of the period, or of the time that was averaged last, or of a trial",
    shape: Shape::Number,
    over_phases: Mean,
    not_in: &[Trials],
    level: |s, _| exact(s.contact_share),
};

/// Least gap.
pub const MIN_GAP: Quantity = Quantity {
    stem: "min_gap",
    suffix: "_m",
    unit: "m",
    about: "least gap between the flagella's surfaces over all phases, negative if they overlap",
    shape: Shape::Number,
    over_phases: Least,
    not_in: &[Trials],
    level: |s, _| exact(s.min_gap_m),
};

/// Power.
pub const POWER: Quantity = Quantity {
    stem: "power",
    suffix: "_w",
    unit: "W",
    about: "power at the shafts into the liquid, from the mean torques and the speeds at the end of the run",
    shape: Shape::Number,
    over_phases: Mean,
    not_in: &[],
    level: |s, _| {
        let power = s.steady.axial_torque.iter().zip(s.steady.speeds_rad_s).map(|(torque, speed)| torque.mean * -speed);
        exact(power.sum())
    },
};

/// Simulated time.
pub const SIMULATED: Quantity = Quantity {
    stem: "simulated",
    suffix: "_s",
    unit: "s",
    about: "simulated time, the search for the steady state included",
    shape: Shape::Number,
    over_phases: Sum,
    not_in: &[Sweep, Trials],
    level: |s, _| exact(s.simulated_s),
};

/// All quantities.
pub const QUANTITIES: [Quantity; 15] = [
    YAW,
    PITCH,
    ROLL,
    TILT,
    SETTLE,
    WINDOW,
    FORCE,
    THRUST,
    AXIAL_TORQUE,
    CONTACT_SHARE,
    MIN_GAP,
    POWER,
    Quantity {
        stem: "max_penetration",
        suffix: "_m",
        unit: "m",
        about: "largest overlap of the flagella's surfaces",
        shape: Shape::Number,
        over_phases: Largest,
        not_in: &[Sweep, Trials],
        level: |s, _| exact(s.max_penetration_m),
    },
    SIMULATED,
    Quantity {
        stem: "sweeps",
        suffix: "",
        unit: "1",
        about: "sweeps of the solver",
        shape: Shape::Count,
        over_phases: Sum,
        not_in: &[Sweep, Trials],
        level: |s, _| exact(s.sweeps as f64),
    },
];

/// A part of a quantity, which is a number.
#[derive(Clone, Debug)]
pub struct Column {
    /// The quantity.
    pub quantity: Quantity,
    /// The part: the number of the flagellum, from 0, and of the axis.
    part: usize,
    /// Its name, with the unit.
    pub name: String,
}

/// Returns the columns of all quantities for this number of flagella.
pub fn columns(flagella: usize) -> impl Iterator<Item = Column> {
    QUANTITIES.into_iter().flat_map(move |quantity| {
        let parts = 0..quantity.shape.parts(flagella);
        parts.map(move |part| Column { quantity, part, name: quantity.name(part, "") })
    })
}

impl Shape {
    const fn parts(self, flagella: usize) -> usize {
        match self {
            Self::Number | Self::Count | Self::Mean => 1,
            Self::OfEach => flagella,
            Self::VectorOfEach => 3 * flagella,
        }
    }

    /// Returns whether the parts have standard errors.
    pub fn has_error(self) -> bool {
        matches!(self, Self::Mean | Self::OfEach | Self::VectorOfEach)
    }
}

impl Quantity {
    /// Returns the name of a part, with `of` before the unit.
    fn name(&self, part: usize, of: &str) -> String {
        let Self { stem, suffix, .. } = self;
        match self.shape {
            Shape::Number | Shape::Count | Shape::Mean => format!("{stem}{of}{suffix}"),
            Shape::OfEach => format!("{stem}{}{of}{suffix}", part + 1),
            Shape::VectorOfEach => format!("{stem}{}_{}{of}{suffix}", part / 3 + 1, ["x", "y", "z"][part % 3]),
        }
    }

    /// Returns its key in a record; that of the first flagellum if each has a key of its own.
    pub fn key(&self) -> String {
        self.keys("").swap_remove(0).0
    }

    /// Returns its keys in a record, with `of` before the unit, and the parts that each has.
    pub fn keys(&self, of: &str) -> Vec<(String, std::ops::Range<usize>)> {
        let Self { stem, suffix, .. } = self;
        match self.shape {
            Shape::VectorOfEach => {
                (0..FLAGELLA).map(|k| (format!("{stem}{}{of}{suffix}", k + 1), 3 * k..3 * k + 3)).collect()
            }
            shape => vec![(format!("{stem}{of}{suffix}"), 0..shape.parts(FLAGELLA))],
        }
    }

    /// Returns where its parts begin among those of all quantities.
    fn start(&self) -> usize {
        let before = QUANTITIES.iter().take_while(|other| other.stem != self.stem);
        before.map(|other| other.shape.parts(FLAGELLA)).sum()
    }

    /// Returns what it is, of any flagellum.
    pub fn label(&self) -> &'static str {
        self.about
    }

    /// Returns whether a table has it.
    pub fn is_in(&self, place: Place) -> bool {
        !self.not_in.contains(&place)
    }

    /// Returns whether its parts are numbers beside each other, not a list.
    pub fn is_single(&self) -> bool {
        matches!(self.shape, Shape::Number | Shape::Count | Shape::Mean)
    }
}

impl Column {
    /// Returns what it is.
    pub fn about(&self) -> String {
        let vector = self.quantity.shape == Shape::VectorOfEach;
        let flagellum = if vector { self.part / 3 } else { self.part } + 1;
        let about = self.quantity.about.replace('#', &flagellum.to_string());
        if vector { format!("{about}: along {}", ["x", "y", "z: thrust"][self.part % 3]) } else { about }
    }

    /// Returns whether a table has it.
    pub fn is_in(&self, place: Place) -> bool {
        self.quantity.is_in(place)
    }

    /// Returns the name of its standard error; `None` unless it decides whether a run has settled, as angles and thrusts do.
    pub fn error(&self) -> Option<String> {
        let decides = match self.quantity.shape {
            Shape::Mean => true,
            Shape::VectorOfEach => self.part % 3 == 2,
            Shape::Number | Shape::Count | Shape::OfEach => false,
        };
        decides.then(|| self.quantity.name(self.part, "_se"))
    }

    /// Returns the name of its spread over the starting phases.
    pub fn spread(&self) -> String {
        self.quantity.name(self.part, "_spread")
    }

    /// Returns whether it is an angle.
    pub fn is_angle(&self) -> bool {
        self.quantity.unit == "deg"
    }

    /// Returns its place in [`Values::numbers`].
    pub fn index(&self) -> usize {
        self.quantity.start() + self.part
    }
}

/// The quantities of a steady state, just computed or from a log.
#[derive(Clone, PartialEq, Debug)]
pub struct Values {
    numbers: Vec<f64>,
    errors: Vec<Option<f64>>,
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
        let levels = columns(FLAGELLA).map(|column| (column.quantity.level)(summary, column.part));
        let (numbers, errors) = levels.map(|level| (level.mean, level.standard_error)).unzip();
        Self { numbers, errors }
    }

    /// Returns the values that stand for those of several starting phases. There must be at least one.
    pub fn over_phases(phases: &[Self]) -> Self {
        let (numbers, errors) = columns(FLAGELLA)
            .enumerate()
            .map(|(i, column)| {
                let number = column.quantity.over_phases.of(phases.iter().map(|phase| phase.numbers[i]));
                (number, error_of_mean(phases.iter().map(|phase| phase.errors[i])))
            })
            .unzip();
        Self { numbers, errors }
    }

    /// Returns the largest less the smallest value of several starting phases, for each column; NaN if one of them is.
    pub fn spreads(phases: &[Self]) -> Vec<f64> {
        let spread = |i: usize| {
            let of = || phases.iter().map(|phase| phase.numbers[i]);
            let spread = Largest.of(of()) - Least.of(of());
            if of().any(f64::is_nan) { f64::NAN } else { spread }
        };
        (0..columns(FLAGELLA).count()).map(spread).collect()
    }

    /// Returns the numbers, in the order of [`columns`].
    pub fn numbers(&self) -> &[f64] {
        &self.numbers
    }

    /// Returns the standard errors, in the order of [`columns`]; `None` where one is unknown.
    pub fn errors(&self) -> &[Option<f64>] {
        &self.errors
    }

    /// Returns a quantity: that of the first flagellum, along x, if it has several parts. NaN if it is unknown.
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

    /// Returns the standard errors of yaw, pitch and roll, degrees.
    pub fn angle_errors_deg(&self) -> [Option<f64>; 3] {
        [YAW, PITCH, ROLL].map(|angle| self.errors[angle.start()])
    }

    /// Computes what older logs do not state from what they do.
    fn completed(mut self) -> Self {
        let [_, pitch, roll] = self.angles_deg();
        let forces = &self.numbers[FORCE.start()..][..3 * FLAGELLA];
        let thrust = forces.chunks(3).map(|force| force[2]).sum();
        for (quantity, value) in [(TILT, tilt_deg(pitch, roll)), (THRUST, thrust)] {
            let number = &mut self.numbers[quantity.start()];
            *number = if number.is_nan() { value } else { *number };
        }
        self
    }
}

impl OverPhases {
    /// NaN if one value is.
    fn of(self, values: impl ExactSizeIterator<Item = f64>) -> f64 {
        let count = values.len() as f64;
        match self {
            Self::Mean => values.sum::<f64>() / count,
            Self::Sum => values.sum(),
            Self::Least => values.fold(f64::INFINITY, f64::min),
            Self::Largest => values.fold(f64::NEG_INFINITY, f64::max),
        }
    }
}

/// Returns the standard error of the mean over starting phases from those of the phases; `None` where one is unknown.
///
/// It is their mean, as for values whose errors are the same. What the solver misses has mostly one sign in all phases, and most
/// standard errors are those of the solver ([`crate::trial::means`]): more phases do not average it away.
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
        for quantity in QUANTITIES {
            let start = quantity.start();
            for (key, parts) in quantity.keys("") {
                let numbers = &self.numbers[start + parts.start..start + parts.end];
                match quantity.shape {
                    Shape::Count => map.serialize_entry(&key, &(numbers[0] as u64))?,
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

/// Keys that are missing leave their values unknown; others are ignored.
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
                        QUANTITIES.iter().find_map(|quantity| {
                            let (_, parts) = quantity.keys(of).into_iter().find(|(name, _)| *name == key)?;
                            Some((quantity, quantity.start() + parts.start..quantity.start() + parts.end))
                        })
                    };
                    if let Some((quantity, at)) = place("") {
                        let numbers = numbers(quantity, &mut map)?.unwrap_or_default();
                        values.numbers[at].iter_mut().zip(numbers).for_each(|(number, read)| *number = read);
                    } else if let Some((quantity, at)) = place("_se").filter(|(quantity, _)| quantity.shape.has_error())
                    {
                        let errors = numbers(quantity, &mut map)?.unwrap_or_default();
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

/// Reads the numbers of a key; `None` where they are `null`.
fn numbers<'de, A: MapAccess<'de>>(quantity: &Quantity, map: &mut A) -> Result<Option<Vec<f64>>, A::Error> {
    if quantity.is_single() {
        return Ok(map.next_value::<Option<f64>>()?.map(|number| vec![number]));
    }
    let numbers = map.next_value::<Option<Vec<Option<f64>>>>()?;
    Ok(numbers.map(|numbers| numbers.into_iter().map(|number| number.unwrap_or(f64::NAN)).collect()))
}

const fn angle(stem: &'static str, about: &'static str, level: fn(&Summary, usize) -> Level) -> Quantity {
    Quantity { stem, suffix: "_deg", unit: "deg", about, shape: Shape::Mean, over_phases: Mean, not_in: &[], level }
}

fn degrees(level: Level) -> Level {
    let [mean, amplitude] = [level.mean, level.amplitude].map(f64::to_degrees);
    Level { mean, amplitude, standard_error: level.standard_error.map(f64::to_degrees) }
}

fn exact(mean: f64) -> Level {
    Level { mean, ..Level::default() }
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
