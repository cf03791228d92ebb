//! End-to-end tests of `simulate --from`, `compare` and `calibrate`, on logs of the model and on logs of a rig that are
//! made from them by adding the noise of a sensor, gaps, faults and cuts.

use crate::program::biflag;
use biflag_log::schema::biflag::{Fault, Quaternion, Telemetry, event::Kind};
use biflag_log::{Body, EventKind, FORMAT, Identity, Origin, Reader, ReplayMeta, Summary, Writer};
use host::plan::{Plan, board};
use host::run;
use nalgebra::UnitQuaternion;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Output;
use std::time::SystemTime;

/// The flagella of a modelled robot need 40 s to sag to their equilibrium. The runs are too short to settle.
const PLAN: &str = "[session]\nname = \"short\"\n[trial]\ncalibrate = 40\npreroll = 12\nrun = 24\ndecay = 4\n\
                    [speeds]\npairs = [[50, 10], [-90, 90]]\n";

#[track_caller]
fn expect(output: &Output, code: i32) -> String {
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{}\n{stderr}", String::from_utf8_lossy(&output.stdout));
    stderr
}

#[track_caller]
fn json(output: &Output, code: i32) -> Value {
    expect(output, code);
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Creates a modelled session `short` at the board's rate.
fn bench(plan: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("plan.toml"), plan).unwrap();
    let code = biflag(folder.path(), &["simulate", "plan.toml", "--rate", "200"]).status.code();
    assert!(matches!(code, Some(0 | 3)), "{code:?}");
    folder
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

/// Converts a model's log to a rig's. `change` modifies each frame; it returns false if the frame is lost.
fn as_of_a_rig(model: &Path, rig: &Path, summary: bool, change: impl FnMut(&mut Telemetry) -> bool) {
    as_of_a_rig_with((protocol::VERSION, &protocol::Settings::DEFAULT), model, rig, summary, change);
}

/// Like [`as_of_a_rig`], with a version of the protocol and the settings of the board.
fn as_of_a_rig_with(
    (version, settings): (u8, &protocol::Settings),
    model: &Path,
    rig: &Path,
    summary: bool,
    mut change: impl FnMut(&mut Telemetry) -> bool,
) {
    let mut reader = Reader::open(model).unwrap();
    let messages: Vec<_> = reader.by_ref().map(Result::unwrap).collect();
    let meta: biflag_log::PlanMeta = reader.meta().unwrap();
    let trial: biflag_log::TrialMeta = reader.meta().unwrap();
    let plan = Plan::parse(&meta.text, "plan").unwrap();
    let trial = plan.trials.iter().find(|planned| planned.name == trial.name).unwrap();
    let time = SystemTime::now();
    let board = board::to_log(&protocol::Info::default(), settings);
    let start = run::start(&plan, trial, 1, Origin::Rig, Some(board), time);
    let mut log = Writer::create(rig, &start, time).unwrap();
    // The last record counts.
    let created = host::program::timestamp(time);
    log.meta(&Identity { format: FORMAT, protocol: version, origin: Origin::Rig, created, ..Identity::default() })
        .unwrap();
    for message in messages {
        match message.body {
            Body::Telemetry(mut frame) => {
                let is_sent = change(&mut frame);
                if is_sent {
                    log.at(frame.time_s);
                    log.message(&*frame, time).unwrap();
                }
            }
            Body::Event(event) if event.kind() == Kind::Phase => {
                log.at(message.log_time_ns as f64 * 1e-9);
                log.event(EventKind::Phase, &event.text, time).unwrap();
            }
            _ => {}
        }
    }
    if summary {
        log.finish(&Summary { end: biflag_log::End::Complete, ..Summary::default() }).unwrap();
    }
}

/// Deterministic noise of a sensor that is mounted askew, starts at a yaw other than zero, and drifts.
struct Sensor {
    state: u64,
    yaw_deg: f64,
    tilt_deg: [f64; 2],
}

impl Sensor {
    fn new(seed: u64) -> Self {
        Self { state: seed.wrapping_mul(2).wrapping_add(1), yaw_deg: 77.0, tilt_deg: [0.0; 2] }
    }

    /// Returns a normal deviate of variance 1.
    fn normal(&mut self) -> f64 {
        let mut uniform = || {
            self.state = self.state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.state >> 11) as f64 / (1u64 << 53) as f64
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    }

    /// Adds errors to a frame, 5 ms after the previous one: 0.03 °/s of bias, 0.005 °/√s of random walk, tilts with
    /// 0.05° of noise with a correlation time of a second, 1.5° and -0.8° askew.
    fn spoil(&mut self, frame: &mut Telemetry) {
        let step: f64 = 0.005;
        self.yaw_deg += 0.03 * step + 0.005 * step.sqrt() * self.normal();
        for k in 0..2 {
            self.tilt_deg[k] += -self.tilt_deg[k] * step + 0.05 * (2.0 * step).sqrt() * self.normal();
        }
        let q = frame.attitude.as_ref().unwrap();
        let truth = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(q.w, q.x, q.y, q.z));
        let away = UnitQuaternion::from_euler_angles(0.0, 0.0, self.yaw_deg.to_radians());
        let [pitch, roll] = self.tilt_deg;
        let askew = UnitQuaternion::from_euler_angles((roll - 0.8).to_radians(), (pitch + 1.5).to_radians(), 0.0);
        let seen = (away * truth * askew).into_inner();
        frame.attitude = Some(Quaternion { w: seen.w, x: seen.i, y: seen.j, z: seen.k });
    }
}

