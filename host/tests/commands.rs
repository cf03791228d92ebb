//! End-to-end tests of `info`, `recover` and `export`: output, files and exit codes.

use biflag_log::{End, EventKind, LinkStats, Origin, Summary};
use host::plan::{Plan, board};
use host::run::{self, Recorder};
use host::session::Session;
use protocol::units::{CentiRpm, Count, Duty, EncoderCounts, Quaternion, SensorCounts, TemperatureCounts};
use protocol::{Info, Settings, State, Telemetry};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::{Duration, SystemTime};

fn biflag(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_biflag")).args(args).output().unwrap()
}

fn code(output: &Output) -> i32 {
    output.status.code().unwrap()
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Creates a session of two short trials, the first of which is complete: at 100 Hz, yaw turning by 1 °/s during the
/// run.
fn session(folder: &Path) -> PathBuf {
    let text = "[session]\nname = \"short\"\noperator = \"Ada\"\n[trial]\ncalibrate = 0\npreroll = 10\nrun = 24\ndecay = 10\n\
                [speeds]\npairs = [[50, 10], [0, 45]]\n";
    let plan = Plan::parse(text, "plan.toml").unwrap();
    let session = Session::create(&folder.join("short"), &plan).unwrap();
    let trial = &plan.trials[0];
    let (attempt, log) = session.next_attempt(trial).unwrap();
    let begun = SystemTime::now();
    let host = |seconds: f64| begun + Duration::from_secs_f64(seconds);
    let info = Info { firmware: [0, 1, 0], imu_id: 0x68, ..Info::default() };
    let board = board::to_log(&info, &Settings::DEFAULT);
    let start = run::start(&plan, trial, attempt, Origin::VirtualRig, Some(board), host(0.0));
    let mut writer = Recorder::create(&log, &start, Settings::DEFAULT, host(0.0)).unwrap();
    for i in 0..=4400u32 {
        let time = f64::from(i) * 0.01;
        for (at, phase) in [(0, "preroll"), (1000, "run"), (3400, "decay"), (4400, "end")] {
            if i == at {
                writer.event(EventKind::Phase, phase, host(time)).unwrap();
            }
        }
        let half = (time - 10.0).clamp(0.0, 24.0).to_radians() / 2.0;
        let frame = Telemetry {
            seq: Count(i as u16),
            attitude: Quaternion::from_f64([half.cos(), 0.0, 0.0, half.sin()]),
            gyro: [SensorCounts(13), SensorCounts(0), SensorCounts(-131)],
            accel: [SensorCounts(0), SensorCounts(0), SensorCounts(16384)],
            temperature: TemperatureCounts::from_celsius(25.0),
            target: [CentiRpm(5000), CentiRpm(1000)],
            speed: [CentiRpm(4990), CentiRpm(1001)],
            duty: [Duty(120), Duty(-30)],
            encoder: [EncoderCounts(60222), EncoderCounts(-60222)],
            state: State::Running,
            imu_fresh: true,
            ..Telemetry::default()
        };
        writer.frame(&frame, 7_000_000 + u64::from(i) * 10_000, host(time)).unwrap();
    }
    writer.dropout(77, 3, host(44.0)).unwrap();
    let link = LinkStats { samples: 4401, lost: 3, retries: 1, ..LinkStats::default() };
    writer.finish(&mut Summary { end: End::Complete, link, ..Summary::default() }).unwrap();
    log
}

#[test]
fn info_shows_the_content_of_a_log() {
    // Three frames were lost, which every command says.
    let folder = tempfile::tempdir().unwrap();
    let log = session(folder.path());
    let output = biflag(&["info", path(&log), "--json"]);
    assert_eq!(code(&output), 3, "{}", stderr(&output));
    let info = json(&output);
    assert_eq!(info["channels"]["/telemetry"], 4401);
    assert_eq!((info["samples"].as_u64(), info["lost"].as_u64()), (Some(4401), Some(3)));
    assert!((info["duration_s"].as_f64().unwrap() - 44.0).abs() < 1e-9);
    assert_eq!(info["clean"], true);
    // The mean over the last 12 s of the run, relative to the mean over the last second before it.
    assert!((info["angles"]["yaw_deg"].as_f64().unwrap() - 18.0).abs() < 0.02);
    // Of ten seconds after the run, the first two are those in which the motors stop.
    assert_eq!(info["angles"]["still_after_s"], 8.0);
    assert!((info["angles"]["turned_deg"][2].as_f64().unwrap() - 24.0).abs() < 0.02);

    let text = String::from_utf8(biflag(&["info", path(&log)]).stdout).unwrap();
    for part in [
        "Ada",
        "001_w1+50_w2+10, 50 and 10 rpm",
        "firmware 0.1.0",
        "4401 samples, 3 lost",
        "yaw 1",
        "complete",
        "robot        physical",
        "log clean",
    ] {
        assert!(text.contains(part), "{part} is not in\n{text}");
    }
}

#[test]
fn info_shows_the_state_of_a_session() {
    let folder = tempfile::tempdir().unwrap();
    let log = session(folder.path());
    let output = biflag(&["--json", "info", path(log.parent().unwrap())]);
    assert_eq!(code(&output), 3, "one of two trials is missing");
    let info = json(&output);
    assert_eq!(info["trials"][0]["complete"], true);
    assert_eq!(info["trials"][0]["summary"]["lost"], 3);
    assert_eq!(info["trials"][1]["complete"], false);
    assert_eq!(info["samples"], 4401);
    let output = biflag(&["info", path(folder.path())]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("not a session folder"));
}

#[test]
fn cut_off_log_is_recovered() {
    let folder = tempfile::tempdir().unwrap();
    let log = session(folder.path());
    let whole = std::fs::read(&log).unwrap();
    std::fs::write(&log, &whole[..whole.len() * 2 / 3]).unwrap();
    let output = biflag(&["info", path(&log), "--json"]);
    assert_eq!((code(&output), &json(&output)["clean"]), (3, &Value::Bool(false)));

    let output = biflag(&["recover", path(&log), "--json"]);
    assert_eq!(code(&output), 3, "{}", stderr(&output));
    let recovered = log.with_extension("recovered.mcap");
    assert_eq!(json(&output)["recovered"], path(&recovered));
    assert_eq!(json(&output)["losses"].as_array().unwrap().len(), 1);
    assert_eq!(code(&biflag(&["info", path(&recovered)])), 3);

    let output = biflag(&["recover", path(&log)]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("already exists"));
    let output = biflag(&["recover", path(&recovered), "--json"]);
    assert_eq!((code(&output), &json(&output)["recovered"]), (0, &Value::Null));
    std::fs::write(&log, b"not a log").unwrap();
    let output = biflag(&["recover", path(&log), "--json"]);
    assert_eq!(code(&output), 2);
    assert!(json(&output)["error"].as_str().unwrap().contains("not an MCAP file"));
    assert!(stderr(&output).contains("help:"));
}

/// A recovery that fails leaves neither an unfinished log nor a draft.
#[test]
fn recovery_into_a_full_disk_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let log = session(folder.path());
    let whole = std::fs::read(&log).unwrap();
    std::fs::write(&log, &whole[..whole.len() * 2 / 3]).unwrap();
    let session = log.parent().unwrap();
    let before = std::fs::read_dir(session).unwrap().count();
    let mut shell = Command::new("sh");
    shell.args(["-c", "ulimit -f 8; exec \"$@\"", "sh", env!("CARGO_BIN_EXE_biflag"), "recover", path(&log)]);
    let output = shell.output().unwrap();
    assert_eq!(code(&output), 1, "{}", stderr(&output));
    assert_eq!(std::fs::read_dir(session).unwrap().count(), before);
    assert_eq!(code(&biflag(&["recover", path(&log)])), 3);
}

