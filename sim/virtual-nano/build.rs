//! Compiles the shim and links simavr.

use std::path::Path;

fn main() {
    println!("cargo:rerun-if-changed=shim");
    cc::Build::new()
        .files(
            ["nano", "chain", "pins", "twi", "uart", "watchdog", "eeprom", "supply"]
                .map(|name| format!("shim/{name}.c")),
        )
        .opt_level(2)
        .flag("-Wno-unused-parameter")
        .warnings_into_errors(false)
        .compile("nano");
    // As a static library, so that the program also runs where simavr is not installed.
    let archive = cc::Build::new().get_compiler().to_command().arg("-print-file-name=libsimavr.a").output();
    let archive = archive.expect("a C compiler").stdout;
    let folder = Path::new(std::str::from_utf8(&archive).expect("a path").trim()).parent().expect("a folder");
    println!("cargo:rustc-link-search=native={}", folder.display());
    println!("cargo:rustc-link-lib=static=simavr");
    println!("cargo:rustc-link-lib=dylib=m");
}
