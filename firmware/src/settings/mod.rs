//! The content of the EEPROM: the settings, the number of starts, the fault log, and the shafts' positions.
//!
//! | address | content |
//! | --- | --- |
//! | 0 | settings of older firmware, as a frame: the number of their layout, a 7, the [`Settings`] |
//! | 64 | the note of the host |
//! | 128 | eight counters of starts of two bytes, little-endian |
//! | 160 | the fault log ([`fault_log`](crate::fault_log)) |
//! | 320, 384 | two slots of the settings: save n is in slot n modulo 2; n wraps at 256 |
//! | 448 | the shafts' positions ([`positions`](crate::positions)) |
//!
//! | byte of a slot | content |
//! | --- | --- |
//! | 0 | n |
//! | 1 | number of the layout |
//! | 2 to 61 | the [`Settings`] and ones |
//! | 62, 63 | CRC-16 of the bytes before it, little-endian |
//!
//! The newest slot with a valid CRC is in force. A save writes the other one, so that a loss of power at any time leaves the
//! old settings or the new ones. The first save also makes those of older firmware invalid. A new field of the settings is
//! added at their end, with a new number of the layout; settings of an older layout get the default for the fields that they
//! lack. Without valid settings (a blank memory) the defaults apply.
//!
//! A byte of EEPROM endures 100,000 writes (ATmega328P, section 8.4). Saving writes only the bytes that differ. The count of
//! starts rotates over eight places. A counter that is not one more than the counter in the place before it comes from a
//! write cut off by loss of power, and is ignored.

use protocol::frame::Accumulator;
use protocol::units::EncoderCounts;
use protocol::{FaultRecord, Settings};

use crate::fault_log::FaultLog;
use crate::positions::Positions;
use crate::storage::{Storage, add_crc, first_difference, read_checked, write_first_difference};

const OLD_ADDRESS: u16 = 0;
const NOTES_ADDRESS: u8 = 64;
const NOTE_SPACE: u8 = 64;
const COUNTS_ADDRESS: u16 = 128;
const COUNTS: u16 = 8;
const SLOTS_ADDRESS: u16 = 320;
const SLOT: usize = 64;
/// A counter, or a byte, that was never written.
const BLANK: u16 = u16::MAX;
const BLANK_BYTE: u8 = u8::MAX;

/// The layout of the settings, identified by the number in the memory.
const LAYOUT: u8 = 3;
/// Length of the settings in this layout.
const LENGTH: usize = 55;
// On the board, a structure in memory is its bytes on the wire.
#[cfg(target_arch = "avr")]
const _: () = assert!(size_of::<Settings>() == LENGTH);
const _: () = assert!(LENGTH <= SLOT - 4, "the settings do not fit into a slot");
/// The second byte of a frame of older firmware. The firmware of protocol version 1 stored the settings as it received
/// them, with the number of the request and this number of the command.
const OLD_TAG: u8 = 7;

/// Writes of a save after which the memory counts as broken: every byte twice.
const MAX_WRITES: u8 = 2 * SLOT as u8;

/// The settings, the count of starts, the fault log and the shafts' positions in a storage.
pub struct Store<S> {
    storage: S,
    /// The number of the last save.
    saved: Option<u8>,
    /// Steps of the save in progress.
    steps: Option<u8>,
    fault_log: FaultLog,
    /// Whether the shafts' positions are known.
    pub positions: Positions,
}

/// The state of a save.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Saving {
    /// No save is in progress.
    Idle,
    /// The save continues.
    Busy,
    /// All bytes have been written and read back.
    Done,
    /// The memory does not keep its content.
    Failed,
}

impl<S: Storage> Store<S> {
    /// Returns a store on `storage`; call [`Store::load`] next.
    pub fn new(storage: S) -> Self {
        Self { storage, saved: None, steps: None, fault_log: FaultLog::default(), positions: Positions::default() }
    }

    /// Replaces `settings`, which are the defaults, by the saved ones; returns false if there are no valid ones.
    /// `accumulator` has room for a frame.
    #[inline(never)]
    pub fn load(&mut self, accumulator: &mut Accumulator, settings: &mut Settings) -> bool {
        self.fault_log.open(&mut self.storage);
        let mut slot = [0; SLOT];
        let mut is_stored = false;
        for number in 0..2 {
            let is_valid = read_checked(&mut self.storage, slot_address(number), &mut slot);
            let [number, layout, stored @ ..] = &slot;
            if is_valid && self.saved.is_none_or(|saved| number.wrapping_sub(saved) == 1) {
                self.saved = Some(*number);
                is_stored = unpack(*layout, stored, settings);
            }
        }
        if self.saved.is_none() {
            is_stored = self.load_old(accumulator, settings);
        }
        is_stored
    }

    /// Loads the settings of older firmware.
    fn load_old(&mut self, accumulator: &mut Accumulator, settings: &mut Settings) -> bool {
        for address in OLD_ADDRESS..u16::from(NOTES_ADDRESS) {
            if let Some(payload) = accumulator.push_for_payload(self.storage.read(address)) {
                return match payload {
                    Ok([layout, OLD_TAG, stored @ ..]) => unpack(*layout, stored, settings),
                    _ => false,
                };
            }
        }
        // A blank memory has no end of a frame, and the accumulator must be empty for the next user.
        let _ = accumulator.push_for_payload(0);
        false
    }

    /// Returns the shafts' positions, if they are known. Their next record is in the slot after theirs, or after `slot`.
    pub fn open_positions(&mut self, slot: u8) -> Option<[EncoderCounts; 2]> {
        self.positions.open(&mut self.storage, slot)
    }

