//! Loss of power at every byte that the program writes to its EEPROM, between two bytes and within the write of one.

#[path = "../../../../firmware/src/settings/tests/two.rs"]
mod two;

use super::row;
use crate::common::{Host, MS, TICK};
use protocol::units::CentiRpm;
use protocol::{Command, FAULT_RECORDS, Fault, FaultRecord, Info, Reply, Settings};
use two::{new, old};
use virtual_nano::BoardOptions;

/// A third of a tick. A byte is written in each tick and takes 3.4 ms, so that one of three cuts is in the half that erases
/// it, one in the half that writes it, and one between two bytes.
const STEP: u64 = TICK / 3;

/// A board with this content of its EEPROM that has just got power.
fn with(eeprom: &[u8]) -> Host {
    let mut host = Host::new(BoardOptions::default());
    host.board.mcu.eeprom_mut().copy_from_slice(eeprom);
    host
}

fn settings(host: &mut Host) -> (Info, Settings) {
    let info = host.hello();
    let Reply::Settings(settings) = host.ask(Command::ReadSettings) else { panic!("no settings") };
    (info, settings)
}

fn save(host: &mut Host, settings: Settings) {
    host.hello();
    host.order(Command::WriteSettings(settings));
    host.order(Command::SaveSettings);
}

/// Cuts the power so many cycles from now, and gives it back.
fn cut(host: &mut Host, cycles: u64) {
    host.run_until(host.board.cycle() + cycles);
    host.cut();
    host.inject("brown-out=1");
    host.run_ms(2);
}

#[test]
fn settings_survive_a_cut_at_any_time_of_a_save_that_changes_all_bytes() {
    let mut host = Host::new(BoardOptions::default());
    save(&mut host, old());
    // Twice, so that no byte to write is blank.
    for board_id in [8, 7] {
        save(&mut host, Settings { board_id, ..old() });
    }
    let eeprom = host.board.mcu.eeprom_mut().to_vec();
    let [mut kept, mut saved, mut cuts] = [0; 3];
    while saved < 3 {
        let mut host = with(&eeprom);
        host.hello();
        host.order(Command::WriteSettings(new()));
        host.send(Command::SaveSettings);
        cut(&mut host, cuts * STEP);
        match settings(&mut host) {
            (Info { settings_stored: true, .. }, found) if found == old() => kept += 1,
            (Info { settings_stored: true, .. }, found) if found == new() => saved += 1,
            other => panic!("cut {:.1} ms after the order: {other:?}", (cuts * STEP) as f64 / MS as f64),
        }
        // The board can save after that.
        if cuts % 16 == 0 {
            save(&mut host, Settings { board_id: 99, ..new() });
            host.reset();
            assert_eq!(settings(&mut host).1.board_id, 99);
        }
        cuts += 1;
        assert!(cuts < 400, "never saved");
    }
    row(
        format!("power cut while settings are saved, {cuts} times"),
        format!("{kept} times the old, {saved} the new"),
        "one of them",
    );
    assert!(kept > 150, "{kept}");
}

#[test]
fn a_cut_in_the_count_of_a_start_makes_it_count_or_not() {
    // The last byte of the second counter changes at 256.
    for starts in [1u16, 7, 255, 256, 40_000] {
        let mut eeprom = [0xFF; 1024];
        for count in starts.max(8) - 7..=starts {
            let place = 128 + 2 * usize::from(count % 8);
            eeprom[place..place + 2].copy_from_slice(&count.to_le_bytes());
        }
        let mut counts = vec![];
        // Two bytes, before which the program does not wait.
        for step in 0..12 {
            let mut host = with(&eeprom);
            cut(&mut host, step * MS);
            let count = host.hello().boot_count;
            assert!([starts + 1, starts + 2].contains(&count), "{count} after {starts} and a cut at {step} ms");
            host.reset();
            assert_eq!(host.hello().boot_count, count + 1);
            counts.push(count);
        }
        counts.dedup();
        assert_eq!(counts, [starts + 1, starts + 2]);
        row(
            format!("power cut in the first 12 ms after {starts} starts, 12 times"),
            format!("then {counts:?}"),
            "one of them",
        );
    }
}

