//! The content of the EEPROM: the settings and the number of starts.
//!
//! | address | content |
//! | --- | --- |
//! | 0 | the settings, as the frame of a request [`Command::WriteSettings`] with the number [`VERSION`] |
//! | 128 | eight counters of starts of two bytes, little-endian |
//!
//! The frame has a CRC, and a change of layout comes with another version. Without a valid frame of this version (a blank
//! memory, a save cut off by loss of power) the defaults apply.
//!
//! A byte of EEPROM endures 100,000 writes (ATmega328P, section 8.4). Saving writes only the bytes that differ. The count
//! of starts rotates over eight places; a write cut off by loss of power at worst makes it wrong.

use protocol::frame::MAX_FRAME;
use protocol::units::Micros;
use protocol::{Command, Request, Settings, VERSION};

use crate::link::Link;
use crate::wire::Writer;

const SETTINGS_ADDRESS: u16 = 0;
const COUNTS_ADDRESS: u16 = 128;
const COUNTS: u16 = 8;
/// A counter that was never written.
const BLANK: u16 = u16::MAX;

/// Writes of a save after which the memory counts as broken: every byte of a frame twice.
const MAX_WRITES: u8 = 2 * MAX_FRAME as u8;

/// A non-volatile memory of bytes.
pub trait Storage {
    /// Reads the byte at `address`, after waiting for the end of a write.
    fn read(&mut self, address: u16) -> u8;

    /// Begins to write a byte, after waiting for the end of the write before. A write takes less than a tick.
    fn write(&mut self, address: u16, byte: u8);
}

/// The settings and the count of starts in a storage.
pub struct Store<S> {
    storage: S,
    /// Writes of the save in progress.
    writes: Option<u8>,
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
    /// Returns a store on `storage`.
    pub fn new(storage: S) -> Self {
        Self { storage, writes: None }
    }

    /// Returns the saved settings, or `None` if there are no valid ones. `link` reads them as if the host had sent them.
    #[inline(never)]
    pub fn load(&mut self, link: &mut Link) -> Option<Settings> {
        let bytes = SETTINGS_ADDRESS..SETTINGS_ADDRESS + MAX_FRAME as u16;
        let frame = bytes.map(|address| self.storage.read(address)).find_map(|byte| link.receive(byte, Micros(0)));
        match frame {
            Some(Request { seq: VERSION, command: Command::WriteSettings(saved) }) if saved.is_valid() => Some(saved),
            _ => None,
        }
    }

    /// Begins a save.
    pub fn begin_save(&mut self) {
        self.writes = Some(0);
    }

    /// Advances a save by one tick: finds the first byte that differs from `settings`, and writes it. So a save is complete
    /// only when all of it has been read back, and follows settings that change meanwhile.
    #[inline(never)]
    pub fn step(&mut self, settings: &Settings) -> Saving {
        let Some(writes) = self.writes else { return Saving::Idle };
        let mut writer = Writer::default();
        writer.write_settings(VERSION, settings);
        let wanted = writer.finish();
        let difference = (SETTINGS_ADDRESS..).zip(wanted).find(|(address, byte)| self.storage.read(*address) != **byte);
        let outcome = match difference {
            None => Saving::Done,
            Some(_) if writes >= MAX_WRITES => Saving::Failed,
            Some((address, byte)) => {
                self.storage.write(address, *byte);
                self.writes = Some(writes + 1);
                return Saving::Busy;
            }
        };
        self.writes = None;
        outcome
    }

    /// Counts a start and returns the number of starts; stays at 65534.
    #[inline(never)]
    pub fn count_start(&mut self) -> u16 {
        let mut count = 0;
        for place in 0..COUNTS {
            let found = self.read_count(place);
            if found != BLANK && found % COUNTS == place && found > count {
                count = found;
            }
        }
        if count < BLANK - 1 {
            count += 1;
        }
        let [low, high] = count.to_le_bytes();
        let address = address_of(count % COUNTS);
        self.change(address, low);
        self.change(address + 1, high);
        count
    }

    #[inline(never)]
    fn read_count(&mut self, place: u16) -> u16 {
        let address = address_of(place);
        u16::from_le_bytes([self.storage.read(address), self.storage.read(address + 1)])
    }

    #[inline(never)]
    fn change(&mut self, address: u16, byte: u8) {
        if self.storage.read(address) != byte {
            self.storage.write(address, byte);
        }
    }
}

