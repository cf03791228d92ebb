//! End-to-end tests of `simulate`: output, files and exit codes.

use crate::program::{biflag, expect, json};
use biflag_log::schema::biflag::event::Kind;
use biflag_log::{Body, Condition, ModelMeta, Origin, Reader};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

/// Four short trials, whose runs are too short to settle.
const PLAN: &str = "[session]\nname = \"short\"\n[trial]\ncalibrate = 0.5\npreroll = 0.5\nrun = 2\ndecay = 0.5\n\
                    [speeds]\npairs = [[50, 10], [0, 45], [-90, 90], [60, 60]]\n";

fn bench() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("plan.toml"), PLAN).unwrap();
    folder
}

/// Returns the bytes of every log of a session.
fn logs(session: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(session).unwrap().map(|entry| entry.unwrap().path());
    entries
        .filter(|path| path.file_name().unwrap() != "session.toml")
        .map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), std::fs::read(&path).unwrap()))
        .collect()
}

#[test]
fn plan_gives_logs_like_those_of_the_rig() {
    let bench = bench();
    let output = biflag(bench.path(), &["simulate", "plan.toml", "--json"]);
    expect(&output, 3);
    let answer = json(&output);
    assert_eq!(answer["session"], "short");
    assert!(answer["real_time_factor"].as_f64().unwrap() > 1.0);
    let first = &answer["trials"][0];
    for key in [
        "name",
        "w1_rpm",
        "w2_rpm",
        "log",
        "yaw_deg",
        "pitch_deg",
        "roll_deg",
        "settled",
        "settle_s",
        "force1_n",
        "force2_n",
        "axial_torque_nm",
        "min_gap_m",
        "max_penetration_m",
        "sweeps",
        "wall_s",
        "simulated_s",
        "bundling",
    ] {
        assert!(!first[key].is_null(), "{key} of {first}");
    }
    assert_eq!((&first["name"], &first["settled"]), (&"001_w1+50_w2+10".into(), &false.into()));
    assert_eq!((&first["simulated_s"], &first["bundling"]), (&3.5.into(), &"apart".into()));
    assert_eq!(first["force1_n"].as_array().unwrap().len(), 3);
    assert!(first["force1_n"][2].as_f64().unwrap() > 1e-3, "a right-handed helix pushes up: {first}");

    let mut reader = Reader::open(&bench.path().join(first["log"].as_str().unwrap())).unwrap();
    let (mut frames, mut truths, mut forces, mut phases) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for message in reader.by_ref() {
        let message = message.unwrap();
        match message.body {
            Body::Telemetry(frame) => frames.push(frame),
            Body::Truth(truth) => truths.push(truth),
            Body::Forces(force) => forces.push(force),
            Body::Event(event) if event.kind() == Kind::Phase => {
                phases.push((event.text, message.log_time_ns as f64 * 1e-9));
            }
            _ => {}
        }
    }
    assert_eq!(reader.condition(), Some(Condition::Clean));
    assert_eq!(reader.meta::<biflag_log::Identity>().unwrap().origin, Origin::Model);
    assert_eq!(reader.meta::<ModelMeta>().unwrap().robot(), Some(sim::params::Robot::default()));
    let phases: Vec<_> = phases.iter().map(|(name, time)| (name.as_str(), *time)).collect();
    assert_eq!(phases, [("calibrate", 0.0), ("preroll", 0.5), ("run", 1.0), ("decay", 3.0), ("end", 3.5)]);
    assert_eq!((frames.len(), truths.len(), forces.len()), (71, 71, 71));
    for (frame, truth) in frames.iter().zip(&truths) {
        assert!((frame.time_s - truth.time_s).abs() < 1e-9);
        assert!((frame.yaw_deg - truth.yaw_deg).abs() < 0.005 && (frame.pitch_deg - truth.pitch_deg).abs() < 0.005);
        let motor = frame.motor1.as_ref().unwrap();
        assert!((motor.turns - truth.motor1_turns).abs() < 1e-3 && (motor.speed_rpm - truth.motor1_rpm).abs() < 0.0051);
        assert_eq!(motor.target_rpm, if (1.0..3.0).contains(&frame.time_s) { 50.0 } else { 0.0 });
        assert!((frame.acceleration_mps2.as_ref().unwrap().z - 9.8).abs() < 0.2);
    }
    assert!(
        frames.iter().zip(&frames[1..]).all(|(a, b)| b.seq == a.seq + 1 && b.board_time_us == a.board_time_us + 50_000)
    );
}

