//! Compares the logged attitude with the ground truth of the simulated robot, through the complete chain: motors, fluid
//! and flagella, base, sensor with its errors, firmware, link, log.

use biflag_log::{Body, End, ModelMeta, Origin, Reader, SensorMeta, Summary};
use host::trial::{Data, Want, Zeroed};
use serde_json::Value;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use tests::Bench;

/// Errors of the log: logged minus true values.
#[derive(Debug)]
struct Errors {
    pitch_rms_deg: f64,
    roll_rms_deg: f64,
    yaw_deg: f64,
    /// The stated 95 % uncertainty.
    yaw_uncertainty_deg: f64,
}

/// Returns the root mean square error of pitch (0) or roll (1) over the run.
fn rms(data: &Data, zeroed: &Zeroed, tilt: usize) -> f64 {
    let run = &data.times.run;
    let truth = data.truth.track(1 + tilt);
    let inside = truth.time_s.iter().zip(truth.value).filter(|(time, _)| run.contains(time));
    let squares: Vec<f64> = inside.map(|(time, truth)| (zeroed.at(*time)[1 + tilt] - truth).powi(2)).collect();
    assert!(squares.len() as f64 > 49.0 * (run.end - run.start), "ground truth is missing");
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

/// Compares a trial of `record --json` with the ground truth in its log.
fn errors(bench: &Bench, trial: &Value) -> Errors {
    let log = bench.path().join(trial["log"].as_str().unwrap());
    let mut start_ns = None;
    for message in Reader::open(&log).unwrap() {
        let message = message.unwrap();
        match message.body {
            Body::Telemetry(_) => drop(start_ns.get_or_insert(message.log_time_ns)),
            Body::Truth(t) => {
                let clock_s = message.log_time_ns.abs_diff(start_ns.unwrap()) as f64 * 1e-9;
                assert!((clock_s - t.time_s).abs() < 1e-6, "the truth's time is the trial's");
            }
            _ => {}
        }
    }
    let data = Data::read(&log, Want::default()).unwrap();
    let zeroed = Zeroed::new(&data);
    let number = |key: &str| trial[key].as_f64().unwrap_or(f64::NAN);
    // Like the reported yaw: from the last second before the run to the steady window.
    let (yaw, run_s) = (data.truth.track(0), data.times.run.start);
    let window = zeroed.steady.as_ref().unwrap().window.clone();
    let turned = yaw.mean(window).unwrap() - yaw.mean(run_s - 1.0..run_s).unwrap();
    Errors {
        pitch_rms_deg: rms(&data, &zeroed, 0),
        roll_rms_deg: rms(&data, &zeroed, 1),
        yaw_deg: number("yaw_deg") - turned,
        yaw_uncertainty_deg: number("yaw_uncertainty_deg"),
    }
}

/// Opens a log and reads its metadata.
fn read(log: &Path) -> Reader {
    let mut reader = Reader::open(log).unwrap();
    reader.by_ref().for_each(|message| drop(message.unwrap()));
    reader
}

/// Records a session on the emulated board with the simulated robot.
fn record(bench: &Bench, plan: &str, seed: u64) -> Value {
    let seed = seed.to_string();
    let run = bench.run(["record", plan, "--virtual", "--seed", &seed, "--out", "session", "--json"]);
    // On a busy machine the motors may start late, with a warning.
    assert!(matches!(run.code, Some(0 | 3)), "{run:?}");
    run.json()
}

/// A short trial with the largest tilt.
#[test]
fn logged_attitude_agrees_with_the_truth() {
    let bench = Bench::new();
    let plan = bench.file(
        "plan.toml",
        "[board]\ndeadline_ms = 5000\n[trial]\ncalibrate = 3\npreroll = 8\nrun = 24\ndecay = 8\n\
         [speeds]\npairs = [[-90, 90]]\n",
    );
    let run = record(&bench, plan.to_str().unwrap(), 1);
    let trial = &run["trials"][0];
    let errors = errors(&bench, trial);
    println!("{errors:?}");
    assert!(errors.pitch_rms_deg < 0.5 && errors.roll_rms_deg < 0.5, "{errors:?}");
    assert!(errors.yaw_deg.abs() < errors.yaw_uncertainty_deg.max(0.5), "{errors:?}");

    let reader = read(&bench.path().join(trial["log"].as_str().unwrap()));
    assert_eq!(reader.meta::<biflag_log::Identity>().unwrap().origin, Origin::VirtualRig);
    let sensor = reader.meta::<SensorMeta>().unwrap();
    assert!(sensor.seed == 1 && sensor.gyro_bias_dps.iter().all(|bias| *bias != 0.0), "{sensor:?}");
    assert_eq!(reader.meta::<ModelMeta>().unwrap().robot(), Some(Default::default()));
    for topic in ["/truth", "/forces", "/flagella", "/flagella_points"] {
        assert!(reader.counts().get(topic).is_some_and(|count| *count > 300), "{topic}: {:?}", reader.counts());
    }
    assert!(reader.meta::<Summary>().is_some());
}

/// A failure of the simulator ends the trial with its reason, and the log contains the ground truth until then.
#[test]
fn simulator_failure_ends_the_trial_with_its_reason() {
    let bench = Bench::new();
    bench.file("hard.toml", "[flagellum]\nyoung_pa = 2e4\n[solver]\nhalvings = 0\nsweeps = 12\ntolerance = 1e-4\n");
    let plan = bench.file(
        "plan.toml",
        "[session]\nrobot = \"hard.toml\"\n\
         [board]\ndeadline_ms = 5000\n[trial]\ncalibrate = 0\npreroll = 2\nrest_at_most = 0\nrun = 20\ndecay = 0\n\
         [speeds]\npairs = [[90, -90]]\n",
    );
    let run = bench.run(["record", plan.to_str().unwrap(), "--virtual", "--out", "session", "--json"]).expect_code(1);
    assert!(run.stderr.contains("simulated robot could not go on: no step from"), "{run:?}");
    let log = bench.path().join(run.json()["trials"][0]["log"].as_str().unwrap());
    let reader = read(&log);
    let summary = reader.meta::<Summary>().unwrap();
    assert!(summary.end == End::Failed && summary.reason.contains("no step from"), "{summary:?}");
    assert!(reader.counts()["/telemetry"] > 300 && reader.counts()["/truth"] > 80, "{:?}", reader.counts());
}

/// The four published points, each with 25 sensors: `cargo test --release -p tests --test all attitude_chain -- --ignored
/// --nocapture`, three quarters of an hour on two cores.
#[test]
#[ignore = "takes three quarters of an hour"]
fn yaw_of_a_hundred_trials_is_within_the_stated_uncertainty() {
    const SEEDS: u64 = 25;
    let next = AtomicU64::new(1);
    let all: Mutex<Vec<(String, Errors)>> = Mutex::default();
    let work = || {
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed > SEEDS {
                return;
            }
            let bench = Bench::new();
            let plan = bench.file("plan.toml", "[speeds]\npairs = [[50, 10], [0, 45], [90, 90], [-90, 90]]\n");
            for trial in record(&bench, plan.to_str().unwrap(), seed)["trials"].as_array().unwrap() {
                let (name, errors) = (trial["name"].as_str().unwrap().to_owned(), errors(&bench, trial));
                println!("seed {seed}, {name}: {errors:.3?}");
                all.lock().unwrap().push((name, errors));
            }
        }
    };
    std::thread::scope(|scope| (0..2).for_each(|_| drop(scope.spawn(work))));
    let mut all = all.into_inner().unwrap();
    all.sort_by(|a, b| a.0.cmp(&b.0));
    for point in all.chunk_by(|a, b| a.0 == b.0) {
        let worst = |of: fn(&Errors) -> f64| point.iter().map(|(_, errors)| of(errors)).fold(0.0, f64::max);
        let rms = |of: fn(&Errors) -> f64| {
            (point.iter().map(|(_, errors)| of(errors).powi(2)).sum::<f64>() / point.len() as f64).sqrt()
        };
        println!(
            "{} x {}: pitch {:.3} deg RMS (worst trial {:.3}), roll {:.3} ({:.3}), yaw {:.3} RMS, stated {:.3}",
            point.len(),
            point[0].0,
            rms(|e| e.pitch_rms_deg),
            worst(|e| e.pitch_rms_deg),
            rms(|e| e.roll_rms_deg),
            worst(|e| e.roll_rms_deg),
            rms(|e| e.yaw_deg),
            rms(|e| e.yaw_uncertainty_deg),
        );
    }
    let covered = all.iter().filter(|(_, e)| e.yaw_deg.abs() <= e.yaw_uncertainty_deg).count();
    println!("yaw within its stated uncertainty in {covered} of {}", all.len());
    assert!(all.iter().all(|(_, e)| e.pitch_rms_deg < 0.5 && e.roll_rms_deg < 0.5));
    assert!(all.len() == 100 && covered >= 95, "{covered} of {}", all.len());
}
