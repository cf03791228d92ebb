//! The program's cost in flash, memory and time, printed as a table.

mod common;

use common::{Host, TICK, firmware};
use protocol::{Command, Settings};
use virtual_nano::BoardOptions;

/// Of 30,720 bytes beside the bootloader.
const FLASH: u64 = 28_000;
/// Of 2,048 bytes.
const RAM: u64 = 1_400;
/// Of 80,000 cycles.
const WORST_TICK: u64 = 60_000;

#[test]
fn the_image_fits_with_room_to_spare() {
    let image = firmware();
    let mut host = Host::ready(BoardOptions::default());
    // Everything at once: both motors, full telemetry, a calibration before, settings saved meanwhile, a dense host.
    host.order(Command::CalibrateGyro { duration_ms: 500 });
    host.run_linked_ms(700);
    host.order(Command::WriteSettings(Settings { board_id: 5, ..Settings::DEFAULT }));
    host.set_speeds([90.0, -90.0]);
    host.run_linked_ms(1000);
    host.order(Command::SaveSettings);
    for _ in 0..200 {
        host.send(Command::ReadSettings);
        host.run_ms(7);
    }
    let tick = host.board.marks().tick();
    let (statics, stack) = (host.board.static_bytes().unwrap(), host.board.deepest_stack().unwrap());
    let ram = u64::from(statics + stack);
    let rows = [
        ("flash, bytes", image.flash_bytes() as u64, FLASH),
        ("static RAM and deepest stack, bytes", ram, RAM),
        ("worst tick, cycles", tick.worst, WORST_TICK),
    ];
    println!("| what | value | limit |");
    println!("| --- | ---: | ---: |");
    for (what, value, limit) in rows {
        println!("| {what} | {value} | {limit} |");
    }
    println!("(static RAM {statics}, stack {stack}, mean tick {} of {TICK} cycles)", tick.mean());
    for (what, value, limit) in rows {
        assert!(value <= limit, "{what}: {value} is more than {limit}");
    }
    assert!(tick.count > 500);
    assert_eq!(host.board.serial_overruns(), 0, "the program read bytes too late");
    assert_eq!(host.last().missed_ticks.0, 0);
}