/// `recover` rebuilds the manifest of a session from its logs.
#[test]
fn lost_manifest_is_rebuilt() {
    let folder = tempfile::tempdir().unwrap();
    let log = session(folder.path());
    let session = log.parent().unwrap();
    let manifest = session.join("session.toml");
    let text = std::fs::read_to_string(&manifest).unwrap();
    std::fs::remove_file(&manifest).unwrap();
    let output = biflag(&["info", path(session)]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("`biflag recover` rebuilds"), "{}", stderr(&output));
    let output = biflag(&["recover", path(session), "--json"]);
    assert_eq!((code(&output), &json(&output)["rebuilt"]), (0, &Value::Bool(true)), "{}", stderr(&output));
    let plan = |text: &str| text.parse::<toml::Table>().unwrap()["plan"].clone();
    assert_eq!(plan(&std::fs::read_to_string(&manifest).unwrap()), plan(&text));
    assert_eq!(json(&biflag(&["info", path(session), "--json"]))["samples"], 4401);
    let output = biflag(&["recover", path(session), "--json"]);
    assert_eq!((code(&output), &json(&output)["rebuilt"]), (0, &Value::Bool(false)));
}

/// Returns the cells of a column of a CSV file with header lines that begin with `#`.
fn column(csv: &str, name: &str) -> Vec<String> {
    let mut lines = csv.lines().filter(|line| !line.starts_with('#'));
    let at = lines.next().unwrap().split(',').position(|column| column == name).unwrap_or_else(|| panic!("no {name}"));
    lines.map(|line| line.split(',').nth(at).unwrap().to_owned()).collect()
}