/// Creates a session `rig` with the trials of `short`, measured by such a sensor.
fn rig(folder: &Path) -> Vec<PathBuf> {
    let plan = Plan::parse(PLAN, "plan").unwrap();
    let session = host::session::Session::create(&folder.join("rig"), &plan).unwrap();
    let trials = plan.trials.iter().zip(1..);
    trials
        .map(|(trial, seed)| {
            let name = format!("{}.mcap", trial.name);
            let path = session.folder().join(&name);
            let mut sensor = Sensor::new(seed);
            as_of_a_rig(&folder.join("short").join(&name), &path, true, |frame| {
                sensor.spoil(frame);
                true
            });
            path
        })
        .collect()
}

#[test]
fn replay_of_a_modelled_session_reproduces_it() {
    let bench = bench(PLAN);
    let folder = bench.path();
    let compared = json(&biflag(folder, &["compare", "short", "--json"]), 3);
    assert_eq!(compared["modelled"], "short-replay");
    assert_eq!(compared["report"], "short/compare.html");
    assert!(folder.join("short/compare.html").exists() && !folder.join("short/report.html").exists());
    for trial in compared["trials"].as_array().unwrap() {
        for key in ["yaw_rmse_deg", "pitch_rmse_deg", "roll_rmse_deg"] {
            assert!(number(&trial[key]) < 0.2, "{key} of {trial}");
        }
        for key in ["steady_yaw_error_deg", "steady_pitch_error_deg"] {
            assert!(number(&trial[key]).abs() < 0.05, "{key} of {trial}");
        }
        assert_eq!((&trial["yaw_uncertainty_deg"], &trial["time_shift_s"]), (&0.0.into(), &0.0.into()));
    }
    let replay = folder.join("short-replay/001_w1+50_w2+10.mcap");
    let meta: ReplayMeta = biflag_log::last_meta(&replay).unwrap().unwrap();
    assert_eq!((meta.source.as_str(), meta.source_sha256.len()), ("001_w1+50_w2+10.mcap", 64));
    // The phases are those of the replayed log.
    let phases = |path: &Path| -> BTreeMap<String, u64> {
        let messages = Reader::open(path).unwrap().map(Result::unwrap);
        messages
            .filter_map(|message| match message.body {
                Body::Event(event) if event.kind() == Kind::Phase => {
                    Some((event.text, message.log_time_ns / 1_000_000))
                }
                _ => None,
            })
            .collect()
    };
    assert_eq!(phases(&replay), phases(&folder.join("short/001_w1+50_w2+10.mcap")));

    // An existing replay is used again, unless the robot differs; the comparison then finds the error.
    let made = replay.metadata().unwrap().modified().unwrap();
    json(&biflag(folder, &["compare", "short/001_w1+50_w2+10.mcap", "--json"]), 3);
    assert_eq!(std::fs::read_dir(folder.join("short-replay")).unwrap().count(), 3);
    assert_eq!(replay.metadata().unwrap().modified().unwrap(), made);
    std::fs::write(folder.join("thick.toml"), "[fluid]\nviscosity_pa_s = 1.2\n").unwrap();
    let compared = json(&biflag(folder, &["compare", "short", "--robot", "thick.toml", "--json"]), 3);
    let moved = "short-replay had replays of the robot physical, which are now in short-replay/attempts";
    assert_eq!(compared["notes"], serde_json::json!([moved]));
    for trial in compared["trials"].as_array().unwrap() {
        assert!(!trial["differences"].as_array().unwrap().is_empty(), "{trial}");
        assert!(trial["verdict"].as_str().unwrap().starts_with("Yaw differs by"), "{trial}");
    }
    assert!(folder.join("short-replay/attempts/001_w1+50_w2+10.attempt1.mcap").exists());
}

