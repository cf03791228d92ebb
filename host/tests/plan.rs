//! Plans: what they expand to, and what is wrong with the wrong ones.

use host::plan::{Phases, Plan, PlanError, Trial};
use miette::Diagnostic;
use proptest::prelude::*;
use std::collections::HashSet;

fn parse(text: &str) -> Result<Plan, PlanError> {
    Plan::parse(text, "plan.toml")
}

#[test]
fn the_plan_of_the_manual_expands() {
    let plan = parse(
        r#"
[session]
name = "glycerin"
robot = "published"      # or a file written by `calibrate`
seed = 7                 # order of the trials
repeats = 1

[trial]                  # seconds
calibrate = 5
preroll = 20
run = 120
decay = 30

[speeds]                 # rpm; pairs and a grid may both be given
pairs = [[50, 15], [0, 45]]
grid = { w1 = [-90, 90, 10], w2 = [0, 90, 10] }
"#,
    )
    .unwrap();
    assert_eq!(plan.trials.len(), 192);
    assert_eq!(plan.trials[0].phases, Phases::default());
    assert_eq!(plan.total_s(), 192.0 * 175.0);
    // The order that seed 7 gives must stay what it is, or sessions could not be gone on with.
    let names: Vec<_> = plan.trials.iter().take(3).map(|trial| trial.name.as_str()).collect();
    assert_eq!(names, FIRST_OF_SEED_7);
}

const FIRST_OF_SEED_7: [&str; 3] = ["001_w1-60_w2+50", "002_w1+20_w2+90", "003_w1-20_w2+80"];

#[test]
fn the_plan_that_help_shows_is_one() {
    let plan = parse(host::plan::EXAMPLE).unwrap();
    assert_eq!((plan.trials.len(), plan.trials[0].phases), (192, Phases::default()));
}

#[test]
fn a_pair_that_the_grid_has_too_is_run_once() {
    let plan = parse("[speeds]\npairs = [[50, 10]]\ngrid = { w1 = [50, 60, 10], w2 = [0, 10, 10] }").unwrap();
    let mut speeds: Vec<_> = plan.trials.iter().map(|trial| trial.speeds.map(|speed| speed.0)).collect();
    speeds.sort();
    assert_eq!(speeds, [[5000, 0], [5000, 1000], [6000, 0], [6000, 1000]]);
}

#[test]
fn names_tell_speeds_and_repeats() {
    let plan = parse("[session]\nrepeats = 2\n[speeds]\npairs = [[-12.5, 0], [-0.0, 90]]").unwrap();
    let names: Vec<_> = plan.trials.iter().map(|trial| trial.name.as_str()).collect();
    assert_eq!(names, ["001_w1-12.5_w2+0_r1", "002_w1+0_w2+90_r1", "003_w1-12.5_w2+0_r2", "004_w1+0_w2+90_r2"]);
}

#[test]
fn the_boards_settings_are_read() {
    let text = r#"
[board]
gyro_axes = ["-x", "+y", "z"]
gyro_bias_counts = [-595.5, 6, 147]
deadline_ms = 300
[speeds]
pairs = [[50, 10]]
"#;
    let settings = parse(text).unwrap().board.apply(protocol::Settings::DEFAULT).unwrap();
    assert_eq!(settings.gyro_axes.0.map(|axis| axis.to_string()), ["-x", "+y", "+z"]);
    assert_eq!((settings.gyro_bias, settings.deadline_ms), ([-595.5, 6.0, 147.0], 300));
    assert!(settings.is_valid());
}

#[test]
fn a_motor_may_reverse_within_the_run() {
    let plan = parse("[trial]\nrun = 50\nreverse = { motor = 2, after = 35.5 }\n[speeds]\npairs = [[90, 40]]").unwrap();
    let trial = &plan.trials[0];
    let reverse = trial.reverse.unwrap();
    assert_eq!((reverse.motor, reverse.after_s), (2, 35.5));
    assert_eq!(reverse.of(trial.speeds).map(|speed| speed.rpm()), [90.0, -40.0]);
    assert_eq!(parse("[speeds]\npairs = [[90, 40]]").unwrap().trials[0].reverse, None);
}