fn numbers(csv: &str, name: &str) -> Vec<f64> {
    column(csv, name).iter().map(|cell| cell.parse().unwrap_or(f64::NAN)).collect()
}

#[test]
fn export_has_the_angles_of_the_other_commands() {
    let folder = tempfile::tempdir().unwrap();
    let log = session(folder.path());
    let output = biflag(&["export", path(&log), "--format", "csv", "--json"]);
    assert_eq!(code(&output), 3, "{}", stderr(&output));
    assert_eq!(json(&output)["rows"], 4401);
    let csv = std::fs::read_to_string(log.with_extension("csv")).unwrap();
    let first = csv.lines().next().unwrap();
    assert!(
        first.starts_with("# biflag 0.1.0 (") && first.ends_with("): trial 001_w1+50_w2+10 at 50 and 10 rpm"),
        "{first}"
    );
    for line in [
        "# SHA-256 of the log: ",
        "# robot physical\n",
        "# offset removed: yaw ",
        "# steady, from 11.990 to 23.990 s: yaw ",
        "# yaw_uncertainty_deg: 95 %",
    ] {
        assert!(csv.contains(line), "{line} is not in\n{}", &csv[..2000]);
    }
    let (times, yaw, board) = (numbers(&csv, "time_s"), numbers(&csv, "yaw_deg"), numbers(&csv, "board_yaw_deg"));
    // Relative to the start of the run, minus the delay of the sensor's filter.
    assert!((times[0] + 10.0).abs() < 0.01 && (times[4400] - 34.0).abs() < 0.01, "{} {}", times[0], times[4400]);
    let phases = column(&csv, "phase");
    assert_eq!([&phases[0], &phases[1500], &phases[4000]], ["preroll", "run", "decay"]);
    assert!((board[4400] - 24.0).abs() < 0.01 && yaw[500].abs() < 0.01, "{} {}", board[4400], yaw[500]);
    assert_eq!((numbers(&csv, "speed1_rpm")[2000], numbers(&csv, "target2_rpm")[2000]), (49.9, 10.0));
    // The mean of the exported angles over the steady time is the steady yaw.
    let steady: Vec<f64> = (0..yaw.len()).filter(|i| (11.99..=23.99).contains(&times[*i])).map(|i| yaw[i]).collect();
    let info = json(&biflag(&["info", path(&log), "--json"]));
    let mean = steady.iter().sum::<f64>() / steady.len() as f64;
    assert!((mean - info["angles"]["yaw_deg"].as_f64().unwrap()).abs() < 0.01, "{mean}");

    let tum = folder.path().join("a.tum");
    let wrong = biflag(&["export", path(&log), "-f", "tum", "-o", path(&tum.with_extension("csv"))]);
    assert!(code(&wrong) == 2 && stderr(&wrong).contains("the name must end with .tum"), "{}", stderr(&wrong));
    // The name says the format.
    assert_eq!(code(&biflag(&["export", path(&log), "-o", path(&tum)])), 3);
    let text = std::fs::read_to_string(&tum).unwrap();
    let last: Vec<f64> = text.lines().last().unwrap().split(' ').map(|cell| cell.parse().unwrap()).collect();
    // A yaw of 24 degrees.
    assert!((last[0] - 44.0).abs() < 0.01 && (last[6] - 0.2079).abs() < 1e-3 && (last[7] - 0.9781).abs() < 1e-3);

    let output = biflag(&["export", path(&log), "-f", "tum", "-o", path(&tum)]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("--force"));
    assert_eq!(code(&biflag(&["export", path(&log), "-f", "tum", "-o", path(&tum), "--force"])), 3);
}

