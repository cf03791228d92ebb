//! `biflag pack`: one archive with everything of a session, whose sums are right.

use crate::program::{biflag, code, json};
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;
use zip::ZipArchive;

const PLAN: &str = "[session]\nname = \"odd speeds\"\noperator = \"A. Operator\"\nnote = \"first | second\"\n[trial]\n\
                    calibrate = 0\npreroll = 0\nrun = 1.3\ndecay = 0\n[speeds]\npairs = [[-37.3, 12.9], [0.5, 0]]\n";

/// Simulates the plan into the folder `session`.
fn simulate(folder: &Path) {
    std::fs::write(folder.join("plan.toml"), PLAN).unwrap();
    let output = biflag(folder, &["simulate", "plan.toml", "--out", "session"]);
    assert_eq!(code(&output), Some(3), "not settled: {output:?}");
}

fn contents(archive: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut archive = ZipArchive::new(File::open(archive).unwrap()).unwrap();
    let mut contents = BTreeMap::new();
    for index in 0..archive.len() {
        let mut entry = archive.by_index(index).unwrap();
        let mut bytes = Vec::new();
        entry.read_to_end(&mut bytes).unwrap();
        let name = entry.name().unwrap().into_owned();
        assert!(contents.insert(name.clone(), bytes).is_none(), "{name} is there twice");
    }
    contents
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

#[test]
fn archive_has_all_files_and_their_sums() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    simulate(folder);
    std::fs::write(folder.join("session/notes 1 %.txt"), "glycerin from June").unwrap();
    std::fs::write(folder.join("secret"), "of someone else").unwrap();
    std::os::unix::fs::symlink(folder.join("secret"), folder.join("session/link.txt")).unwrap();
    std::fs::create_dir(folder.join("session/photos")).unwrap();
    let output = biflag(folder, &["pack", "session", "-o", "odd.zip", "--license", "CC-BY-4.0", "--json"]);
    // The run of 1.3 s does not settle.
    assert_eq!(code(&output), Some(3), "{output:?}");
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(answer["notes"], serde_json::json!(["left out, as no files: link.txt and photos"]));

    let contents = contents(&folder.join("odd.zip"));
    let names: Vec<_> = contents.keys().map(String::as_str).collect();
    let expected = [
        "README.md",
        "figures/001_w1-37.3_w2+12.9.svg",
        "figures/002_w1+0.5_w2+0.svg",
        "figures/map.svg",
        "manifest-sha256.txt",
        "plan.toml",
        "report.html",
        "ro-crate-metadata.json",
        "robot.toml",
        "session/001_w1-37.3_w2+12.9.mcap",
        "session/002_w1+0.5_w2+0.mcap",
        "session/notes 1 %.txt",
        "session/session.toml",
        "tables/001_w1-37.3_w2+12.9.csv",
        "tables/002_w1+0.5_w2+0.csv",
        "tables/budget.csv",
        "tables/trials.csv",
    ];
    assert_eq!(names, expected);
    assert_eq!(answer["entries"].as_array().unwrap().len(), expected.len());
    for (name, bytes) in contents.iter().filter_map(|(name, bytes)| Some((name.strip_prefix("session/")?, bytes))) {
        assert!(std::fs::read(folder.join("session").join(name)).unwrap() == *bytes, "{name}");
    }
    assert_eq!(text(&contents["plan.toml"]), PLAN);
    toml::from_str::<sim::params::Robot>(text(&contents["robot.toml"])).unwrap();

    let sums: BTreeMap<_, _> = text(&contents["manifest-sha256.txt"])
        .lines()
        .map(|line| line.split_once("  ").map(|(sum, name)| (name, sum)).unwrap())
        .collect();
    assert_eq!(sums.len(), expected.len() - 2, "all but itself and the metadata");
    let digest =
        |name: &str| -> String { Sha256::digest(&contents[name]).iter().map(|byte| format!("{byte:02x}")).collect() };
    for (name, sum) in &sums {
        assert_eq!(digest(name), *sum, "{name}");
    }

    let metadata: Value = serde_json::from_slice(&contents["ro-crate-metadata.json"]).unwrap();
    let graph = metadata["@graph"].as_array().unwrap();
    let entity = |id: &str| graph.iter().find(|entity| entity["@id"] == id).unwrap_or_else(|| panic!("{id}"));
    assert_eq!(entity("./")["license"]["@id"], "https://spdx.org/licenses/CC-BY-4.0");
    assert_eq!(entity("#author")["name"], "A. Operator", "of the plan");
    assert_eq!(entity("session/notes%201%20%25.txt")["contentSize"], "18");
    let parts = entity("./")["hasPart"].as_array().unwrap();
    assert_eq!(parts.len(), expected.len() - 1, "all but the metadata");
    for part in parts {
        let file = entity(part["@id"].as_str().unwrap());
        let name = file["name"].as_str().unwrap();
        assert_eq!(file["sha256"], digest(name), "{file}");
        assert_eq!(file["contentSize"], contents[name].len().to_string(), "{file}");
    }

    let readme = text(&contents["README.md"]);
    assert!(readme.contains("| 001_w1-37.3_w2+12.9 | "), "{readme}");
    assert!(readme.contains("not settled |\n| 002_w1+0.5_w2+0 |"), "{readme}");
}

