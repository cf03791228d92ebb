//! End-to-end tests of `aim` with a robot that is known only from its recordings.

use host::aim::Attitude;
use serde_json::Value;
use sim::body::closure::Closure;
use sim::params::Robot;
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Trial};
use tests::Bench;

/// Attitudes that are asked for.
const ATTITUDES: usize = 10;
/// Attitudes of them whose recording must be within the interval.
const WITHIN: usize = 9;

/// Returns the JSON of `biflag`. Warnings are allowed, because the motors may start late on a busy machine.
fn answer(bench: &Bench, arguments: &[&str]) -> Value {
    let run = bench.run(arguments);
    assert!(matches!(run.code, Some(0 | 3)), "{run:?}");
    run.json()
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} in {value}"))
}

/// Fits a hidden robot to four recordings, asks for the speeds of ten of its attitudes, and records these:
/// `cargo test --release -p tests --test all aim -- --ignored --nocapture`, a quarter of an hour on two cores.
#[test]
#[ignore = "takes a quarter of an hour"]
fn a_fitted_robot_takes_the_attitudes_that_it_is_asked_for() {
    let mut hidden = Robot::default();
    hidden.fluid.viscosity_pa_s = 0.85;
    hidden.joint.tether_full_nm_per_rad = 6e-4;
    let bench = Bench::new();
    bench.file("hidden.toml", "[fluid]\nviscosity_pa_s = 0.85\n[joint]\ntether_full_nm_per_rad = 6e-4\n");
    let head =
        "[session]\nrobot = \"hidden.toml\"\n[board]\ndeadline_ms = 5000\n[trial]\ncalibrate = 5\npreroll = 20\n";
    bench.file(
        "known.toml",
        &format!("{head}run = 60\ndecay = 30\n[speeds]\npairs = [[50, 10], [-90, 80], [0, 45], [70, 60]]\n"),
    );
    answer(&bench, &["record", "known.toml", "--virtual", "--seed", "7", "--out", "known", "--json"]);
    answer(&bench, &["calibrate", "known", "--robot", "physical", "-o", "fitted.toml", "--json"]);

    // A linear congruential generator (Knuth's MMIX).
    let mut state = 2026u64;
    let mut within = |low: f64, high: f64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let mut solutions = Vec::new();
    for _ in 0..ATTITUDES {
        let profile = SpeedProfile::constant([within(-90.0, 90.0), within(0.0, 90.0)], 120.0).unwrap();
        let mut trial = Trial::new(&hidden, Closure::Full, profile, Options::default()).unwrap();
        let attitude = Attitude::of(&trial.finish().unwrap());
        let (yaw, pitch) = (format!("--yaw={}", attitude.yaw_deg), format!("--pitch={}", attitude.pitch_deg));
        let aimed = answer(&bench, &["aim", &yaw, &pitch, "--robot", "fitted.toml", "--json"]);
        assert_eq!(aimed["reachable"], true, "{aimed:#}");
        solutions.push(aimed["solutions"][0].clone());
    }
    let pairs: Vec<_> = solutions.iter().map(|s| format!("[{}, {}]", s["w1_rpm"], s["w2_rpm"])).collect();
    // The trials need different speeds, and keep their order.
    bench.file("asked.toml", &format!("{head}run = 120\ndecay = 30\n[speeds]\npairs = [{}]\n", pairs.join(", ")));
    let recorded = answer(&bench, &["record", "asked.toml", "--virtual", "--seed", "8", "--out", "asked", "--json"]);
    let trials = recorded["trials"].as_array().unwrap();
    assert_eq!(trials.len(), ATTITUDES);
    let mut met = 0;
    println!("| speeds, rpm | recorded yaw | 95 % | recorded pitch | 95 % | within |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for (trial, solution) in trials.iter().zip(&solutions) {
        let bounds = |key: &str| [0, 1].map(|i| solution[key][i].as_f64().unwrap());
        let (yaw, pitch) = (number(trial, "yaw_deg"), number(trial, "pitch_deg"));
        let ([yaw_low, yaw_high], [pitch_low, pitch_high]) = (bounds("yaw_ci_deg"), bounds("pitch_ci_deg"));
        let holds = (yaw_low..=yaw_high).contains(&yaw) && (pitch_low..=pitch_high).contains(&pitch);
        met += usize::from(holds);
        println!(
            "| {}, {} | {yaw:.2} (± {:.2}) | {yaw_low:.2} to {yaw_high:.2} | {pitch:.2} | {pitch_low:.2} to {pitch_high:.2} | {holds} |",
            number(trial, "w1_rpm"),
            number(trial, "w2_rpm"),
            number(trial, "yaw_uncertainty_deg")
        );
    }
    assert!(met >= WITHIN, "{met} of {ATTITUDES}");
}