#[test]
fn session_is_exported_as_a_table_and_a_file_per_trial() {
    let folder = tempfile::tempdir().unwrap();
    let log = session(folder.path());
    let session = log.parent().unwrap();
    let output = biflag(&["export", path(session), "--json"]);
    assert_eq!(code(&output), 3, "{}", stderr(&output));
    let export = folder.path().join("short-export");
    assert_eq!(json(&output)["files"].as_array().unwrap().len(), 3);
    // Three frames are lost, but the uncertainty stands, with its causes.
    let budget = std::fs::read_to_string(export.join("budget.csv")).unwrap();
    assert!(column(&budget, "trial").iter().all(|trial| trial == "001_w1+50_w2+10"), "{budget}");
    let trials = std::fs::read_to_string(export.join("trials.csv")).unwrap();
    assert_eq!(
        (column(&trials, "trial"), column(&trials, "origin")),
        (vec!["001_w1+50_w2+10".to_owned()], vec!["emulated".to_owned()])
    );
    assert_eq!((column(&trials, "lost"), column(&trials, "complete")), (vec!["3".to_owned()], vec!["1".to_owned()]));
    let info = json(&biflag(&["info", path(&log), "--json"]));
    let yaw = info["angles"]["yaw_deg"].as_f64().unwrap();
    assert!((numbers(&trials, "yaw_deg")[0] - yaw).abs() < 1e-8, "{trials}");
    assert!(export.join(&column(&trials, "file")[0]).is_file());
    assert_eq!(code(&biflag(&["export", path(session)])), 2, "it already exists");
    assert_eq!(code(&biflag(&["export", path(session), "-f", "tum", "-o", "x"])), 2);
}

/// An export never overwrites the log, under any name, and never leaves a partial file.
#[test]
fn export_keeps_the_log_and_leaves_no_partial_file() {
    let folder = tempfile::tempdir().unwrap();
    let log = session(folder.path());
    let content = std::fs::read(&log).unwrap();
    let [symbolic, hard] = ["symbolic.csv", "hard.csv"].map(|name| folder.path().join(name));
    std::os::unix::fs::symlink(&log, &symbolic).unwrap();
    std::fs::hard_link(&log, &hard).unwrap();
    for (output, said) in [
        (&log, "the name must end with .csv, .parquet or .tum"),
        (&symbolic, "is the log itself"),
        (&hard, "is the log itself"),
    ] {
        let output = biflag(&["export", path(&log), "-o", path(output), "--force"]);
        assert_eq!(code(&output), 2);
        assert!(stderr(&output).contains(said), "{}", stderr(&output));
        assert!(std::fs::read(&log).unwrap() == content);
    }
    let csv = folder.path().join("a.csv");
    // A limit of eight blocks on the size of files simulates a full disk.
    let limited = "trap '' XFSZ; ulimit -f 8; exec \"$@\"";
    let mut shell = Command::new("sh");
    shell.args(["-c", limited, "sh", env!("CARGO_BIN_EXE_biflag"), "export", path(&log), "-o", path(&csv)]);
    let output = shell.output().unwrap();
    assert_eq!(code(&output), 1);
    assert!(stderr(&output).contains("a.csv: cannot be written"), "{}", stderr(&output));
    assert!(!csv.exists());
}