#[test]
fn comparison_removes_zero_and_drift_of_a_rigs_trial() {
    let bench = bench(PLAN);
    let folder = bench.path();
    rig(folder);
    let compared = json(&biflag(folder, &["compare", "rig", "--json"]), 3);
    for trial in compared["trials"].as_array().unwrap() {
        let yaw = number(&trial["yaw_uncertainty_deg"]);
        // Most of it is the scale of a gyroscope that nobody has measured.
        assert!(yaw > 1.0 && yaw < 3.0, "{trial}");
        assert!(number(&trial["steady_yaw_error_deg"]).abs() < yaw, "{trial}");
        assert!(number(&trial["steady_pitch_error_deg"]).abs() < 0.1, "{trial}");
        assert!(number(&trial["pitch_rmse_deg"]) < 0.2, "{trial}");
        assert_eq!(trial["differences"], serde_json::json!([]), "{trial}");
        assert!((number(&trial["measured_zero_deg"][1]) - 1.5).abs() < 0.1, "{trial}");
    }
    // Whichever of both is named first, the measurement has the window of the means.
    let name = "001_w1+50_w2+10.mcap";
    let [rig, replay] = ["rig", "rig-replay"].map(|session| format!("{session}/{name}"));
    let error = |a: &str, b: &str| {
        let compared = json(&biflag(folder, &["compare", a, b, "--json"]), 3);
        ["yaw", "pitch", "roll"].map(|angle| number(&compared["trials"][0][format!("steady_{angle}_error_deg")]))
    };
    let (of_model, of_rig) = (error(&rig, &replay), error(&replay, &rig));
    assert!((0..3).all(|k| (of_model[k] + of_rig[k]).abs() < 1e-9), "{of_model:?} and {of_rig:?}");
    std::fs::write(folder.join("thick.toml"), "[fluid]\nviscosity_pa_s = 1.2\n").unwrap();
    let compared = json(&biflag(folder, &["compare", "rig", "--robot", "thick.toml", "--json"]), 3);
    let verdict = compared["trials"][0]["verdict"].as_str().unwrap();
    assert!(verdict.contains("times the measured ±") && verdict.starts_with("Yaw differs by"), "{verdict}");

    // Compared with the session that it was made from, and with an unrelated one.
    let direct = json(&biflag(folder, &["compare", "rig", "short", "--json"]), 3);
    assert!(number(&direct["trials"][1]["pitch_rmse_deg"]) < 0.2);
    for (args, reason) in [
        (
            vec!["simulate", "plan.toml", "--robot", "thick.toml", "--out", "thick"],
            "the robots differ: fluid.viscosity_pa_s",
        ),
        (
            vec!["simulate", "plan.toml", "--closure", "lumped", "--out", "lumped"],
            "the closures differ: full and lumped",
        ),
    ] {
        let code = biflag(folder, &args).status.code();
        assert!(matches!(code, Some(0 | 3)), "{code:?}");
        let out = args[args.len() - 1];
        assert!(expect(&biflag(folder, &["compare", "short", out]), 2).contains(reason));
        let anyway = json(&biflag(folder, &["compare", "short", out, "--anyway", "--json"]), 3);
        assert!(!anyway["trials"][0]["differences"].as_array().unwrap().is_empty());
    }
    expect(&biflag(folder, &["simulate", "--speeds=20,20", "--duration", "2", "--out", "other"]), 3);
    assert!(expect(&biflag(folder, &["compare", "rig", "other"]), 2).contains("no common trials"));
    let logs = ["short/001_w1+50_w2+10.mcap", "short/002_w1-90_w2+90.mcap"];
    assert!(expect(&biflag(folder, &["compare", logs[0], logs[1]]), 2).contains("the speeds differ"));
    assert!(expect(&biflag(folder, &["compare", "rig", "nowhere"]), 2).contains("nowhere"));
    // A recording agrees with itself whatever the robot did.
    std::fs::copy(folder.join("rig/001_w1+50_w2+10.mcap"), folder.join("copy.mcap")).unwrap();
    let copied = biflag(folder, &["compare", "rig/001_w1+50_w2+10.mcap", "copy.mcap"]);
    assert!(expect(&copied, 2).contains("both are the same recording"));
}

