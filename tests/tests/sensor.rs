//! The commands that measure the sensor, and what plans and logs make of the file.

use biflag_log::Origin;
use host::trial::{Judged, Want};
use std::io::{BufRead, BufReader};
use tests::{Bench, Run, data, expect_error, logs, nano};

/// A trial at rest, of a board whose sensor was measured.
const PLAN: &str = "[session]\nname = \"s\"\nsensor = \"sensor.toml\"\n[board]\ndeadline_ms = 5000\n\
                    [trial]\ncalibrate = 0\npreroll = 0\nrun = 1\ndecay = 0\n[speeds]\npairs = [[0, 0]]\n";

#[test]
fn a_turn_of_a_real_sensor_has_its_scale() {
    let bench = Bench::new();
    let imu = format!("--virtual={}", data("mpu6050/rotate-z-720.csv").display());
    // One turn of six, and the accelerometer of this board has its z axis down.
    let run = bench.run(["sensor", "turn", "z", &imu, "--json"]).expect_code(3).json();
    println!("{run}");
    tests::golden::hold_keys("sensor-turn", &run);
    let [scale, u] = ["scale", "scale_u"].map(|key| run["sensor"][key][2].as_f64().unwrap());
    // By the trapezium rule, the recorded counts less those at rest are 706.22 of the 720 degrees.
    let expected = 706.22 / 720.0 - 1.0;
    assert!((scale - expected).abs() < 1e-3 && (0.0005..0.003).contains(&u), "{scale} ± {u}");
    assert_eq!(run["turns"]["turned_deg"].as_array().unwrap().len(), 1);
    assert_eq!(run["warnings"].as_array().unwrap().len(), 2);
}

#[test]
fn the_emulated_hand_measures_an_axis_and_the_log_of_a_trial_has_it() {
    let bench = Bench::new();
    let arguments = ["sensor", "turn", "x", "360", "--repeats", "2", "--virtual", "--sensor", "typical", "--seed", "5"];
    let run = bench.run(arguments.into_iter().chain(["--json"])).expect_code(0).json();
    println!("{run}");
    let log = bench.path().join(run["log"].as_str().unwrap());
    let truth = Judged::read(&log, Want::default()).unwrap().data.records.sensor.unwrap();
    assert_eq!(Judged::read(&log, Want::default()).unwrap().data.origin(), Origin::VirtualRig);
    let expected = truth.gyro_scale[0];
    let [scale, u] = ["scale", "scale_u"].map(|key| run["sensor"][key][0].as_f64().unwrap());
    println!("{scale} ± {u}, true {expected}");
    assert!((scale - expected).abs() < 3.0 * u && u < 0.005, "{scale} ± {u} for {expected}");

    // A trial of the same board carries it, and one of another board refuses it.
    let plan = bench.file("plan.toml", PLAN);
    let record = |arguments: &[&str]| -> Run {
        let all = ["record", plan.to_str().unwrap(), "--virtual"];
        bench.run(all.iter().chain(arguments))
    };
    record(&["--out", "session"]).expect_code(0);
    let recorded = Judged::read(&logs(&bench.path().join("session"))[0], Want::default()).unwrap().data;
    assert_eq!(recorded.records.measured_sensor.as_ref().unwrap().name, "sensor.toml");
    let known = recorded.sensor().gyro_scale;
    assert!((known[0].value - scale).abs() < 1e-4 && (known[0].u - u).abs() < 1e-4, "{known:?}");
    assert!(known[1].value == 0.0 && known[1].u > 0.017, "{known:?}");
    let file = bench.path().join("sensor.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, text.replace("board_id = 0", "board_id = 9")).unwrap();
    expect_error(&record(&["--out", "other"]), 2, &["sensor.toml", "board 9"]);
    std::fs::write(&file, text.replace("[gyro_scale]", "[gyro_skale]")).unwrap();
    expect_error(&record(&["--out", "other"]), 2, &["sensor.toml:7:2", "unknown key `gyro_skale`"]);
    bench.file("plan.toml", &PLAN.replace("sensor = \"sensor.toml\"\n", ""));
    let run = record(&["--out", "none"]).expect_code(0);
    assert!(run.stderr.contains("the plan names no sensor file"), "{}", run.stderr);
}

#[test]
fn the_file_names_the_board_that_it_was_measured_on() {
    let bench = Bench::new();
    let mut nano = nano(["--speed", "max", "--sensor", "typical", "--seed", "8"]);
    let port = nano.port().to_owned();
    let mut child = bench.start(["sensor", "turn", "z", "--repeats", "1", "--json", "--port", &port]);
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    for (said, degrees) in [("turn 1 of 2: turn it by", 720.0), ("turn 2 of 2: turn it by", -720.0)] {
        let said = lines.by_ref().map(Result::unwrap).find(|line| line.contains(said));
        assert!(said.is_some(), "the program ended");
        nano.turn('z', degrees, 12.5).unwrap();
    }
    lines.for_each(drop);
    let run = Run::of(child).expect_code(0).json();
    let scale = run["sensor"]["scale"][2].as_f64().unwrap();
    let settings = bench.run(["settings", "--port", &port, "--json"]).expect_code(0).json();
    println!("{run}\n{settings}");
    assert!(scale != 0.0);
    let file = std::fs::read_to_string(bench.path().join("sensor.toml")).unwrap();
    assert!(file.contains(&format!("board_id = {}", settings["board_id"])), "{file}");

    // The board keeps the scale: a computer without the file uses it, and one with an older file is told.
    assert_eq!(run["kept_on_board"], true);
    let record = |plan: &str, out: &str| {
        let plan = bench.file("plan.toml", plan);
        bench.run(["record", plan.to_str().unwrap(), "--port", &port, "--out", out, "--json"])
    };
    let alone = record(&PLAN.replace("sensor = \"sensor.toml\"\n", ""), "alone");
    assert!(alone.stderr.contains("those that the board keeps, measured on 20"), "{}", alone.stderr);
    let recorded = Judged::read(&logs(&bench.path().join("alone"))[0], Want::default()).unwrap().data;
    assert_eq!(recorded.records.measured_sensor.as_ref().unwrap().name, "the board");
    let u = run["sensor"]["scale_u"][2].as_f64().unwrap();
    let known = recorded.sensor().gyro_scale;
    // As in the file, to the third digit of the uncertainty.
    assert!((known[2].value - scale).abs() < 1.1e-5 && (known[2].u - u).abs() < 6e-3 * u, "{known:?}");
    bench.run(["doctor", "alone"]).expect_code(0);
    let line = file.lines().skip_while(|line| !line.starts_with("[gyro_scale]")).nth(1).unwrap();
    bench.file("sensor.toml", &file.replace(line, "z = { value = 0.05, u = 0.001 }"));
    let older = record(PLAN, "older");
    assert!(older.stderr.contains("scale about z is +5.000"), "{}", older.stderr);
}
