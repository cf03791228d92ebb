//! All behaviours of the whole in one program: each program more would be linked with everything again, and tests that wait
//! for a board leave the processor to others.
//!
//! `cargo test --release -p tests --test all NAME` runs the tests whose path has NAME in it, such as one file's.

mod aim;
mod among_programs;
mod attitude_chain;
mod bad_input;
mod book;
mod busy_computer;
mod doctor;
mod drift;
mod emulated_sensor;
mod false_alarms;
mod findings;
mod flash;
mod golden;
mod hand_turns;
mod handshake;
mod hostile;
mod link;
mod live;
mod matrix;
mod one_number;
mod other_readers;
mod phase;
mod python;
mod real_time;
mod report;
mod rest;
mod resume;
mod sensor;
mod sensor_errors;
mod simulate;
mod slurm;
mod standalone;
mod steer;
mod sweep;
mod sweep_together;
mod truth;
mod twin;

/// A file that is no module of its program would be no test. `every_byte` is a program: it measures its own memory.
#[test]
fn every_file_is_a_module() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    for folder in ["sim/tests", "host/tests", "tests/tests"].map(|folder| root.join(folder)) {
        let mut files: Vec<_> = std::fs::read_dir(&folder)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .filter(|path| path.extension().is_none_or(|kind| kind == "rs"))
            .filter_map(|path| path.file_stem()?.to_str().map(str::to_owned))
            .filter(|name| name != "main" && name != "every_byte")
            .collect();
        files.sort();
        let program = std::fs::read_to_string(folder.join("main.rs")).unwrap();
        let modules = program.lines().filter_map(|line| line.strip_prefix("mod ")?.strip_suffix(';'));
        assert_eq!(files, modules.collect::<Vec<_>>(), "{}", folder.display());
    }
}
