//! `biflag doctor`, the settings that this computer keeps of its boards, and the checks before a trial.

use biflag_log::BoardMeta;
use rustix::fs::OFlags;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use serde_json::Value;
use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;
use tests::{Bench, bare_nano, expect_error, logs, nano, pass, program};

/// Returns the check of this name.
#[track_caller]
fn check<'a>(report: &'a Value, name: &str) -> &'a Value {
    let checks = report["checks"].as_array().expect("checks");
    let found = checks.iter().find(|check| check["name"].as_str().is_some_and(|found| found.starts_with(name)));
    found.unwrap_or_else(|| panic!("no check {name:?} in {report}"))
}

/// Asserts a check's verdict, and words of its detail and cure.
#[track_caller]
fn expect(report: &Value, name: &str, ok: bool, words: &[&str]) {
    let check = check(report, name);
    assert_eq!(check["ok"], ok, "{check}");
    for word in words {
        assert!(check.to_string().contains(word), "no {word:?} in {check}");
    }
}

/// Asserts that a motor is good and turns at 130 rpm at full duty, as the emulated one does; the mean of its measured speed
/// depends on when the frames were read.
#[track_caller]
fn expect_good(report: &Value, name: &str) {
    expect(report, name, true, &[" rpm forwards"]);
    let detail = check(report, name)["detail"].as_str().unwrap();
    let speed = detail.split_once(" rpm forwards").unwrap().0.rsplit(' ').next().unwrap();
    assert!((speed.parse::<f64>().unwrap() - 130.0).abs() <= 2.0, "{detail}");
}

/// A wrong wire of the emulated robot: the fault, the check that names it, whether the check is good all the same, and words of it.
type WrongWire = (&'static str, &'static str, bool, &'static [&'static str]);

/// One that stops the whole test, one of an encoder that the gyroscope finds, and one that settings correct; what the test makes
/// of its readings is tested in `rig`, with every wrong wire.
#[test]
fn self_test_finds_wrong_wires() {
    expect_found(&[
        ("motors-swapped", "motors", false, &["driving motor 1 moves encoder 2", "AO1 and AO2 with BO1 and BO2"]),
        ("encoder-open=2,1", "motor 2", false, &["gyroscope", "channel C1", "D2"]),
        ("motor-reversed=1", "motor 1", true, &["against the duty"]),
    ]);
}

#[test]
#[ignore = "half a minute of the emulated board: part of `make proof`"]
fn self_test_finds_the_other_wrong_wires() {
    expect_found(&[
        ("motor-supply-off", "motor supply", false, &["6 V", "STBY on D9"]),
        ("encoder-open=1,2", "motor 1", false, &["channel C2", "D5"]),
        ("blocked=2", "motor 2", false, &["no edge", "nothing holds it"]),
        ("tone=200000,2,1", "motor 2", false, &["encoder 2 has more edges", "the encoder's cable"]),
    ]);
}

fn expect_found(wrong: &[WrongWire]) {
    for &(fault, name, ok, words) in wrong {
        let run = Bench::new().run(["doctor", "--motors", "--virtual", "--fault", fault, "--json"]);
        println!("{fault}: {}", run.stdout);
        let report = run.expect_code(3).json();
        expect(&report, name, ok, words);
        if ok {
            expect_good(&report, name);
        }
        let other = if name.ends_with('1') { "motor 2" } else { "motor 1" };
        if fault.starts_with("tone") {
            expect(&report, other, false, &["not tested to the end: encoder 2"]);
        } else if name.starts_with("motor ") && name != "motor supply" {
            expect_good(&report, other);
        }
    }
}