#[test]
fn logs_do_not_depend_on_jobs_shards_or_interruptions() {
    let bench = bench();
    let folder = bench.path();
    let run = |args: &[&str]| {
        let output = biflag(folder, &[&["simulate", "plan.toml", "--json"], args].concat());
        expect(&output, 3);
        json(&output)
    };
    let whole = run(&["--jobs", "1", "--out", "one"]);
    run(&["--jobs", "4", "--out", "four"]);
    let expected = logs(&folder.join("one"));
    assert_eq!(expected.len(), 4);
    assert!(expected == logs(&folder.join("four")));

    let halves = [run(&["--shard", "1/2", "--out", "shards"]), run(&["--shard", "2/2", "--out", "shards"])];
    assert_eq!(halves.each_ref().map(|half| half["trials"].as_array().unwrap().len()), [2, 2]);
    assert!(expected == logs(&folder.join("shards")));

    // The state after a killed run: one complete trial, and one that was started.
    let cut = folder.join("cut");
    std::fs::create_dir(&cut).unwrap();
    for name in ["session.toml", "001_w1+50_w2+10.mcap"] {
        std::fs::copy(folder.join("one").join(name), cut.join(name)).unwrap();
    }
    std::fs::write(cut.join("002_w1+0_w2+45.mcap.unfinished"), b"begun").unwrap();
    let begun = cut.join("001_w1+50_w2+10.mcap").metadata().unwrap().modified().unwrap();
    let resumed = run(&["--resume", "--out", "cut"]);
    assert!(expected == logs(&cut));
    assert_eq!(cut.join("001_w1+50_w2+10.mcap").metadata().unwrap().modified().unwrap(), begun, "it is not repeated");
    for (resumed, whole) in resumed["trials"].as_array().unwrap().iter().zip(whole["trials"].as_array().unwrap()) {
        for key in ["name", "yaw_deg", "force1_n", "sweeps", "settle_s", "min_gap_m"] {
            assert_eq!(resumed[key], whole[key], "{key}");
        }
    }
    assert!(resumed["trials"][0]["wall_s"].is_null() && resumed["trials"][1]["wall_s"].is_f64());
}

#[test]
fn speeds_give_a_session_of_one_trial() {
    let bench = bench();
    let folder = bench.path();
    let output = biflag(folder, &["simulate", "--speeds=-90,90", "--duration", "1", "--rate", "200", "--json"]);
    expect(&output, 3);
    let answer = json(&output);
    assert_eq!(answer["trials"][0]["log"], "w1-90_w2+90/001_w1-90_w2+90.mcap");
    let info = json(&biflag(folder, &["info", answer["trials"][0]["log"].as_str().unwrap(), "--json"]));
    assert_eq!((&info["samples"], &info["origin"], &info["clean"]), (&201.into(), &"model".into(), &true.into()));
    assert!(info["angles"]["pitch_deg"].is_f64());
    assert_eq!((&info["model"]["closure"], &info["steady"]["settled"]), (&"full".into(), &false.into()));
}

#[test]
fn flagella_start_at_the_phase_that_is_asked_for() {
    let bench = bench();
    let folder = bench.path();
    let output =
        biflag(folder, &["simulate", "--speeds", "90,90", "--phase", "0,-90", "--duration", "1", "--shapes", "--json"]);
    expect(&output, 3);
    let answer = json(&output);
    let trial = &answer["trials"][0];
    assert_eq!(trial["log"], "w1+90_w2+90_p0_-90/001_w1+90_w2+90.mcap");
    assert_eq!(trial["phase_deg"], serde_json::json!([0.0, -90.0]));
    let note = answer["notes"][0].as_str().unwrap();
    assert!(note.starts_with("the flagella turn at 1:1, so these values hold for one starting phase"), "{note}");
    let log = trial["log"].as_str().unwrap();
    let first = Reader::open(&folder.join(log)).unwrap().find_map(|message| match message.unwrap().body {
        Body::Telemetry(frame) => Some((frame.motor1.unwrap().turns, frame.motor2.unwrap().turns)),
        _ => None,
    });
    let (one, two) = first.unwrap();
    assert!(one == 0.0 && (two + 0.25).abs() < 1e-3, "{one} {two}");
    let info = json(&biflag(folder, &["info", log, "--json"]));
    assert_eq!(info["trial"]["phase_deg"], serde_json::json!([0.0, -90.0]));
    let text = String::from_utf8(biflag(folder, &["info", log]).stdout).unwrap();
    assert!(text.contains("starts at    0° and -90°"), "{text}");

    // A ratio that is not simple has no note.
    let plain = biflag(folder, &["simulate", "--speeds", "50,10", "--duration", "1", "--json"]);
    assert_eq!(
        (&json(&plain)["notes"], &json(&plain)["trials"][0]["phase_deg"]),
        (&serde_json::json!([]), &Value::Null)
    );
}

