//! Puts the firmware image into the program. It is the last crate to be built, so that the image may be built meanwhile.

use std::path::PathBuf;
use std::{env, fs};

/// The image without symbols, which `firmware/build.sh` leaves here.
const IMAGE: &str = "../target/firmware.stripped.elf";

fn main() {
    // Without an image, cargo runs this script in each build, and finds the image as soon as there is one.
    for path in ["build.rs", IMAGE] {
        println!("cargo::rerun-if-changed={path}");
    }
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    // A computer without the AVR toolchain has no image; the program is built without one.
    fs::write(out.join("firmware.elf"), fs::read(IMAGE).unwrap_or_default()).expect("OUT_DIR can be written");
}
