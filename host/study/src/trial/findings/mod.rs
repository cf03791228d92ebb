//! The table of findings: what may be wrong with a trial, by its log alone.
//!
//! Each finding is a row with its subject, its weight, its test and its remedy. Every command prints the findings of a
//! [`super::Judged`] trial in the order of the table.

mod axes;
mod import;
mod log;
mod rest;
mod sensor;
mod sensor_gap;
mod swing;
mod window;

pub use log::DAMAGED_FRAME;

use super::data::Data;
use super::finding::{Finding, FindingKind, Gravity};
use super::zero::Zeroed;

const REPEAT: &str = "repeat the trial";

/// The sections of the table.
pub(super) static TABLE: [Section; 6] =
    [log::SECTION, sensor::SECTION, import::SECTION, rest::SECTION, swing::SECTION, window::SECTION];

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
    /// The remedy; empty if there is none, `None` if it follows a colon in the text.
    cure: Option<&'static str>,
    test: Test,
}

/// Returns what is wrong, in words; nothing if all is well.
#[derive(Clone, Copy, Debug)]
enum Test {
    One(One),
    Each(fn(&Data) -> Vec<String>),
}

type One = fn(&Data, &Zeroed) -> Option<String>;

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

    const fn note(kind: FindingKind, cure: &'static str, test: One) -> Self {
        Self::new(kind, Gravity::Note, cure, test)
    }

    fn finding(&self, said: String) -> Finding {
        let (text, cure) = match self.cure {
            Some(cure) => (said.as_str(), cure),
            None => said.split_once(": ").unwrap_or((&said, "")),
        };
        Finding::new(self.kind, self.gravity, text, cure)
    }
}

/// Returns the findings about a trial by a table.
pub(super) fn all(table: &[Section], data: &Data, zeroed: &Zeroed) -> Vec<Finding> {
    let said = |rule: &Rule| match rule.test {
        Test::One(test) => Vec::from_iter(test(data, zeroed)),
        Test::Each(test) => test(data),
    };
    let of_rule = |rule| said(rule).into_iter().map(move |said| rule.finding(said));
    let rules = table.iter().filter(|section| (section.is_judged)(data)).flat_map(|section| section.rules);
    data.identity.iter().cloned().chain(rules.flat_map(of_rule)).collect()
}
