//! The real avrdude writes the real image into the emulated board through Arduino's own bootloaders.

use host::rig::{Image, VirtualNano};
use tests::{Bench, firmware, program};

fn flash_through(bootloader: &str, baud: u64) {
    let bench = Bench::new();
    let nano = VirtualNano::start(&program("vnano"), ["--bootloader", bootloader]).unwrap();
    let image = firmware();
    let run =
        bench.run(["flash", "--port", nano.port(), "--firmware", image.to_str().unwrap(), "--json"]).expect_code(0);
    let flashed = run.json();
    println!("{flashed}");
    assert_eq!(flashed["baud"], baud);
    assert_eq!(flashed["firmware"], Image::read(&image).unwrap().commit());
    assert_eq!(flashed["protocol"], protocol::VERSION);
}

#[test]
fn through_optiboot() {
    flash_through("optiboot", 115_200);
}

#[test]
fn through_the_old_bootloader() {
    flash_through("old", 57_600);
}