/// What is wrong, and where.
#[test]
fn every_mistake_is_named_with_its_place() {
    let speeds = "[speeds]\npairs = [[50, 10]]\n";
    for (text, expected) in [
        ("", "plan.toml:1:1: the plan has no trials"),
        ("[speeds]\npairs = []", "plan.toml:1:1: the plan has no trials"),
        ("[speeds]\npairs = [[50, 10]]\nspeed = 3", "plan.toml:3:1: unknown field `speed`"),
        ("[spedes]\n", "plan.toml:1:2: unknown field `spedes`"),
        ("[trial]\nruns = 3", "plan.toml:2:1: unknown field `runs`"),
        ("[speeds]\npairs = [[50, 10]", "plan.toml:2:18: "),
        ("[speeds]\npairs = [[50, 91]]", "plan.toml:2:10: 91 rpm is beyond ±90 rpm"),
        ("[speeds]\npairs = [[1, 2], [-90.01, 0]]", "plan.toml:2:18: -90.01 rpm is beyond ±90 rpm"),
        ("[speeds]\npairs = [[nan, 0]]", "plan.toml:2:10: NaN is no speed"),
        ("[speeds]\npairs = [[inf, 0]]", "plan.toml:2:10: inf is no speed"),
        ("[speeds]\npairs = [[0.001, 0]]", "plan.toml:2:10: 0.001 rpm is finer than"),
        ("[speeds]\npairs = [[1, 2], [1, 2]]", "plan.toml:2:18: the speeds 1, 2 are listed twice"),
        ("[speeds]\npairs = [[0, 2], [-0.0, 2]]", "plan.toml:2:18: the speeds 0, 2 are listed twice"),
        ("[speeds]\npairs = [[10, 20, 30]]", "plan.toml:2:9: a list of 3 where 2 are expected"),
        (&format!("{speeds}[board]\nmotor_reversed = [true]"), "plan.toml:4:18: a list of 1 where 2 are expected"),
        ("[speeds]\npairs = [[\"fast\", 20]]", "plan.toml:2:11: invalid type"),
        ("[speeds]\ngrid = { w1 = [0, 9, 0], w2 = [0, 9, 1] }", "plan.toml:2:15: the step of w1 is 0"),
        ("[speeds]\ngrid = { w1 = [0, 9, nan], w2 = [0, 9, 1] }", "plan.toml:2:15: the step of w1 is NaN"),
        ("[speeds]\ngrid = { w1 = [0, 9, 1], w2 = [9, 0, 1] }", "plan.toml:2:31: steps of 1 do not lead from 9 to 0"),
        ("[speeds]\ngrid = { w1 = [0, 99, 1], w2 = [0, 9, 1] }", "plan.toml:2:15: 99 rpm is beyond"),
        ("[speeds]\ngrid = { w1 = [0, 90, 0.01], w2 = [0, 90, 1] }", "plan.toml:2:15: the plan has 819091 trials"),
        ("[speeds]\ngrid = { w1 = [0, 90, 1e-300], w2 = [0, 9, 1] }", "plan.toml:2:15: w1 has "),
        ("[speeds]\ngrid = { w1 = [0, 9, 1] }", "plan.toml:2:8: missing field `w2`"),
        (&format!("{speeds}[session]\nrepeats = 10001"), "plan.toml:4:11: repeats = 10001 alone makes"),
        (&format!("{speeds}[session]\nrepeats = 99999999999"), "plan.toml:4:11: repeats = 99999999999 alone makes"),
        (
            &format!("[session]\nrepeats = 6000\n{}", "[speeds]\npairs = [[1, 2], [3, 4]]"),
            "plan.toml:3:1: the plan has 12000",
        ),
        (&format!("{speeds}[session]\nrepeats = 0"), "plan.toml:4:11: repeats must be 1 or more"),
        (&format!("{speeds}[session]\nrepeats = -2"), "plan.toml:4:11: repeats must be 1 or more"),
        (&format!("{speeds}[session]\nseed = -1"), "plan.toml:4:8: a seed cannot be negative"),
        (&format!("{speeds}[session]\nname = \" \""), "plan.toml:4:8: the session has an empty name"),
        (&format!("{speeds}[trial]\npreroll = -1"), "plan.toml:4:11: preroll = -1 is negative"),
        (&format!("{speeds}[trial]\nrun = inf"), "plan.toml:4:7: run = inf is no duration"),
        (&format!("{speeds}[trial]\nrun = 0"), "plan.toml:4:7: run = 0 is no trial"),
        (&format!("{speeds}[trial]\ndecay = 1e9"), "plan.toml:4:9: decay = 1000000000 is longer than a day"),
        (&format!("{speeds}[trial]\ncalibrate = 61"), "plan.toml:4:13: calibrate = 61 is not within"),
        (&format!("{speeds}[trial]\nreverse = {{ motor = 3, after = 1 }}"), "plan.toml:4:11: there is no motor 3"),
        (&format!("{speeds}[trial]\nreverse = {{ motor = 1 }}"), "plan.toml:4:11: missing field `after`"),
        (
            &format!("{speeds}[trial]\nreverse = {{ motor = 1, after = 120 }}"),
            "plan.toml:4:11: the motor cannot reverse",
        ),
        (&format!("{speeds}[trial]\nreverse = {{ motor = 1, after = 0 }}"), "plan.toml:4:11: the motor cannot reverse"),
        (
            &format!("{speeds}[trial]\nreverse = {{ motor = 1, after = nan }}"),
            "plan.toml:4:11: the motor cannot reverse",
        ),
        (&format!("{speeds}[trial]\nreverse = {{ motor = 1, afters = 1 }}"), "plan.toml:4:24: unknown field `afters`"),
        (
            "[trial]\nreverse = { motor = 2, after = 60 }\n[speeds]\npairs = [[10, 20], [50, 0]]",
            "plan.toml:4:20: at 50, 0 motor 2 has nothing to reverse",
        ),
        (&format!("{speeds}[board]\nlow_pass = 7"), "plan.toml:3:1: [board] low_pass = 7 is out of range"),
        (&format!("{speeds}[board]\nspeed_kp = nan"), "plan.toml:3:1: [board] speed_kp = NaN is out of range"),
        (
            &format!("{speeds}[board]\ngyro_axes = [\"x\", \"x\", \"z\"]"),
            "plan.toml:3:1: [board] gyro_axes = [\"x\", \"x\", \"z\"] is out of range",
        ),
        (&format!("{speeds}[board]\nlowpass = 3"), "plan.toml:4:1: unknown field `lowpass`"),
    ] {
        let error = parse(text).expect_err(text);
        assert!(error.to_string().starts_with(expected), "{text}\n{error}\nexpected {expected}");
        assert_eq!(error.code().unwrap().to_string(), "wrong_use");
        assert!(!error.help().unwrap().to_string().is_empty());
    }
}