fn address_of(place: u16) -> u16 {
    COUNTS_ADDRESS + 2 * place
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use protocol::frame;
    use std::cell::RefCell;
    use std::rc::Rc;

    /// A memory that counts the writes of each byte; the byte at `stuck` cannot be written.
    #[derive(Clone)]
    pub(crate) struct Memory {
        pub(crate) bytes: Rc<RefCell<[u8; 1024]>>,
        writes: Rc<RefCell<[u32; 1024]>>,
        stuck: Option<u16>,
    }

    impl Memory {
        pub(crate) fn blank() -> Self {
            Self { bytes: Rc::new(RefCell::new([0xFF; 1024])), writes: Rc::new(RefCell::new([0; 1024])), stuck: None }
        }
    }

    impl Storage for Memory {
        fn read(&mut self, address: u16) -> u8 {
            self.bytes.borrow()[usize::from(address)]
        }

        fn write(&mut self, address: u16, byte: u8) {
            self.writes.borrow_mut()[usize::from(address)] += 1;
            if self.stuck != Some(address) {
                self.bytes.borrow_mut()[usize::from(address)] = byte;
            }
        }
    }

    fn load(memory: &Memory) -> Option<Settings> {
        Store::new(memory.clone()).load(&mut Link::new())
    }

    fn save(memory: &Memory, settings: &Settings) -> (Saving, u32) {
        let mut store = Store::new(memory.clone());
        store.begin_save();
        (1..).map(|tick| (store.step(settings), tick)).find(|(saving, _)| *saving != Saving::Busy).unwrap()
    }

    fn other() -> Settings {
        Settings { board_id: 7, gyro_bias: [594.1, 6.2, 147.0], deadline_ms: 400, ..Settings::DEFAULT }
    }

    #[test]
    fn a_blank_memory_gives_no_settings() {
        assert_eq!(load(&Memory::blank()), None);
        let zero = Memory::blank();
        zero.bytes.borrow_mut().fill(0);
        assert_eq!(load(&zero), None);
    }

    #[test]
    fn a_save_writes_one_byte_per_tick_and_none_twice() {
        let memory = Memory::blank();
        let (saving, ticks) = save(&memory, &other());
        assert_eq!(saving, Saving::Done);
        assert!(ticks <= 60, "{ticks}");
        assert_eq!(load(&memory), Some(other()));
        assert!(memory.writes.borrow().iter().all(|writes| *writes <= 1));
        assert_eq!(save(&memory, &other()), (Saving::Done, 1), "nothing differs, so nothing is written");
        assert_eq!(Store::new(memory).step(&other()), Saving::Idle);
    }

    #[test]
    fn every_damaged_bit_gives_the_defaults() {
        let memory = Memory::blank();
        save(&memory, &other());
        let length = memory.bytes.borrow().iter().position(|byte| *byte == 0).unwrap();
        for bit in 0..8 * length {
            memory.bytes.borrow_mut()[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(load(&memory), None, "bit {bit}");
            memory.bytes.borrow_mut()[bit / 8] ^= 1 << (bit % 8);
        }
    }

    #[test]
    fn a_save_cut_off_anywhere_leaves_valid_settings_or_none() {
        for cut in 0..60 {
            let memory = Memory::blank();
            save(&memory, &other());
            let mut store = Store::new(memory.clone());
            store.begin_save();
            for _ in 0..cut {
                store.step(&Settings::DEFAULT);
            }
            let loaded = load(&memory);
            assert!([None, Some(other()), Some(Settings::DEFAULT)].contains(&loaded), "{loaded:?}");
        }
    }

    #[test]
    fn another_version_and_values_out_of_range_are_not_loaded() {
        let unfit = Settings { deadline_ms: 1, ..Settings::DEFAULT };
        for request in [
            Request { seq: VERSION + 1, command: Command::WriteSettings(Settings::DEFAULT) },
            Request { seq: VERSION, command: Command::WriteSettings(unfit) },
            Request { seq: VERSION, command: Command::Stop },
        ] {
            let memory = Memory::blank();
            let mut buffer = [0; MAX_FRAME];
            let bytes = frame::encode(&request, &mut buffer).unwrap();
            memory.bytes.borrow_mut()[..bytes.len()].copy_from_slice(bytes);
            assert_eq!(load(&memory), None);
        }
    }

    #[test]
    fn a_broken_byte_fails_the_save() {
        let memory = Memory { stuck: Some(11), ..Memory::blank() };
        let (saving, ticks) = save(&memory, &other());
        assert_eq!(saving, Saving::Failed);
        assert!(ticks < 200);
    }

    #[test]
    fn starts_are_counted_with_the_wear_spread_and_stop_at_the_top() {
        let memory = Memory::blank();
        for start in 1..=2000 {
            assert_eq!(Store::new(memory.clone()).count_start(), start);
        }
        assert!(memory.writes.borrow()[128..144].iter().all(|writes| *writes <= 250));
        assert!(memory.writes.borrow()[..128].iter().all(|writes| *writes == 0));
        memory.bytes.borrow_mut()[128..144].fill(0xFF);
        memory.bytes.borrow_mut()[140..142].copy_from_slice(&0xFFFEu16.to_le_bytes());
        assert_eq!(Store::new(memory.clone()).count_start(), 0xFFFE);
        assert_eq!(Store::new(memory).count_start(), 0xFFFE);
    }

    #[test]
    fn a_counter_cut_off_by_loss_of_power_is_ignored() {
        let memory = Memory::blank();
        for _ in 0..20 {
            Store::new(memory.clone()).count_start();
        }
        // The write of count 20 (place 4) was cut off.
        memory.bytes.borrow_mut()[136..138].copy_from_slice(&[0xFF, 0xFF]);
        assert_eq!(Store::new(memory).count_start(), 20);
    }
}
