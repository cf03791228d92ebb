//! How much of a trial a page has room for.

/// Room for the data of all trials, bytes. With the scripts and the texts, a page stays below 10 MB.
pub(super) const DATA_BYTES: usize = 6_400_000;

/// The most events that a page lists and marks.
pub(super) const MAX_EVENTS: usize = 200;

/// The room for the data of a trial on a page, bytes of text.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ByteBudget(pub(super) usize);

impl ByteBudget {
    /// An equal share of a page for each of so many trials. A page of one trial opens faster below the limit.
    pub fn of_trials(trials: usize) -> Self {
        Self((DATA_BYTES / trials.max(1)).min(3_500_000))
    }

    /// Whether there is room for charts at all.
    pub(super) fn is_enough(self) -> bool {
        self.0 >= 8_000
    }

    /// The room for curves; what they leave, and at least as much as this leaves, is for the shapes.
    pub(super) fn series(self) -> usize {
        self.0 / 4 * 3
    }

    /// How many events to list.
    pub(super) fn events(self) -> usize {
        (self.0 / 1_000).min(MAX_EVENTS)
    }

    /// How many shapes are worth reading.
    pub fn frames(self) -> usize {
        self.0 / 400
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_of_many_trials_lists_fewer_events() {
        assert_eq!(ByteBudget::of_trials(1).events(), MAX_EVENTS);
        assert_eq!(ByteBudget::of_trials(190).events(), 33);
    }
}