#[test]
fn phases_give_means_and_spreads() {
    let bench = bench();
    let folder = bench.path();
    let plan = "[session]\nname = \"around\"\n[trial]\ncalibrate = 0\npreroll = 0\nrun = 25\ndecay = 0\nphases = 3\n\
                [speeds]\npairs = [[90, 90], [50, 10]]\n";
    std::fs::write(folder.join("around.toml"), plan).unwrap();
    let run = |args: &[&str]| {
        let output = biflag(folder, &[&["simulate", "around.toml"], args].concat());
        assert!(matches!(output.status.code(), Some(0 | 3)));
        output
    };
    let answer = json(&run(&["--json"]));
    assert_eq!(logs(&folder.join("around")).len(), 6);
    let rows = answer["trials"].as_array().unwrap();
    assert_eq!(
        rows.iter().map(|row| row["name"].as_str().unwrap()).collect::<Vec<_>>(),
        ["w1+90_w2+90", "w1+50_w2+10"]
    );
    for row in rows {
        let starts = row["starts"].as_array().unwrap();
        assert_eq!((starts.len(), &row["phases"]), (3, &3.into()));
        for (i, key) in ["yaw_deg", "pitch_deg", "roll_deg"].into_iter().enumerate() {
            let values: Vec<f64> = starts.iter().map(|start| start[key].as_f64().unwrap()).collect();
            let (least, largest) =
                values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
            let mean = values.iter().sum::<f64>() / 3.0;
            assert!((row[key].as_f64().unwrap() - mean).abs() < 1e-9, "{key} of {row}");
            assert!((row["phase_spread_deg"][i].as_f64().unwrap() - (largest - least)).abs() < 1e-9, "{key} of {row}");
        }
        let tilts: Vec<f64> = starts.iter().map(|start| start["tilt_deg"].as_f64().unwrap()).collect();
        assert!((row["tilt_deg"].as_f64().unwrap() - tilts.iter().sum::<f64>() / 3.0).abs() < 1e-9, "{row}");
        let thrust = |value: &Value| value["force2_n"][2].as_f64().unwrap();
        assert!((thrust(row) - starts.iter().map(thrust).sum::<f64>() / 3.0).abs() < 1e-12);
        let contact = |value: &Value| value["contact_share"].as_f64().unwrap();
        assert!((contact(row) - starts.iter().map(contact).sum::<f64>() / 3.0).abs() < 1e-12);
    }
    assert_eq!(rows[1]["starts"][1]["name"], "005_w1+50_w2+10_p2");
    assert_eq!(rows[1]["starts"][1]["phase_deg"], serde_json::json!([0.0, 24.0]));
    let pitch = |row: &Value| row["phase_spread_deg"][1].as_f64().unwrap();
    assert!(pitch(&rows[0]) > 2.0 && pitch(&rows[1]) < 0.1, "{rows:?}");
    let note = answer["notes"][0].as_str().unwrap();
    assert!(
        note.starts_with("the starting phase of the flagella changes yaw by") && note.contains("at 90 and 90 rpm"),
        "{note}"
    );

    // Resumed, nothing is computed and the means are the same. A shard has no means of a part of the phases.
    let text = String::from_utf8(run(&["--resume"]).stdout).unwrap();
    assert!(text.contains("w1+90_w2+90: mean and spread over 3 phases: yaw"), "{text}");
    let again = json(&run(&["--resume", "--json"]));
    assert_eq!((&again["trials"][0]["yaw_deg"], &again["notes"]), (&rows[0]["yaw_deg"], &answer["notes"]));
    let half = json(&run(&["--shard", "1/2", "--out", "shards", "--json"]));
    let names: Vec<_> = half["trials"].as_array().unwrap().iter().map(|row| row["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["001_w1+90_w2+90_p1", "003_w1+90_w2+90_p3", "005_w1+50_w2+10_p2"]);
    assert_eq!(half["notes"], serde_json::json!([]));
}

/// The run is a single phase; the log states when the speeds change and their new values.
#[test]
fn motor_reverses_during_the_run() {
    let bench = bench();
    let plan = "[session]\nname = \"turn\"\n[trial]\ncalibrate = 0\npreroll = 1\nrun = 6\ndecay = 1\n\
                reverse = { motor = 2, after = 2 }\n[speeds]\npairs = [[50, 30]]\n";
    std::fs::write(bench.path().join("turn.toml"), plan).unwrap();
    expect(&biflag(bench.path(), &["simulate", "turn.toml", "--json"]), 3);
    let mut reader = Reader::open(&bench.path().join("turn/001_w1+50_w2+30.mcap")).unwrap();
    let (mut events, mut turns) = (Vec::new(), 0.0);
    for message in reader.by_ref() {
        let message = message.unwrap();
        match message.body {
            Body::Event(event) => events.push((event.text, message.log_time_ns as f64 * 1e-9)),
            Body::Telemetry(frame) => {
                let target = frame.motor2.as_ref().unwrap().target_rpm;
                let expected = match frame.time_s {
                    t if !(1.0 - 1e-9..7.0 - 1e-9).contains(&t) => 0.0,
                    t if t < 3.0 - 1e-9 => 30.0,
                    _ => -30.0,
                };
                assert_eq!(target, expected, "{} s", frame.time_s);
                turns = frame.motor2.unwrap().turns;
            }
            _ => {}
        }
    }
    let events: Vec<_> = events.iter().map(|(text, time)| (text.as_str(), *time)).collect();
    let reversed = "motor 2 reverses: from here on +50 and -30 rpm";
    assert_eq!(events, [("preroll", 0.0), ("run", 1.0), (reversed, 3.0), ("decay", 7.0), ("end", 8.0)]);
    // A turn forwards and two back, minus the loss in ramps of 0.25 s.
    assert!((turns - (1.0 - 2.0)).abs() < 0.15, "{turns}");
    let trial = reader.meta::<biflag_log::TrialMeta>().unwrap();
    assert_eq!((trial.reverse_motor, trial.reverse_after_s), (Some(2), Some(2.0)));
}

#[test]
fn wrong_use_is_reported_and_writes_nothing() {
    let bench = bench();
    let folder = bench.path();
    std::fs::write(folder.join("wrong.toml"), "[base]\nmass_g = 94\n").unwrap();
    std::fs::write(folder.join("tight.toml"), "[base]\nmotor_distance_m = 0.01\n").unwrap();
    for (args, message) in [
        (vec!["plan.toml", "--robot", "missing.toml"], "missing.toml: the robot file cannot be read"),
        (vec!["plan.toml", "--robot", "wrong.toml"], "wrong.toml:2:1: unknown key `mass_g`"),
        (
            vec!["plan.toml", "--robot", "tight.toml"],
            "tight.toml:2:20: base.motor_distance_m = 0.01: the flagella touch",
        ),
        (vec!["missing.toml"], "missing.toml: the plan cannot be read"),
        (vec!["plan.tmol"], "did you mean plan.toml?"),
        (vec!["plan.toml", "--robot", "physcal"], "did you mean physical?"),
        (vec!["50,-10"], "--speeds=50,-10, simulate with --duration 120"),
        (vec!["--speeds=50,10", "--duration", "1,5"], "write a decimal point: 1.5"),
        (vec!["."], "--out . --resume` goes on with a session"),
        (vec![], "required"),
        (vec!["--speeds=50,10"], "--duration"),
        (vec!["--speeds=50", "--duration", "1"], "give two speeds"),
        (vec!["--speeds=50,500", "--duration", "1"], "500 rpm is beyond ±90 rpm"),
        (vec!["--speeds=50,10", "--duration", "0"], "give seconds, 0.005 to 86400"),
        (vec!["--duration", "1"], "arguments were not provided:\n  --speeds <W1,W2>\n\nUsage"),
        (vec!["plan.toml", "--duration", "1"], "cannot be used with"),
        (vec!["--from", "short", "--duration", "1"], "cannot be used with"),
        (vec!["plan.toml", "--speeds=50,10", "--duration", "1"], "cannot be used with"),
        (vec!["plan.toml", "--closure", "held"], "full, lumped, paper"),
        (vec!["plan.toml", "--phase", "0,90"], "cannot be used with"),
        (vec!["--from", "short", "--phase", "0,90"], "cannot be used with"),
        (vec!["--speeds=50,10", "--duration", "1", "--phase", "90"], "give two angles in degrees"),
        (vec!["--speeds=50,10", "--duration", "1", "--phase", "0,nan"], "give two angles in degrees"),
        (vec!["plan.toml", "--shard", "3/2"], "1/8"),
        (vec!["plan.toml", "--shard", "0/2"], "1/8"),
        (vec!["plan.toml", "--jobs", "0"], "1..=1024"),
        (vec!["plan.toml", "--rate", "nan"], "samples per second"),
    ] {
        let output = biflag(folder, &[&["simulate"], args.as_slice()].concat());
        expect(&output, 2);
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert!(stderr.contains(message), "{args:?}: {stderr}");
    }
    assert!(!folder.join("short").exists());
}

/// A log that is not whole is removed, and nothing of it is promised.
#[test]
fn full_disk_keeps_what_it_says() {
    let bench = bench();
    let mut shell = Command::new("sh");
    shell.args(["-c", "trap '' XFSZ; ulimit -f 100; exec \"$@\"", "sh", env!("CARGO_BIN_EXE_biflag"), "simulate"]);
    let output = shell.args(["plan.toml", "--rate", "1000"]).current_dir(bench.path()).output().unwrap();
    expect(&output, 1);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(stderr.contains(".mcap: cannot be written; 0 bytes were kept") && !stderr.contains("recover"), "{stderr}");
    let left = std::fs::read_dir(bench.path().join("short")).unwrap().map(|entry| entry.unwrap().file_name());
    assert_eq!(left.collect::<Vec<_>>(), ["session.toml"]);
}

/// A base whose weight does not hold it upright: no command has an angle of it.
#[test]
fn a_robot_that_turns_over_has_no_angles() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("light.toml"), "[base]\nmass_centre_below_joint_m = -0.02\n").unwrap();
    let run = |args: &[&str], code: i32| {
        let output = biflag(folder, args);
        expect(&output, code);
        output
    };
    let simulate = ["simulate", "--speeds=50,10", "--duration", "12", "--robot", "light.toml", "--out", "s"];
    let output = run(&simulate, 3);
    assert!(
        String::from_utf8_lossy(&output.stderr).contains(": overturned, so it has no steady attitude"),
        "{output:?}"
    );
    let trial = json(&run(&[&simulate[..], &["--resume", "--json"]].concat(), 3))["trials"][0].clone();
    assert_eq!(
        (&trial["kind"], &trial["settled"], &trial["origin"]),
        (&"overturned".into(), &false.into(), &"model".into())
    );
    for key in ["yaw_deg", "pitch_deg", "roll_deg", "tilt_deg", "yaw_se_deg"] {
        assert!(trial[key].is_null(), "{key}: {trial}");
    }
    assert!(trial["force1_n"][2].is_number(), "{trial}");
    let log = "s/001_w1+50_w2+10.mcap";
    let info = json(&run(&["info", log, "--json"], 3));
    assert!(info["angles"].is_null() && info["steady"]["yaw_deg"].is_null(), "{info}");
    assert_eq!(
        (&info["steady"]["kind"], &info["findings"][0]["grave"]),
        (&"overturned".into(), &true.into()),
        "{info}"
    );
    let export = json(&run(&["export", "s", "-o", "e", "--json"], 3));
    assert_eq!(export["trials"], serde_json::json!([{ "name": "001_w1+50_w2+10", "origin": "model" }]), "{export}");
    let fitted = run(&["calibrate", log, "-o", "fitted.toml"], 1);
    assert!(String::from_utf8_lossy(&fitted.stderr).contains("the robot overturned"), "{fitted:?}");
    run(&["report", "s"], 3);
}