/// A fault while the user watches a flagellum does not lose what the test has found.
#[test]
fn fault_while_the_user_watches_keeps_the_results() {
    let bench = Bench::new();
    let mut nano = nano(["--speed", "max"]);
    let terminal = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
    grantpt(&terminal).and_then(|()| unlockpt(&terminal)).unwrap();
    let user = ptsname(&terminal, Vec::new()).unwrap().into_string().unwrap();
    let no_control = OFlags::NOCTTY.bits() as i32;
    let user = || File::options().read(true).write(true).custom_flags(no_control).open(&user).unwrap();
    let mut command = Command::new(program("biflag"));
    command.args(["doctor", "--motors", "--json", "--port", nano.port()]).current_dir(bench.path());
    command.env("XDG_CONFIG_HOME", bench.path().join("config"));
    let doctor = command.stdin(user()).stderr(user()).stdout(Stdio::piped()).spawn().unwrap();
    drop(command);
    let mut terminal = BufReader::new(File::from(terminal));
    let mut said = String::new();
    while !said.contains("Watch flagellum 1") {
        said.clear();
        assert!(terminal.read_line(&mut said).unwrap() > 0);
    }
    nano.control("fault tone=200000,1,1").unwrap();
    // Flagellum 1 may have turned before the fault came: the user wants to see it again.
    let mut answers = terminal.get_ref().try_clone().unwrap();
    std::thread::spawn(move || {
        while answers.write_all(b"r\n").is_ok() {
            std::thread::sleep(Duration::from_millis(500));
        }
    });
    std::thread::spawn(move || terminal.lines().map_while(Result::ok).for_each(drop));
    let output = doctor.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(3), "{output:?}");
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    expect(&report, "motor 1", false, &["encoder 1 has more edges"]);
    expect(&report, "motor 2", false, &["not tested to the end: encoder 1"]);
}

/// A new board is refused until the self-test has saved its settings; then trials run, also with an encoder that is
/// connected the wrong way round.
#[test]
fn new_board_is_set_up_by_the_self_test() {
    let bench = Bench::new();
    let plan = bench.short_plan(3.0, [40.0, -40.0]);
    let plan = plan.to_str().unwrap();
    let mut nano = bare_nano(["--speed", "max", "--fault", "encoder-swapped=2"]);
    let port = nano.port().to_owned();
    let refused = bench.run(["record", plan, "--port", &port]);
    expect_error(&refused, 1, &["no settings in its EEPROM", &format!("`biflag doctor --motors --port {port}`")]);
    assert!(!bench.path().join("bench").exists(), "no session without a trial");

    let report = bench.run(["doctor", "--motors", "--port", &port, "--json"]).expect_code(3).json();
    expect(&report, "settings", false, &["not saved", "encoder_reversed = [false, true]", "--motors --yes"]);
    assert!(!bench.path().join("config").exists());
    let report = bench.run(["doctor", "--motors", "--yes", "--port", &port, "--json"]).expect_code(0).json();
    expect(&report, "settings", true, &["encoder_reversed = [false, true]", "moving_duty = [40, 40]", "board 1"]);
    assert!(bench.path().join("config/biflag/boards/1.toml").is_file());

    nano.control("reset").unwrap();
    let report = bench.run(["doctor", "--motors", "--port", &port, "--json"]).expect_code(0).json();
    assert!(!check(&report, "motor 2").to_string().contains("against"), "{report}");
    assert!(report["checks"].as_array().unwrap().iter().all(|check| check["detail"] != "not saved"));
    tests::golden::hold_keys("doctor-motors", &report);
    bench.run(["record", plan, "--port", &port]).expect_code(3);
}

/// A board whose EEPROM is blank again is not driven until it has its settings back.
#[test]
fn forgotten_settings_are_restored_from_the_copy() {
    let bench = Bench::new();
    let plan = bench.short_plan(1.0, [30.0, 0.0]);
    let plan = plan.to_str().unwrap();
    let settings = bench.file("board.toml", "board_id = 7\nmotor_reversed = [true, false]\nmoving_duty = [60, 61]\n");
    {
        let nano = nano(["--speed", "max"]);
        bench.run(["settings", "--write", settings.to_str().unwrap(), "--port", nano.port()]).expect_code(0);
    }
    let mut nano = bare_nano(["--speed", "max"]);
    let port = nano.port().to_owned();
    let restore = format!("`biflag settings --restore 7 --port {port}` for board 7");
    for command in [["record", plan, "--port", &port].as_slice(), &["doctor", "--motors", "--yes", "--port", &port]] {
        let copy = bench.path().join("config/biflag/boards/7.toml");
        expect_error(&bench.run(command), 1, &["no settings in its EEPROM", &restore, copy.to_str().unwrap(), "--new"]);
    }
    expect_error(&bench.run(["settings", "--restore", "8", "--port", &port]), 2, &["8.toml"]);
    let restored = bench.run(["settings", "--restore", "7", "--port", &port, "--json"]).expect_code(0).json();
    assert_eq!(restored["moving_duty"], serde_json::json!([60, 61]));
    nano.control("reset").unwrap();
    let read = bench.run(["settings", "--port", &port, "--json"]).expect_code(0).json();
    assert_eq!((&read["board_id"], &read["motor_reversed"]), (&7.into(), &serde_json::json!([true, false])));
    let second = bench.run(["settings", "--new", "--port", &port, "--json"]).expect_code(0);
    assert_eq!(
        (&second.json()["board_id"], second.stderr.as_str()),
        (&1.into(), "note: this is board 1 from here on (board_id)\n")
    );
}

