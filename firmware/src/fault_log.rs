//! The fault log: the last faults in EEPROM, including those before the host opened the port, which resets the board.
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

use protocol::{FAULT_RECORDS, FaultRecord};

use crate::storage::{Storage, add_crc, read_checked, write_first_difference};

const ADDRESS: u16 = 160;
const SLOT: usize = 20;

/// Writes of an entry after which the memory counts as broken: every byte twice.
const MAX_WRITES: u8 = 2 * SLOT as u8;

/// The log in a storage, which is passed to each of its functions.
#[derive(Debug, Default)]
pub struct FaultLog {
    /// The number of the latest entry. Kept, because finding it reads all of the log, which takes most of a tick.
    latest: Option<u8>,
    writing: Option<Entry>,
    /// A record that came during the write.
    waiting: Option<FaultRecord>,
}

/// An entry that is being written.
#[derive(Debug)]
struct Entry {
    slot: [u8; SLOT],
    writes: u8,
}

impl FaultLog {
    /// Finds the latest entry in `storage`: the one without a successor.
    #[inline(never)]
    pub fn open(&mut self, storage: &mut impl Storage) {
        self.latest = (0..FAULT_RECORDS).find_map(|place| {
            let number = storage.read(address_of(place));
            valid_slot(storage, number)?;
            valid_slot(storage, number.wrapping_add(1)).is_none().then_some(number)
        });
    }

    /// Adds a record, which [`FaultLog::step`] writes. A third one within the time of a write replaces the second.
    #[inline(never)]
    pub fn add(&mut self, record: &FaultRecord) {
        if self.writing.is_some() {
            self.waiting = Some(*record);
            return;
        }
        let mut slot = [0; SLOT];
        slot[0] = self.latest.map_or(0, |number| number.wrapping_add(1));
        // The record has a fixed length, which leaves room for the CRC.
        postcard::to_slice(record, &mut slot[1..SLOT - 2]).ok();
        add_crc(&mut slot);
        self.writing = Some(Entry { slot, writes: 0 });
    }

    /// Returns whether a record is being written.
    pub fn is_writing(&self) -> bool {
        self.writing.is_some()
    }

    /// Writes one byte; returns false when there is none to write.
    #[inline(never)]
    pub fn step(&mut self, storage: &mut impl Storage) -> bool {
        let Some(Entry { slot, writes }) = &mut self.writing else { return false };
        *writes += 1;
        if *writes <= MAX_WRITES && write_first_difference(storage, address_of(slot[0]), slot) {
            return true;
        }
        // The next entry skips a slot that does not keep its content.
        self.latest = Some(slot[0]);
        self.writing = None;
        if let Some(record) = self.waiting.take() {
            self.add(&record);
        }
        self.writing.is_some()
    }

    /// Returns an entry of the log; index 0 is the latest one.
    #[inline(never)]
    pub fn read(&self, storage: &mut impl Storage, index: u8) -> Option<FaultRecord> {
        let slot = valid_slot(storage, self.latest?.wrapping_sub(index))?;
        FaultRecord::read(&slot[1..SLOT - 2])
    }
}

/// Returns the slot of entry `number` if it holds this entry, undamaged.
#[inline(never)]
fn valid_slot(storage: &mut impl Storage, number: u8) -> Option<[u8; SLOT]> {
    let mut slot = [0; SLOT];
    (read_checked(storage, address_of(number), &mut slot) && slot[0] == number).then_some(slot)
}

fn address_of(number: u8) -> u16 {
    ADDRESS + u16::from(number % FAULT_RECORDS) * SLOT as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::tests::{End, Memory};
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

    /// Returns a log that has just been opened.
    fn open(memory: &Memory) -> FaultLog {
        let mut log = FaultLog::default();
        log.open(&mut memory.clone());
        log
    }

    fn read(memory: &Memory, index: u8) -> Option<FaultRecord> {
        open(memory).read(&mut memory.clone(), index)
    }

    /// Writes the records of the log that wait; returns the steps that it took.
    fn write_out(log: &mut FaultLog, memory: &Memory) -> u32 {
        (1..1000).find(|_| !log.step(&mut memory.clone())).unwrap()
    }

    fn write(memory: &Memory, record: &FaultRecord) -> u32 {
        let mut log = open(memory);
        log.add(record);
        write_out(&mut log, memory)
    }

    #[test]
    fn a_blank_memory_and_a_zeroed_one_have_no_entries() {
        let memory = Memory::blank();
        assert_eq!(read(&memory, 0), None);
        memory.bytes.borrow_mut().fill(0);
        assert_eq!(read(&memory, 0), None);
    }

    #[test]
    fn the_latest_entries_are_read_in_order_over_many_wraps() {
        let memory = Memory::blank();
        let mut kept = open(&memory);
        for boot in 0..600 {
            kept.add(&record(boot));
            assert!(write_out(&mut kept, &memory) <= 21);
            let opened = open(&memory);
            for index in 0..FAULT_RECORDS {
                let expected = boot.checked_sub(u16::from(index)).map(record);
                for log in [&kept, &opened] {
                    assert_eq!(log.read(&mut memory.clone(), index), expected, "{boot} {index}");
                }
            }
        }
        assert!((0..1024).all(|address| (160..320).contains(&address) || memory.writes.borrow()[address] == 0));
    }

    #[test]
    fn power_that_ends_at_any_write_of_an_entry_leaves_the_others() {
        for end in End::ALL {
            for writes in 0..=20 {
                let memory = Memory::blank();
                for boot in 0..11 {
                    write(&memory, &record(boot));
                }
                write(&memory.cut_after(writes, end), &record(11));
                let latest = read(&memory, 0).unwrap().boot;
                assert!([10, 11].contains(&latest), "{writes} {end:?}: {latest}");
                for index in 0..FAULT_RECORDS - 1 {
                    let boot = latest - u16::from(index);
                    assert_eq!(read(&memory, index), Some(record(boot)), "{writes} {end:?} {index}");
                }
                write(&memory, &record(12));
                assert_eq!(read(&memory, 0), Some(record(12)));
            }
        }
    }

    #[test]
    fn a_record_that_comes_during_a_write_follows_it() {
        let memory = Memory::blank();
        let mut log = open(&memory);
        log.add(&record(1));
        log.step(&mut memory.clone());
        log.add(&record(2));
        assert_eq!(log.read(&mut memory.clone(), 0), None, "neither is written");
        write_out(&mut log, &memory);
        assert_eq!([0, 1, 2].map(|index| read(&memory, index)), [Some(record(2)), Some(record(1)), None]);
    }

    #[test]
    fn a_broken_byte_costs_its_own_entry_only() {
        let memory = Memory { stuck: Some(161), ..Memory::blank() };
        let mut log = open(&memory);
        log.add(&record(1));
        // Two writes for each byte of a slot.
        assert_eq!(write_out(&mut log, &memory), 41);
        log.add(&record(2));
        write_out(&mut log, &memory);
        let boots = |log: &FaultLog| [0, 1].map(|index| log.read(&mut memory.clone(), index).map(|entry| entry.boot));
        assert_eq!(boots(&log), [Some(2), None]);
        assert_eq!(boots(&open(&memory)), [Some(2), None]);
    }
}