#[test]
fn a_robots_file_is_read_beside_the_plan() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plan.toml");
    std::fs::write(&path, "[session]\nrobot = \"soft.toml\"\n[speeds]\npairs = [[50, 10]]").unwrap();
    let error = Plan::load(&path).unwrap_err();
    assert!(matches!(&error, PlanError::ReadRobot { path, .. } if path.ends_with("soft.toml")));
    std::fs::write(folder.path().join("soft.toml"), "mass_kg = 0.1").unwrap();
    assert_eq!(Plan::load(&path).unwrap().robot.text, "mass_kg = 0.1");
}

fn key(trial: &Trial) -> ([i16; 2], u32) {
    (trial.speeds.map(|speed| speed.0), trial.repeat)
}

proptest! {
    #[test]
    fn a_plan_lists_every_pair_as_often_as_asked_in_any_order(
        speeds in prop::collection::hash_set((-9000i16..=9000, -9000i16..=9000), 1..40),
        repeats in 1u32..4,
        seed in prop::option::of(0u32..),
    ) {
        let rpm = |speed: i16| f64::from(speed) / 100.0;
        let pairs: Vec<_> = speeds.iter().map(|(a, b)| format!("[{:?}, {:?}]", rpm(*a), rpm(*b))).collect();
        let seed_line = seed.map(|seed| format!("seed = {seed}\n")).unwrap_or_default();
        let text = format!("[session]\nrepeats = {repeats}\n{seed_line}[speeds]\npairs = [{}]", pairs.join(", "));
        let plan = parse(&text).unwrap();

        let expected: HashSet<_> =
            speeds.iter().flat_map(|(a, b)| (1..=repeats).map(move |repeat| ([*a, *b], repeat))).collect();
        prop_assert_eq!(plan.trials.iter().map(key).collect::<HashSet<_>>(), expected);
        prop_assert_eq!(plan.trials.len(), speeds.len() * repeats as usize);
        prop_assert_eq!(plan.trials.iter().map(|trial| &trial.name).collect::<HashSet<_>>().len(), plan.trials.len());
        prop_assert!(plan.trials.is_sorted_by_key(|trial| &trial.name));
        prop_assert_eq!(parse(&text).unwrap(), plan);
    }

    #[test]
    fn a_grid_holds_every_step_from_first_to_last(first in -90i32..=90, count in 1i32..30, step in 1i32..60) {
        let step = f64::from(step) * 0.1;
        let last = f64::from(first) + step * f64::from(count - 1);
        prop_assume!(last <= 90.0);
        let text = format!("[speeds]\ngrid = {{ w1 = [{first}, {last:?}, {step:?}], w2 = [0, 0, 1] }}");
        let plan = parse(&text).unwrap();
        prop_assert_eq!(plan.trials.len(), count as usize);
        let reached = plan.trials.last().unwrap().speeds[0].rpm();
        prop_assert!((reached - last).abs() < 1e-6);
    }

    #[test]
    fn no_text_makes_the_parser_panic(text in "(\\[(session|trial|speeds|board)\\]\n|pairs|grid|w1|w2|seed|run| = |\\[|\\]|\\{|\\}|[-0-9.enaif,\"ä\n]){0,40}") {
        let _ = parse(&text);
    }
}
