mod two;

use super::*;
use crate::storage::tests::{End, Memory};
use protocol::frame::{self, MAX_FRAME};
use protocol::units::Micros;
use protocol::{Bridge, Fault, SpeedFrom};
use two::{new, old};

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

/// Returns a memory in which older firmware has saved the settings of a frame of its protocol.
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
    // Settings of version 1 have no duty that moves a motor, and no bandgap.
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
        // Without the slots no settings are left: older ones do not come into force again.
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
    // The same holds for the newest slot, and the settings before those do not come into force again either.
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

/// Whatever bytes follow those of an older layout.
#[test]
fn older_layouts_are_read_as_encoders_and_an_enable() {
    let Settings { bridge, speed_from, moving_duty, bandgap, .. } = Settings::DEFAULT;
    assert_eq!((bridge, speed_from), (Bridge::Enable, SpeedFrom::Encoders));
    let two = Settings { bridge, speed_from, ..new() };
    for (layout, expected) in [(1, Settings { moving_duty, bandgap, ..two }), (2, two), (LAYOUT, new())] {
        let memory = Memory::blank();
        save(&memory, &new());
        memory.bytes.borrow_mut()[321] = layout;
        add_crc(&mut memory.bytes.borrow_mut()[320..320 + SLOT]);
        assert_eq!(load(&memory), Some(expected), "{layout}");
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
fn the_note_is_beside_all_else() {
    let memory = Memory::blank();
    save(&memory, &old());
    save(&memory, &new());
    let mut store = open(&memory);
    assert_eq!((store.count_start(), store.read_note(36)), (1, u32::MAX));
    (0..40).for_each(|index| store.write_note(index, 3 * index));
    let mut store = open(&memory);
    for index in 0..37 {
        assert_eq!(store.read_note(index), u32::from_le_bytes([0, 1, 2, 3].map(|i| 3 * (index + i))));
    }
    assert_eq!((load(&memory), store.count_start()), (Some(new()), 2));
    assert_eq!(store.read_fault(0), None);
}

#[test]
fn a_broken_byte_fails_the_save_and_leaves_the_settings_before_it() {
    let memory = Memory { stuck: Some(395), ..Memory::blank() };
    assert_eq!(save(&memory, &old()).0, Saving::Done);
    // A check of the saved settings, then two writes for each byte of a slot.
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
