//! One finding about a trial.

use serde::Serialize;
use std::fmt;

/// What a finding is about.
#[derive(Serialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(rename_all = "snake_case")]
pub enum FindingKind {
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
    pub(super) fn grave(kind: FindingKind, text: impl Into<String>, cure: &str) -> Self {
        Self { kind, text: text.into(), cure: cure.to_owned(), grave: true }
    }

    /// Creates a finding that the numbers already allow for, for instance by an uncertainty that is unknown.
    pub(super) fn slight(kind: FindingKind, text: impl Into<String>, cure: &str) -> Self {
        Self { grave: false, ..Self::grave(kind, text, cure) }
    }
}
