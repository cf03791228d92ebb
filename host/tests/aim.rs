//! Tests of `aim`: the model's own trial at the speeds that it finds takes the attitude that was asked for.
//!
//! A few attitudes run with the other tests. To run two hundred, with a table:
//!
//! ```text
//! AIM_CASES=200 cargo test --release -p host --test all aim -- --ignored --nocapture
//! ```

use host::aim::{self, Aimed, Attitude, Known, Model, Quantity, Target};
use serde_json::Value;
use sim::body::closure::Closure;
use sim::params::Robot;
use sim::step::InversesAtRest;
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Trial};
use std::path::Path;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

/// A solution counts if the trial's yaw and pitch are this near to what was asked for, degrees.
const NEAR_DEG: f64 = 0.5;

/// Returns the steady attitude of a whole trial at these speeds.
fn trial(rpm: [f64; 2]) -> Attitude {
    let profile = SpeedProfile::constant(rpm, 120.0).unwrap();
    let mut trial = Trial::new(&Robot::default(), Closure::Full, profile, Options::default()).unwrap();
    Attitude::of(&trial.finish().unwrap())
}

fn yaw_and_pitch(attitude: &Attitude) -> Target {
    Target { wanted: vec![(Quantity::Yaw, attitude.yaw_deg), (Quantity::Pitch, attitude.pitch_deg)] }
}

fn aimed(target: &Target) -> Aimed {
    let robot = Robot::default();
    let at_rest = InversesAtRest::default();
    let model = Model { robot: &robot, at_rest: &at_rest, goes_on: &|| true, until: None, solved: &|| {} };
    aim::aim(&model, &Known::new(&robot, None), &aim::shipped().unwrap(), target, Duration::from_secs(600)).unwrap()
}

fn biflag(args: &[&str]) -> (Output, Value) {
    let output = Command::new(env!("CARGO_BIN_EXE_biflag")).arg("aim").arg("--json").args(args).output().unwrap();
    let json = serde_json::from_slice(&output.stdout).unwrap();
    (output, json)
}

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Random ones are in `make proof`.
#[test]
fn speeds_that_are_found_give_the_attitude() {
    for rpm in [[50.0, 10.0], [12.4, 78.66]] {
        let target = yaw_and_pitch(&trial(rpm));
        let aimed = aimed(&target);
        println!("{rpm:?}: {target:?}");
        assert!(aimed.reachable && aimed.is_complete(), "{aimed:?}");
        for solution in &aimed.solutions {
            let attitude = trial(solution.state.rpm());
            println!("  {:?}: {attitude:?}", solution.state.rpm());
            assert!(target.error_deg(&attitude) < NEAR_DEG, "{solution:?}");
            for (value, ci) in [
                (attitude.yaw_deg, solution.interval.yaw_ci_deg),
                (attitude.pitch_deg, solution.interval.pitch_ci_deg),
                (attitude.roll_deg, solution.interval.roll_ci_deg),
            ] {
                let [low, high] = ci.expect("an interval");
                assert!((low..=high).contains(&value), "{value} in {solution:?}");
            }
        }
    }
}

#[test]
fn exchanged_motors_lean_the_robot_to_the_other_side() {
    let (output, json) = biflag(&["--yaw=-67.6", "--tilt", "6.65", "--for", "600"]);
    assert_eq!(output.status.code(), Some(0), "{json}");
    let solutions = json["solutions"].as_array().unwrap();
    let number = |solution: &Value, key: &str| solution[key].as_f64().unwrap();
    let mirrored = |one: &Value, other: &Value| {
        (number(one, "w1_rpm") - number(other, "w2_rpm")).abs() < 0.5
            && (number(one, "w2_rpm") - number(other, "w1_rpm")).abs() < 0.5
            && (number(one, "pitch_deg") + number(other, "pitch_deg")).abs() < 0.5
    };
    assert!(solutions.iter().any(|one| solutions.iter().any(|other| mirrored(one, other))), "{json:#}");
    for solution in solutions {
        assert!(number(solution, "error_deg") < NEAR_DEG);
        assert!(solution["contact"] == "apart" && number(solution, "min_gap_m") > 0.0, "{solution:#}");
    }
}

/// A robot whose viscosity is fitted to some 2 %, most of it by the scatter of a few independent residuals.
const FITTED: &str = "[fluid]\nviscosity_pa_s = 1.1\n\n# made by hand\n[fit]\nclosure = \"full\"\n\
    fitted_to = \"simulation\"\nis_described = true\ndegrees_of_freedom = 2.7\ncovariance = [[4.84e-4]]\n\
    scatter_covariance = [[4.4e-4]]\n\n[[fit.parameters]]\nname = \"viscosity\"\nkey = \"fluid.viscosity_pa_s\"\n\
    unit = \"Pa s\"\nstart = 1.0\nvalue = 1.1\nstd_error = 0.022\ninterval_95 = [1.03, 1.17]\n";

