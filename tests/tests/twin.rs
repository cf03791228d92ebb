//! End-to-end tests of replay, comparison and calibration, with trials recorded from the simulated robot through the
//! real firmware.

use host::trial::{Judged, Want};
use serde_json::Value;
use sim::params::{Robot, Tank};
use std::path::Path;
use tests::Bench;
use tests::browser::Browser;

/// Returns the JSON of `biflag`. Warnings are allowed, because the motors may start late on a busy machine.
fn answer(bench: &Bench, arguments: &[&str]) -> Value {
    let run = bench.run(arguments);
    assert!(matches!(run.code, Some(0 | 3)), "{run:?}");
    run.json()
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} in {value}"))
}

/// Returns the errors of a comparison's first trial: steady, and over the run.
fn errors(compared: &Value) -> [f64; 4] {
    let trial = &compared["trials"][0];
    ["steady_yaw_error_deg", "steady_pitch_error_deg", "yaw_rmse_deg", "pitch_rmse_deg"].map(|key| number(trial, key))
}

/// Returns the true yaw, pitch and roll at the end of the run, relative to the rest before it.
fn steady_truth(log: &Path) -> [f64; 3] {
    let data = Judged::read(log, Want::default()).unwrap().data;
    let (start, end) = (data.times.run.start, data.times.run.end);
    let mean = |k: usize, range| data.truth.track(k).mean(range).unwrap();
    [0, 1, 2].map(|k| mean(k, end - 12.0..end) - mean(k, start - 1.0..start))
}

#[test]
fn replay_agrees_with_the_recording_only_in_the_same_fluid() {
    let bench = Bench::new();
    bench.file(
        "plan.toml",
        "[board]\ndeadline_ms = 5000\n[trial]\ncalibrate = 5\npreroll = 15\nrun = 30\ndecay = 20\n[speeds]\npairs = [[-90, 90]]\n",
    );
    // The replay is to be exact, and not the sensor.
    let ideal = ["--virtual", "--sensor", "ideal", "--seed", "7"];
    answer(&bench, &[&["record", "plan.toml", "--out", "tank", "--json"], &ideal[..]].concat());

    let right = answer(&bench, &["compare", "tank", "--json"]);
    println!("the robot itself: steady yaw and pitch, RMS of yaw and pitch: {:.3?}", errors(&right));
    let [yaw, pitch, yaw_rmse, pitch_rmse] = errors(&right);
    // The error of the measured yaw is within its stated uncertainty.
    let unknown = number(&right["trials"][0], "yaw_uncertainty_deg");
    assert!(yaw.abs() < unknown.max(0.5) && pitch.abs() < 0.5, "{right}");
    assert!(yaw_rmse < 1.0 && pitch_rmse < 1.0, "{right}");
    let log = bench.path().join(right["trials"][0]["measured"].as_str().unwrap());
    let modelled = right["trials"][0]["steady_modelled_deg"].as_array().unwrap();
    for (angle, (truth, modelled)) in
        ["yaw", "pitch", "roll"].into_iter().zip(steady_truth(&log).into_iter().zip(modelled))
    {
        let error = modelled.as_f64().unwrap() - truth;
        println!("replay minus truth, steady {angle}: {error:+.3} deg");
        assert!(error.abs() < 0.5, "{angle}: {error}");
    }

    bench.file("thick.toml", "[fluid]\nviscosity_pa_s = 1.2\n");
    let wrong = answer(&bench, &["compare", "tank", "--robot", "thick.toml", "--json"]);
    println!("in a fluid 20 % thicker: {:.3?}", errors(&wrong));
    let [yaw, pitch, yaw_rmse, _] = errors(&wrong);
    assert!(yaw.abs() > 3.0 && yaw_rmse > 3.0, "{wrong}");

    // The page of the latter shows the same numbers.
    let page = bench.path().join(wrong["report"].as_str().expect("a page"));
    let mut browser = Browser::start();
    browser.window(1280, 900, false);
    browser.open(&page);
    assert!(browser.problems.is_empty(), "{:#?}", browser.problems);
    let pictures = Path::new(env!("CARGO_MANIFEST_DIR")).with_file_name("target").join("report-pictures");
    browser.picture(&pictures.join("comparison-session.png"));
    browser.evaluate("location.hash = document.querySelector('table.trials tbody a').getAttribute('href')");
    browser.evaluate("new Promise((done) => setTimeout(done, 100)).then(() => 0)");
    let shown = browser.evaluate("[...document.querySelectorAll('section:not([hidden]) .tile')].map(t => t.innerText)");
    let shown: Vec<_> = shown.as_array().unwrap().iter().map(|text| text.as_str().unwrap().to_owned()).collect();
    println!("{shown:#?}");
    for (tile, error) in shown.iter().zip([yaw, pitch]) {
        let said = format!("error {}{:.2}°", if error < 0.0 { "−" } else { "" }, error.abs());
        assert!(tile.contains(&said), "{said} in {tile}");
    }
    browser.picture(&pictures.join("comparison-trial.png"));
}

