//! The positions of both shafts over a loss of power: the gears do not turn by themselves, so the encoders' counts up
//! to the last rest still hold.
//!
//! A record has a slot of its own in the EEPROM, from address 448 on:
//!
//! | byte of a slot | content |
//! | --- | --- |
//! | 0 to 7 | positions of encoders 1 and 2 in counts from the marks, little-endian |
//! | 8, 9 | CRC-16 of the bytes before it, little-endian |
//! | 10 | 0xA5 if the record is valid |
//!
//! At most one record is valid. Its last byte is cleared before a motor turns, or when a hand turns a shaft. When both shafts
//! have come to rest, a new record is written, with its last byte at the end. So after a loss of power at any time the one
//! valid record is right, or there is none and the positions are unknown.
//!
//! A record takes the next of 52 slots and writes the last byte of its slot twice: the 100,000 writes that a byte
//! endures (ATmega328P, section 8.4) are enough for 2.6 million records. A trial with its parking takes two: that is 35
//! years of a hundred trials a day.

use protocol::units::EncoderCounts;

use crate::storage::{Storage, add_crc, read_checked, write_first_difference};

const ADDRESS: u16 = 448;
/// The positions and their CRC.
const RECORD: usize = 10;
const SLOT: u16 = RECORD as u16 + 1;
const SLOTS: u8 = ((1024 - ADDRESS) / SLOT) as u8;

/// The last byte of a slot.
const VALID: u8 = 0xA5;
const INVALID: u8 = 0;

/// Writes of a slot after which it counts as broken: every byte twice.
const MAX_WRITES: u8 = 2 * SLOT as u8;

/// Whether the positions are known, and their record in a storage, which is passed to the functions.
#[derive(Debug, Default)]
pub struct Positions {
    known: bool,
    /// The slot of the valid record, or of the last one.
    slot: u8,
    /// Whether the memory may have a valid record.
    recorded: bool,
    /// Whether that record is wrong though nothing has turned.
    outdated: bool,
    /// Writes of the slot so far.
    writes: u8,
}

impl Positions {
    /// Returns the positions in the valid record, if there is one. The next record is in the slot after it, or after `slot`.
    #[inline(never)]
    pub fn open(&mut self, storage: &mut impl Storage, slot: u8) -> Option<[EncoderCounts; 2]> {
        self.slot = slot % SLOTS;
        let mut found = None;
        for slot in 0..SLOTS {
            if let Some(positions) = read(storage, slot) {
                if found.is_some() {
                    // Only a broken memory has two valid records, and neither is known to be right.
                    self.outdated = true;
                    storage.write(address_of(self.slot) + RECORD as u16, INVALID);
                }
                self.slot = slot;
                self.recorded = true;
                found = Some(positions);
            }
        }
        self.known = self.recorded && !self.outdated;
        found.filter(|_| self.known)
    }

    /// Returns whether the positions count from the marks.
    pub fn are_known(&self) -> bool {
        self.known
    }

    /// Makes the positions, which are zero now, known.
    pub fn align(&mut self) {
        self.known = true;
        self.outdated = true;
    }

    /// Makes the positions unknown, because a motion was not counted.
    pub fn lose(&mut self) {
        self.known = false;
        self.outdated = true;
    }

    /// Returns whether a motor may turn: the memory has no valid record.
    pub fn may_change(&self) -> bool {
        !self.recorded
    }

    /// Advances by one tick, which writes at most one byte; returns whether it did.
    #[inline(never)]
    pub fn step(&mut self, storage: &mut impl Storage, positions: &[EncoderCounts; 2], at_rest: bool) -> bool {
        if self.recorded {
            let is_valid = read(storage, self.slot).is_some();
            if is_valid && at_rest && !self.outdated {
                self.writes = 0;
                return false;
            }
            if is_valid && self.writes < MAX_WRITES {
                // If the last byte cannot be cleared, clearing those before it makes the CRC wrong.
                let byte = SLOT - 1 - u16::from(self.writes / 2);
                storage.write(address_of(self.slot) + byte, INVALID);
                self.writes += 1;
                return true;
            }
            self.recorded = false;
            self.writes = 0;
        }
        self.outdated = false;
        if !self.known || !at_rest {
            self.writes = 0;
            return false;
        }
        if self.writes == 0 {
            self.slot = (self.slot + 1) % SLOTS;
        }
        self.writes += 1;
        let address = address_of(self.slot);
        if !write_first_difference(storage, address, &pack(positions)) {
            // Valid from the first moment of this write on.
            storage.write(address + RECORD as u16, VALID);
            self.recorded = true;
            self.writes = 0;
        } else if self.writes == MAX_WRITES {
            // The next slot.
            self.writes = 0;
        }
        true
    }
}

fn pack(positions: &[EncoderCounts; 2]) -> [u8; RECORD] {
    let mut record = [0; RECORD];
    for (place, position) in record.chunks_exact_mut(4).zip(positions) {
        place.copy_from_slice(&position.0.to_le_bytes());
    }
    add_crc(&mut record);
    record
}

/// Returns the positions in a slot, if its record is valid.
#[inline(never)]
fn read(storage: &mut impl Storage, slot: u8) -> Option<[EncoderCounts; 2]> {
    let address = address_of(slot);
    let mut record = [0; RECORD];
    if storage.read(address + RECORD as u16) != VALID || !read_checked(storage, address, &mut record) {
        return None;
    }
    let [a, b, c, d, e, f, g, h, ..] = record;
    Some([[a, b, c, d], [e, f, g, h]].map(|bytes| EncoderCounts(i32::from_le_bytes(bytes))))
}

fn address_of(slot: u8) -> u16 {
    ADDRESS + u16::from(slot) * SLOT
}

#[cfg(test)]
mod tests;
