//! Compiles the shim and links simavr.

fn main() {
    println!("cargo:rerun-if-changed=shim");
    cc::Build::new()
        .files(["shim/nano.c", "shim/pins.c", "shim/twi.c", "shim/uart.c"])
        .opt_level(2)
        .flag("-Wno-unused-parameter")
        .warnings_into_errors(false)
        .compile("nano");
    println!("cargo:rustc-link-lib=dylib=simavr");
}
