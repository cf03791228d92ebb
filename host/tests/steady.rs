//! What `simulate` says of a steady state, whether it is solved for or is the end of a trial.

use crate::program::{biflag, expect, json};
use biflag_log::{Body, ModelMeta, Reader};

/// The steady state is that of the whole run, although the last sample at 1 Hz comes 0.9 s before its end.
#[test]
fn steady_state_does_not_depend_on_the_rate() {
    let folder = tempfile::tempdir().unwrap();
    let [one, twenty] = ["1", "20"].map(|rate| {
        let args = ["simulate", "--speeds=50,10", "--duration", "6.9", "--rate", rate, "--out", rate, "--json"];
        let output = biflag(folder.path(), &args);
        expect(&output, 3);
        let answer = json(&output);
        let info = json(&biflag(folder.path(), &["info", answer["trials"][0]["log"].as_str().unwrap(), "--json"]));
        ["yaw_deg", "pitch_deg", "roll_deg"].map(|angle| {
            assert_eq!(answer["trials"][0][angle], info["angles"][angle]);
            info["angles"][angle].as_f64().unwrap()
        })
    });
    for (one, twenty) in one.iter().zip(twenty) {
        assert!((one - twenty).abs() < 0.01, "{one} {twenty}");
    }
}

#[test]
fn steady_states_are_solved_for_and_their_logs_hold_one_period() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let args = ["simulate", "--speeds", "0,45", "--duration", "120"];
    let answer = |rest: &[&str]| {
        let output = biflag(folder, &[&args, rest].concat());
        expect(&output, 0);
        json(&output)["trials"][0].clone()
    };
    let solved = answer(&["--method", "steady", "--json", "--out", "solved"]);
    let whole = answer(&["--json", "--out", "whole"]);
    assert_eq!((&solved["kind"], &whole["kind"]), (&"steady".into(), &serde_json::Value::Null));
    for angle in ["yaw", "pitch", "roll"] {
        let [a, b] =
            [&solved, &whole].map(|trial| ["deg", "se_deg"].map(|of| trial[format!("{angle}_{of}")].as_f64().unwrap()));
        // Both within their ±.
        assert!((a[0] - b[0]).abs() <= 1.96 * (a[1] + b[1]), "{angle}: {a:?} {b:?}");
        for (trial, [_, error]) in [(&solved, a), (&whole, b)] {
            let info = json(&biflag(folder, &["info", trial["log"].as_str().unwrap(), "--json"]));
            assert_eq!(info["angles"][format!("{angle}_uncertainty_deg")], 2.0 * error, "{angle} in {info}");
        }
    }
    assert!(solved["simulated_s"].as_f64().unwrap() < 60.0, "{solved}");
    let mut reader = Reader::open(&folder.join(solved["log"].as_str().unwrap())).unwrap();
    let times: Vec<f64> = (reader.by_ref())
        .filter_map(|message| match message.unwrap().body {
            Body::Telemetry(frame) => Some(frame.time_s),
            _ => None,
        })
        .collect();
    let trial = reader.meta::<biflag_log::TrialMeta>().unwrap();
    assert_eq!((trial.calibrate_s, trial.preroll_s, trial.decay_s), (0.0, 0.0, 0.0));
    // Two turns at 45 rpm.
    assert!((trial.run_s - 8.0 / 3.0).abs() < 1e-9 && times[0].abs() < 1e-9, "{times:?}");
    assert!((times[times.len() - 1] - trial.run_s).abs() < 0.051, "{times:?}");
    assert_eq!(reader.meta::<ModelMeta>().unwrap().method, biflag_log::Method::Steady);

    let other = biflag(folder, &[args.as_slice(), &["--out", "solved", "--resume"]].concat());
    expect(&other, 2);
}

#[test]
fn the_log_of_a_motion_that_does_not_repeat_holds_its_last_window() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let args = ["simulate", "--speeds", "37,53", "--duration", "60", "--method", "steady", "--json", "--out", "window"];
    let output = biflag(folder, &args);
    expect(&output, 0);
    let solved = json(&output)["trials"][0].clone();
    assert_eq!(solved["kind"], "beating");
    let log = solved["log"].as_str().unwrap();
    let trial = biflag_log::last_meta::<biflag_log::TrialMeta>(&folder.join(log)).unwrap().unwrap();
    // The means are from more than the window.
    assert!(trial.run_s <= 12.0 && solved["window_s"].as_f64().unwrap() > 2.0 * trial.run_s, "{solved}");
    // Half of what the solver's own error allows where the flagella touch.
    assert!((0.0..0.08).contains(&solved["yaw_se_deg"].as_f64().unwrap()), "{solved}");
    let info = biflag(folder, &["info", log]);
    expect(&info, 0);
    let info = String::from_utf8_lossy(&info.stdout).into_owned();
    assert!(info.contains("beating") && !info.contains("settled"), "{info}");
}

#[test]
fn a_plan_asks_for_steady_states() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let plan = |trial: &str| {
        std::fs::write(folder.join("p.toml"), format!("[trial]\n{trial}\n[speeds]\npairs = [[0, 45]]\n")).unwrap();
    };
    plan("method = \"steady\"\nphases = 2");
    let output = biflag(folder, &["simulate", "p.toml", "--out", "phases", "--json"]);
    expect(&output, 0);
    let mean = &json(&output)["trials"][0];
    assert_eq!(mean["kind"], "steady");
    // Which way the flagellum that stands points leans the robot.
    assert!(mean["phase_spread_deg"][1].as_f64().unwrap() > 0.5, "{mean}");

    plan("method = \"steady\"\nreverse = { motor = 2, after = 35 }");
    expect(&biflag(folder, &["simulate", "p.toml", "--out", "reverse"]), 2);
    plan("method = \"quick\"");
    expect(&biflag(folder, &["simulate", "p.toml", "--out", "quick"]), 2);
}
