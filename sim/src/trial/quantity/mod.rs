//! The quantities of a trial: the only list of their names, units, descriptions, rules and values, in its samples and its steady state.
//!
//! A log, `--json`, sweeps, exports, pages and Python take their columns from [`QUANTITIES`]. A new row appears in all of them.
//!
//! ```
//! use sim::trial::quantity::{YAW, columns};
//!
//! assert_eq!(YAW.key(), "yaw_deg");
//! assert_eq!(columns(3).map(|column| column.name).nth(14), Some("force3_z_n".to_owned()));
//! ```

mod list;
mod values;

pub use list::*;
pub use values::Values;

use super::Summary;
use super::means::Level;
use super::sample::Sample;
use std::ops::Range;

/// Number of flagella.
pub const FLAGELLA: usize = 2;

/// A quantity of a trial.
#[derive(Clone, Copy, Debug)]
pub struct Quantity {
    /// Its name without the unit.
    stem: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// What it is; `#` is the number of the flagellum, `@` its axis.
    about: &'static str,
    /// Its parts.
    pub shape: Shape,
    /// How values of several starting phases are combined.
    pub over_phases: OverPhases,
    /// Tables without it, because they state it in another form or do not need it.
    not_in: &'static [Place],
    /// The level of a part in the steady state; `None` if only samples have it.
    level: Option<fn(&Summary, usize) -> Level>,
    /// The value of a part in a sample; `None` if only the steady state has it.
    sample: Option<fn(&Sample, usize) -> f64>,
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

/// How the values of a quantity for several starting phases are combined.
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

/// A part of a quantity: one number.
#[derive(Clone, Debug)]
pub struct Column {
    /// The quantity.
    pub quantity: Quantity,
    /// The part: the number of the flagellum, from 0, and of the axis.
    part: usize,
    index: usize,
    /// Its name, with the unit.
    pub name: String,
}

/// Returns the columns of a steady state for this number of flagella.
pub fn columns(flagella: usize) -> impl Iterator<Item = Column> {
    numbered(steady().flat_map(move |of| of.columns(flagella)))
}

/// Returns the quantities of a steady state.
pub fn steady() -> impl Iterator<Item = Quantity> {
    QUANTITIES.iter().copied().filter(|quantity| quantity.level.is_some())
}

/// Returns the columns of a sample for this number of flagella.
pub fn sample_columns(flagella: usize) -> impl Iterator<Item = Column> {
    let sampled = QUANTITIES.iter().copied().filter(|quantity| quantity.sample.is_some());
    numbered(sampled.flat_map(move |of| of.columns(flagella)))
}

fn numbered(columns: impl Iterator<Item = Column>) -> impl Iterator<Item = Column> {
    columns.enumerate().map(|(index, column)| Column { index, ..column })
}

/// Number of the columns of a sample of two flagella.
pub const SAMPLE_COLUMNS: usize = {
    let (mut columns, mut at) = (0, 0);
    while at < QUANTITIES.len() {
        if QUANTITIES[at].sample.is_some() {
            columns += QUANTITIES[at].shape.parts(FLAGELLA);
        }
        at += 1;
    }
    columns
};

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
    /// Returns the unit as a suffix of the name; empty for a pure number.
    fn suffix(&self) -> String {
        if self.unit == "1" { String::new() } else { format!("_{}", self.unit.replace(' ', "").to_lowercase()) }
    }

    /// Returns the name of a part, with `of` before the unit.
    fn name(&self, part: usize, of: &str) -> String {
        let (stem, suffix) = (self.stem, self.suffix());
        match self.shape {
            Shape::Number | Shape::Count | Shape::Mean => format!("{stem}{of}{suffix}"),
            Shape::OfEach => format!("{stem}{}{of}{suffix}", part + 1),
            Shape::VectorOfEach => format!("{stem}{}_{}{of}{suffix}", part / 3 + 1, ["x", "y", "z"][part % 3]),
        }
    }

    /// Returns its key in a record; the first flagellum's key if each has its own.
    pub fn key(&self) -> String {
        self.keys("").swap_remove(0).0
    }

    /// Returns its keys in a record, with `of` before the unit, and the parts that each has.
    pub fn keys(&self, of: &str) -> Vec<(String, Range<usize>)> {
        let (stem, suffix) = (self.stem, self.suffix());
        match self.shape {
            Shape::VectorOfEach => {
                (0..FLAGELLA).map(|k| (format!("{stem}{}{of}{suffix}", k + 1), 3 * k..3 * k + 3)).collect()
            }
            shape => vec![(format!("{stem}{of}{suffix}"), 0..shape.parts(FLAGELLA))],
        }
    }

    /// Returns where its parts begin among the columns of a steady state.
    fn start(&self) -> usize {
        let before = QUANTITIES.iter().take_while(|other| other.stem != self.stem);
        before.filter(|other| other.level.is_some()).map(|other| other.shape.parts(FLAGELLA)).sum()
    }

    /// Returns where its parts are among the columns of a sample.
    pub fn in_sample(&self) -> Range<usize> {
        let before = QUANTITIES.iter().take_while(|other| other.stem != self.stem);
        let start = before.filter(|other| other.sample.is_some()).map(|other| other.shape.parts(FLAGELLA)).sum();
        start..start + self.shape.parts(FLAGELLA)
    }

    fn columns(self, flagella: usize) -> impl Iterator<Item = Column> {
        (0..self.shape.parts(flagella)).map(move |part| Column {
            quantity: self,
            part,
            index: 0,
            name: self.name(part, ""),
        })
    }

    /// Returns its description, for this flagellum (counted from 0) or for each.
    pub fn label(&self, flagellum: Option<usize>) -> String {
        let of = flagellum.map_or("each flagellum".to_owned(), |k| format!("flagellum {}", k + 1));
        self.about.replace("flagellum #", &of).replace('@', "")
    }

    /// Returns whether a table has it.
    pub fn is_in(&self, place: Place) -> bool {
        !self.not_in.contains(&place)
    }

    /// Returns whether it is a single number, not a list.
    pub fn is_single(&self) -> bool {
        matches!(self.shape, Shape::Number | Shape::Count | Shape::Mean)
    }
}

impl Column {
    /// Returns its description.
    pub fn about(&self) -> String {
        let (flagellum, axis) = match self.quantity.shape {
            Shape::VectorOfEach => (self.part / 3, [" along x", " along y", " along z (thrust)"][self.part % 3]),
            _ => (self.part, ""),
        };
        self.quantity.about.replace('#', &(flagellum + 1).to_string()).replace('@', axis)
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

    /// Returns its value in a sample; NaN if only the steady state has it.
    pub fn of_sample(&self, sample: &Sample) -> f64 {
        self.quantity.sample.map_or(f64::NAN, |value| value(sample, self.part))
    }

    /// Returns its place among the columns, and so in [`Values::numbers`].
    pub fn index(&self) -> usize {
        self.index
    }
}