#[test]
fn phase_of_a_rigs_flagella_is_found_and_used() {
    let plan = "[session]\nname = \"short\"\n[trial]\ncalibrate = 20\npreroll = 12\nrun = 16\ndecay = 3\n\
                [speeds]\npairs = [[45, 45]]\n";
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("plan.toml"), plan).unwrap();
    std::fs::write(folder.join("stands.toml"), "[flagellum]\nphase_deg = [0, 110]\n").unwrap();
    let code = biflag(folder, &["simulate", "plan.toml", "--robot", "stands.toml", "--rate", "200"]).status.code();
    assert!(matches!(code, Some(0 | 3)), "{code:?}");
    let mut sensor = Sensor::new(3);
    as_of_a_rig(&folder.join("short/001_w1+45_w2+45.mcap"), &folder.join("rig.mcap"), true, |frame| {
        sensor.spoil(frame);
        true
    });
    // The encoders count from zero: of themselves they say that the flagella are in phase.
    let compared = json(&biflag(folder, &["compare", "rig.mcap", "--json"]), 3);
    let note = compared["notes"][0].as_str().unwrap();
    assert!(note.contains("depend on how the flagella stood") && note.contains("calibrate --fit phase"), "{note}");
    let tilt = |compared: &Value| {
        let error = |key: &str| number(&compared["trials"][0][key]);
        error("steady_pitch_error_deg").hypot(error("steady_roll_error_deg"))
    };
    let before = tilt(&compared);
    let fit = json(&biflag(folder, &["calibrate", "rig.mcap", "--fit", "phase", "-o", "fitted.toml", "--json"]), 3);
    let [phase, both] = fit["parameters"].as_array().unwrap().as_slice() else { panic!("{fit}") };
    assert!(number(&both["value"]).abs() < 4.0 * number(&both["std_error"]), "{both}");
    assert_eq!((&phase["name"], &phase["unit"]), (&"phase".into(), &"deg".into()));
    assert!((number(&phase["value"]) - 110.0).abs() < 4.0 * number(&phase["std_error"]), "{phase}");
    assert!(number(&phase["std_error"]) < 10.0, "{phase}");
    let compared = json(&biflag(folder, &["compare", "rig.mcap", "--robot", "fitted.toml", "--json"]), 3);
    let after = tilt(&compared);
    println!("tilt error {before:.2} deg in phase, {after:.2} deg at {} deg", phase["value"]);
    assert!(before > 1.0 && after < 0.2, "{before} {after}");
    assert!(compared["notes"][0].as_str().unwrap().starts_with("rig-replay had replays of the robot physical"));
    assert!(compared["notes"][1].is_null(), "{}", compared["notes"]);
}

#[test]
fn imperfect_logs_give_warnings_or_errors() {
    let bench = bench("[trial]\ncalibrate = 40\npreroll = 6\nrun = 20\ndecay = 2\n[speeds]\npairs = [[50, 10]]\n");
    let folder = bench.path();
    let model = folder.join("session/001_w1+50_w2+10.mcap");
    let compare = |name: &str, code: i32| json(&biflag(folder, &["compare", name, "--json"]), code);
    let warned = |compared: &Value, text: &str| {
        let trial = &compared["trials"][0];
        let warnings = format!("{}{}", trial["findings"], trial["warnings"]);
        assert!(warnings.contains(text), "{warnings}");
    };

    as_of_a_rig(&model, &folder.join("gap.mcap"), true, |frame| !(52.0..53.5).contains(&frame.time_s));
    let compared = compare("gap.mcap", 3);
    warned(&compared, "telemetry is missing in 1 place, 1.5 s in total");
    assert!(number(&compared["trials"][0]["pitch_rmse_deg"]) < 0.2, "{compared}");
    assert!(folder.join("gap-replay/001_w1+50_w2+10.mcap").exists());

    let fault = |frame: &mut Telemetry| {
        frame.fault = if frame.time_s >= 60.0 { Fault::Motor1Stalled.into() } else { Fault::None.into() };
        frame.time_s < 60.5
    };
    as_of_a_rig(&model, &folder.join("fault.mcap"), false, fault);
    let compared = compare("fault.mcap", 3);
    warned(&compared, "the board stopped at 60.0 s (motor1 stalled)");

    as_of_a_rig_with((9, &protocol::Settings::DEFAULT), &model, &folder.join("old.mcap"), true, |_| true);
    let compared = compare("old.mcap", 3);
    warned(&compared, "recorded with protocol 9, of which this program knows");
    assert!(number(&compared["trials"][0]["pitch_rmse_deg"]) < 0.2, "{compared}");

    let bytes = std::fs::read(&model).unwrap();
    std::fs::write(folder.join("cut.mcap"), &bytes[..bytes.len() * 4 / 5]).unwrap();
    warned(&compare("cut.mcap", 3), "cut off");
    std::fs::write(folder.join("short.mcap"), &bytes[..bytes.len() / 20]).unwrap();
    assert!(expect(&biflag(folder, &["compare", "short.mcap"]), 1).contains("motors"));

    as_of_a_rig(&model, &folder.join("still.mcap"), true, |frame| {
        for motor in [&mut frame.motor1, &mut frame.motor2] {
            motor.as_mut().unwrap().turns = 0.0;
        }
        true
    });
    let refused = compare("still.mcap", 1);
    assert!(refused["error"].as_str().unwrap().contains("encoder of motor 1 did not move"), "{refused}");

    as_of_a_rig(&model, &folder.join("blind.mcap"), true, |frame| {
        (frame.motor1, frame.motor2) = (None, None);
        true
    });
    assert!(expect(&biflag(folder, &["simulate", "--from", "blind.mcap"]), 1).contains("contains no motor speeds"));
    std::fs::write(folder.join("text.mcap"), "no log").unwrap();
    assert!(expect(&biflag(folder, &["compare", "text.mcap"]), 2).contains("not an MCAP file"));
}

