//! Writes the firmware image to the emulated board with avrdude, through Arduino's bootloaders.

use host::run::rig::{Image, VirtualNano};
use tests::{Bench, firmware, nano, program};

/// `standalone` flashes through the other bootloader, optiboot, at 115200 bit/s.
#[test]
fn flash_with_the_old_bootloader() {
    let bench = Bench::new();
    let image = firmware();
    let run = bench.run(["flash", "--virtual", "--firmware", image.to_str().unwrap(), "--json"]).expect_code(0);
    let flashed = run.json();
    println!("{flashed}");
    tests::golden::hold_keys("flash", &flashed);
    assert_eq!(flashed["baud"], 57_600);
    assert_eq!(flashed["firmware"], Image::read(&image).unwrap().commit);
    assert_eq!(flashed["protocol"], protocol::VERSION);
}

/// The chip of newer clones: avrdude first expects an ATmega328P, and writes to it once it is named.
#[test]
fn flash_of_an_atmega328pb() {
    let new = VirtualNano::start(&program("vnano"), ["--bootloader", "optiboot-328pb"]).unwrap();
    let image = firmware();
    let run = Bench::new().run(["flash", "--port", new.port(), "--firmware", image.to_str().unwrap()]).expect_code(0);
    assert!(run.stdout.contains("written at 115200 bit/s to m328pb"), "{run:?}");
}

/// While avrdude uses the port, another biflag must not open it, because that would reset the board.
#[test]
fn port_is_busy_during_flashing() {
    let bench = Bench::new();
    let nano = nano(["--speed", "max"]);
    let plan = bench.short_plan(1.0, [0.0, 0.0]);
    let claim = host::claim::Claim::take(nano.port()).unwrap();
    let image = firmware();
    for command in [
        ["flash", "--port", nano.port(), "--firmware", image.to_str().unwrap()],
        ["record", plan.to_str().unwrap(), "--port", nano.port(), "--json"],
    ] {
        let run = bench.run(command).expect_code(1);
        assert!(run.stderr.contains("is busy: another program has it open"), "{run:?}");
    }
    drop(claim);
    bench.run(["record", plan.to_str().unwrap(), "--port", nano.port()]).expect_code(0);
}
