//! The condition of a log as a whole, and its lost parts.

/// The condition of a log.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Condition {
    /// Intact to the last byte.
    #[default]
    Clean,
    /// Rewritten by another program, and complete: every record up to the end can be read. Changes to a file without
    /// CRCs are not detected.
    Rewritten,
    /// The end is missing.
    CutOff,
    /// Bytes were changed or lost before the end.
    Damaged,
}

impl Condition {
    /// Returns whether the log is complete.
    pub fn is_whole(self) -> bool {
        matches!(self, Self::Clean | Self::Rewritten)
    }
}

/// An unreadable part of a log.
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
