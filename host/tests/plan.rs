//! Plans: their expansion, and the errors of invalid ones.

use host::plan::{Phases, Plan, PlanError, Trial, board, note_on_grid};
use miette::Diagnostic;
use proptest::prelude::*;
use std::collections::HashSet;

fn parse(text: &str) -> Result<Plan, PlanError> {
    Plan::parse(text, "plan.toml")
}

#[test]
fn plan_of_the_manual_expands() {
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
    assert_eq!(plan.trials.iter().map(|trial| trial.phases.total_s()).sum::<f64>(), 192.0 * 175.0);
    // The order for seed 7 must never change, or sessions could not be resumed.
    let names: Vec<_> = plan.trials.iter().take(3).map(|trial| trial.name.as_str()).collect();
    assert_eq!(names, FIRST_OF_SEED_7);
}

const FIRST_OF_SEED_7: [&str; 3] = ["001_w1-60_w2+50", "002_w1+20_w2+90", "003_w1-20_w2+80"];

#[test]
fn plan_in_the_help_is_valid() {
    let plan = parse(host::plan::EXAMPLE).unwrap();
    assert_eq!((plan.trials.len(), plan.trials[0].phases), (2, Phases::default()));
    // With its comments as lines, except the files, which do not exist.
    let text = host::plan::EXAMPLE.replace("# grid", "grid");
    assert_eq!(parse(&text).unwrap().trials.len(), 192);
}

#[test]
fn pair_that_is_also_in_the_grid_runs_once() {
    let plan = parse("[speeds]\npairs = [[50, 10]]\ngrid = { w1 = [50, 60, 10], w2 = [0, 10, 10] }").unwrap();
    let mut speeds: Vec<_> = plan.trials.iter().map(|trial| trial.speeds.map(|speed| speed.0)).collect();
    speeds.sort();
    assert_eq!(speeds, [[5000, 0], [5000, 1000], [6000, 0], [6000, 1000]]);
    assert_eq!(note_on_grid(&plan.text), None);
    let note = note_on_grid("[speeds]\ngrid = { w1 = [-90, 90, 50], w2 = [0, 0.3, 0.1] }").unwrap();
    assert_eq!(note, "the steps of the grid end w1 at 60 rpm, not 90");
}

#[test]
fn trial_names_contain_speeds_and_repeats() {
    let plan = parse("[session]\nrepeats = 2\n[speeds]\npairs = [[-12.5, 0], [-0.0, 90]]").unwrap();
    let names: Vec<_> = plan.trials.iter().map(|trial| trial.name.as_str()).collect();
    assert_eq!(names, ["001_w1-12.5_w2+0_r1", "002_w1+0_w2+90_r1", "003_w1-12.5_w2+0_r2", "004_w1+0_w2+90_r2"]);
}