#[test]
fn a_plan_has_the_speeds_and_the_robot() {
    let folder = tempfile::tempdir().unwrap();
    let (robot, out) = (folder.path().join("thick.toml"), folder.path().join("plan.toml"));
    std::fs::write(&robot, FITTED).unwrap();
    let args = ["--yaw=-40", "--pitch", "2", "--robot", path(&robot), "-o", path(&out)];
    let (output, json) = biflag(&args);
    assert_eq!(output.status.code(), Some(0), "{json}");
    let first = &json["solutions"][0];
    // The yaw is nearly proportional to the viscosity, whose standard error is 2 %.
    let error = first["std_error_deg"][0].as_f64().unwrap();
    assert!(error > 0.4 && error < 1.2, "{first:#}");
    assert_eq!((&json["confidence"], &json["doubts"]), (&0.95.into(), &serde_json::json!([])));
    // Student's quantile for the 2.7 degrees of freedom of nine tenths of the variance is 3.2.
    let ci: Vec<f64> = first["yaw_ci_deg"].as_array().unwrap().iter().map(|bound| bound.as_f64().unwrap()).collect();
    assert!(ci[1] - ci[0] > 2.0 * 3.0 * error && ci[1] - ci[0] < 2.0 * 3.6 * error, "{first:#}");
    assert!(first["model_error_deg"].is_null(), "a simulation has no error of the model: {first:#}");

    let plan = host::plan::Plan::load(&out).unwrap();
    assert_eq!(plan.trials.len(), json["solutions"].as_array().unwrap().len());
    assert_eq!(plan.trials[0].speeds[0].rpm(), first["w1_rpm"].as_f64().unwrap());
    assert_eq!(plan.robot.parse().unwrap().fluid.viscosity_pa_s, 1.1);

    let (output, json) = biflag(&args);
    assert_eq!(output.status.code(), Some(2), "{json}");
    assert!(json["error"].as_str().unwrap().contains("already exists"), "{json}");
}

/// What is known of a robot survives a program that knows nothing but TOML. Where it is not known, nothing is called a 95 %
/// interval.
#[test]
fn intervals_are_those_of_the_fit_or_have_no_confidence() {
    let folder = tempfile::tempdir().unwrap();
    let aimed = |text: &str| {
        let robot = folder.path().join("robot.toml");
        std::fs::write(&robot, text).unwrap();
        let (output, json) = biflag(&["--yaw=-40", "--pitch", "2", "--for", "600", "--robot", path(&robot)]);
        (output.status.code().unwrap(), json)
    };
    let (_, fitted) = aimed(FITTED);
    let reformatted = toml::to_string_pretty(&FITTED.parse::<toml::Table>().unwrap()).unwrap();
    assert!(reformatted != FITTED && !reformatted.contains('#'));
    let (code, same) = aimed(&reformatted);
    assert_eq!((code, &same["solutions"]), (0, &fitted["solutions"]));

    let reason = |json: &Value| json["doubts"][0]["reason"].as_str().unwrap_or_default().to_owned();
    let real = FITTED.replace("simulation", "robot");
    let (code, real) = aimed(&real);
    assert_eq!((code, &real["confidence"]), (0, &0.95.into()));
    let width = |json: &Value| {
        let bound = |i: usize| json["solutions"][0]["pitch_ci_deg"][i].as_f64().unwrap();
        bound(1) - bound(0)
    };
    let of_model = real["solutions"][0]["model_error_deg"][1].as_f64().unwrap();
    assert!(of_model > 1.0 && width(&real) > 2.0 * of_model && width(&fitted) < of_model, "{real:#}");

    let old = "# viscosity (fluid.viscosity_pa_s): 1.10000e0 Pa s, standard error 2.2e-2, 95 % 1 to 2; it was 1\n\
               [fluid]\nviscosity_pa_s = 1.1\n";
    for (text, code, words) in [
        (old, 3, "an earlier version"),
        ("[fluid]\nviscosity_pa_s = 1.1\n", 0, "were not fitted"),
        (&FITTED.replace("\"full\"", "\"lumped\""), 3, "for the closure lumped"),
    ] {
        let (found, json) = aimed(text);
        assert_eq!((found, &json["confidence"]), (code, &Value::Null), "{json:#}");
        assert!(reason(&json).contains(words), "{json:#}");
        assert!(!json["solutions"][0]["yaw_ci_deg"].is_null());
    }
    let (code, json) = aimed(&FITTED.replace("degrees_of_freedom = 2.7", "degrees_of_freedom = -1.0"));
    assert_eq!(code, 2, "{json}");
    assert!(
        json["error"].as_str().unwrap().contains("robot.toml:9:22: [fit] degrees_of_freedom: -1 is less than 1"),
        "{json}"
    );
}

