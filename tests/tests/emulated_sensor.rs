//! A sensor with errors behind the emulated board, through the real firmware, the link and the log.

use biflag_log::{Reader, SensorMeta};
use tests::{Bench, Run, bare_nano, nano, program, wait_for_line};

/// A hand turns the sensor by 720 deg while a trial is recorded: the log has the angle times scale and clock.
#[test]
fn turn_by_hand_is_logged_with_the_errors_of_scale_and_clock() {
    const ANGLE_DEG: f64 = 720.0;
    let bench = Bench::new();
    let sensor = bench.file("sensor.toml", "gyro_scale = [0.02, -0.01, -0.0165]\nboard_clock_error = 0.0035\n");
    let plan = bench.short_plan(30.0, [0.0, 0.0]);
    let mut nano = nano(["--speed", "4", "--sensor", sensor.to_str().unwrap()]);
    assert_eq!(nano.sensor.gyro_scale, [0.02, -0.01, -0.0165]);
    // A hand that sways cones, and the rate about z is then not the whole turn.
    nano.control("hand 0 0").unwrap();
    let port = nano.port().to_owned();
    let mut recording = bench.start(["record", plan.to_str().unwrap(), "--port", &port, "--json"]);
    wait_for_line(&mut recording, ": run");
    let turn = nano.turn('z', ANGLE_DEG, 17.5).unwrap();
    assert!((turn.end_s - turn.begin_s - 17.5).abs() < 1e-9 && turn.off_deg == [0.0; 3], "{turn:?}");
    assert!(nano.is_moving().unwrap());
    let trial = Run::of(recording).json()["trials"][0].clone();
    assert!(!nano.is_moving().unwrap(), "the recording ended before the turn");
    let turned = trial["turned_deg"][2].as_f64().unwrap();
    let expected = ANGLE_DEG * (1.0 - 0.0165) * (1.0 + 0.0035);
    println!("turned {turned:.3} deg of {expected:.3}: {trial}");
    assert!((turned - expected).abs() < 0.3, "{turned} of {expected}");
}

/// `record --sensor typical --seed N` records with the sensor that the seed draws, and its log says all of it.
#[test]
fn log_has_the_errors_that_the_seed_draws() {
    let bench = Bench::new();
    let plan = bench.short_plan(3.0, [20.0, -10.0]);
    let log = |sensor: &str, seed: &str| {
        let out = format!("{sensor}-{seed}");
        let arguments = [
            "record",
            plan.to_str().unwrap(),
            "--virtual",
            "--sensor",
            sensor,
            "--seed",
            seed,
            "--out",
            &out,
            "--json",
        ];
        let run = bench.run(arguments);
        assert!(matches!(run.code, Some(0 | 3)), "{run:?}");
        let mut reader = Reader::open(&bench.path().join(run.json()["trials"][0]["log"].as_str().unwrap())).unwrap();
        reader.by_ref().for_each(|message| drop(message.unwrap()));
        reader.meta::<SensorMeta>().unwrap()
    };
    let drawn = |sensor: &str, seed: &str| bare_nano(["--sensor", sensor, "--seed", seed]).sensor.clone();
    let typical = log("typical", "12");
    assert_eq!(typical, SensorMeta { seed: 12, ..drawn("typical", "12") });
    assert!(typical.kind == "typical" && typical.gyro_cross[0][1] != 0.0 && typical.board_clock_error != 0.0);
    let ideal = log("ideal", "12");
    assert_eq!(ideal, SensorMeta { seed: 12, ..drawn("ideal", "12") });
    assert_eq!((ideal.gyro_bias_dps, ideal.gyro_scale), (typical.gyro_bias_dps, [0.0; 3]));
}

/// The emulated board knows no error that a log cannot hold.
#[test]
fn log_can_hold_every_error_of_the_emulated_sensor() {
    let help = std::process::Command::new(program("vnano")).args(["--sensor", "help"]).output().unwrap();
    let help = String::from_utf8(help.stdout).unwrap();
    let is_name = |name: &&str| name.chars().all(|letter| letter.is_ascii_lowercase() || letter == '_');
    let keys: Vec<&str> =
        help.lines().filter_map(|line| line.split_once(" = ")).map(|line| line.0).filter(is_name).collect();
    let meta = serde_json::to_value(SensorMeta::default()).unwrap();
    assert!(keys.len() >= 18 && keys.iter().all(|key| meta.get(key).is_some()), "{keys:?} in {meta}");
}

/// Options of the emulated sensor that make no sense are wrong use, said in one line.
#[test]
fn wrong_sensors_are_named() {
    let bench = Bench::new();
    let plan = bench.short_plan(3.0, [20.0, -10.0]);
    bench.file("sensor.toml", "# my sensor\ngyro_scales = [0, 0, 0]\n");
    let imu = format!("--virtual={}", tests::data("mpu6050/still-655s.csv").display());
    for (arguments, message) in [
        (["--virtual", "--sensor", "sensor.toml"], "unknown key gyro_scales; the keys are gyro_scale,"),
        (["--virtual", "--sensor", "none.toml"], "none.toml: No such file"),
        ([imu.as_str(), "--sensor", "typical"], "has its own sensor's errors: leave out --sensor"),
    ] {
        let run =
            bench.run([&["record", plan.to_str().unwrap(), "--out", "x"][..], &arguments].concat()).expect_code(2);
        assert!(run.stderr.contains(message), "{run:?}");
        assert!(!bench.path().join("x").exists(), "{arguments:?}");
    }
}
