//! Settings live in EEPROM: through a reset, and through damage.

use crate::common::Host;
use protocol::{Command, Reply, ResetCause, Settings};
use virtual_nano::BoardOptions;

fn settings(host: &mut Host) -> Settings {
    match host.ask(Command::ReadSettings) {
        Reply::Settings(settings) => settings,
        other => panic!("{other:?}"),
    }
}

fn saved() -> (Host, Settings) {
    let mut host = Host::ready(BoardOptions::default());
    let other = Settings { board_id: 7, deadline_ms: 333, speed_kp: 1.25, ..Settings::DEFAULT };
    host.order(Command::WriteSettings(other));
    host.order(Command::SaveSettings);
    (host, other)
}

#[test]
fn saved_settings_survive_a_reset_and_unsaved_ones_do_not() {
    let mut host = Host::ready(BoardOptions::default());
    let info = host.hello();
    assert_eq!((info.settings_stored, info.reset_cause, info.boot_count), (false, ResetCause::PowerOn, 1));
    host.order(Command::WriteSettings(Settings { board_id: 9, ..Settings::DEFAULT }));
    host.reset();
    host.hello();
    assert_eq!(settings(&mut host), Settings::DEFAULT);

    let (mut host, other) = saved();
    host.order(Command::WriteSettings(Settings { board_id: 9, ..other }));
    host.reset();
    let info = host.hello();
    assert_eq!((info.settings_stored, info.reset_cause), (true, ResetCause::External));
    assert_eq!((info.boot_count, info.board_id), (2, 7));
    assert_eq!(settings(&mut host), other);
}

#[test]
fn damaged_settings_give_the_defaults() {
    // In the slot of the first save.
    for damage in [320, 325, 350] {
        let (mut host, _) = saved();
        host.board.mcu.eeprom_mut()[damage] ^= 0x04;
        host.reset();
        assert!(!host.hello().settings_stored);
        assert_eq!(settings(&mut host), Settings::DEFAULT, "byte {damage} damaged");
    }
}
