//! One finding about a trial.

use serde::Serialize;
use std::fmt;
use std::path::Path;

/// What a finding is about.
#[derive(Serialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(rename_all = "snake_case")]
pub enum FindingKind {
    /// Which trial of which session the log holds: its content against its file's name and the other logs.
    Identity,
    /// How the trial was run: clipped readings, missed ticks, speeds not reached, supply, lost frames, faults, damage.
    Conduct,
    /// The still phases that zero and drift are estimated from.
    Rest,
    /// The time over which the steady angles are averaged.
    Window,
}

/// A finding about a trial.
#[derive(Serialize, Clone, PartialEq, Eq, Debug)]
pub struct Finding {
    /// What it is about.
    pub kind: FindingKind,
    /// What was found.
    pub text: String,
    /// What to do about it; empty if nothing can be done.
    pub cure: String,
    /// Whether the trial's numbers may be wrong, so that commands exit with 3.
    pub grave: bool,
    /// Whether the uncertainties hold nevertheless: the loss does not reach the angles.
    #[serde(skip)]
    spares_angles: bool,
}

/// A finding about one of several logs.
#[derive(Serialize, Clone, PartialEq, Eq, Debug)]
pub struct LogFinding {
    /// The log.
    pub log: String,
    /// The finding.
    #[serde(flatten)]
    pub finding: Finding,
}

impl LogFinding {
    /// Returns findings about a log.
    pub fn all_of(log: &Path, findings: impl IntoIterator<Item = Finding>) -> Vec<Self> {
        let log = log.to_string_lossy();
        findings.into_iter().map(|finding| Self { log: log.to_string(), finding }).collect()
    }
}

/// The finding with what to do about it, as the recorder writes its warnings.
impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)?;
        if self.cure.is_empty() { Ok(()) } else { write!(f, ": {}", self.cure) }
    }
}

impl Finding {
    /// Creates a finding after which the trial's numbers may be wrong.
    pub(crate) fn grave(kind: FindingKind, text: impl Into<String>, cure: &str) -> Self {
        Self { kind, text: text.into(), cure: cure.to_owned(), grave: true, spares_angles: false }
    }

    /// Creates a finding about a loss that the user must know of, and that does not reach the angles.
    pub(super) fn loss(kind: FindingKind, text: impl Into<String>, cure: &str) -> Self {
        Self { spares_angles: true, ..Self::grave(kind, text, cure) }
    }

    /// Returns whether no uncertainty of the angles can be stated.
    pub(crate) fn empties_uncertainty(&self) -> bool {
        self.grave && !self.spares_angles
    }

    /// Creates a finding that the numbers already allow for, for instance by an uncertainty that is unknown.
    pub(crate) fn slight(kind: FindingKind, text: impl Into<String>, cure: &str) -> Self {
        Self { grave: false, ..Self::grave(kind, text, cure) }
    }
}
