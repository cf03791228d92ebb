//! The note that the host keeps in the board's EEPROM.

use crate::link::{Link, LinkError};
use protocol::{Command, NOTE_COPIES, NOTE_LENGTH, Reply};

/// The copies of a note.
pub type Copies = [[u8; NOTE_LENGTH as usize]; NOTE_COPIES as usize];

/// Reads the copies of the note.
///
/// # Errors
/// As [`Link::ask`].
pub fn read(link: &Link) -> Result<Copies, LinkError> {
    let mut copies = Copies::default();
    for (copy, note) in (0..).zip(&mut copies) {
        let command = Command::ReadNote { copy };
        match link.ask(command)? {
            Reply::Note(bytes) => *note = bytes,
            other => return Err(link.wrong_answer(&command, &other)),
        }
    }
    Ok(copies)
}

/// Writes a copy of the note, and returns whether the board keeps it.
///
/// # Errors
/// As [`Link::ask`].
pub fn write(link: &Link, copy: u8, note: &[u8; NOTE_LENGTH as usize]) -> Result<bool, LinkError> {
    for (index, byte) in (0..).zip(note) {
        link.command(Command::WriteNote { copy, index, byte: *byte })?;
    }
    Ok(read(link)?[usize::from(copy)] == *note)
}