#[test]
fn board_settings_are_read() {
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
fn reversal_is_read() {
    let plan = parse("[trial]\nrun = 50\nreverse = { motor = 2, after = 35.5 }\n[speeds]\npairs = [[90, 40]]").unwrap();
    let trial = &plan.trials[0];
    let reverse = trial.reverse.unwrap();
    assert_eq!((reverse.motor, reverse.after_s), (2, 35.5));
    assert_eq!(trial.final_speeds().map(|speed| speed.rpm()), [90.0, -40.0]);
    assert_eq!(parse("[speeds]\npairs = [[90, 40]]").unwrap().trials[0].reverse, None);
}

#[test]
fn starting_phases_are_trials_of_their_own() {
    let plan = parse("[trial]\nphase_deg = [0, -90.5]\n[speeds]\npairs = [[90, 90]]").unwrap();
    assert_eq!((plan.trials[0].name.as_str(), plan.trials[0].phase_deg), ("001_w1+90_w2+90", Some([0.0, -90.5])));
    assert_eq!(parse("[speeds]\npairs = [[90, 90]]").unwrap().trials[0].phase_deg, None);

    let plan =
        parse("[session]\nrepeats = 2\nseed = 7\n[trial]\nphases = 4\n[speeds]\npairs = [[90, 90], [0, 45], [90, 45]]")
            .unwrap();
    assert_eq!(plan.trials.len(), 24);
    let names: HashSet<_> = plan.trials.iter().map(|trial| trial.name.as_str()).collect();
    assert_eq!(names.len(), 24);
    for (group, trials) in plan.trials.chunks(4).enumerate() {
        let step = match trials[0].speeds.map(|speed| speed.rpm()) {
            [0.0, 45.0] => [90.0, 0.0],
            [90.0, 45.0] => [0.0, 45.0],
            _ => [0.0, 90.0],
        };
        for (i, trial) in trials.iter().enumerate() {
            assert_eq!(trial.phase_deg, Some(step.map(|step| step * i as f64)), "{}", trial.name);
            assert_eq!((trial.index, trial.repeat), (4 * group + i, trials[0].repeat));
            assert!(trial.is_at_the_phases_of(&trials[0]) && trial.name.ends_with(&format!("_p{}", i + 1)));
        }
    }
    assert_eq!(plan.trials.chunks(4).filter(|trials| trials[0].is_at_the_phases_of(&plan.trials[0])).count(), 1);
}

/// Asserts the message and the help of an error.
#[track_caller]
fn expect(error: PlanError, message: &str, help: &str) {
    let found = (error.to_string(), error.help().unwrap().to_string());
    assert_eq!(found, (message.to_owned(), help.to_owned()));
    assert_eq!(error.code().unwrap().to_string(), "wrong_use");
}

const PLAN_FORM: &str = "a plan is a TOML file in UTF-8; `biflag record --help` shows one";
const SECONDS: &str = "give seconds as a plain number, such as run = 60";
const PAIRS: &str = "give a list of pairs in rpm, such as pairs = [[50, 10]]";
const AXIS: &str = "give [first, last, step] in rpm, such as [-90, 90, 10]";
const REPEATS: &str = "give a whole number from 1 to 10000: how often each pair of speeds runs";
const SEED: &str = "give a whole number from 0 to 9223372036854775807";
const RANGE: &str = "give -90 to 90 rpm";
const TICK: &str = "give at least 0.005 s; for a trial at rest, give the speeds [0, 0]";
const CALIBRATE: &str = "give seconds as a plain number: 0.1 to 60, or 0 to keep the bias that the board has";
const PHASE: &str = "give the starting angles of motors 1 and 2 in degrees, -360 to 360, such as phase_deg = [0, 90]";
const PHASES: &str = "give a whole number from 1 to 360: at how many starting phases each pair of speeds runs";
const REVERSE: &str =
    "give the motor and the seconds after the start of the run, such as reverse = { motor = 2, after = 35 }";
const TOML: &str = "a plan is a TOML file in UTF-8; `biflag record --help` shows one";

#[test]
fn errors_in_the_trial_table_have_line_and_help() {
    for (line, message, help) in [
        ("run = \"60\"", "4:7: run cannot be \"60\"", SECONDS),
        ("run = [60]", "4:7: run cannot be [60]", SECONDS),
        ("run = 2024-01-01", "4:7: run cannot be 2024-01-01", SECONDS),
        ("run = { s = 60 }", "4:7: run cannot be { s = 60 }", SECONDS),
        ("run = true", "4:7: run cannot be true", SECONDS),
        ("run = 60 s", "4:7: run = 60 s: give the number without a unit", SECONDS),
        ("run = 60s # seconds", "4:7: run = 60s: give the number without a unit", SECONDS),
        ("run = sixty", "4:7: run = sixty: text needs quotes", SECONDS),
        ("run =", "4:6: run =: this is not a value", SECONDS),
        ("run = 60,5", "4:9: run = 60,5: TOML has no decimal comma", "write run = 60.5"),
        ("run = -60,5", "4:10: run = -60,5: TOML has no decimal comma", "write run = -60.5"),
        ("run = 1e308", "4:7: run = 1e308 is longer than a day", SECONDS),
        ("run = inf", "4:7: run = inf is not a duration", SECONDS),
        ("run = nan", "4:7: run = NaN is not a duration", SECONDS),
        ("run = 0", "4:7: run = 0 is shorter than a tick of the board", TICK),
        ("run = 1e-9", "4:7: run = 1e-9 is shorter than a tick of the board", TICK),
        ("run = 0.004", "4:7: run = 0.004 is shorter than a tick of the board", TICK),
        ("decay = -1e-300", "4:9: decay = -1e-300 is negative", "give seconds as a plain number, such as decay = 30"),
        ("decay = 1e9", "4:9: decay = 1e9 is longer than a day", "give seconds as a plain number, such as decay = 30"),
        ("preroll = -1", "4:11: preroll = -1 is negative", "give seconds as a plain number, such as preroll = 20"),
        ("calibrate = 61", "4:13: calibrate cannot be 61", CALIBRATE),
        ("calibrate = 1e-300", "4:13: calibrate cannot be 1e-300", CALIBRATE),
        (
            "length = 3",
            "4:1: unknown key `length`",
            "write one of `calibrate`, `preroll`, `run`, `decay`, `rest_at_most`, `reverse`, `hand_turn`, `phase_deg`, `phases`, `method`, \
             or leave it out",
        ),
        ("runs = 3", "4:1: unknown key `runs`", "did you mean run?"),
        ("phase_deg = 90", "4:13: phase_deg cannot be 90", PHASE),
        ("phase_deg = [0, 90, 180]", "4:13: phase_deg cannot be [0, 90, 180]", PHASE),
        ("phase_deg = [0, \"up\"]", "4:17: phase_deg cannot hold \"up\"", PHASE),
        ("phase_deg = [0, 360.5]", "4:13: phase_deg cannot be 360.5", PHASE),
        ("phase_deg = [nan, 0]", "4:13: phase_deg cannot be NaN", PHASE),
        ("phase_deg = [0, -inf]", "4:13: phase_deg cannot be -inf", PHASE),
        ("phases = 0", "4:10: phases cannot be 0", PHASES),
        ("phases = 361", "4:10: phases cannot be 361", PHASES),
        ("phases = 8.0", "4:10: phases cannot be 8.0", PHASES),
        (
            "phases = 8\nphase_deg = [0, 90]",
            "5:13: phase_deg and phases cannot both be set",
            "give one starting phase or the number of phases, and leave the other out",
        ),
        ("run = 60\nrun = 70", "5:1: duplicate key", "leave one of them out"),
        ("reverse = [2, 35]", "4:11: reverse cannot be [2, 35]", REVERSE),
        ("reverse = { motor = 3, after = 1 }", "4:11: motor cannot be 3", "give 1 or 2"),
        ("reverse = { motor = 1.5, after = 1 }", "4:21: motor cannot be 1.5", "give 1 or 2"),
        (
            "reverse = { motor = 1 }",
            "4:11: the key `after` is missing",
            "give seconds after the start of the run as a plain number",
        ),
        (
            "reverse = { motor = 1, after = 120 }",
            "4:11: after = 120 is not within the run of 120 s",
            "give seconds between 0 and 120",
        ),
        (
            "reverse = { motor = 1, after = 0 }",
            "4:11: after = 0 is not within the run of 120 s",
            "give seconds between 0 and 120",
        ),
        (
            "reverse = { motor = 1, after = nan }",
            "4:11: after = NaN is not within the run of 120 s",
            "give seconds between 0 and 120",
        ),
        ("reverse = { motor = 1, afters = 1 }", "4:24: unknown key `afters`", "did you mean after?"),
    ] {
        let text = format!("[speeds]\npairs = [[50, 10]]\n[trial]\n{line}\n");
        expect(parse(&text).expect_err(line), &format!("plan.toml:{message}"), help);
    }
}

#[test]
fn errors_in_the_speeds_table_have_line_and_help() {
    const TRIALS: &str = "take larger steps or fewer repeats, or split the plan";
    let pair = "leave one out; to run every pair several times, set repeats";
    for (line, message, help) in [
        ("pairs = []", "1:1: the plan has no trials", "give speeds, such as [speeds] pairs = [[50, 10]]"),
        ("pairs = [50, 10]", "2:10: pairs cannot hold 50", PAIRS),
        ("pairs = 50", "2:9: pairs cannot be 50", PAIRS),
        ("pairs = [[10, 20, 30]]", "2:9: pairs cannot be [[10, 20, 30]]", PAIRS),
        ("pairs = [[1, 2], [\"fast\", 20]]", "2:19: pairs cannot hold \"fast\"", PAIRS),
        ("pairs = [[50, 10]", "2:18: unclosed array, expected `]`", TOML),
        ("pairs = [50 10]", "2:10: pairs = [50 10]: this is not a value", PAIRS),
        ("pairs = [[50, 91]]", "2:10: 91 rpm is beyond ±90 rpm", RANGE),
        ("pairs = [[1, 2], [-90.01, 0]]", "2:18: -90.01 rpm is beyond ±90 rpm", RANGE),
        ("pairs = [[1e300, 0]]", "2:10: 1e300 rpm is beyond ±90 rpm", RANGE),
        ("pairs = [[nan, 0]]", "2:10: a speed cannot be NaN", RANGE),
        ("pairs = [[inf, 0]]", "2:10: a speed cannot be inf", RANGE),
        ("pairs = [[0.001, 0]]", "2:10: 0.001 rpm is finer than the board's resolution", "round it to 0.01 rpm"),
        ("pairs = [[1, 2], [1, 2]]", "2:18: the speeds 1, 2 are listed twice", pair),
        ("pairs = [[0, 2], [-0.0, 2]]", "2:18: the speeds 0, 2 are listed twice", pair),
        ("pairs = [[50, 10]]\nspeed = 3", "3:1: unknown key `speed`", "write `pairs` or `grid`, or leave it out"),
        ("grid = { w1 = [0, 10, 20, 30], w2 = [0, 9, 1] }", "2:15: w1 cannot be [0, 10, 20, 30]", AXIS),
        ("grid = { w1 = [0, 9, 0], w2 = [0, 9, 1] }", "2:15: the step of w1 cannot be 0", AXIS),
        ("grid = { w1 = [0, 9, nan], w2 = [0, 9, 1] }", "2:15: the step of w1 cannot be NaN", AXIS),
        ("grid = { w1 = [0, 9, 1], w2 = [9, 0, 1] }", "2:31: w2 does not get from 9 to 0 in steps of 1", AXIS),
        ("grid = { w1 = [0, 99, 1], w2 = [0, 9, 1] }", "2:15: 99 rpm is beyond ±90 rpm", RANGE),
        (
            "grid = { w1 = [0, 90, 1e-300], w2 = [0, 9, 1] }",
            "2:15: the step 1e-300 gives w1 more than 10000 speeds",
            AXIS,
        ),
        ("grid = { w1 = [0, 90, 0.01], w2 = [0, 90, 1] }", "2:15: the plan has 819091 trials, more than 10000", TRIALS),
        ("grid = { w1 = [0, 9, 1] }", "2:8: the key `w2` is missing", AXIS),
        (
            "grid = [[0, 9, 1], [0, 9, 1]]",
            "2:8: grid cannot be [[0, 9, 1], [0, 9, 1]]",
            "give both axes, such as grid = { w1 = [-90, 90, 10], w2 = [0, 90, 10] }",
        ),
        (
            "pairs = [[1, 2], [3, 4]]\n[session]\nrepeats = 6000",
            "1:1: the plan has 12000 trials, more than 10000",
            TRIALS,
        ),
        (
            "pairs = [[10, 20], [50, 0]]\n[trial]\nreverse = { motor = 2, after = 60 }",
            "2:20: motor 2 does not turn at 50, 0 rpm, so it cannot reverse",
            "leave these speeds out, or reverse the other motor",
        ),
    ] {
        let text = format!("[speeds]\n{line}\n");
        expect(parse(&text).expect_err(line), &format!("plan.toml:{message}"), help);
    }
}

#[test]
fn errors_in_the_session_and_board_tables_have_line_and_help() {
    let gain = "give a number from 0 to 1000";
    let low_pass = "give a whole number from 0 (260 Hz) to 6 (5 Hz)";
    let deadline = "give a whole number of milliseconds from 50 to 5000";
    let axes = "name each axis of the sensor once with its sign, such as [\"-x\", \"+y\", \"+z\"]";
    for (lines, message, help) in [
        ("[session]\nrepeats = 2.5", "4:11: repeats cannot be 2.5", REPEATS),
        ("[session]\nrepeats = \"2\"", "4:11: repeats cannot be \"2\"", REPEATS),
        ("[session]\nrepeats = 0", "4:11: repeats cannot be 0", REPEATS),
        ("[session]\nrepeats = -2", "4:11: repeats cannot be -2", REPEATS),
        ("[session]\nrepeats = 10001", "4:11: repeats cannot be 10001", REPEATS),
        ("[session]\nseed = -1", "4:8: seed cannot be -1", SEED),
        ("[session]\nseed = 18446744073709551616", "4:8: seed cannot be 18446744073709551616", SEED),
        ("[session]\nname = 5", "4:8: name cannot be 5", "give text in quotes"),
        ("[session]\nname = my session", "4:8: name = my session: text needs quotes", "give text in quotes"),
        ("[session]\nname = \" \"", "4:8: the name of the session is empty", "give it a name, or leave the key out"),
        (
            "[session]\nrobot = \"\"",
            "4:9: the name of the robot is empty",
            "give \"physical\", \"published\", or the path of a robot file",
        ),
        ("[board]\nlow_pass = 7", "4:12: low_pass cannot be 7", low_pass),
        ("[board]\nlow_pass = 300", "4:12: low_pass cannot be 300", low_pass),
        ("[board]\ndeadline_ms = 5", "4:15: deadline_ms cannot be 5", deadline),
        ("[board]\ndeadline_ms = 500 ms", "4:15: deadline_ms = 500 ms: give the number without a unit", deadline),
        ("[board]\nspeed_kp = nan", "4:12: speed_kp cannot be NaN", gain),
        ("[board]\nspeed_kp = 1e30", "4:12: speed_kp cannot be 1e30", gain),
        ("[board]\nboard_id = 70000", "4:12: board_id cannot be 70000", "give a whole number from 0 to 65535"),
        ("[board]\ngyro_axes = [\"x\"]", "4:13: gyro_axes cannot be [\"x\"]", axes),
        ("[board]\ngyro_axes = [\"x\", \"x\", \"z\"]", "4:13: gyro_axes cannot be [\"x\", \"x\", \"z\"]", axes),
        (
            "[board]\nmotor_reversed = [true]",
            "4:18: motor_reversed cannot be [true]",
            "give true or false for motors 1 and 2, such as [false, true]",
        ),
        ("[[trial]]\nrun = 5", "3:1: trial cannot be [[trial]]", "write it as a table: [trial]"),
        ("[trials]", "3:2: unknown key `trials`", "did you mean trial?"),
    ] {
        let text = format!("[speeds]\npairs = [[50, 10]]\n{lines}\n");
        expect(parse(&text).expect_err(lines), &format!("plan.toml:{message}"), help);
    }
    let dotted = parse("board.low_pass = 7\n[speeds]\npairs = [[50, 10]]").unwrap_err();
    expect(dotted, "plan.toml:1:18: low_pass cannot be 7", low_pass);
    let unknown = parse("[speeds]\npairs = [[50, 10]]\n[board]\nlowpass = 3").unwrap_err();
    assert_eq!(unknown.to_string(), "plan.toml:4:1: unknown key `lowpass`");
    assert!(unknown.help().unwrap().to_string().contains("did you mean low_pass?"));
}

#[test]
fn file_of_another_format_is_not_a_plan() {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in [
        ("plan.json", &b"{ \"speeds\": { \"pairs\": [[50, 10]] } }\n"[..]),
        ("list.json", b"[[50, 10]]\n"),
        ("plan.csv", b"w1,w2\n50,10\n"),
        ("plan.yaml", b"speeds:\n  pairs:\n    - [50, 10]\n"),
        ("firmware.elf", b"\x7fELF\x01\x01\x01\0\0\0\0\0\0\0\0\0\x02\0\x53\0\xff\xfe"),
        ("utf-16.toml", b"\xff\xfe[\0s\0p\0e\0e\0d\0s\0]\0\n\0"),
        ("notes.txt", b"Take the pairs 50, 10 and 0, 45.\n"),
    ] {
        let path = folder.path().join(name);
        std::fs::write(&path, content).unwrap();
        expect(Plan::load(&path).unwrap_err(), &format!("{}: this is not a plan", path.display()), TOML);
    }
    expect(
        parse("").unwrap_err(),
        "plan.toml:1:1: the plan has no trials",
        "give speeds, such as [speeds] pairs = [[50, 10]]",
    );
}

#[test]
fn settings_file_is_checked_like_a_plan() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("board.toml");
    let load = |text: &str| {
        std::fs::write(&path, text).unwrap();
        board::load(&path)
    };
    let low_pass = "give a whole number from 0 (260 Hz) to 6 (5 Hz)";
    let toml = "a settings file is a TOML file in UTF-8; `biflag settings` prints one";
    for (text, message, help) in [
        ("board_id = 1\nlow_pass = 7\n", ":2:12: low_pass cannot be 7", low_pass),
        ("low_pass = 300\n", ":1:12: low_pass cannot be 300", low_pass),
        ("low_pass = \"3\"\n", ":1:12: low_pass cannot be \"3\"", low_pass),
        ("speed_kp = 1,5\n", ":1:13: speed_kp = 1,5: TOML has no decimal comma", "write speed_kp = 1.5"),
        ("board_id = 1\nboard_id = 2\n", ":2:1: duplicate key", "leave one of them out"),
        ("{ \"low_pass\": 3 }\n", ": this is not a settings file", toml),
    ] {
        expect(load(text).unwrap_err(), &format!("{}{message}", path.display()), help);
    }
    assert_eq!(load("low_pass = 2\n").unwrap().low_pass, Some(2));
    std::fs::remove_file(&path).unwrap();
    let missing = board::load(&path).unwrap_err();
    assert_eq!(missing.to_string(), format!("{}: the settings file cannot be read", path.display()));
}

