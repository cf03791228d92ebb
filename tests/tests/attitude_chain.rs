//! Compares the logged attitude with the ground truth of the simulated robot, through the complete chain: motors, fluid
//! and flagella, base, sensor with its errors, firmware, link, log.

use biflag_log::schema::biflag::{Telemetry, Truth};
use biflag_log::{Body, End, ModelMeta, Origin, Reader, SensorMeta, Summary};
use host::attitude::tilt_deg;
use host::trial::{Data, Judged, Want, Zeroed};
use serde_json::Value as Json;
use std::fs;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use tests::Bench;

/// The angles, in the order of all arrays here.
const ANGLES: [&str; 4] = ["yaw", "pitch", "roll", "tilt"];

/// Errors of the log: logged minus true values.
#[derive(Debug)]
struct Errors {
    /// Of the steady angles.
    steady_deg: [f64; 4],
    /// Their stated 95 % uncertainties.
    stated_deg: [f64; 4],
    /// Root mean square over the run of the errors of pitch and roll without their means: what is left is the wobble.
    wobble_deg: [f64; 2],
}

impl Errors {
    /// Returns the errors over the stated uncertainties.
    fn ratios(&self) -> [f64; 4] {
        [0, 1, 2, 3].map(|k| self.steady_deg[k].abs() / self.stated_deg[k])
    }
}

/// Returns the standard deviation of the error of pitch (0) or roll (1) over the second half of the run.
fn wobble(data: &Data, zeroed: &Zeroed, tilt: usize) -> f64 {
    let run = 0.5 * (data.times.run.start + data.times.run.end)..data.times.run.end;
    let truth = data.truth.track(1 + tilt);
    let inside = truth.time_s.iter().zip(truth.value).filter(|(time, _)| run.contains(time));
    let errors: Vec<f64> = inside.map(|(time, truth)| zeroed.at(*time)[1 + tilt] - truth).collect();
    assert!(errors.len() as f64 > 49.0 * (run.end - run.start), "ground truth is missing");
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    (errors.iter().map(|error| (error - mean).powi(2)).sum::<f64>() / errors.len() as f64).sqrt()
}

/// Compares a trial of `record --json` with the ground truth in its log.
fn errors(bench: &Bench, trial: &Json) -> Errors {
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
    let Judged { data, angles: zeroed, .. } = Judged::read(&log, Want::default()).unwrap();
    let number = |key: String| trial[&key].as_f64().unwrap_or(f64::NAN);
    // As the reported angles: over the steady window, the yaw from the last second before the run on.
    let (window, run_s) = (zeroed.steady.as_ref().unwrap().window.clone(), data.times.run.start);
    let truth = |k: usize| data.truth.track(k).mean(window.clone()).unwrap();
    let yaw_at_rest = data.truth.track(0).mean(run_s - 1.0..run_s).unwrap();
    let truth = [truth(0) - yaw_at_rest, truth(1), truth(2), tilt_deg(truth(1), truth(2))];
    Errors {
        steady_deg: [0, 1, 2, 3].map(|k| number(format!("{}_deg", ANGLES[k])) - truth[k]),
        stated_deg: ANGLES.map(|angle| number(format!("{angle}_uncertainty_deg"))),
        wobble_deg: [wobble(&data, &zeroed, 0), wobble(&data, &zeroed, 1)],
    }
}

/// Opens a log and reads its metadata.
fn read(log: &Path) -> Reader {
    let mut reader = Reader::open(log).unwrap();
    reader.by_ref().for_each(|message| drop(message.unwrap()));
    reader
}

/// Records a session on the emulated board with the simulated robot.
fn record(bench: &Bench, plan: &str, seed: u64) -> Json {
    let seed = seed.to_string();
    let run = bench.run(["record", plan, "--virtual", "--seed", &seed, "--out", "session", "--json"]);
    // On a busy machine the motors may start late, with a warning.
    assert!(matches!(run.code, Some(0 | 3)), "{run:?}");
    run.json()
}

