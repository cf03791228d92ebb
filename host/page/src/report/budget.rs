//! The amount of data of a trial that a page can hold.

/// Most bytes of data of all trials on a page. With the scripts and the texts, a page stays below 10 MB.
pub(super) const DATA_BYTES: usize = 6_400_000;

/// Largest number of events that a page lists and marks.
pub(super) const MAX_EVENTS: usize = 200;

/// Largest number of bytes of text for the data of a trial on a page.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ByteBudget(pub(super) usize);

impl ByteBudget {
    /// Returns an equal share of a page for each of `trials` trials. One trial gets less than a page, which opens
    /// faster.
    pub fn of_trials(trials: usize) -> Self {
        Self((DATA_BYTES / trials.max(1)).min(3_500_000))
    }

    /// Returns whether the budget is enough for charts.
    pub(super) fn is_enough(self) -> bool {
        self.0 >= 8_000
    }

    /// Returns the bytes for curves. Shapes get the rest of the budget, and the bytes that the curves do not use.
    pub(super) fn series(self) -> usize {
        self.0 / 4 * 3
    }

    /// Returns the number of events to list.
    pub(super) fn events(self) -> usize {
        (self.0 / 1_000).min(MAX_EVENTS)
    }

    /// Returns the largest number of shapes to read.
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
