//! The note that the host keeps in the board's EEPROM.

use crate::link::{Link, LinkError};
use protocol::units::Micros;
use protocol::{Command, NOTE_COPIES, NOTE_LENGTH, Reply};

/// The copies of a note.
pub type Copies = [[u8; NOTE_LENGTH as usize]; NOTE_COPIES as usize];

/// Reads the copies of the note.
///
/// # Errors
/// As [`Link::ask`].
pub fn read(link: &Link) -> Result<Copies, LinkError> {
    let mut copies = Copies::default();
    for (index, word) in (0..).step_by(4).zip(copies.as_flattened_mut().as_chunks_mut().0) {
        let command = Command::ReadNote { index };
        match link.ask(command)? {
            Reply::Pong(Micros(bytes)) => *word = bytes.to_le_bytes(),
            other => return Err(link.wrong_answer(&command, &other)),
        }
    }
    Ok(copies)
}

/// Writes a copy of the note, and returns whether the board has stored it.
///
/// # Errors
/// As [`Link::ask`].
pub fn write(link: &Link, copy: u8, note: &[u8; NOTE_LENGTH as usize]) -> Result<bool, LinkError> {
    for (index, byte) in (copy * NOTE_LENGTH..).zip(note) {
        link.command(Command::WriteNote { index, byte: *byte })?;
    }
    Ok(read(link)?[usize::from(copy)] == *note)
}