/// The replay begins with its motors at other angles, so a slow approach of nearly equal speeds differs.
#[test]
fn without_encoders_a_slow_approach_is_in_the_uncertainty_of_a_comparison() {
    // The shorter run does not settle.
    for (run_s, is_settled) in [(76, true), (26, false)] {
        let bench = bench(&format!(
            "[trial]\ncalibrate = 40\npreroll = 12\nrun = {run_s}\ndecay = 4\n[speeds]\npairs = [[31.06, 27.2]]\n"
        ));
        let folder = bench.path();
        let settings = protocol::Settings { speed_from: protocol::SpeedFrom::Duty, ..protocol::Settings::DEFAULT };
        let model = folder.join("session/001_w1+31.06_w2+27.2.mcap");
        let mut sensor = Sensor::new(1);
        as_of_a_rig_with((protocol::VERSION, &settings), &model, &folder.join("blind.mcap"), true, |frame| {
            sensor.spoil(frame);
            true
        });
        let said = |command: &str, log: &str| {
            serde_json::from_slice::<Value>(&biflag(folder, &[command, log, "--json"]).stdout).unwrap()
        };
        let (info, compared) = (said("info", "blind.mcap"), said("compare", "blind.mcap"));
        assert_eq!(info["angles"]["settled"], is_settled);
        let replay = said("info", "blind-replay/001_w1+31.06_w2+27.2.mcap");
        // The replay has not settled, which the uncertainty holds.
        let of_replay = |finding: &Value| finding["log"].as_str().unwrap().contains("replay");
        assert!(!compared["findings"].as_array().unwrap().iter().any(of_replay), "{}", compared["findings"]);
        let trial = &compared["trials"][0];
        for angle in trial["angles"].as_array().unwrap() {
            let key = format!("{}_uncertainty_deg", angle["angle"].as_str().unwrap());
            let [own, of_replay] = [&info, &replay].map(|trial| number(&trial["angles"][&key]));
            let of_both = number(&angle["uncertainty"]["total_deg"]);
            assert!(of_both > own, "{angle}: {own} of one");
            let is_left = |term: &&Value| term["angle"] == angle["angle"] && term["name"] == "slow approach";
            let left = number(&trial["budget"].as_array().unwrap().iter().find(is_left).unwrap()["u_deg"]);
            assert!(left > 0.5 * of_replay, "{angle}: {left}, and ±{of_replay} of the replay");
        }
    }
}