/// What leaves the computer says what is not in it, as `info` does.
#[test]
fn a_trial_without_a_log_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    simulate(folder);
    let commands = [&["report", "session"][..], &["export", "session", "--force"], &["pack", "session"]];
    let grave = |args: &[&str]| -> (Option<i32>, Vec<String>) {
        let output = biflag(folder, &[args, &["--json"]].concat());
        let found = json(&output)["findings"].as_array().unwrap().clone();
        // Both trials are too short to settle.
        let others = found.iter().filter(|one| one["grave"] == true && one["kind"] != "window");
        let grave = others.map(|one| one["text"].to_string()).collect();
        (code(&output), grave)
    };
    for args in commands {
        assert_eq!(grave(args).1, [""; 0], "{args:?}");
    }
    std::fs::remove_file(folder.join("session/002_w1+0.5_w2+0.mcap")).unwrap();
    std::fs::remove_file(folder.join("session.zip")).unwrap();
    for args in commands {
        let (code, grave) = grave(args);
        assert_eq!(code, Some(3), "{args:?}");
        assert_eq!(grave, ["\"1 of 2 trials has no log: 002_w1+0.5_w2+0\""], "{args:?}");
    }
    let (logs, findings) = host::twin::logs(&folder.join("session")).unwrap();
    assert_eq!((logs.len(), findings.len()), (1, 1), "of a fit");
}

#[test]
fn nothing_is_replaced_and_no_half_session_is_packed() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    simulate(folder);
    let pack = |args: &[&str]| biflag(folder, &[&["pack", "session"], args].concat());
    std::fs::write(folder.join("mine.zip"), "mine").unwrap();
    for (out, why) in [("mine.zip", "already exists"), ("session/in.zip", "is in the folder that is packed")] {
        let output = pack(&["-o", out]);
        assert_eq!(code(&output), Some(2), "{output:?}");
        assert!(String::from_utf8_lossy(&output.stderr).contains(why), "{output:?}");
    }
    assert_eq!(std::fs::read_to_string(folder.join("mine.zip")).unwrap(), "mine");
    for license in ["see my page", "foo"] {
        assert_eq!(code(&pack(&["--license", license])), Some(2));
    }
    assert_eq!(code(&biflag(folder, &["pack", "plan.toml"])), Some(2));

    let manifest = File::options().read(true).write(true).open(folder.join("session/session.toml")).unwrap();
    manifest.lock().unwrap();
    let output = pack(&[]);
    assert_eq!(code(&output), Some(1), "{output:?}");
    assert!(String::from_utf8_lossy(&output.stderr).contains("another biflag is writing"), "{output:?}");
    drop(manifest);

    // A damaged log is packed as it is, and what is missing in its table is said.
    let log = folder.join("session/001_w1-37.3_w2+12.9.mcap");
    let bytes = std::fs::read(&log).unwrap();
    std::fs::write(&log, &bytes[..bytes.len() / 2]).unwrap();
    let output = pack(&["--json"]);
    assert_eq!(code(&output), Some(3), "{output:?}");
    let notes = serde_json::from_slice::<Value>(&output.stdout).unwrap()["notes"].to_string();
    assert!(notes.contains("cut off or damaged") && notes.contains("no licence is stated"), "{notes}");
    let contents = contents(&folder.join("session.zip"));
    assert_eq!(contents["session/001_w1-37.3_w2+12.9.mcap"].len(), bytes.len() / 2);
    assert!(text(&contents["README.md"]).contains("| 001_w1-37.3_w2+12.9 | | | | not complete |"));
    let left: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(left.len(), 4, "no draft is left: {left:?}");
}
