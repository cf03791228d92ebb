//! All behaviours of the simulator in one program: each program more would be linked with everything again.
//!
//! `cargo test -p sim --test all NAME` runs the tests whose path has NAME in it, such as one file's.

mod bundling;
mod common;
mod contact;
mod elastic;
mod fluid;
mod groups;
mod hard_cases;
mod head;
mod helices;
mod params;
mod peer;
mod periodic;
mod phase;
mod published;
mod resistance;
mod robot;
mod rod;
mod spin;
mod surroundings;
mod tank;
mod walls;

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
