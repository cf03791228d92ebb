//! The trials of a session as its page names them: in the table and in the small pictures.

use super::view::View;
use study::twin::SessionComparison;

/// A trial of a session.
#[derive(Clone, Debug)]
pub(super) struct Row {
    /// Its name in the plan.
    pub name: String,
    pub speeds_rpm: [f64; 2],
    pub state: RowState,
}

/// State of a trial on the page.
#[derive(Clone, Debug)]
pub(super) enum RowState {
    /// It is on the page.
    Shown(Box<View>),
    /// It has no log yet.
    Missing,
    /// Its log cannot be read, and why.
    Unreadable(String),
}

impl Row {
    pub fn view(&self) -> Option<&View> {
        match &self.state {
            RowState::Shown(view) => Some(view),
            _ => None,
        }
    }
}

/// Returns the anchor of the `i`-th trial.
pub(super) fn anchor(i: usize) -> String {
    format!("trial-{}", i + 1)
}

/// Returns whether a trial differs from what it is compared with, in a few words.
pub(super) fn verdict(view: &View, session: Option<&SessionComparison>) -> Option<&'static str> {
    let trial = session?.trials.iter().find(|trial| trial.name == view.name)?;
    match (trial.differences.is_empty(), trial.transients_agree()) {
        (false, _) if trial.is_beyond_chance => Some("differs, beyond chance"),
        (false, _) => Some("differs"),
        (true, false) => Some("transient differs"),
        (true, true) => None,
    }
}
