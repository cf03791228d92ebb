//! The content of the EEPROM: the settings, the number of starts, and the fault log.
//!
//! | address | content |
//! | --- | --- |
//! | 0 | settings of older firmware, as a frame: the number of their layout, a 7, the [`Settings`] |
//! | 128 | eight counters of starts of two bytes, little-endian |
//! | 160 | the fault log ([`fault_log`](crate::fault_log)) |
//! | 320, 384 | two slots of the settings: save n is in slot n modulo 2; n wraps at 256 |
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
//! starts rotates over eight places. A counter that is not one more than the one in the place before it is that of a write
//! cut off by loss of power, and does not count.

use protocol::frame::Accumulator;
use protocol::{FaultRecord, Settings};

use crate::fault_log::FaultLog;
use crate::storage::{Storage, add_crc, first_difference, read_checked, write_first_difference};

const OLD_ADDRESS: u16 = 0;
const COUNTS_ADDRESS: u16 = 128;
const COUNTS: u16 = 8;
const SLOTS_ADDRESS: u16 = 320;
const SLOT: usize = 64;
/// A counter, or a byte, that was never written.
const BLANK: u16 = u16::MAX;
const BLANK_BYTE: u8 = u8::MAX;

/// The layout of the settings, identified by the number in the memory.
const LAYOUT: u8 = 2;
/// Length of the settings in this layout.
const LENGTH: usize = 53;
/// The second byte of a frame of older firmware. That of protocol version 1 stored the settings as it received them, with
/// the number of the request and this number of the command.
const OLD_TAG: u8 = 7;

/// Writes of a save after which the memory counts as broken: every byte twice.
const MAX_WRITES: u8 = 2 * SLOT as u8;

/// The settings, the count of starts and the fault log in a storage.
pub struct Store<S> {
    storage: S,
    /// The number of the last save.
    saved: Option<u8>,
    /// Steps of the save in progress.
    steps: Option<u8>,
    fault_log: FaultLog,
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
        Self { storage, saved: None, steps: None, fault_log: FaultLog::default() }
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
        for address in OLD_ADDRESS..COUNTS_ADDRESS {
            if let Some(payload) = accumulator.push_for_payload(self.storage.read(address)) {
                return match payload {
                    Ok([layout, OLD_TAG, stored @ ..]) => unpack(*layout, stored, settings),
                    _ => false,
                };
            }
        }
        // A blank memory has no end of a frame, and the accumulator is to be empty for the next user.
        let _ = accumulator.push_for_payload(0);
        false
    }

    /// Begins a save. A save in progress continues: the host repeats its request more often than a failing save takes.
    pub fn begin_save(&mut self) {
        self.steps.get_or_insert(0);
    }

    /// Adds a record to the fault log.
    pub fn log_fault(&mut self, record: &FaultRecord) {
        self.fault_log.add(record);
    }

    /// Returns an entry of the fault log; index 0 is the latest one.
    pub fn read_fault(&mut self, index: u8) -> Option<FaultRecord> {
        self.fault_log.read(&mut self.storage, index)
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
        // The first step looks whether these settings are saved already.
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
    match postcard::from_bytes::<Settings>(&bytes) {
        Ok(read) if found == length && read.is_valid() => *settings = read,
        _ => return false,
    }
    true
}

fn slot_address(number: u8) -> u16 {
    SLOTS_ADDRESS + u16::from(number % 2) * SLOT as u16
}

