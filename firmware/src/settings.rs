//! The content of the EEPROM: the settings, the number of starts, and the fault log.
//!
//! | address | content |
//! | --- | --- |
//! | 0 | the settings, as a frame: the number of their layout, a 7, the [`Settings`] |
//! | 128 | eight counters of starts of two bytes, little-endian |
//! | 160 | the fault log ([`fault_log`]) |
//!
//! The frame has a CRC. A new field of the settings is added at their end, with a new number of the layout; settings of an
//! older layout get the default for the fields that they lack. Without a valid frame (a blank memory, a save cut off by
//! loss of power) the defaults apply.
//!
//! A byte of EEPROM endures 100,000 writes (ATmega328P, section 8.4). Saving writes only the bytes that differ. The count
//! of starts rotates over eight places; a write cut off by loss of power at worst makes it wrong.

use protocol::frame::{self, Accumulator, MAX_FRAME};
use protocol::{FaultRecord, Settings};

use crate::fault_log::{self, Entry};
use crate::storage::{Storage, write_first_difference};

const SETTINGS_ADDRESS: u16 = 0;
const COUNTS_ADDRESS: u16 = 128;
const COUNTS: u16 = 8;
/// A counter that was never written.
const BLANK: u16 = u16::MAX;

/// The layout of the settings, identified by the number in the memory.
const LAYOUT: u8 = 2;
/// The second byte of every stored frame. Firmware of protocol version 1 stored the settings as it received them, with the
/// number of the request and this number of the command.
const TAG: u8 = 7;
/// Length of the settings in layouts 1, 2.
const LENGTHS: [usize; LAYOUT as usize] = [49, 53];
const LENGTH: usize = LENGTHS[LAYOUT as usize - 1];

/// Writes of a save after which the memory counts as broken: every byte of a frame twice.
const MAX_WRITES: u8 = 2 * MAX_FRAME as u8;

