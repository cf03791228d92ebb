//! What is wrong with a log as a whole, and which parts of it are lost.

/// The condition of a log.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Condition {
    /// Intact to the last byte.
    Clean,
    /// Rewritten by another program, and whole: every record up to the end can be read. Changes to a file without CRCs
    /// do not show.
    Rewritten,
    /// The end is missing.
    CutOff,
    /// Bytes were changed or lost before the end.
    Damaged,
}

impl Condition {
    /// Returns whether nothing of the log is missing.
    pub fn is_whole(self) -> bool {
        matches!(self, Self::Clean | Self::Rewritten)
    }
}

/// A place in a log that cannot be read.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Loss {
    /// Offset of the first byte.
    pub offset: u64,
    /// Number of bytes.
    pub bytes: u64,
    /// What was lost.
    pub what: &'static str,
}

impl std::fmt::Display for Loss {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { offset, bytes, what } = self;
        match bytes {
            0 => write!(f, "{what} (at byte {offset})"),
            _ => write!(f, "{what} ({bytes} bytes at byte {offset})"),
        }
    }
}