/// The lines of motors are those of a board's own hardware: its id is not given to another one.
#[test]
fn another_board_does_not_take_the_lines_of_a_board() {
    let bench = Bench::new();
    let settings = bench.file("board.toml", "board_id = 7\nspeed_from = \"duty\"\n");
    let write = |port: &str| bench.run(["settings", "--write", settings.to_str().unwrap(), "--port", port]);
    let first = nano(["--speed", "max"]);
    write(first.port()).expect_code(0);
    let boards = bench.path().join("config/biflag/boards");
    std::fs::write(boards.join("7.lines.toml"), LINES).unwrap();
    write(first.port()).expect_code(0);
    let second = nano(["--speed", "max"]);
    let words = ["board_id = 7 is that of another board", "settings --new", "--restore"];
    expect_error(&write(second.port()), 2, &words);
    let restore = |port: &str| bench.run(["settings", "--restore", "7", "--port", port, "--json"]);
    expect_error(&restore(second.port()), 2, &words);
    let kept = bench.run(["settings", "--port", second.port(), "--json"]).json();
    assert_eq!((&kept["board_id"], &kept["speed_from"]), (&1.into(), &"encoders".into()));
    // One that has lost its settings may be the same.
    let blank = bare_nano(["--speed", "max"]);
    let restored = restore(blank.port()).expect_code(0);
    assert!(
        restored.stderr.contains("the lines of its motors are those") && restored.json()["board_id"] == 7,
        "{restored:?}"
    );
    // A plan's own id changes nothing: the board is asked.
    let plan = bench.short_plan(1.0, [30.0, 0.0]);
    let text = std::fs::read_to_string(&plan).unwrap().replace("[board]", "[board]\nboard_id = 7");
    std::fs::write(&plan, text).unwrap();
    let settings = bench.file("duty.toml", "speed_from = \"duty\"\n");
    bench.run(["settings", "--write", settings.to_str().unwrap(), "--port", second.port()]).expect_code(0);
    expect_error(
        &bench.run(["record", plan.to_str().unwrap(), "--port", second.port()]),
        1,
        &["not known", "doctor --motors"],
    );
}

const LINES: &str = "supply_v = 5.0\n[wiring]\nbridge = \"enable\"\nmotor_reversed = [false, false]\n\
    [[motor]]\nforwards = [{ duty = 60, speed_rpm = 20.0 }, { duty = 200, speed_rpm = 90.0 }]\nbackwards = []\n\
    [[motor]]\nforwards = []\nbackwards = []\n";

/// What the self-test mends is no problem: the id of a board that has settings and none.
#[test]
fn self_test_gives_a_board_its_id() {
    let bench = Bench::new();
    let nano = bare_nano(["--speed", "max", "--rig", "in-in"]);
    let report = bench.run(["doctor", "--motors", "--yes", "--port", nano.port(), "--json"]).expect_code(0).json();
    expect(&report, "settings", true, &["saved ", "this is board 1"]);
    assert!(report["checks"].as_array().unwrap().iter().all(|check| check["ok"] == true), "{report}");
    assert_eq!(bench.run(["settings", "--port", nano.port(), "--json"]).json()["bridge"], "in-in");
}

fn calibrated_plan(bench: &Bench, trials: &str) -> String {
    let text = format!(
        "[session]\nname = \"bench\"\n[board]\ndeadline_ms = 5000\n[trial]\ncalibrate = 2\npreroll = 0\nrest_at_most = 0\nrun = 2\ndecay = 0\n[speeds]\npairs = [{trials}]\n"
    );
    bench.file("plan.toml", &text).to_str().unwrap().to_owned()
}