/// Damage in the middle of a log does not show at its end, so `info` of a session reads every log in full.
#[test]
fn info_of_a_session_finds_a_damaged_log() {
    let folder = tempfile::tempdir().unwrap();
    let log = session(folder.path());
    let mut content = std::fs::read(&log).unwrap();
    // The data of a chunk follow the name of its compression and a length.
    let chunk = content.windows(4).enumerate().filter(|(_, four)| four == b"zstd").nth(1).unwrap().0;
    content[chunk + 4 + 8 + 6] ^= 0x55;
    std::fs::write(&log, content).unwrap();
    let output = biflag(&["info", path(log.parent().unwrap()), "--json"]);
    assert_eq!(code(&output), 3);
    let trial = &json(&output)["trials"][0];
    assert_eq!(trial["complete"], false);
    assert!(trial["losses"][0].as_str().unwrap().starts_with("a chunk"), "{trial}");
    let text = String::from_utf8(biflag(&["info", path(log.parent().unwrap())]).stdout).unwrap();
    assert!(
        text.contains("0 of 2 trials complete") && text.contains("damaged, --resume repeats the trial; lost: a chunk"),
        "{text}"
    );
}

#[test]
fn parquet_file_contains_the_same_table() {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    let folder = tempfile::tempdir().unwrap();
    let log = session(folder.path());
    for format in ["csv", "parquet"] {
        assert_eq!(code(&biflag(&["export", path(&log), "-f", format])), 3);
    }
    let file = std::fs::File::open(log.with_extension("parquet")).unwrap();
    let reader = SerializedFileReader::new(file).unwrap();
    let about = reader.metadata().file_metadata().key_value_metadata().unwrap();
    assert!(about.iter().any(|pair| pair.key == "about" && pair.value.as_ref().unwrap().contains("offset removed")));
    let csv = std::fs::read_to_string(log.with_extension("csv")).unwrap();
    let (yaw, phases) = (numbers(&csv, "yaw_deg"), column(&csv, "phase"));
    let mut rows = 0;
    for (i, row) in reader.get_row_iter(None).unwrap().enumerate() {
        for (name, field) in row.unwrap().get_column_iter() {
            match (name.as_str(), field) {
                ("yaw_deg", parquet::record::Field::Double(value)) => assert!((value - yaw[i]).abs() < 1e-9),
                ("phase", parquet::record::Field::Str(phase)) => assert_eq!(*phase, phases[i]),
                ("yaw_deg" | "phase", other) => panic!("{other:?}"),
                _ => {}
            }
        }
        rows += 1;
    }
    assert_eq!(rows, 4401);
}

#[test]
fn wrong_use_exits_with_two_and_help_with_zero() {
    assert_eq!(code(&biflag(&[])), 2);
    assert_eq!(code(&biflag(&["inform"])), 2);
    assert_eq!(code(&biflag(&["export", "a.mcap", "--format", "xls"])), 2);
    assert_eq!(code(&biflag(&["info", "--help"])), 0);
    let output = biflag(&["info", "no-such.mcap", "--json"]);
    assert_eq!(code(&output), 2);
    assert!(json(&output)["error"].as_str().unwrap().starts_with("no-such.mcap: no such log"));
}
