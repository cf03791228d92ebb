//! Durations of the program's stages, from the marks that it writes to GPIOR0.
//!
//! A mark ends a stage of a tick and begins the next.

/// The tick begins.
pub const TICK_BEGIN: u8 = 0x10;
/// The tick's last stage has ended.
pub const TICK_END: u8 = 0x15;

/// Lengths in cycles.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Lengths {
    /// Their number.
    pub count: u64,
    /// Their sum.
    pub total: u64,
    /// The longest.
    pub worst: u64,
}

impl Lengths {
    /// Returns the mean; 0 if there are none.
    pub fn mean(&self) -> u64 {
        self.total.checked_div(self.count).unwrap_or(0)
    }

    fn add(&mut self, cycles: u64) {
        self.count += 1;
        self.total += cycles;
        self.worst = self.worst.max(cycles);
    }
}

/// Durations of the stages so far.
pub struct Marks {
    stages: [Lengths; 256],
    /// The durations from [`TICK_BEGIN`] to [`TICK_END`].
    pub tick: Lengths,
    last: Option<u64>,
    tick_began: Option<u64>,
}

impl Default for Marks {
    fn default() -> Self {
        Self { stages: [Lengths::default(); 256], tick: Lengths::default(), last: None, tick_began: None }
    }
}

impl Marks {
    /// Records that the program wrote `value`.
    pub fn mark(&mut self, cycle: u64, value: u8) {
        if let Some(began) = self.last.replace(cycle) {
            self.stages[usize::from(value)].add(cycle - began);
        }
        match value {
            TICK_BEGIN => self.tick_began = Some(cycle),
            TICK_END => {
                if let Some(began) = self.tick_began.take() {
                    self.tick.add(cycle - began);
                }
            }
            _ => {}
        }
    }

    /// Records a reset of the program: the present stage does not end.
    pub fn reset(&mut self) {
        self.last = None;
        self.tick_began = None;
    }

    /// Removes all durations.
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    /// Returns the durations of the stage that the mark `value` ends.
    pub fn stage(&self, value: u8) -> Lengths {
        self.stages[usize::from(value)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tick_lasts_through_the_marks_within_it() {
        let mut marks = Marks::default();
        for (cycle, value) in [(5, TICK_END), (100, TICK_BEGIN), (130, 0x11), (150, TICK_END), (180, TICK_BEGIN)] {
            marks.mark(cycle, value);
        }
        assert_eq!(marks.tick, Lengths { count: 1, total: 50, worst: 50 });
        assert_eq!(marks.stage(0x11).mean(), 30);
        assert_eq!(marks.stage(TICK_BEGIN).worst, 95);
    }
}
