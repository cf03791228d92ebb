//! Bad input gives one clear error and the right exit code, and nothing is lost.

use tests::{Bench, Run, data, expect_error, nano};

const SPEEDS: &str = "[speeds]\npairs = [[50, 10]]\n";

fn record(plan: &str) -> Run {
    let bench = Bench::new();
    let plan = bench.file("plan.toml", plan);
    bench.run(["record", plan.to_str().unwrap(), "--port", "/dev/no-such-port", "--json"])
}

#[test]
fn invalid_plan_is_reported_with_its_place() {
    let cases: [(&str, String, &[&str]); 10] = [
        ("unknown key", format!("{SPEEDS}colour = \"red\"\n"), &["plan.toml", "colour"]),
        ("unknown table", format!("{SPEEDS}[motor]\nx = 1\n"), &["motor"]),
        ("too fast", "[speeds]\npairs = [[91, 0]]\n".into(), &["91", "90"]),
        ("too fast backwards", "[speeds]\npairs = [[0, -90.5]]\n".into(), &["-90.5"]),
        ("not a number", "[speeds]\npairs = [[nan, 0]]\n".into(), &["plan.toml"]),
        ("negative duration", format!("{SPEEDS}[trial]\nrun = -1\n"), &["run", "-1"]),
        ("no trials", "[session]\nname = \"x\"\n".into(), &["plan.toml", "trial"]),
        ("empty list", "[speeds]\npairs = []\n".into(), &["plan.toml"]),
        ("grid step", "[speeds]\ngrid = { w1 = [0, 90, 0], w2 = [0, 90, 10] }\n".into(), &["w1", "0"]),
        ("not TOML", "[speeds\n".into(), &["plan.toml", "1"]),
    ];
    for (name, plan, words) in cases {
        println!("{name}");
        expect_error(&record(&plan), 2, words);
    }
}

#[test]
fn missing_plan_is_reported() {
    let bench = Bench::new();
    let run = bench.run(["record", "no-such-plan.toml", "--port", "/dev/null"]);
    expect_error(&run, 2, &["no-such-plan.toml: the plan cannot be read", "help: check the path"]);
    let plan = bench.file("plan.toml", &format!("[session]\nrobot = \"no-such-robot.toml\"\n{SPEEDS}"));
    let run = bench.run(["record", plan.to_str().unwrap(), "--port", "/dev/null"]);
    expect_error(&run, 2, &["no-such-robot.toml: the robot file cannot be read", "help: check the path"]);
}

#[test]
fn other_missing_files_are_wrong_use() {
    let bench = Bench::new();
    let nano = nano(["--speed", "max"]);
    let run = bench.run(["settings", "--port", nano.port(), "--write", "no-such.toml"]);
    expect_error(&run, 2, &["no-such.toml: the settings file cannot be read", "help: check the path"]);
    let run = bench.run(["flash", "--port", nano.port(), "--firmware", "no-such.elf"]);
    expect_error(&run, 2, &["no-such.elf", "help: check the path"]);
    for command in ["info", "recover", "export", "report", "compare", "live"] {
        let run = bench.run([command, "no-such.mcap"]);
        expect_error(&run, 2, &["no-such.mcap: no such log", "help: check the path"]);
    }
}

#[test]
fn missing_port_is_reported_and_leaves_no_log() {
    let bench = Bench::new();
    let plan = bench.file("plan.toml", SPEEDS);
    let run = bench.run(["record", plan.to_str().unwrap(), "--port", "/dev/no-such-port", "--out", "session"]);
    expect_error(&run, 2, &["/dev/no-such-port"]);
    for command in ["doctor", "settings", "flash", "live"] {
        let run = bench.run([command, "--port", "/dev/no-such-port"]);
        expect_error(&run, 2, &["there is no port /dev/no-such-port", "help: "]);
    }
    let logs = walk(&bench.path().join("session"));
    assert!(logs.iter().all(|name| !name.ends_with(".mcap")), "{logs:?}");
}

#[test]
fn device_that_is_not_a_serial_port_is_rejected() {
    let bench = Bench::new();
    let plan = bench.file("plan.toml", SPEEDS);
    let run = bench.run(["record", plan.to_str().unwrap(), "--port", "/dev/null"]);
    expect_error(&run, 2, &["/dev/null is not a serial port", "help: "]);
}

#[test]
fn invalid_imu_recording_is_rejected_with_its_line() {
    let bench = Bench::new();
    let plan = bench.file("plan.toml", SPEEDS);
    let csv = bench.file("imu.csv", "t_s,ax,ay,az,gx,gy,gz,temp_c\n0.0,1,2,three,4,5,6,20\n");
    let argument = format!("--virtual={}", csv.display());
    let run = bench.run(["record", plan.to_str().unwrap(), &argument]);
    expect_error(&run, 1, &["imu.csv", "2"]);
}

#[test]
fn files_that_are_not_logs_are_rejected() {
    let bench = Bench::new();
    let empty = bench.file("empty.mcap", "");
    let text = bench.file("text.mcap", "this is not a log, despite its name\n");
    let csv = data("mpu6050/rotate-z-720.csv");
    // An intact log of another program.
    let foreign = bench.path().join("foreign.mcap");
    let mut writer = mcap::Writer::new(std::fs::File::create(&foreign).unwrap()).unwrap();
    let channel = writer.add_channel(0, "/chatter", "json", &Default::default()).unwrap();
    let header = mcap::records::MessageHeader { channel_id: channel, sequence: 0, log_time: 0, publish_time: 0 };
    writer.write_to_known_channel(&header, b"{}").unwrap();
    writer.finish().unwrap();
    let cases = [
        // An empty log is a recording that failed, not a wrong name.
        ("info", &empty, 1),
        ("info", &text, 2),
        ("info", &foreign, 2),
        ("recover", &empty, 1),
        ("recover", &csv, 2),
        ("recover", &foreign, 2),
        ("export", &text, 2),
        ("report", &foreign, 2),
        ("compare", &foreign, 2),
        ("live", &foreign, 2),
    ];
    for (command, path, code) in cases {
        let run = bench.run([command, path.to_str().unwrap()]);
        expect_error(&run, code, &[path.file_name().unwrap().to_str().unwrap(), "help: "]);
    }
    let left = walk(bench.path());
    assert_eq!(left.len(), 3, "no file was created: {left:?}");
}

#[test]
fn wrong_use_exits_with_two() {
    let bench = Bench::new();
    for arguments in
        [&["record"][..], &["no-such-command"], &["info", "--no-such-option"], &["export", "x", "--format", "xls"]]
    {
        assert_eq!(bench.run(arguments).code, Some(2), "{arguments:?}");
    }
    for command in ["doctor", "flash", "record", "info", "recover", "export", "settings"] {
        let run = bench.run([command, "--help"]).expect_code(0);
        assert!(run.stdout.contains("Example"), "{command} has no example");
    }
}

fn walk(folder: &std::path::Path) -> Vec<String> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect()
}
