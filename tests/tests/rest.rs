//! Rest is measured: a plan without time to come to rest gives angles within their ± of the truth of the emulated robot.

use host::trial::{Judged, Want};
use serde_json::Value;
use std::path::Path;
use tests::Bench;

/// Speeds that nobody tuned for.
const PAIRS: &str = "[[67.3, 88.1], [-51.7, 83.9], [63.7, -41.3], [-52.9, 78.3], [12.7, 89.3], [88.9, 31.1], [44.9, 45.7], [-7.3, 71.9]]";

fn plan(bench: &Bench, trial: &str, pairs: &str) -> String {
    let text = format!(
        "[session]\nname = \"rest\"\n[board]\ndeadline_ms = 5000\n[trial]\n{trial}\n[speeds]\npairs = {pairs}\n"
    );
    bench.file("plan.toml", &text).to_str().unwrap().to_owned()
}

/// Returns the errors of yaw, pitch and roll against the truth in the log, and their stated uncertainties.
fn errors(log: &Path) -> [(f64, Option<f64>); 3] {
    let Judged { data, angles: zeroed, .. } = Judged::read(log, Want::default()).unwrap();
    let (steady, angles) = (zeroed.steady.as_ref().unwrap(), zeroed.angles().unwrap());
    let stated = [angles.yaw_uncertainty_deg, angles.pitch_uncertainty_deg, angles.roll_uncertainty_deg];
    std::array::from_fn(|k| {
        let truth = data.truth.track(k).mean(steady.window.clone()).unwrap();
        (steady.angles_deg[k] - truth, stated[k])
    })
}

/// Records a plan and returns the trials of its answer.
fn record(bench: &Bench, plan: &str, options: &[&str], code: i32) -> Vec<Value> {
    let mut arguments = vec!["record", plan, "--virtual", "--json"];
    arguments.extend(options);
    let run = bench.run(&arguments);
    println!("{}", run.stderr.trim_end());
    run.expect_code(code).json()["trials"].as_array().unwrap().clone()
}

/// Eight trials in a row, each with a rest of 3 s after the one before, with several sensors.
#[test]
#[ignore = "minutes: part of `make proof`"]
fn eight_trials_without_time_to_rest_are_within_their_uncertainty() {
    let mut outside = Vec::new();
    for trial in ["calibrate = 5\npreroll = 20\nrun = 40\ndecay = 3", "calibrate = 2\npreroll = 8\nrun = 40\ndecay = 0"]
    {
        for sensor in ["ideal", "typical"] {
            for seed in ["1", "2", "3"] {
                let bench = Bench::new();
                let plan = plan(&bench, trial, PAIRS);
                let trials = record(&bench, &plan, &["--sensor", sensor, "--seed", seed], 0);
                assert_eq!(trials.len(), 8);
                for trial in &trials {
                    let log = bench.path().join(trial["log"].as_str().unwrap());
                    let rows = errors(&log);
                    let shown = rows.map(|(error, stated)| format!("{error:+.3} ± {:.3}", stated.unwrap()));
                    println!("{sensor} {seed} {}: {}", trial["name"], shown.join(", "));
                    for (angle, (error, stated)) in ["yaw", "pitch", "roll"].iter().zip(rows) {
                        if error.abs() > stated.unwrap() {
                            outside.push(format!("{sensor} {seed} {} {angle}", trial["name"]));
                        }
                    }
                }
            }
        }
    }
    let count = 2 * 2 * 3 * 8 * 3;
    println!("{} of {count} outside: {outside:?}", outside.len());
    assert!(20 * outside.len() <= count, "more than one in twenty outside a 95 % interval: {outside:?}");
    assert!(!outside.iter().any(|text| text.starts_with("ideal") && text.ends_with("yaw")), "{outside:?}");
}

/// The same plan with the wait and without: the robot still swings from the trial before, its zero is none, and no ± may
/// claim to know it.
#[test]
fn a_trial_waits_until_the_robot_is_still() {
    let bench = Bench::new();
    // The first run is gentle, so that the board takes the motion after it for a bias.
    let phases = "calibrate = 2\npreroll = 8\nrun = 8\ndecay = 3";
    let pairs = "[[11.3, 7.9], [-51.7, 83.9]]";
    let trials = record(&bench, &plan(&bench, phases, pairs), &["--out", "waits"], 3);
    let graves = trials.iter().flat_map(|trial| trial["findings"].as_array().unwrap()).filter(|f| f["grave"] == true);
    assert!(graves.clone().all(|finding| finding["kind"] == "window"), "{trials:?}");
    let starts: Vec<f64> = trials.iter().map(|trial| trial["run_start_s"].as_f64().unwrap()).collect();
    println!("runs start at {starts:?} s");
    assert!(
        starts.iter().all(|start| *start > 16.0),
        "six seconds of wait, two of calibration, eight of pre-roll: {starts:?}"
    );
    for trial in &trials {
        let run_s = trial["run_end_s"].as_f64().unwrap() - trial["run_start_s"].as_f64().unwrap();
        assert!((run_s - 8.0).abs() < 0.02, "{trial}");
        let rows = errors(&bench.path().join(trial["log"].as_str().unwrap()));
        println!("{rows:?}");
        // Six intervals of 95 %: three standard deviations, so that the seed does not decide.
        assert!(rows.iter().all(|(error, stated)| error.abs() < 1.5 * stated.unwrap()), "{trial}");
    }

    let phases = format!("{phases}\nrest_at_most = 0");
    let trials = record(&bench, &plan(&bench, &phases, pairs), &["--out", "hurries"], 3);
    assert!(
        trials[0]["warnings"].as_array().unwrap().iter().all(|w| w.to_string().contains("not settled")),
        "{trials:?}"
    );
    let second = &trials[1];
    assert!(
        second["findings"].as_array().unwrap().iter().any(|f| f["kind"] == "rest" && f["grave"] == true),
        "{second}"
    );
    assert_eq!(second["yaw_uncertainty_deg"], Value::Null, "{second}");
    let log = second["log"].as_str().unwrap();
    let info = bench.run(["info", log]).expect_code(3).stdout;
    assert!(info.contains("was not still during the calibration") && !info.contains('±'), "{info}");
}