#[test]
fn session_is_resumed_only_with_its_model() {
    let bench = bench();
    let folder = bench.path();
    std::fs::write(folder.join("soft.toml"), "[flagellum]\nyoung_pa = 8e5\n").unwrap();
    let run = |args: &[&str], code: i32| {
        let output =
            biflag(folder, &[&["simulate", "plan.toml", "--robot", "soft.toml", "--out", "soft"], args].concat());
        expect(&output, code);
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    run(&["--shard", "1/4"], 3);
    assert!(run(&[], 2).contains("already contains a session"));
    assert!(run(&["--shard", "1/4"], 2).contains("already contains a session"));
    assert!(run(&["--resume", "--closure", "lumped"], 2).contains("computed with the closure full"));
    assert!(run(&["--resume", "--rate", "50"], 2).contains("computed with 20 samples per second"));
    let other = biflag(folder, &["simulate", "plan.toml", "--out", "soft", "--resume"]);
    expect(&other, 2);
    assert!(String::from_utf8_lossy(&other.stderr).contains("the robot differs"));
    run(&["--resume"], 3);
    assert_eq!(logs(&folder.join("soft")).len(), 4);
    let mut log = Reader::open(&folder.join("soft/001_w1+50_w2+10.mcap")).unwrap();
    assert!(log.by_ref().all(|message| message.is_ok()));
    assert_eq!(log.meta::<ModelMeta>().unwrap().robot().unwrap().flagellum.young_pa, 8e5);
}

#[test]
fn solver_failure_keeps_the_log_and_the_other_trials() {
    let bench = bench();
    let folder = bench.path();
    std::fs::write(folder.join("hard.toml"), "[solver]\nsweeps = 2\nhalvings = 0\nstep_rad = 1.1\ntolerance = 1e-7\n")
        .unwrap();
    for method in ["trial", "steady"] {
        let args = ["simulate", "plan.toml", "--robot", "hard.toml", "--method", method, "--out", method, "--json"];
        let output = biflag(folder, &args);
        expect(&output, 1);
        let error = json(&output)["trials"][0]["error"].as_str().unwrap().to_owned();
        assert!(error.contains("001_w1+50_w2+10: no step from") && error.contains("solver.halvings"), "{error}");
        let info = json(&biflag(folder, &["info", &format!("{method}/001_w1+50_w2+10.mcap"), "--json"]));
        assert_eq!((&info["end"], &info["clean"]), (&"failed".into(), &true.into()), "{method}");
    }
}

/// The end of a trial without a decay is that of its run, to the last digit.
#[test]
fn model_without_a_decay_is_replayed_and_compared() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for run_s in ["6.9", "15", "30", "60", "120"] {
        let plan =
            format!("[trial]\ncalibrate = 0\npreroll = 0\nrun = {run_s}\ndecay = 0\n[speeds]\npairs = [[50, 10]]\n");
        std::fs::write(folder.join("plan.toml"), plan).unwrap();
        let args = ["simulate", "plan.toml", "--closure", "lumped", "--out", run_s, "--json"];
        let answer = biflag(folder, &args);
        assert!(matches!(answer.status.code(), Some(0 | 3)), "{}", String::from_utf8_lossy(&answer.stderr));
        let replayed = biflag(folder, &["simulate", "--from", run_s, "--json"]);
        assert!(matches!(replayed.status.code(), Some(0 | 3)), "{}", String::from_utf8_lossy(&replayed.stderr));
        let [own, again] = [&answer, &replayed].map(|output| json(output)["trials"][0]["pitch_deg"].as_f64().unwrap());
        assert!((own - again).abs() < 1.0, "{run_s} s: {own} and {again}");
        let compared = biflag(folder, &["compare", run_s, "--json"]);
        assert_eq!(compared.status.code(), replayed.status.code(), "{run_s} s");
        assert_eq!(json(&compared)["trials"].as_array().unwrap().len(), 1);
    }
}
