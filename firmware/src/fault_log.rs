//! The fault log: the last faults in EEPROM, for what happened before the host's opening of the port reset the board.
//!
//! Entry n is in slot n modulo [`FAULT_RECORDS`]; n wraps at 256.
//!
//! | byte of a slot | content |
//! | --- | --- |
//! | 0 | n |
//! | 1 to 17 | the [`FaultRecord`] |
//! | 18, 19 | CRC-16 of the bytes before it, little-endian |
//!
//! A slot whose CRC does not match is empty: it was never written, or loss of power cut the write off.

use protocol::frame::crc16;
use protocol::{FAULT_RECORDS, FaultRecord};

use crate::storage::{Storage, write_first_difference};

const ADDRESS: u16 = 160;
const SLOT: usize = 20;

/// Writes of an entry after which the memory counts as broken: every byte twice.
const MAX_WRITES: u8 = 2 * SLOT as u8;

/// An entry that is being written.
#[derive(Debug)]
pub struct Entry {
    slot: [u8; SLOT],
    writes: u8,
}

impl Entry {
    /// Returns the entry that follows the latest one in `storage`.
    #[inline(never)]
    pub fn new(storage: &mut impl Storage, record: &FaultRecord) -> Self {
        let mut slot = [0; SLOT];
        slot[0] = latest(storage).map_or(0, |number| number.wrapping_add(1));
        // The record has a fixed length, which leaves room for the CRC.
        postcard::to_slice(record, &mut slot[1..SLOT - 2]).ok();
        let crc = crc16(&slot[..SLOT - 2]);
        slot[SLOT - 2..].copy_from_slice(&crc.to_le_bytes());
        Self { slot, writes: 0 }
    }

    /// Writes one byte; returns false when the entry is complete, or the memory does not keep it.
    pub fn step(&mut self, storage: &mut impl Storage) -> bool {
        self.writes += 1;
        self.writes <= MAX_WRITES && write_first_difference(storage, address_of(self.slot[0]), &self.slot)
    }
}

/// Returns an entry of the log; index 0 is the latest one.
#[inline(never)]
pub fn read(storage: &mut impl Storage, index: u8) -> Option<FaultRecord> {
    let number = latest(storage)?.wrapping_sub(index);
    let slot = valid_slot(storage, number)?;
    postcard::from_bytes(&slot[1..SLOT - 2]).ok()
}

/// Returns the number of the latest entry: the one without a successor.
#[inline(never)]
fn latest(storage: &mut impl Storage) -> Option<u8> {
    (0..FAULT_RECORDS).find_map(|place| {
        let number = storage.read(address_of(place));
        valid_slot(storage, number)?;
        valid_slot(storage, number.wrapping_add(1)).is_none().then_some(number)
    })
}

/// Returns the slot of entry `number` if it holds this entry, undamaged.
#[inline(never)]
fn valid_slot(storage: &mut impl Storage, number: u8) -> Option<[u8; SLOT]> {
    let mut slot = [0; SLOT];
    for (address, byte) in (address_of(number)..).zip(&mut slot) {
        *byte = storage.read(address);
    }
    let crc = u16::from_le_bytes([slot[SLOT - 2], slot[SLOT - 1]]);
    (slot[0] == number && crc16(&slot[..SLOT - 2]) == crc).then_some(slot)
}

fn address_of(number: u8) -> u16 {
    ADDRESS + u16::from(number % FAULT_RECORDS) * SLOT as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::tests::Memory;
    use protocol::Fault;
    use protocol::units::{CentiRpm, Duty, Micros};

    fn record(boot: u16) -> FaultRecord {
        FaultRecord {
            boot,
            time: Micros(0xFFFF_FFFF),
            fault: Fault::Motor2Runaway,
            duty: [Duty(-255), Duty(255)],
            speed: [CentiRpm(-9000), CentiRpm(1)],
            program_counter: 0xFFFF,
        }
    }

    fn write(memory: &Memory, record: &FaultRecord) -> u32 {
        let mut entry = Entry::new(&mut memory.clone(), record);
        (1..1000).find(|_| !entry.step(&mut memory.clone())).unwrap()
    }

    #[test]
    fn a_blank_memory_and_a_zeroed_one_have_no_entries() {
        let memory = Memory::blank();
        assert_eq!(read(&mut memory.clone(), 0), None);
        memory.bytes.borrow_mut().fill(0);
        assert_eq!(read(&mut memory.clone(), 0), None);
    }

    #[test]
    fn the_latest_entries_are_read_in_order_over_many_wraps() {
        let memory = Memory::blank();
        for boot in 0..600 {
            assert!(write(&memory, &record(boot)) <= 21);
            for index in 0..FAULT_RECORDS {
                let expected = boot.checked_sub(u16::from(index)).map(record);
                assert_eq!(read(&mut memory.clone(), index), expected, "{boot} {index}");
            }
        }
        assert!((0..1024).all(|address| (160..320).contains(&address) || memory.writes.borrow()[address] == 0));
    }

    #[test]
    fn an_entry_cut_off_anywhere_leaves_the_others() {
        for cut in 0..=20 {
            let memory = Memory::blank();
            for boot in 0..11 {
                write(&memory, &record(boot));
            }
            let mut entry = Entry::new(&mut memory.clone(), &record(11));
            for _ in 0..cut {
                entry.step(&mut memory.clone());
            }
            let latest = read(&mut memory.clone(), 0).unwrap();
            assert!([record(10), record(11)].contains(&latest), "{cut}: {latest:?}");
            write(&memory, &record(12));
            assert_eq!(read(&mut memory.clone(), 0), Some(record(12)));
        }
    }

    #[test]
    fn a_broken_byte_does_not_hold_the_log_up() {
        let memory = Memory { stuck: Some(161), ..Memory::blank() };
        // Two writes for each byte of a slot.
        assert_eq!(write(&memory, &record(1)), 41);
        write(&memory, &record(2));
        write(&memory, &record(3));
        assert_eq!(read(&mut memory.clone(), 0).map(|entry| entry.boot), None, "all of them went to the broken slot");
    }
}