    /// Begins a save. A save in progress continues: the host repeats its request more often than a failing save takes.
    pub fn begin_save(&mut self) {
        self.steps.get_or_insert(0);
    }

    /// Adds a record to the fault log.
    pub fn log_fault(&mut self, record: &FaultRecord) {
        self.fault_log.add(record);
    }

    /// Returns whether a record of the fault log is being written.
    pub fn is_logging(&self) -> bool {
        self.fault_log.is_writing()
    }

    /// Returns an entry of the fault log; index 0 is the latest one.
    pub fn read_fault(&mut self, index: u8) -> Option<FaultRecord> {
        self.fault_log.read(&mut self.storage, index)
    }

    /// Returns four bytes of the note from `index` on, as a little-endian number.
    pub fn read_note(&mut self, index: u8) -> u32 {
        let mut bytes = [0; 4];
        for (address, byte) in (note_address(index)..).zip(&mut bytes) {
            *byte = self.storage.read(address);
        }
        u32::from_le_bytes(bytes)
    }

    /// Begins to write a byte of the note, after waiting for the end of a write.
    pub fn write_note(&mut self, index: u8, byte: u8) {
        self.change(note_address(index), byte);
    }

    /// Advances the record of the shafts' positions by one tick, which writes at most one byte; returns whether it did.
    /// Other writes then wait, because the motors may wait for this one.
    pub fn step_positions(&mut self, positions: &[EncoderCounts; 2], at_rest: bool) -> bool {
        self.positions.step(&mut self.storage, positions, at_rest)
    }

    /// Advances by one tick, which writes at most one byte: of the fault log first, then of a save. A save writes the first
    /// byte that differs from `settings`, so it is complete only when all of it has been read back, and follows settings
    /// that change meanwhile.
    #[inline(never)]
    pub fn step(&mut self, settings: &Settings) -> Saving {
        if self.fault_log.step(&mut self.storage) {
            return Saving::Busy;
        }
        let Some(steps) = self.steps else { return Saving::Idle };
        // The first step checks whether these settings are saved already.
        let writes = steps.checked_sub(1);
        let number = match self.saved {
            Some(saved) => saved.wrapping_add(u8::from(writes.is_some())),
            None => 0,
        };
        let slot = pack(number, settings);
        let address = slot_address(number);
        let is_different = match writes {
            Some(MAX_WRITES..) | None => first_difference(&mut self.storage, address, &slot).is_some(),
            Some(_) => write_first_difference(&mut self.storage, address, &slot),
        };
        if is_different && writes.is_none_or(|writes| writes < MAX_WRITES) {
            self.steps = Some(steps + 1);
            return Saving::Busy;
        }
        self.steps = None;
        if is_different {
            return Saving::Failed;
        }
        self.saved = Some(number);
        self.change(OLD_ADDRESS, BLANK_BYTE);
        Saving::Done
    }

    /// Counts a start and returns the number of starts; stays at 65534.
    #[inline(never)]
    pub fn count_start(&mut self) -> u16 {
        let mut count = 0;
        let mut before = self.read_count(COUNTS - 1);
        for place in 0..COUNTS {
            let found = self.read_count(place);
            let follows = found == 1 || found.wrapping_sub(1) == before;
            if found != BLANK && found % COUNTS == place && follows {
                count = count.max(found);
            }
            before = found;
        }
        if count < BLANK - 1 {
            count += 1;
        }
        let [low, high] = count.to_le_bytes();
        let address = count_address(count % COUNTS);
        self.change(address, low);
        self.change(address + 1, high);
        count
    }

    fn read_count(&mut self, place: u16) -> u16 {
        let address = count_address(place);
        u16::from_le_bytes([self.storage.read(address), self.storage.read(address + 1)])
    }

    fn change(&mut self, address: u16, byte: u8) {
        if self.storage.read(address) != byte {
            self.storage.write(address, byte);
        }
    }
}

/// Returns the slot of a save.
#[inline(never)]
fn pack(number: u8, settings: &Settings) -> [u8; SLOT] {
    let mut slot = [BLANK_BYTE; SLOT];
    let [first, layout, stored @ .., _, _] = &mut slot;
    *first = number;
    *layout = LAYOUT;
    // They have a fixed length, for which there is room.
    postcard::to_slice(settings, stored).ok();
    add_crc(&mut slot);
    slot
}

/// Replaces `settings` by stored ones, or by the defaults if they are not valid; returns whether they are.
#[inline(never)]
fn unpack(layout: u8, stored: &[u8], settings: &mut Settings) -> bool {
    *settings = Settings::DEFAULT;
    let length = match layout {
        1 => 49,
        2 => 53,
        LAYOUT => LENGTH,
        _ => return false,
    };
    let mut bytes = [0; LENGTH];
    // The fields that a layout lacks are at the end.
    postcard::to_slice(settings, &mut bytes).ok();
    let mut found = 0;
    for (byte, stored) in bytes.iter_mut().zip(stored).take(length) {
        *byte = *stored;
        found += 1;
    }
    match Settings::read(&bytes) {
        Some(read) if found == length && read.is_valid() => *settings = read,
        _ => return false,
    }
    true
}

fn slot_address(number: u8) -> u16 {
    SLOTS_ADDRESS + u16::from(number % 2) * SLOT as u16
}

fn note_address(index: u8) -> u16 {
    u16::from(NOTES_ADDRESS + index % NOTE_SPACE)
}

fn count_address(place: u16) -> u16 {
    COUNTS_ADDRESS + 2 * place
}

#[cfg(test)]
mod tests;