/// Turns the motors and is silent for longer than the board allows; it then begins to log the fault.
fn lose_link(host: &mut Host) {
    host.order(Command::WriteSettings(Settings { deadline_ms: 50, ..Settings::DEFAULT }));
    host.order(Command::SetSpeeds([CentiRpm(3000); 2]));
    // They turn from the next tick on.
    host.run_ms(10);
    while !host.board.rig().bridge.pwm.iter().all(|duty| *duty == 0) {
        host.run_ms(1);
    }
}

fn fault_log(host: &mut Host) -> Vec<FaultRecord> {
    let record = |index| match host.ask(Command::ReadFault { index }) {
        Reply::FaultRecord(record) => record,
        other => panic!("{other:?}"),
    };
    (0..FAULT_RECORDS).map(record).collect()
}

#[test]
fn a_cut_in_the_writing_of_a_fault_leaves_the_log_of_the_others() {
    let mut host = Host::new(BoardOptions::default());
    host.hello();
    // More than the log has room for.
    for _ in 0..FAULT_RECORDS + 3 {
        lose_link(&mut host);
        host.run_ms(150);
        host.order(Command::ClearFault);
    }
    let before = fault_log(&mut host);
    assert!(before.iter().all(|record| record.fault == Fault::LinkLost), "{before:?}");
    let eeprom = host.board.mcu.eeprom_mut().to_vec();
    let [mut instead, mut logged, mut cuts] = [0; 3];
    while logged < 3 {
        let mut host = with(&eeprom);
        host.hello();
        lose_link(&mut host);
        cut(&mut host, cuts * STEP);
        host.hello();
        host.run_ms(150);
        let after = fault_log(&mut host);
        let has_hang = (after[0].fault, after[0].boot) == (Fault::Hang, 3);
        let after = &after[usize::from(has_hang)..];
        let has_fault = (after[0].fault, after[0].boot) == (Fault::LinkLost, 2);
        assert!(has_hang || has_fault, "cut {cuts} leaves no trace: {after:?}");
        let older = &after[usize::from(has_fault)..];
        assert_eq!(older, &before[..older.len()], "cut {cuts}");
        logged += u64::from(has_fault);
        instead += u64::from(!has_fault);
        cuts += 1;
        assert!(cuts < 150, "never logged");
    }
    row(
        format!("power cut while the fault that ended a run is logged, {cuts} times"),
        format!("{logged} times with it, {instead} with Hang instead, those before it kept"),
        "one of them, those before it",
    );
}

/// A plug that bounces: the second reset comes while the first one is being logged, which takes 0.1 s.
#[test]
fn a_reset_in_a_run_is_logged_though_another_one_follows() {
    let apart_ms = [0, 13, 29, 57, 96];
    for ms in apart_ms {
        let mut host = Host::ready(BoardOptions::default());
        host.set_speeds([50.5, -20.25]);
        host.run_linked_ms(100);
        cut(&mut host, 0);
        cut(&mut host, ms * MS);
        host.hello();
        host.stream();
        host.run_ms(150);
        assert_eq!((host.fault(), fault_log(&mut host)[0].fault), (Fault::Hang, Fault::Hang), "{ms} ms");
        // Once, and it is over.
        host.reset();
        host.hello();
        host.stream();
        host.run_ms(150);
        let faults = fault_log(&mut host).iter().filter(|record| record.fault != Fault::None).count();
        assert_eq!((host.fault(), faults), (Fault::None, 1), "{ms} ms");
    }
    row(
        format!("a second reset {apart_ms:?} ms after one in a run"),
        "Hang latched and logged once",
        "latched, logged",
    );
}