fn count_address(place: u16) -> u16 {
    COUNTS_ADDRESS + 2 * place
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::tests::{End, Memory};
    use protocol::Fault;
    use protocol::frame::{self, MAX_FRAME};
    use protocol::units::{AccelRange, Axis, AxisMap, GyroRange, Micros, Millivolts};

    fn load(memory: &Memory) -> Option<Settings> {
        let mut settings = Settings::DEFAULT;
        let is_stored = Store::new(memory.clone()).load(&mut Accumulator::new(), &mut settings);
        assert!(is_stored || settings == Settings::DEFAULT, "what is not valid is in force: {settings:?}");
        is_stored.then_some(settings)
    }

    /// Returns a store that has loaded the content of the memory.
    fn open(memory: &Memory) -> Store<Memory> {
        let mut store = Store::new(memory.clone());
        store.load(&mut Accumulator::new(), &mut Settings::DEFAULT.clone());
        store
    }

    fn save(memory: &Memory, settings: &Settings) -> (Saving, u32) {
        let mut store = open(memory);
        store.begin_save();
        (1..1000).map(|tick| (store.step(settings), tick)).find(|(saving, _)| *saving != Saving::Busy).unwrap()
    }

    fn old() -> Settings {
        Settings {
            board_id: 7,
            gyro_bias: [594.1, 6.2, 147.0],
            deadline_ms: 400,
            bandgap: Millivolts(1010),
            ..Settings::DEFAULT
        }
    }

    /// Settings of which every byte differs from those of `old`.
    fn new() -> Settings {
        let settings = Settings {
            board_id: 0x4711,
            gyro_range: GyroRange::Dps1000,
            accel_range: AccelRange::G8,
            low_pass: 5,
            gyro_axes: AxisMap([Axis::MinusY, Axis::PlusX, Axis::MinusZ]),
            accel_axes: AxisMap([Axis::PlusY, Axis::MinusX, Axis::MinusZ]),
            gyro_bias: [0xC107_0203, 0x4122_2324, 0xC233_3435].map(f32::from_bits),
            attitude_kp: f32::from_bits(0x4001_0203),
            attitude_ki: f32::from_bits(0x3E01_0203),
            speed_kp: f32::from_bits(0x4101_0203),
            speed_ki: f32::from_bits(0x4131_3233),
            counts_per_turn: f32::from_bits(0x4532_3334),
            motor_reversed: [true; 2],
            encoder_reversed: [true; 2],
            deadline_ms: 0x0203,
            moving_duty: [31, 32],
            bandgap: Millivolts(0x0401),
        };
        let mut bytes = [[0; LENGTH]; 2];
        postcard::to_slice(&old(), &mut bytes[0]).unwrap();
        postcard::to_slice(&settings, &mut bytes[1]).unwrap();
        let same: Vec<_> = (0..LENGTH).filter(|at| bytes[0][*at] == bytes[1][*at]).collect();
        assert!(same.is_empty() && settings.is_valid(), "bytes that do not change: {same:?}");
        settings
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
        let (saving, ticks) = save(&memory, &old());
        assert_eq!(saving, Saving::Done);
        assert!(ticks <= 64, "{ticks}");
        assert_eq!(load(&memory), Some(old()));
        assert!(memory.writes.borrow().iter().all(|writes| *writes <= 1));
        assert_eq!(save(&memory, &old()), (Saving::Done, 1), "nothing differs, so nothing is written");
        assert!(memory.writes.borrow().iter().all(|writes| *writes <= 1));
        assert_eq!(open(&memory).step(&old()), Saving::Idle);
    }

    #[test]
    fn the_newest_of_many_saves_is_loaded() {
        let memory = Memory::blank();
        let kept = &mut open(&memory);
        for board_id in 0..600 {
            let settings = Settings { board_id, ..old() };
            if board_id % 3 == 0 {
                save(&memory, &settings);
                *kept = open(&memory);
            } else {
                kept.begin_save();
                assert!((0..100).any(|_| kept.step(&settings) == Saving::Done));
            }
            assert_eq!(load(&memory), Some(settings));
        }
    }

    #[test]
    fn a_damaged_bit_gives_the_save_before_or_the_defaults() {
        let memory = Memory::blank();
        let each_damaged = |from: usize, expected| {
            for bit in 8 * from..8 * (from + SLOT) {
                memory.bytes.borrow_mut()[bit / 8] ^= 1 << (bit % 8);
                assert_eq!(load(&memory), expected, "bit {bit}");
                memory.bytes.borrow_mut()[bit / 8] ^= 1 << (bit % 8);
            }
        };
        save(&memory, &old());
        each_damaged(320, None);
        save(&memory, &new());
        each_damaged(384, Some(old()));
    }

    #[test]
    fn power_that_ends_at_any_write_of_a_save_leaves_the_old_settings_or_the_new_ones() {
        for (saves, end) in End::ALL.into_iter().flat_map(|end| [0, 1, 2, 255, 256].map(|saves| (saves, end))) {
            let memory = Memory::blank();
            memory.bytes.borrow_mut()[320..448].fill(0x5A);
            for board_id in 0..saves {
                save(&memory, &Settings { board_id, ..Settings::DEFAULT });
            }
            save(&memory, &old());
            let before = *memory.bytes.borrow();
            let mut writes = 0;
            loop {
                *memory.bytes.borrow_mut() = before;
                let (saving, _) = save(&memory.cut_after(writes, end), &new());
                let loaded = load(&memory);
                assert!([Some(old()), Some(new())].contains(&loaded), "{saves} {writes} {end:?}: {loaded:?}");
                // The board can save after that.
                let next = Settings { board_id: 99, ..new() };
                assert_eq!((save(&memory, &next).0, load(&memory)), (Saving::Done, Some(next)));
                if saving == Saving::Done {
                    break;
                }
                writes += 1;
            }
            assert!(writes > LENGTH as u32, "{writes} writes");
        }
    }

    /// A frame of protocol version 1 with the settings of a robot, numbered 200 (the golden file of that version).
    const VERSION_1: &str = "05c807341201020303020403020404e014c40103c840010313430103803f010101010103803f0107a040148e16440101\
                             0105f401f3c100";
    /// The same of protocol version 2.
    const VERSION_2: &str = "05c807341201020303020403020404e014c40103c840010313430103803f010101010103803f0107a040148e16440101\
                             0109f40164644c04b8da00";

    /// A memory in which older firmware has saved the settings of a frame of its protocol.
    fn with_old(frame: &str, layout: u8) -> Memory {
        let mut accumulator = Accumulator::new();
        let bytes = (0..frame.len()).step_by(2).map(|at| u8::from_str_radix(&frame[at..at + 2], 16).unwrap());
        let payload =
            bytes.into_iter().find_map(|byte| accumulator.push_for_payload(byte).map(|frame| frame.unwrap().to_vec()));
        let mut payload = payload.unwrap();
        payload[0] = layout;
        with_frame(&payload)
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
    fn settings_that_older_firmware_saved_are_in_force_until_the_first_save() {
        // Those of version 1 have no duty that moves a motor, and no bandgap.
        for (frame, layout) in [(VERSION_1, 1), (VERSION_2, 2)] {
            let stored = Settings { board_id: 0x1234, gyro_bias: [-595.5, 6.25, 147.0], ..Settings::DEFAULT };
            for (writes, end) in (0..70).flat_map(|writes| End::ALL.map(|end| (writes, end))) {
                let memory = with_old(frame, layout);
                assert_eq!(load(&memory), Some(stored));
                save(&memory.cut_after(writes, end), &new());
                let loaded = load(&memory);
                assert!([Some(stored), Some(new())].contains(&loaded), "{writes} {end:?}: {loaded:?}");
            }
            let memory = with_old(frame, layout);
            save(&memory, &new());
            // Without the slots nothing is left, and least of all what was in force long ago.
            memory.bytes.borrow_mut()[320..].fill(0xFF);
            assert_eq!(load(&memory), None);
        }
    }

    #[test]
    fn another_layout_and_values_out_of_range_are_not_loaded() {
        let payload = |layout: u8, tag: u8, settings: Settings| {
            postcard::to_slice(&(layout, tag, settings), &mut [0; 80]).unwrap().to_vec()
        };
        let unfit = Settings { deadline_ms: 1, ..Settings::DEFAULT };
        assert_eq!(load(&with_frame(&payload(LAYOUT, OLD_TAG, old()))), Some(old()));
        for payload in [
            payload(LAYOUT + 1, OLD_TAG, old()),
            payload(0, OLD_TAG, old()),
            payload(LAYOUT, OLD_TAG + 1, old()),
            payload(LAYOUT, OLD_TAG, unfit),
            payload(LAYOUT, OLD_TAG, old())[..2 + LENGTH - 1].to_vec(),
            vec![LAYOUT],
        ] {
            assert_eq!(load(&with_frame(&payload)), None, "{payload:?}");
        }
        // Nor in the newest slot, and the settings before those are not in force again either.
        for (layout, settings, expected) in
            [(LAYOUT, old(), Some(old())), (LAYOUT + 1, old(), None), (0, old(), None), (LAYOUT, unfit, None)]
        {
            let memory = Memory::blank();
            save(&memory, &new());
            save(&memory, &settings);
            memory.bytes.borrow_mut()[385] = layout;
            add_crc(&mut memory.bytes.borrow_mut()[384..384 + SLOT]);
            assert_eq!(load(&memory), expected, "{layout}");
        }
    }

    #[test]
    fn a_fault_is_logged_beside_a_save() {
        let memory = Memory::blank();
        let mut store = open(&memory);
        let record = FaultRecord { boot: 3, time: Micros(4), fault: Fault::LinkLost, ..FaultRecord::default() };
        store.begin_save();
        store.step(&old());
        store.log_fault(&record);
        assert_eq!((1..1000).map(|_| store.step(&old())).find(|saving| *saving != Saving::Busy), Some(Saving::Done));
        assert_eq!(store.read_fault(0), Some(record));
        assert_eq!(store.read_fault(1), None);
        assert_eq!(load(&memory), Some(old()));
    }

    #[test]
    fn a_broken_byte_fails_the_save_and_leaves_the_settings_before_it() {
        let memory = Memory { stuck: Some(395), ..Memory::blank() };
        assert_eq!(save(&memory, &old()).0, Saving::Done);
        // A look at what is saved, then two writes for each byte of a slot.
        assert_eq!(save(&memory, &new()), (Saving::Failed, 2 * SLOT as u32 + 2));
        assert_eq!(load(&memory), Some(old()));
    }

    #[test]
    fn a_broken_byte_fails_the_save_also_if_the_host_asks_again_and_again() {
        let memory = Memory { stuck: Some(331), ..Memory::blank() };
        let mut store = open(&memory);
        let outcome = (0..200).find_map(|tick| {
            if tick % 10 == 0 {
                store.begin_save();
            }
            Some(store.step(&old())).filter(|saving| *saving != Saving::Busy)
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
        memory.bytes.borrow_mut()[138..142].copy_from_slice(&[0xFD, 0xFF, 0xFE, 0xFF]);
        assert_eq!(Store::new(memory.clone()).count_start(), 0xFFFE);
        assert_eq!(Store::new(memory).count_start(), 0xFFFE);
    }

    #[test]
    fn power_that_ends_at_any_write_of_a_start_makes_it_count_or_not() {
        for starts in (0..40).chain(250..260).chain(510..520).chain(65_528..65_532) {
            for (writes, end) in [0, 1].into_iter().flat_map(|writes| End::ALL.map(|end| (writes, end))) {
                let memory = Memory::blank();
                for count in u16::max(starts, 8) - 7..=starts {
                    let place = 128 + 2 * usize::from(count % 8);
                    memory.bytes.borrow_mut()[place..place + 2].copy_from_slice(&count.to_le_bytes());
                }
                Store::new(memory.cut_after(writes, end)).count_start();
                let next = Store::new(memory).count_start();
                assert!([starts + 1, starts + 2].contains(&next), "{next} after {starts}, {writes} {end:?}");
            }
        }
    }
}