/// A steady state is the end of a run: its log has no start that could be laid over another trial's.
#[test]
fn a_steady_state_is_compared_with_the_end_of_a_trial() {
    let folder = tempfile::tempdir().unwrap();
    for (out, method) in [("trial", "trial"), ("steady", "steady")] {
        let options = ["--duration", "100", "--robot", "published", "--method", method, "--out", out];
        expect(&biflag(folder.path(), &[&["simulate", "--speeds=50,10"][..], &options].concat()), 0);
    }
    for [one, other] in [["trial", "steady"], ["steady", "trial"]] {
        let compared = json(&biflag(folder.path(), &["compare", one, other, "--json", "-o", "page.html"]), 0);
        let trial = &compared["trials"][0];
        let error = number(&trial["steady_yaw_error_deg"]);
        assert!(error.abs() < 0.1, "{trial}");
        assert_eq!(trial["warnings"], serde_json::json!([]), "{trial}");
        assert!(trial["verdict"].as_str().unwrap().contains("a steady state has no transient"), "{trial}");
    }
}

#[test]
fn replay_is_resumed_only_with_its_settings() {
    let bench = bench(PLAN);
    let folder = bench.path();
    let from =
        |args: &[&str], code| json(&biflag(folder, &[&["simulate", "--from", "short", "--json"], args].concat()), code);
    let replayed = from(&[], 3);
    assert_eq!(replayed["session"], "short-replay");
    assert_eq!(replayed["trials"].as_array().unwrap().len(), 2);
    assert!(from(&[], 2)["error"].as_str().unwrap().contains("already contains a session"));
    std::fs::remove_file(folder.join("short-replay/002_w1-90_w2+90.mcap")).unwrap();
    let resumed = from(&["--resume"], 3);
    let wall: Vec<_> = resumed["trials"].as_array().unwrap().iter().map(|trial| trial["wall_s"].is_null()).collect();
    assert_eq!(wall, [true, false]);
    assert_eq!(resumed["trials"][1]["yaw_deg"], replayed["trials"][1]["yaw_deg"]);
    for (args, message) in [
        (vec!["--from", "short", "plan.toml"], "cannot be used with"),
        (vec!["--from", "short", "--speeds=1,2", "--duration", "1"], "cannot be used with"),
        (
            vec!["--from", "short", "--robot", "missing.toml", "--out", "x"],
            "missing.toml: the robot file cannot be read",
        ),
        (vec!["--from", "missing"], "missing"),
    ] {
        let output = biflag(folder, &[&["simulate"], args.as_slice()].concat());
        assert!(matches!(output.status.code(), Some(1 | 2)));
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert!(stderr.contains(message), "{args:?}: {stderr}");
    }
}

#[test]
fn calibration_recovers_hidden_parameters() {
    let bench = bench(PLAN);
    let folder = bench.path();
    rig(folder);
    std::fs::write(folder.join("start.toml"), "[joint]\ntether_full_nm_per_rad = 4.5e-4\n").unwrap();
    let args =
        ["calibrate", "rig", "--fit", "tether,mount-yaw", "--robot", "start.toml", "-o", "fitted.toml", "--json"];
    let fitted = json(&biflag(folder, &args), 3);
    let [tether, mount] = [0, 1].map(|i| &fitted["parameters"][i]);
    let within = |p: &Value, truth: f64| number(&p["interval_95"][0]) <= truth && truth <= number(&p["interval_95"][1]);
    assert_eq!((&tether["name"], &mount["name"]), (&"tether".into(), &"mount-yaw".into()));
    assert!(
        within(tether, sim::params::Robot::default().joint.tether_full_nm_per_rad) && within(mount, 0.0),
        "{fitted}"
    );
    assert!(number(&tether["std_error"]) < 0.02 * number(&tether["value"]), "{fitted}");
    assert!(number(&fitted["rmse_after_deg"]) < 0.2 * number(&fitted["rmse_before_deg"]), "{fitted}");
    assert!((number(&fitted["mounting"]["pitch_deg"]) - 1.5).abs() < 0.1, "{fitted}");
    let file = std::fs::read_to_string(folder.join("fitted.toml")).unwrap();
    assert!(file.contains("# 001_w1+50_w2+10.mcap") && file.contains("sha256"));
    let fit = &file.parse::<toml::Table>().unwrap()["fit"];
    assert!(fit["parameters"].as_array().unwrap().len() == 2 && fit.get("covariance").is_some(), "{fit}");
    // The file is a valid robot file, and it is not overwritten.
    let output = biflag(folder, &["simulate", "--speeds=1,1", "--duration", "1", "--robot", "fitted.toml"]);
    expect(&output, 3);
    assert!(expect(&biflag(folder, &args), 2).contains("already exists"));
    assert!(expect(&biflag(folder, &["calibrate", "rig", "--fit", "colour", "-o", "x.toml"]), 2).contains("viscosity"));
}
