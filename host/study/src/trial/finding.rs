//! One finding about a trial.

use serde::Serialize;
use std::fmt;
use std::path::Path;

/// The subject of a finding.
#[derive(Serialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(rename_all = "snake_case")]
pub enum FindingKind {
    /// The log's trial and session: its content compared with its file name and the other logs.
    Identity,
    /// The conduct of the trial: clipped readings, missed ticks, speeds not reached, supply, lost frames, faults,
    /// damage.
    Conduct,
    /// The still phases from which zero and drift are estimated.
    Rest,
    /// The averaging window of the steady angles.
    Window,
    /// The tilt at rest: a robot hangs upright.
    Upright,
    /// The yaw after the run: a robot comes back to its zero.
    Return,
    /// The swing of the robot: each flagellum swings it once a turn.
    Swing,
}

/// How much a finding matters.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Gravity {
    /// The trial's numbers may be wrong, and no uncertainty of its angles can be stated.
    Warning,
    /// The user must know of it, but the uncertainties of the angles hold.
    Loss,
    /// The user should know of it. The numbers hold, or their uncertainty is stated as unknown.
    Note,
}

/// A finding about a trial.
#[derive(Serialize, Clone, PartialEq, Eq, Debug)]
pub struct Finding {
    /// Its subject.
    pub kind: FindingKind,
    /// The finding in words.
    pub text: String,
    /// The remedy; empty if there is none.
    pub cure: String,
    /// Whether the trial's numbers may be wrong; commands then exit with 3.
    pub grave: bool,
    /// Whether the uncertainties of the angles hold nevertheless.
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

/// The finding with its remedy, in the format of the recorder's warnings.
impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)?;
        if self.cure.is_empty() { Ok(()) } else { write!(f, ": {}", self.cure) }
    }
}

impl Finding {
    /// Creates a finding which means that the trial's numbers may be wrong.
    pub(crate) fn grave(kind: FindingKind, text: impl Into<String>, cure: &str) -> Self {
        Self::new(kind, Gravity::Warning, text, cure)
    }

    /// Creates a finding that the user must know of, though the uncertainties hold.
    pub(crate) fn loss(kind: FindingKind, text: impl Into<String>, cure: &str) -> Self {
        Self::new(kind, Gravity::Loss, text, cure)
    }

    /// Creates a finding that leaves the numbers and their uncertainties as they are.
    pub(crate) fn slight(kind: FindingKind, text: impl Into<String>, cure: &str) -> Self {
        Self::new(kind, Gravity::Note, text, cure)
    }

    pub(super) fn new(kind: FindingKind, gravity: Gravity, text: impl Into<String>, cure: &str) -> Self {
        let (grave, spares_angles) = (gravity != Gravity::Note, gravity == Gravity::Loss);
        Self { kind, text: text.into(), cure: cure.to_owned(), grave, spares_angles }
    }

    /// Returns whether no uncertainty of the angles can be stated.
    pub(crate) fn empties_uncertainty(&self) -> bool {
        self.grave && !self.spares_angles
    }
}