/// A check that fails refuses the trial; when its cause is gone, `--resume` goes on.
#[test]
fn preflight_refuses_and_resume_continues() {
    let bench = Bench::new();
    let plan = calibrated_plan(&bench, "[30, 0], [0, 30]");
    let mut nano = nano(["--speed", "max"]);
    let port = nano.port().to_owned();
    let record = |words: &[&str]| {
        let run = bench.run(["record", &plan, "--resume", "--port", &port]);
        expect_error(&run, 1, words);
        assert!(run.stderr.contains("continue with --resume"), "{}", run.stderr);
    };
    let session = bench.path().join("bench");
    nano.control("fault supply=4400").unwrap();
    // It averages its supply over some measurements, four a second.
    pass(&mut nano, 3.0);
    record(&["the board's supply is 4.4", "4.5 V are needed"]);
    assert_eq!(logs(&session), Vec::<std::path::PathBuf>::new(), "refused before the trial");
    nano.control("fault clear").unwrap();
    nano.control("fault scale=20").unwrap();
    pass(&mut nano, 3.0);
    record(&["the accelerometer reads 1.", " g at rest instead of 1 g"]);
    nano.control("fault clear").unwrap();
    nano.control("fault spin=3000").unwrap();
    record(&["calibration 3 begins", "the sensor was at the end of its range in "]);
    nano.control("fault clear").unwrap();
    nano.control("fault scale=3").unwrap();
    let done = bench.run(["record", &plan, "--resume", "--port", &port, "--json"]).expect_unsettled().json();
    assert!(done["trials"].as_array().unwrap().iter().all(|trial| trial["complete"] == true), "{done}");
    // The refused attempts have a log that says why: one for the acceleration, three for the range. Two trials are whole.
    assert_eq!(logs(&session).len(), 6);
}

/// Without a wait, a robot that still swings from the trial before is calibrated again when it has come to rest. It may
/// still creep then, too slowly for the board to notice: exit code 3.
#[test]
fn a_robot_that_swings_is_calibrated_again() {
    let bench = Bench::new();
    let plan = bench.file(
        "plan.toml",
        "[session]\nname = \"bench\"\n[board]\ndeadline_ms = 5000\n[trial]\ncalibrate = 8\npreroll = 0\nrest_at_most = 0\nrun = 3\ndecay = 0\n\
         [speeds]\npairs = [[90, 90], [30, 0]]\n",
    );
    let run = bench.run(["record", plan.to_str().unwrap(), "--virtual", "--json"]);
    assert!(matches!(run.code, Some(0 | 3)), "{run:?}");
    assert!(
        run.stderr.contains("the board moved during the calibration of the gyroscope; calibration 2 begins"),
        "{}",
        run.stderr
    );
    let trials = run.json()["trials"].as_array().unwrap().clone();
    assert!(trials.len() == 2 && trials.iter().all(|trial| trial["complete"] == true), "{trials:?}");
    let session = bench.path().join("bench");
    assert!(logs(&session).len() > 2, "an attempt that fails keeps its log");
    let info = bench.run(["info", session.to_str().unwrap()]);
    assert!(info.stdout.contains("bench: 2 of 2 trials complete"), "{}", info.stdout);
}

/// A robot that never comes to rest ends the session after three calibrations.
#[test]
fn a_moving_robot_is_refused() {
    let bench = Bench::new();
    let plan = calibrated_plan(&bench, "[30, 0], [0, 30]");
    let run = bench.run(["record", &plan, "--virtual", "--fault", "spin=50"]);
    expect_error(&run, 1, &["the board moved during the calibration", "let the robot come to rest", "--resume"]);
    assert!(run.stderr.contains("calibration 3 begins"), "{}", run.stderr);
    assert_eq!(logs(&bench.path().join("bench")).len(), 3);
}

/// Logs of a plan that the disk has no room for are not begun.
#[test]
fn a_plan_that_does_not_fit_the_disk_is_refused() {
    let bench = Bench::new();
    let plan = bench.file(
        "plan.toml",
        "[session]\nname = \"bench\"\nrepeats = 10000\n[trial]\ncalibrate = 0\npreroll = 0\nrun = 86400\ndecay = 0\n\
         [speeds]\npairs = [[0, 0]]\n",
    );
    let nano = nano(["--speed", "max"]);
    let run = bench.run(["record", plan.to_str().unwrap(), "--port", nano.port()]);
    expect_error(&run, 1, &["the rest of the plan needs up to 69120.0 GB", "choose another one with --out"]);
    assert!(logs(&bench.path().join("bench")).is_empty());
}