#[test]
fn an_attitude_out_of_reach_is_not_found() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("plan.toml");
    let (output, json) = biflag(&["--yaw", "0", "--pitch", "60", "--for", "600", "-o", path(&out)]);
    assert_eq!(output.status.code(), Some(3), "{json}");
    assert!(json["reachable"] == false && json["unfinished"].as_array().unwrap().is_empty(), "{json:#}");
    assert!(json["solutions"].as_array().unwrap().is_empty() && !out.exists());
    assert!(json["nearest"]["error_deg"].as_f64().unwrap() > 30.0, "{json:#}");
}

/// With contact all the time a trial takes seconds: the answer has the time that it is given.
#[test]
fn an_answer_is_given_in_time_and_names_what_is_unknown() {
    let begun = Instant::now();
    let (output, json) = biflag(&["--yaw", "150", "--pitch=-1", "--for", "1"]);
    assert!(begun.elapsed() < Duration::from_secs(20), "{:?}", begun.elapsed());
    assert_eq!(output.status.code(), Some(3), "{json}");
    let unfinished = json["unfinished"].as_array().unwrap();
    assert!(!unfinished.is_empty() && unfinished.iter().all(|one| one["yaw_deg"].is_number()), "{json:#}");
    for one in json["solutions"].as_array().unwrap().iter().chain(json.get("nearest")) {
        let is_unknown = one["unknown"].as_array().unwrap().contains(&"intervals".into());
        assert_eq!(one["yaw_ci_deg"].is_null(), is_unknown, "{one:#}");
    }
}

#[test]
fn wrong_use_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("table.csv");
    std::fs::write(&table, "speed,angle\n1,2\n").unwrap();
    for (args, words) in [
        (vec![], "none is named"),
        (vec!["--yaw", "60"], "one is named"),
        (vec!["--yaw", "60", "--pitch", "91"], "pitch cannot be 91"),
        (vec!["--yaw", "nan", "--tilt", "1"], "yaw cannot be NaN"),
        (vec!["--yaw", "60", "--pitch", "1", "--table", path(&table)], "it has no column w1_rpm"),
        (vec!["--yaw", "60", "--pitch", "1", "--robot", "missing.toml"], "cannot be read"),
        (vec!["--yaw", "60", "--pitch", "1", "--for", "0"], "give seconds"),
    ] {
        let (output, json) = biflag(&args);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {json}");
        assert!(json["error"].as_str().unwrap().contains(words), "{args:?}: {json}");
    }
}

/// Asks for the attitudes of random speeds in the published range.
#[test]
#[ignore = "takes minutes"]
fn two_hundred_random_attitudes_are_met() {
    let cases: usize = std::env::var("AIM_CASES").map_or(200, |text| text.parse().unwrap());
    // A linear congruential generator (Knuth's MMIX): the same draws on every machine.
    let mut state = 190u64;
    let mut within = |low: f64, high: f64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let value = low + (high - low) * (state >> 11) as f64 / (1u64 << 53) as f64;
        (value * 100.0).round() / 100.0
    };
    let (mut errors, mut seconds) = (Vec::new(), Vec::new());
    println!("| of speeds | yaw | pitch | solutions | nearest to them | misses by, deg | s |");
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for _ in 0..cases {
        let rpm = [within(-90.0, 90.0), within(0.0, 90.0)];
        let attitude = trial(rpm);
        let target = yaw_and_pitch(&attitude);
        let begun = Instant::now();
        let aimed = aimed(&target);
        seconds.push(begun.elapsed().as_secs_f64());
        // Every solution must hold, not the best one alone.
        let misses = aimed.solutions.iter().map(|solution| target.error_deg(&trial(solution.state.rpm())));
        let miss = if aimed.reachable { misses.fold(0.0, f64::max) } else { f64::INFINITY };
        errors.push(miss);
        let apart = |solution: &&aim::Solution| {
            let [w1, w2] = solution.state.rpm();
            (w1 - rpm[0]).hypot(w2 - rpm[1])
        };
        let nearest =
            aimed.solutions.iter().chain(&aimed.nearest).min_by(|a, b| apart(a).total_cmp(&apart(b))).unwrap();
        println!(
            "| {:?} | {:.2} | {:.2} | {} | {:?} | {miss:.2} | {:.2} |",
            rpm,
            attitude.yaw_deg,
            attitude.pitch_deg,
            aimed.solutions.len(),
            nearest.state.rpm(),
            seconds[seconds.len() - 1]
        );
    }
    seconds.sort_by(f64::total_cmp);
    let met = errors.iter().filter(|miss| **miss <= NEAR_DEG).count();
    println!("\n{met} of {cases} within {NEAR_DEG} deg of the trial; median {:.2} s", seconds[cases / 2]);
    assert!(met as f64 >= 0.95 * cases as f64);
}
