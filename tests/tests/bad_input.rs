//! Bad input gets one clear error, the right exit code, and nothing is lost.

use tests::{Bench, Run, data, nano};

const SPEEDS: &str = "[speeds]\npairs = [[50, 10]]\n";

fn record(plan: &str) -> Run {
    let bench = Bench::new();
    let plan = bench.file("plan.toml", plan);
    bench.run(["record", plan.to_str().unwrap(), "--port", "/dev/no-such-port", "--json"])
}

/// One error on stderr that says all of `words`.
#[track_caller]
fn expect_error(run: &Run, code: i32, words: &[&str]) {
    assert_eq!(run.code, Some(code), "{run:?}");
    assert_eq!(run.stderr.matches("error: ").count(), 1, "one error, not {}", run.stderr);
    for word in words {
        assert!(run.stderr.contains(word), "no {word:?} in: {}", run.stderr);
    }
}

#[test]
fn a_bad_plan_says_what_and_where() {
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
fn a_plan_that_is_not_there_is_named() {
    let bench = Bench::new();
    let run = bench.run(["record", "no-such-plan.toml", "--port", "/dev/null"]);
    expect_error(&run, 2, &["no-such-plan.toml: the plan cannot be read", "help: check the path"]);
    let plan = bench.file("plan.toml", &format!("[session]\nrobot = \"no-such-robot.toml\"\n{SPEEDS}"));
    let run = bench.run(["record", plan.to_str().unwrap(), "--port", "/dev/null"]);
    expect_error(&run, 2, &["no-such-robot.toml: the robot file cannot be read", "help: check the path"]);
}

#[test]
fn other_files_that_are_not_there_are_wrong_use_too() {
    let bench = Bench::new();
    let nano = nano(["--speed", "1"]);
    let run = bench.run(["settings", "--port", nano.port(), "--write", "no-such.toml"]);
    expect_error(&run, 2, &["no-such.toml: the settings file cannot be read", "help: check the path"]);
    let run = bench.run(["flash", "--port", nano.port(), "--firmware", "no-such.elf"]);
    expect_error(&run, 2, &["no-such.elf", "help: check the path"]);
    for command in ["info", "recover", "export", "report", "compare", "live"] {
        let run = bench.run([command, "no-such.mcap"]);
        expect_error(&run, 2, &["no-such.mcap: there is no such log", "help: check the path"]);
    }
}

#[test]
fn a_port_that_is_not_there_is_named_and_nothing_is_left_behind() {
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
fn a_device_that_is_no_serial_port_is_refused() {
    let bench = Bench::new();
    let plan = bench.file("plan.toml", SPEEDS);
    let run = bench.run(["record", plan.to_str().unwrap(), "--port", "/dev/null"]);
    expect_error(&run, 2, &["/dev/null is not a serial port", "help: "]);
}

#[test]
fn an_imu_recording_that_is_none_is_refused_with_its_line() {
    let bench = Bench::new();
    let plan = bench.file("plan.toml", SPEEDS);
    let csv = bench.file("imu.csv", "t_s,ax,ay,az,gx,gy,gz,temp_c\n0.0,1,2,three,4,5,6,20\n");
    let argument = format!("--virtual={}", csv.display());
    let run = bench.run(["record", plan.to_str().unwrap(), &argument]);
    expect_error(&run, 1, &["imu.csv", "2"]);
}

#[test]
fn logs_that_are_none_are_refused_with_a_reason() {
    let bench = Bench::new();
    let empty = bench.file("empty.mcap", "");
    let text = bench.file("text.mcap", "this is not a log, whatever it is called\n");
    let csv = data("mpu6050/rotate-z-720.csv");
    // A log of another program: whole, and nothing of ours in it.
    let foreign = bench.path().join("foreign.mcap");
    let mut writer = mcap::Writer::new(std::fs::File::create(&foreign).unwrap()).unwrap();
    let channel = writer.add_channel(0, "/chatter", "json", &Default::default()).unwrap();
    let header = mcap::records::MessageHeader { channel_id: channel, sequence: 0, log_time: 0, publish_time: 0 };
    writer.write_to_known_channel(&header, b"{}").unwrap();
    writer.finish().unwrap();
    let cases = [
        ("info", &empty),
        ("info", &text),
        ("info", &foreign),
        ("recover", &empty),
        ("recover", &csv),
        ("recover", &foreign),
        ("export", &text),
        ("report", &foreign),
        ("compare", &foreign),
        ("live", &foreign),
    ];
    for (command, path) in cases {
        let run = bench.run([command, path.to_str().unwrap()]);
        expect_error(&run, 1, &[path.file_name().unwrap().to_str().unwrap(), "help: "]);
    }
    let left = walk(bench.path());
    assert_eq!(left.len(), 3, "nothing was made of them: {left:?}");
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