/// The parameters of robots that the fit does not know, and the robots' file.
fn hidden(draw: &mut impl FnMut() -> f64) -> ([(&'static str, f64); 2], Robot) {
    let mut robot = Robot::default();
    robot.fluid.viscosity_pa_s *= 0.8 + 0.4 * draw();
    robot.joint.tether_full_nm_per_rad *= 0.8 + 0.4 * draw();
    let truth = [("viscosity", robot.fluid.viscosity_pa_s), ("tether", robot.joint.tether_full_nm_per_rad)];
    (truth, robot)
}

/// Records three trials of a robot with a sensor that is drawn from the data sheet, and fits `physical` to them.
fn recorded_and_fitted(robot: &Robot, seed: u64) -> Value {
    let bench = Bench::new();
    bench.file("hidden.toml", &toml::to_string(robot).unwrap());
    bench.file(
        "plan.toml",
        "[session]\nrobot = \"hidden.toml\"\n[board]\ndeadline_ms = 5000\n[trial]\ncalibrate = 5\npreroll = 20\nrun = 60\ndecay = 30\n\
         [speeds]\npairs = [[50.3, 10.7], [-87.4, 79.6], [12.9, 46.1]]\n",
    );
    let seed = seed.to_string();
    let record =
        ["record", "plan.toml", "--virtual", "--sensor", "typical", "--seed", &seed, "--out", "tank", "--json"];
    answer(&bench, &record);
    let fit = ["calibrate", "tank", "--robot", "physical", "--fit", "viscosity,tether", "-o", "fitted.toml", "--json"];
    answer(&bench, &fit)
}

/// Recovers two parameters of ten robots, each up to 20 % from `physical`, from three trials each with a sensor of its own that is
/// drawn from the data sheet; and then of a robot in a tank, which is fitted without walls:
/// `cargo test --release -p tests --test all twin -- --ignored --nocapture`, a quarter of an hour on two cores.
#[test]
#[ignore = "takes a quarter of an hour"]
fn calibration_recovers_ten_robots_from_recordings() {
    const ROBOTS: usize = 10;
    // A linear congruential generator (Knuth's MMIX).
    let mut state = 2024u64;
    let mut draw = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let mut held = [0; 2];
    println!(
        "| robot | viscosity Pa s | fitted | 95 % | tether mN m/rad | fitted | 95 % | RMSE after, deg | misfits |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    for seed in 1..=ROBOTS {
        let (truths, robot) = hidden(&mut draw);
        let fitted = recorded_and_fitted(&robot, seed as u64);
        let mut row = format!("| {seed} |");
        for (i, (name, truth)) in truths.into_iter().enumerate() {
            let parameters = fitted["parameters"].as_array().unwrap();
            let found = parameters.iter().find(|parameter| parameter["name"] == name).unwrap();
            let [low, high] = [0, 1].map(|i| found["interval_95"][i].as_f64().unwrap());
            let is_held = (low..=high).contains(&truth);
            held[i] += usize::from(is_held);
            let scale = if name == "tether" { 1e3 } else { 1.0 };
            let [truth, value, low, high] = [truth, number(found, "value"), low, high].map(|value| value * scale);
            let outside = if is_held { "" } else { ", outside" };
            row += &format!(" {truth:.4} | {value:.4} | {low:.4} to {high:.4}{outside} |");
        }
        println!("{row} {:.3} | {} |", number(&fitted, "rmse_after_deg"), fitted["misfits"]);
        assert_eq!(fitted["misfits"].as_array().unwrap().len(), 0, "the model is right: {fitted:#}");
    }
    println!("within 95 %: viscosity {} of {ROBOTS}, tether {} of {ROBOTS}", held[0], held[1]);
    let (_, robot) = hidden(&mut draw);
    let wrong = recorded_and_fitted(&Robot { tank: Some(Tank::published()), ..robot }, 11);
    let misfits = wrong["misfits"].as_array().unwrap();
    println!("a robot in a tank, fitted without walls:");
    misfits.iter().for_each(|text| println!("  {}", text.as_str().unwrap()));
    assert!(held.iter().all(|held| *held >= ROBOTS - 1), "{held:?}");
    let text = wrong["misfits"].to_string();
    assert!(text.contains("times its noise") && text.contains("the model does not describe these trials"), "{wrong:#}");
}
