//! The program's cost in flash, memory and time, printed as a table.

use crate::common::{Host, TICK, firmware};
use protocol::{Command, Fault, Settings};
use virtual_nano::BoardOptions;

/// Of 30,720 bytes beside the bootloader.
const FLASH: u64 = 29_200;
/// Of 2,048 bytes.
const RAM: u64 = 1_450;
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

/// Requests at a share of the line's 50,000 bytes a second, for two seconds while both motors turn.
fn flood(share: f64, request: Command) -> (Host, u64, u64) {
    let mut host = Host::ready(BoardOptions::default());
    host.set_speeds([90.0, -90.0]);
    host.run_linked_ms(500);
    host.board.marks_mut().clear();
    let (mut sent, mut owed) = (0, 0.0);
    let answered = host.replies();
    for _ in 0..2000 {
        owed += 50.0 * share;
        while owed >= 6.0 {
            host.send(request);
            sent += 1;
            owed -= 6.0;
        }
        host.run_ms(1);
    }
    host.run_ms(10);
    let answered = host.replies() - answered;
    (host, sent, answered)
}

#[test]
fn a_full_line_of_requests_takes_nothing_from_motors_and_telemetry() {
    println!("| line | requests | answered | worst tick, cycles | telemetry lost |");
    println!("| ---: | ---: | ---: | ---: | ---: |");
    let shares = [0.02, 0.2, 0.5, 1.0].map(|share| (share, Command::Ping));
    for (share, request) in shares.into_iter().chain([(0.01, Command::ReadSettings), (1.0, Command::ReadSettings)]) {
        let (host, sent, answered) = flood(share, request);
        let tick = host.board.marks().tick();
        let last = host.last();
        println!("| {:.0} % {request:?} | {sent} | {answered} | {} | {} |", 100.0 * share, tick.worst, last.unsent.0);
        assert_eq!((last.fault, last.missed_ticks.0, last.unsent.0), (Fault::None, 0, 0));
        // No host fills the line with requests for the longest answer: there a tick only has to end before the next one.
        let limit = if request == Command::Ping { WORST_TICK } else { TICK };
        assert!(tick.worst <= limit, "{} cycles", tick.worst);
        // What the processor has no time for is dropped; a host sends far less.
        assert!(answered > 0 && (answered == sent || share > 0.1), "{answered} of {sent}");
    }
}
