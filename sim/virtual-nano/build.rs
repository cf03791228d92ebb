//! Compiles the shim and links simavr.

fn main() {
    println!("cargo:rerun-if-changed=shim");
    cc::Build::new()
        .files(["nano", "pins", "twi", "uart", "watchdog", "eeprom", "supply"].map(|name| format!("shim/{name}.c")))
        .opt_level(2)
        .flag("-Wno-unused-parameter")
        .warnings_into_errors(false)
        .compile("nano");
    println!("cargo:rustc-link-lib=dylib=simavr");
    println!("cargo:rustc-link-lib=dylib=m");
}
