//! `biflag new`, `biflag plan check` and `biflag record --dry-run`: what a plan will do, without a board.

use crate::program::{biflag, code, json};
use serde_json::Value;

fn texts(findings: &Value) -> Vec<&str> {
    findings.as_array().unwrap().iter().map(|finding| finding["text"].as_str().unwrap()).collect()
}

#[test]
fn new_writes_a_plan_that_the_others_read() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let new = biflag(folder, &["new", "--json"]);
    assert_eq!(code(&new), Some(0), "{new:?}");
    let new = json(&new);
    assert_eq!((&new["file"], &new["duration_s"]), (&"plan.toml".into(), &350.0.into()), "{new}");
    let check = json(&biflag(folder, &["plan", "check", "plan.toml", "--json"]));
    for key in ["name", "trials", "duration_s", "at_most_s", "findings"] {
        assert_eq!(new[key], check[key], "{key}");
    }
    assert_eq!(check["at_most_s"], 950.0, "two waits of 300 s");
    let dry = biflag(folder, &["record", "plan.toml", "--dry-run", "--json"]);
    assert_eq!((code(&dry), json(&dry)), (Some(0), check));
    let again = biflag(folder, &["new"]);
    assert_eq!(code(&again), Some(2));
    assert!(String::from_utf8_lossy(&again.stderr).contains("plan.toml exists already"), "{again:?}");
    let entries: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(entries, ["plan.toml"], "nothing else is written");
}

#[test]
fn plan_check_says_what_may_be_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let check = |text: &str| {
        std::fs::write(folder.path().join("p.toml"), text).unwrap();
        json(&biflag(folder.path(), &["plan", "check", "p.toml", "--json"]))
    };
    let long = "[trial]\nrun = 120\n[speeds]\npairs = [[47.3, -12.9], [0, 33.3]]";
    let found = check(long);
    assert_eq!(found["trials"][0]["name"], "001_w1+47.3_w2-12.9");
    let [sensor, angles] = texts(&found["findings"])[..] else { panic!("{found}") };
    assert!(sensor.contains("no sensor file") && angles.starts_with("2 of 2 trials, such as those at 47.3"));
    assert_eq!(texts(&check(&long.replace("120", "120\nphases = 2"))["findings"]).len(), 1, "they are turned to");
    let found = check(&long.replace("120", "11.5\ndecay = 2"));
    let [_, run, rest, _] = texts(&found["findings"])[..] else { panic!("{found}") };
    assert!(run.starts_with("a run has 12 s, and the robot takes 54 s"), "{run}");
    assert!(rest.starts_with("the plan has 27 s of rest"), "{rest}");
    assert_eq!(found["duration_s"], 2.0 * (5.0 + 20.0 + 11.5 + 2.0));
    let wrong = biflag(folder.path(), &["plan", "check", "groups"]);
    assert_eq!(code(&wrong), Some(2));
    assert!(String::from_utf8_lossy(&wrong.stderr).contains("run it with `biflag sweep`"), "{wrong:?}");
}

#[test]
fn record_takes_speeds_or_a_plan() {
    let folder = tempfile::tempdir().unwrap();
    let run = |args: &[&str]| biflag(folder.path(), args);
    let dry = json(&run(&["record", "--speeds=-37.25,12.9", "--run", "60.5", "--dry-run", "--json"]));
    assert_eq!(dry["trials"].as_array().unwrap().len(), 1);
    assert_eq!((&dry["trials"][0]["name"], &dry["duration_s"]), (&"001_w1-37.25_w2+12.9".into(), &115.5.into()));
    for wrong in [
        &["record", "--speeds", "50", "--dry-run"][..],
        &["record", "--speeds", "50,90.5", "--dry-run"],
        &["record", "demo", "--speeds", "50,10", "--dry-run"],
        &["record", "demo", "--run", "10", "--dry-run"],
        &["record", "--speeds", "50,10", "--run", "0", "--dry-run"],
        &["record", "--dry-run"],
    ] {
        assert_eq!(code(&run(wrong)), Some(2), "{wrong:?}");
    }
}

/// The reference of the book has every key that a plan may have: errors list them.
#[test]
fn the_book_has_every_key() {
    let page = include_str!("../book/src/plan.md");
    let folder = tempfile::tempdir().unwrap();
    let mut keys = Vec::new();
    for table in ["session", "trial", "trial.reverse", "trial.hand_turn", "speeds", "speeds.grid", "board"] {
        std::fs::write(folder.path().join("p.toml"), format!("[{table}]\nunknown = 1\n")).unwrap();
        let said = String::from_utf8(biflag(folder.path(), &["plan", "check", "p.toml"]).stderr).unwrap();
        let list = said.split("help: write ").nth(1).unwrap_or_else(|| panic!("{table}: {said}"));
        keys.extend(list.split('`').skip(1).step_by(2).map(str::to_owned));
    }
    assert!(keys.len() > 35, "{keys:?}");
    for key in keys {
        let is_there = [format!("`{key}`"), format!("{key} = ")].iter().any(|form| page.contains(form));
        assert!(is_there, "{key} is not in plan.md");
    }
}