/// The settings, the count of starts and the fault log in a storage.
pub struct Store<S> {
    storage: S,
    /// Writes of the save in progress.
    writes: Option<u8>,
    /// The entry of the fault log that is being written.
    entry: Option<Entry>,
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
        Self { storage, writes: None, entry: None }
    }

    /// Replaces `settings`, which are the defaults, by the saved ones; returns false if there are no valid ones.
    /// `accumulator` has room for the frame.
    #[inline(never)]
    pub fn load(&mut self, accumulator: &mut Accumulator, settings: &mut Settings) -> bool {
        for address in SETTINGS_ADDRESS..SETTINGS_ADDRESS + MAX_FRAME as u16 {
            if let Some(payload) = accumulator.push_for_payload(self.storage.read(address)) {
                return payload.ok().and_then(|payload| unpack(payload, settings)).is_some();
            }
        }
        // A blank memory has no end of a frame, and the accumulator is to be empty for the next user.
        let _ = accumulator.push_for_payload(0);
        false
    }

    /// Begins a save. A save in progress continues: the host repeats its request more often than a failing save takes.
    pub fn begin_save(&mut self) {
        self.writes.get_or_insert(0);
    }

    /// Adds a record to the fault log. A record that comes while one is being written is dropped.
    pub fn log_fault(&mut self, record: &FaultRecord) {
        if self.entry.is_none() {
            self.entry = Some(Entry::new(&mut self.storage, record));
        }
    }

    /// Returns an entry of the fault log; index 0 is the latest one.
    pub fn read_fault(&mut self, index: u8) -> Option<FaultRecord> {
        fault_log::read(&mut self.storage, index)
    }

    /// Advances by one tick, which writes at most one byte: of the fault log first, then of a save. A save finds the first
    /// byte that differs from `settings`, so it is complete only when all of it has been read back, and follows settings
    /// that change meanwhile.
    #[inline(never)]
    pub fn step(&mut self, settings: &Settings) -> Saving {
        if let Some(entry) = &mut self.entry {
            if entry.step(&mut self.storage) {
                return Saving::Busy;
            }
            self.entry = None;
        }
        let Some(writes) = self.writes else { return Saving::Idle };
        let mut buffer = [0; MAX_FRAME];
        let is_different = match frame::encode(&(LAYOUT, TAG, settings), &mut buffer) {
            Ok(wanted) => write_first_difference(&mut self.storage, SETTINGS_ADDRESS, wanted),
            Err(_) => true,
        };
        if is_different && writes < MAX_WRITES {
            self.writes = Some(writes + 1);
            return Saving::Busy;
        }
        self.writes = None;
        if is_different { Saving::Failed } else { Saving::Done }
    }

    /// Counts a start and returns the number of starts; stays at 65534.
    pub fn count_start(&mut self) -> u16 {
        let mut count = 0;
        for place in 0..COUNTS {
            let found = self.read_count(place);
            if found != BLANK && found % COUNTS == place {
                count = count.max(found);
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

    fn read_count(&mut self, place: u16) -> u16 {
        let address = address_of(place);
        u16::from_le_bytes([self.storage.read(address), self.storage.read(address + 1)])
    }

    fn change(&mut self, address: u16, byte: u8) {
        if self.storage.read(address) != byte {
            self.storage.write(address, byte);
        }
    }
}

/// Replaces `settings` by those in a stored frame's payload, or by the defaults if they are not valid.
#[inline(never)]
fn unpack(payload: &[u8], settings: &mut Settings) -> Option<()> {
    let (&[layout, TAG], stored) = payload.split_first_chunk()? else { return None };
    let length = *LENGTHS.get(usize::from(layout).checked_sub(1)?)?;
    let mut bytes = [0; LENGTH];
    postcard::to_slice(&Settings::DEFAULT, &mut bytes).ok()?;
    if stored.len() != length {
        return None;
    }
    bytes[..length].copy_from_slice(stored);
    *settings = postcard::from_bytes(&bytes).ok()?;
    if !settings.is_valid() {
        *settings = Settings::DEFAULT;
        return None;
    }
    Some(())
}

fn address_of(place: u16) -> u16 {
    COUNTS_ADDRESS + 2 * place
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::tests::Memory;
    use protocol::Fault;
    use protocol::units::{Micros, Millivolts};

    fn load(memory: &Memory) -> Option<Settings> {
        let mut settings = Settings::DEFAULT;
        Store::new(memory.clone()).load(&mut Accumulator::new(), &mut settings).then_some(settings)
    }

    fn save(memory: &Memory, settings: &Settings) -> (Saving, u32) {
        let mut store = Store::new(memory.clone());
        store.begin_save();
        (1..1000).map(|tick| (store.step(settings), tick)).find(|(saving, _)| *saving != Saving::Busy).unwrap()
    }

    fn other() -> Settings {
        Settings {
            board_id: 7,
            gyro_bias: [594.1, 6.2, 147.0],
            deadline_ms: 400,
            bandgap: Millivolts(1080),
            ..Settings::DEFAULT
        }
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
        assert!(ticks <= 64, "{ticks}");
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
        for cut in 0..64 {
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

    /// A frame of protocol version 1 with the settings of a robot, numbered 200 (the golden file of that version).
    const VERSION_1: &str = "05c807341201020303020403020404e014c40103c840010313430103803f010101010103803f0107a040148e16440101\
                             0105f401f3c100";

    #[test]
    fn settings_that_protocol_version_1_saved_are_read_and_saved_in_the_new_layout() {
        let mut accumulator = Accumulator::new();
        let bytes = (0..VERSION_1.len()).step_by(2).map(|at| u8::from_str_radix(&VERSION_1[at..at + 2], 16).unwrap());
        let frame =
            bytes.into_iter().find_map(|byte| accumulator.push_for_payload(byte).map(|frame| frame.unwrap().to_vec()));
        let mut payload = frame.unwrap();
        payload[0] = 1;
        let memory = with_frame(&payload);
        let stored = Settings { board_id: 0x1234, gyro_bias: [-595.5, 6.25, 147.0], ..Settings::DEFAULT };
        assert_eq!(load(&memory), Some(stored));
        save(&memory, &stored);
        assert_eq!(load(&memory), Some(stored));
        assert_eq!(memory.bytes.borrow()[1..3], [LAYOUT, TAG]);
    }

    fn with_frame(payload: &[u8]) -> Memory {
        let memory = Memory::blank();
        let mut buffer = [0; MAX_FRAME];
        buffer[1..=payload.len()].copy_from_slice(payload);
        let bytes = frame::seal(&mut buffer, payload.len()).unwrap();
        memory.bytes.borrow_mut()[..bytes.len()].copy_from_slice(bytes);
        memory
    }

    #[test]
    fn another_layout_and_values_out_of_range_are_not_loaded() {
        let payload = |layout: u8, tag: u8, settings: Settings| {
            postcard::to_slice(&(layout, tag, settings), &mut [0; 80]).unwrap().to_vec()
        };
        let unfit = Settings { deadline_ms: 1, ..Settings::DEFAULT };
        assert_eq!(load(&with_frame(&payload(LAYOUT, TAG, other()))), Some(other()));
        for payload in [
            payload(LAYOUT + 1, TAG, other()),
            payload(0, TAG, other()),
            payload(1, TAG, other()),
            payload(LAYOUT, TAG + 1, other()),
            payload(LAYOUT, TAG, unfit),
            vec![LAYOUT],
        ] {
            assert_eq!(load(&with_frame(&payload)), None, "{payload:?}");
        }
    }

    #[test]
    fn a_fault_is_logged_beside_a_save() {
        let memory = Memory::blank();
        let mut store = Store::new(memory.clone());
        let record = FaultRecord { boot: 3, time: Micros(4), fault: Fault::LinkLost, ..FaultRecord::default() };
        store.begin_save();
        store.step(&other());
        store.log_fault(&record);
        assert_eq!((1..1000).map(|_| store.step(&other())).find(|saving| *saving != Saving::Busy), Some(Saving::Done));
        assert_eq!(store.read_fault(0), Some(record));
        assert_eq!(store.read_fault(1), None);
        assert_eq!(load(&memory), Some(other()));
    }

    #[test]
    fn a_broken_byte_fails_the_save() {
        let memory = Memory { stuck: Some(11), ..Memory::blank() };
        let (saving, ticks) = save(&memory, &other());
        // Two writes for each byte of the longest frame.
        assert_eq!((saving, ticks), (Saving::Failed, 161));
    }

    #[test]
    fn a_broken_byte_fails_the_save_also_if_the_host_asks_again_and_again() {
        let memory = Memory { stuck: Some(11), ..Memory::blank() };
        let mut store = Store::new(memory);
        let outcome = (0..200).find_map(|tick| {
            if tick % 10 == 0 {
                store.begin_save();
            }
            Some(store.step(&other())).filter(|saving| *saving != Saving::Busy)
        });
        assert_eq!(outcome, Some(Saving::Failed));
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