/// A fault is in the board's log after the reset that comes with the next opening of the port, in `doctor`, and in the
/// logs of later trials.
#[test]
fn fault_log_reaches_doctor_and_later_trials() {
    let bench = Bench::new();
    let plan = bench.short_plan(6.0, [0.0, 90.0]);
    let plan = plan.to_str().unwrap();
    let mut nano = nano(["--speed", "max", "--fault", "blocked=2"]);
    let port = nano.port().to_owned();
    let empty = bench.run(["doctor", "--port", &port, "--json"]).json();
    expect(&empty, "fault log", true, &["empty"]);
    expect_error(&bench.run(["record", plan, "--port", &port]), 1, &["motor 2 is stalled"]);
    // The board writes an entry in a tenth of a second.
    pass(&mut nano, 0.5);
    nano.control("fault clear").unwrap();
    nano.control("reset").unwrap();
    let report = bench.run(["doctor", "--port", &port, "--json"]).json();
    expect(&report, "fault log", true, &["motor 2 is stalled", "speeds 0.0 and 0.0 rpm"]);
    bench.run(["record", plan, "--resume", "--port", &port]).expect_code(3);
    let board = |log: &Path| biflag_log::last_meta::<BoardMeta>(log).unwrap().unwrap();
    let logs = logs(&bench.path().join("bench"));
    let [later, first] = logs.as_slice() else { panic!("{logs:?}") };
    assert_eq!(board(first).faults, []);
    let faults = board(later).faults;
    assert_eq!((faults.len(), faults[0].fault.as_str()), (1, "Motor2Stalled"));
    assert!(faults[0].duty[1] > 0 && faults[0].boot < board(later).boot_count, "{faults:?}");
}

/// A session is checked log by log.
#[test]
fn a_session_with_a_damaged_log_is_reported() {
    let bench = Bench::new();
    let plan = bench.file(
        "plan.toml",
        "[session]\nname = \"bench\"\nrepeats = 2\n[trial]\ncalibrate = 0\npreroll = 0\nrun = 1\ndecay = 0\n\
         [speeds]\npairs = [[0, 0]]\n",
    );
    let nano = nano(["--speed", "max"]);
    bench.run(["record", plan.to_str().unwrap(), "--port", nano.port()]).expect_code(0);
    let report = bench.run(["doctor", "bench", "--json"]).expect_code(0).json();
    expect(&report, "trial 002_w1+0_w2+0_r2", true, &["is whole, 200 samples"]);
    let log = &logs(&bench.path().join("bench"))[0];
    let bytes = std::fs::read(log).unwrap();
    std::fs::write(log, &bytes[..bytes.len() / 2]).unwrap();
    let report = bench.run(["doctor", "bench", "--json"]).expect_code(3).json();
    expect(&report, "trial 001_w1+0_w2+0_r1", false, &["cut off", "biflag recover bench/001_w1+0_w2+0_r1.mcap"]);
    expect(&report, "trial 002_w1+0_w2+0_r2", true, &["whole"]);
    // As while the trial is being recorded.
    let manifest = std::fs::File::open(bench.path().join("bench/session.toml")).unwrap();
    manifest.lock().unwrap();
    let report = bench.run(["doctor", "bench", "--json"]).expect_code(3).json();
    expect(&report, "trial 001_w1+0_w2+0_r1", false, &["is being recorded\"", "when `biflag record` has ended"]);
    assert!(!report.to_string().contains("recover") && !report.to_string().contains("cut off"), "{report}");
    drop(manifest);
    expect_error(&bench.run(["doctor", "config"]), 2, &["not a session folder"]);
}

#[test]
fn a_meter_at_the_5_v_pin_makes_the_board_measure_its_supply_right() {
    let bench = Bench::new();
    // With its default of 1100 mV the board tells 4.78 V.
    let nano = nano(["--speed", "max", "--fault", "bandgap=1150"]);
    let settings = |volts: &str| bench.run(["settings", "--supply", volts, "--port", nano.port(), "--json"]);
    expect_error(&settings("50"), 2, &["4 to 6"]);
    expect_error(&settings("5.9"), 1, &["the board tells 4.7", "pins 5V and GND"]);
    let saved = settings("5.0").expect_code(0).json();
    let reference = saved["bandgap_mv"].as_f64().unwrap();
    assert!((reference - 1150.0).abs() < 8.0, "{saved}");
}