#[test]
fn file_of_another_kind_is_called_what_it_is() {
    let robot = "[fluid]\nviscosity_pa_s = 1.1";
    let plan = "[session]\nname = \"a\"\n[speeds]\npairs = [[50, 10]]";
    expect(parse(robot).unwrap_err(), "plan.toml: this is a robot file, not a plan", PLAN_FORM);
    let error = host::plan::robot::parse(plan, "robot.toml").unwrap_err();
    let form = "a robot file is a TOML file in UTF-8; `biflag plans robot-published` prints one with every key";
    expect(error, "robot.toml: this is a plan, not a robot file", form);
    // A mistake in a file of the right kind is a mistake.
    let error = parse(&format!("{plan}\n[fluid]\nviscosity_pa_s = 1.1")).unwrap_err().to_string();
    assert!(error.starts_with("plan.toml:5:2: unknown key `fluid`"), "{error}");
}

#[test]
fn robot_file_is_relative_to_the_plan() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plan.toml");
    std::fs::write(&path, "[session]\nrobot = \"soft.toml\"\n[speeds]\npairs = [[50, 10]]").unwrap();
    let error = Plan::load(&path).unwrap_err();
    assert!(matches!(&error, PlanError::Read { path, noun: "robot file", .. } if path.ends_with("soft.toml")));
    std::fs::write(folder.path().join("soft.toml"), "[base]\nmass_kg = 0.1").unwrap();
    assert_eq!(Plan::load(&path).unwrap().robot.text, "[base]\nmass_kg = 0.1");
}

fn key(trial: &Trial) -> ([i16; 2], u32) {
    (trial.speeds.map(|speed| speed.0), trial.repeat)
}

proptest! {
    #[test]
    fn plan_repeats_every_pair_in_any_order(
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
    fn grid_contains_every_step_from_first_to_last(first in -90i32..=90, count in 1i32..30, step in 1i32..60) {
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
    fn parser_never_panics(text in "(\\[(session|trial|speeds|board)\\]\n|pairs|grid|w1|w2|seed|run| = |\\[|\\]|\\{|\\}|[-0-9.enaif,\"ä\n]){0,40}") {
        let _ = parse(&text);
    }
}
