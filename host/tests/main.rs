//! All behaviours of the host in one program: each program more would be linked with everything again.
//!
//! `cargo test -p host --test all NAME` runs the tests whose path has NAME in it, such as one file's.

mod aim;
mod calibration;
mod commands;
mod drift;
mod figure;
mod format1;
mod handshake;
mod hostile_logs;
mod plan;
mod plans;
mod resistance;
mod simulate;
mod sweep;
mod twin;

/// A file that is no module here would be no test.
#[test]
fn every_file_is_a_module() {
    let mut files: Vec<_> = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/tests"))
        .unwrap()
        .filter_map(|entry| entry.unwrap().path().file_stem()?.to_str().map(str::to_owned))
        .filter(|name| name != "main")
        .collect();
    files.sort();
    let modules = include_str!("main.rs").lines().filter_map(|line| line.strip_prefix("mod ")?.strip_suffix(';'));
    assert_eq!(files, modules.collect::<Vec<_>>());
}
