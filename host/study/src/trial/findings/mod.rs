//! The table of findings: what may be wrong with a trial, by its log alone.
//!
//! Each finding is a row with its subject, its weight, its test and its remedy. Every command prints the findings of a
//! [`super::Judged`] trial in the order of the table.

mod axes;
mod frame;
mod import;
mod log;
mod rest;
mod sensor;
mod sensor_gap;
mod swing;
mod window;

pub use log::DAMAGED_FRAME;
pub(crate) use swing::{labelled, speeds_without_encoders};

use super::data::Data;
use super::finding::{Finding, FindingKind, Gravity};
use super::zero::Zeroed;

const REPEAT: &str = "repeat the trial";

/// The sections of the table.
pub(super) static TABLE: [Section; 7] =
    [log::SECTION, sensor::SECTION, import::SECTION, rest::SECTION, frame::SECTION, swing::SECTION, window::SECTION];

/// Rows for one kind of trials.
#[derive(Clone, Copy, Debug)]
pub(super) struct Section {
    /// Whether the rows apply to a trial.
    pub is_judged: fn(&Data) -> bool,
    pub rules: &'static [Rule],
}

/// A row of the table.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rule {
    kind: FindingKind,
    gravity: Gravity,
    /// The remedy; empty if there is none. `None`: the text of the test ends with a colon and the remedy.
    cure: Option<&'static str>,
    test: Test,
}

/// A function that returns what is wrong, in words; nothing if all is well.
#[derive(Clone, Copy, Debug)]
enum Test {
    One(One),
    Each(fn(&Data) -> Vec<String>),
    Law(Law),
}

type One = fn(&Data, &Zeroed) -> Option<String>;

/// The error says why a trial cannot be judged.
type Law = fn(&Data, &Zeroed) -> Result<Option<String>, &'static str>;

impl Rule {
    const fn new(kind: FindingKind, gravity: Gravity, cure: &'static str, test: One) -> Self {
        Self { kind, gravity, cure: Some(cure), test: Test::One(test) }
    }

    /// Creates a row for a trial whose numbers may be wrong.
    pub(super) const fn warning(kind: FindingKind, cure: &'static str, test: One) -> Self {
        Self::new(kind, Gravity::Warning, cure, test)
    }

    const fn loss(kind: FindingKind, cure: &'static str, test: One) -> Self {
        Self::new(kind, Gravity::Loss, cure, test)
    }

    /// Creates a row for several warnings of one kind.
    const fn each(kind: FindingKind, cure: Option<&'static str>, test: fn(&Data) -> Vec<String>) -> Self {
        Self { kind, gravity: Gravity::Warning, cure, test: Test::Each(test) }
    }

    /// Creates a row for what leaves the numbers as they are.
    pub(super) const fn note(kind: FindingKind, cure: &'static str, test: One) -> Self {
        Self::new(kind, Gravity::Note, cure, test)
    }

    /// Creates a row for a warning that needs data that some trials lack.
    const fn law(kind: FindingKind, cure: &'static str, test: Law) -> Self {
        Self { kind, gravity: Gravity::Warning, cure: Some(cure), test: Test::Law(test) }
    }

    fn said(&self, data: &Data, zeroed: &Zeroed) -> Result<Vec<String>, &'static str> {
        match self.test {
            Test::One(test) => Ok(Vec::from_iter(test(data, zeroed))),
            Test::Each(test) => Ok(test(data)),
            Test::Law(test) => Ok(Vec::from_iter(test(data, zeroed)?)),
        }
    }

    fn finding(&self, said: String) -> Finding {
        let (text, cure) = match self.cure {
            Some(cure) => (said.as_str(), cure),
            None => said.split_once(": ").unwrap_or((&said, "")),
        };
        Finding::new(self.kind, self.gravity, text, cure)
    }
}

/// Returns the findings of a table about a trial, and why some of its laws cannot judge a measured trial.
pub(super) fn all(table: &[Section], data: &Data, zeroed: &Zeroed) -> (Vec<Finding>, Vec<&'static str>) {
    let (mut found, mut not_judged) = (data.identity.clone(), Vec::new());
    for rule in table.iter().filter(|section| (section.is_judged)(data)).flat_map(|section| section.rules) {
        match rule.said(data, zeroed) {
            Ok(said) => found.extend(said.into_iter().map(|said| rule.finding(said))),
            Err(why) if !data.is_model() && !not_judged.contains(&why) => not_judged.push(why),
            Err(_) => {}
        }
    }
    (found, not_judged)
}
