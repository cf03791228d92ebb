//! What the program costs: flash, memory, time. Printed as a table.

mod common;

use common::{Host, TICK, TICK_BUDGET, firmware};
use protocol::{Command, Settings};
use virtual_nano::Options;

#[test]
fn the_image_fits_with_room_to_spare() {
    let image = firmware();
    let mut host = Host::ready(Options::default());
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
    println!("| what | value | limit |");
    println!("| --- | ---: | ---: |");
    println!("| flash, bytes | {} | 20480 |", image.flash_bytes());
    println!("| static RAM, bytes | {statics} | |");
    println!("| deepest stack, bytes | {stack} | |");
    println!("| RAM together, bytes | {} | 1024 |", statics + stack);
    println!("| mean tick, cycles of {TICK} | {} | |", tick.mean());
    println!("| worst tick, cycles | {} | {TICK_BUDGET} |", tick.worst);
    assert!(image.flash_bytes() <= 20 * 1024);
    assert!(statics + stack <= 1024);
    assert!(tick.count > 500 && tick.worst <= TICK_BUDGET);
    assert_eq!(host.board.serial_overruns(), 0, "the program read bytes too late");
    assert_eq!(host.last().missed_ticks.0, 0);
}