type Value<M> = (&'static str, fn(&M) -> f64);

/// A value of a frame on each axis, and of each part.
const FRAME: [Value<Telemetry>; 7] = [
    ("rate_x_dps", |frame| frame.angular_velocity_dps.unwrap().x),
    ("acceleration_y_mps2", |frame| frame.acceleration_mps2.unwrap().y),
    ("gyro_z_counts", |frame| frame.gyro_counts.unwrap().z.into()),
    ("accel_x_counts", |frame| frame.accel_counts.unwrap().x.into()),
    ("temperature_counts", |frame| frame.temperature_counts.into()),
    ("duty1", |frame| frame.motor1.unwrap().duty.into()),
    ("encoder2_counts", |frame| frame.motor2.unwrap().encoder_counts.into()),
];

const TRUTH: [Value<Truth>; 6] = [
    ("truth_yaw_deg", |truth| truth.yaw_deg),
    ("truth_pitch_deg", |truth| truth.pitch_deg),
    ("truth_rate_x_dps", |truth| truth.angular_velocity_dps.unwrap().x),
    ("truth_rate_z_dps", |truth| truth.angular_velocity_dps.unwrap().z),
    ("truth_speed1_rpm", |truth| truth.motor1_rpm),
    ("truth_turns2", |truth| truth.motor2_turns),
];

/// Checks that each row of an export has the values of its frame, and the truth between the samples around its time.
fn check_export(bench: &Bench, log: &str) {
    assert!(matches!(bench.run(["export", log, "-o", "log.csv"]).code, Some(0 | 3)));
    let csv = fs::read_to_string(bench.path().join("log.csv")).unwrap();
    let mut lines = csv.lines().filter(|line| !line.starts_with('#')).map(|line| line.split(',').collect::<Vec<_>>());
    let names = lines.next().unwrap();
    let at = |name: &str| names.iter().position(|other| *other == name).unwrap_or_else(|| panic!("{name}: {names:?}"));
    let (mut frames, mut truths) = (Vec::new(), Vec::new());
    for message in Reader::open(&bench.path().join(log)).unwrap() {
        match message.unwrap().body {
            Body::Telemetry(frame) if frame.imu_fresh => frames.push(frame),
            Body::Truth(truth) => truths.push(truth),
            _ => {}
        }
    }
    let Judged { data, .. } = Judged::read(&bench.path().join(log), Want::default()).unwrap();
    // By the true rate of the board's clock.
    let times = &data.truth.time_s;
    assert_eq!(times.len(), truths.len());
    let (mut rows, mut known) = (0, 0);
    for (row, frame) in lines.zip(&frames) {
        let cell = |name: &str| row[at(name)].parse::<f64>().ok();
        for (name, of) in FRAME {
            assert!((cell(name).unwrap() - of(frame)).abs() < 1e-8, "{name} of {row:?}, not {}", of(frame));
        }
        let time_s = cell("time_s").unwrap() + data.times.run.start;
        let after = times.partition_point(|time| *time < time_s);
        for (name, of) in TRUTH {
            let (Some(value), Some([a, b])) = (cell(name), truths.get(after.wrapping_sub(1)..=after)) else {
                assert!(cell(name).is_none() && (after == 0 || after == times.len()), "{name} of {row:?}");
                continue;
            };
            let share = (time_s - times[after - 1]) / (times[after] - times[after - 1]);
            let expected = of(a) + share * (of(b) - of(a));
            assert!((value - expected).abs() < 1e-6, "{name} of {row:?}, not {expected}");
            known += 1;
        }
        rows += 1;
    }
    assert_eq!(rows, frames.len());
    assert!(known > TRUTH.len() * (rows - 12), "{known} values of {rows} rows");
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
    assert!(errors.ratios().iter().all(|ratio| *ratio < 1.0), "{errors:?}");
    assert!(errors.wobble_deg.iter().all(|deg| *deg < 0.5), "{errors:?}");
    check_export(&bench, trial["log"].as_str().unwrap());
    // The budget of each angle is its ±.
    for (k, angle) in ANGLES.iter().enumerate() {
        let terms = trial["budget"].as_array().unwrap().iter().filter(|term| term["angle"] == *angle);
        let (mut variance, mut share) = (0.0, 0.0);
        terms.for_each(|term| {
            variance += term["u_deg"].as_f64().unwrap().powi(2);
            share += term["share"].as_f64().unwrap();
        });
        let factor = errors.stated_deg[k] / variance.sqrt();
        assert!((1.95..2.6).contains(&factor) && (share - 1.0).abs() < 1e-6, "{angle}: {factor}, {share}");
    }

    let reader = read(&bench.path().join(trial["log"].as_str().unwrap()));
    assert_eq!(reader.meta::<biflag_log::Identity>().unwrap().origin, Origin::VirtualRig);
    let sensor = reader.meta::<SensorMeta>().unwrap();
    assert!(sensor.seed == 1 && sensor.kind == "typical" && sensor.gyro_scale[0] != 0.0, "{sensor:?}");
    assert_eq!(reader.meta::<ModelMeta>().unwrap().robot(), Some(Default::default()));
    for topic in ["/truth", "/forces", "/flagella", "/flagella_points"] {
        assert!(reader.counts.get(topic).is_some_and(|count| *count > 300), "{topic}: {:?}", reader.counts);
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
    assert!(reader.counts["/telemetry"] > 300 && reader.counts["/truth"] > 80, "{:?}", reader.counts);
}

/// The four published points, each with 25 sensors: `cargo test --release -p tests --test all attitude_chain -- --ignored
/// --nocapture`, three quarters of an hour on two cores.
#[test]
#[ignore = "takes three quarters of an hour"]
fn angles_of_a_hundred_trials_are_within_their_stated_uncertainties() {
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
    assert_eq!(all.len(), 100);
    all.sort_by(|a, b| a.0.cmp(&b.0));
    for point in all.chunk_by(|a, b| a.0 == b.0) {
        let rms = |of: &dyn Fn(&Errors) -> f64| {
            (point.iter().map(|(_, errors)| of(errors).powi(2)).sum::<f64>() / point.len() as f64).sqrt()
        };
        println!("{} x {}:", point.len(), point[0].0);
        for (k, angle) in ANGLES.iter().enumerate() {
            let [error, stated] = [rms(&|e| e.steady_deg[k]), rms(&|e| e.stated_deg[k])];
            println!("  {angle} {error:.3} deg RMS, stated {stated:.3}");
        }
    }
    for (k, angle) in ANGLES.iter().enumerate() {
        let covered = all.iter().filter(|(_, errors)| errors.ratios()[k] <= 1.0).count();
        println!("{angle} within its stated uncertainty in {covered} of {}", all.len());
        assert!((90..=99).contains(&covered), "{angle}: {covered}");
    }
    assert!(all.iter().all(|(_, errors)| errors.wobble_deg.iter().all(|deg| *deg < 0.5)));
}
