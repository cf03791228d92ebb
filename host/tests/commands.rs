//! `info`, `recover` and `export` as a user runs them: what they print, write, and exit with.

use host::log::{End, EventKind, Origin, Start, Summary, Writer};
use host::plan::Plan;
use host::session::Session;
use host::stats::LinkStats;
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

/// A session of two short trials, the first of which was run: at 100 Hz, yaw turning by 1 °/s while the motors run.
fn session(folder: &Path) -> PathBuf {
    let text = "[session]\nname = \"short\"\noperator = \"Ada\"\n[trial]\ncalibrate = 0\npreroll = 10\nrun = 24\ndecay = 10\n\
                [speeds]\npairs = [[50, 10], [0, 45]]\n";
    let plan = Plan::parse(text, "plan.toml").unwrap();
    let session = Session::create(&folder.join("short"), &plan).unwrap();
    let trial = &plan.trials[0];
    let (attempt, log) = session.next_attempt(trial).unwrap();
    let host =
        |seconds: f64| SystemTime::UNIX_EPOCH + Duration::from_secs(1_700_000_000) + Duration::from_secs_f64(seconds);
    let start = Start {
        plan: &plan,
        trial,
        attempt,
        origin: Origin::VirtualRig,
        board: Some((Info { firmware: [0, 1, 0], imu_id: 0x68, ..Info::default() }, Settings::DEFAULT)),
        time: host(0.0),
    };
    let mut writer = Writer::create(&log, &start).unwrap();
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
        writer.telemetry(&frame, 7_000_000 + u64::from(i) * 10_000, host(time)).unwrap();
    }
    writer.dropout(77, 3, host(44.0)).unwrap();
    let link = LinkStats { samples: 4401, lost: 3, retries: 1, ..LinkStats::default() };
    writer.finish(&Summary { end: End::Complete, link, ..Summary::default() }).unwrap();
    log
}

#[test]
fn info_tells_what_a_log_holds() {
    let folder = tempfile::tempdir().unwrap();
    let log = session(folder.path());
    let output = biflag(&["info", path(&log), "--json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let info = json(&output);
    assert_eq!(info["channels"]["/telemetry"], 4401);
    assert_eq!((info["samples"].as_u64(), info["lost"].as_u64()), (Some(4401), Some(3)));
    assert!((info["duration_s"].as_f64().unwrap() - 44.0).abs() < 1e-9);
    assert_eq!(info["clean"], true);
    // The mean over the last 12 s of the run, from the mean over the last second before it.
    assert!((info["angles"]["yaw_deg"].as_f64().unwrap() - 18.0).abs() < 0.02);
    // Ten seconds are too few to tell a robot that swings back to rest from a gyroscope that drifts.
    assert_eq!(info["angles"]["still_after_s"], 0.0);
    assert!((info["angles"]["turned_deg"][2].as_f64().unwrap() - 24.0).abs() < 0.02);

    let text = String::from_utf8(biflag(&["info", path(&log)]).stdout).unwrap();
    for part in [
        "Ada",
        "001_w1+50_w2+10, 50 and 10 rpm",
        "firmware 0.1.0",
        "4401 samples, 3 lost",
        "yaw 1",
        "complete",
        "clean",
    ] {
        assert!(text.contains(part), "{part} is not in\n{text}");
    }
}

#[test]
fn info_tells_how_far_a_session_is() {
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
    assert!(stderr(&output).contains("not a session's folder"));
}

#[test]
fn a_cut_off_log_is_recovered() {
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
    assert_eq!(code(&biflag(&["info", path(&recovered)])), 0);

    let output = biflag(&["recover", path(&log)]);
    assert_eq!(code(&output), 1);
    assert!(stderr(&output).contains("exists already"));
    let output = biflag(&["recover", path(&recovered), "--json"]);
    assert_eq!((code(&output), &json(&output)["recovered"]), (0, &Value::Null));
    std::fs::write(&log, b"nothing of the kind").unwrap();
    let output = biflag(&["recover", path(&log), "--json"]);
    assert_eq!(code(&output), 1);
    assert!(json(&output)["error"].as_str().unwrap().contains("not an MCAP file"));
    assert!(stderr(&output).contains("help:"));
}

const CSV_HEAD: &str = "\
time_s,log_time_ns,board_time_us,seq,yaw_deg,pitch_deg,roll_deg,q_w,q_x,q_y,q_z,\
rate_x_dps,rate_y_dps,rate_z_dps,accel_x_mps2,accel_y_mps2,accel_z_mps2,\
gyro_x_counts,gyro_y_counts,gyro_z_counts,accel_x_counts,accel_y_counts,accel_z_counts,temperature_c,\
target1_rpm,speed1_rpm,duty1_of_255,encoder1_counts,turns1,target2_rpm,speed2_rpm,duty2_of_255,encoder2_counts,turns2,\
state,fault,imu_fresh,unsent,imu_errors,bad_frames,missed_ticks
0,1700000000000000000,7000000,0,0,0,0,1,0,0,0,0.099236641,0,-1,0,0,9.80665,13,0,-131,0,0,16384,25.000588235,\
50,49.9,120,60222,100.000004865,10,10.01,-30,-60222,-100.000004865,RUNNING,NONE,1,0,0,0,0
0.01,1700000000010000000,7010000,1,0,0,0,1,0,0,0,0.099236641,0,-1,0,0,9.80665,13,0,-131,0,0,16384,25.000588235,\
50,49.9,120,60222,100.000004865,10,10.01,-30,-60222,-100.000004865,RUNNING,NONE,1,0,0,0,0
";

const TUM_END: &str = "\
1700000043.990000000 0 0 0 0.000000000 0.000000000 0.207915693 0.978146750
1700000044.000000000 0 0 0 0.000000000 0.000000000 0.207915693 0.978146750
";

#[test]
fn exports_are_what_they_were() {
    let folder = tempfile::tempdir().unwrap();
    let log = session(folder.path());
    let output = biflag(&["export", path(&log), "--format", "csv", "--json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert_eq!(json(&output)["rows"], 4401);
    let csv = std::fs::read_to_string(log.with_extension("csv")).unwrap();
    assert_eq!(&csv[..CSV_HEAD.len().min(csv.len())], CSV_HEAD);
    assert_eq!(csv.lines().count(), 4402);

    let tum = folder.path().join("a.tum");
    assert_eq!(code(&biflag(&["export", path(&log), "-f", "tum", "-o", path(&tum)])), 0);
    let text = std::fs::read_to_string(&tum).unwrap();
    assert!(text.ends_with(TUM_END), "{}", &text[text.len() - TUM_END.len()..]);

    let output = biflag(&["export", path(&log), "-f", "tum", "-o", path(&tum)]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("--force"));
    assert_eq!(code(&biflag(&["export", path(&log), "-f", "tum", "-o", path(&tum), "--force"])), 0);
}

/// An export never takes the log's place, by whatever name, and a part never passes for the whole.
#[test]
fn an_export_spares_the_log_and_leaves_no_part_behind() {
    let folder = tempfile::tempdir().unwrap();
    let log = session(folder.path());
    let content = std::fs::read(&log).unwrap();
    let [symbolic, hard] = ["symbolic.csv", "hard.csv"].map(|name| folder.path().join(name));
    std::os::unix::fs::symlink(&log, &symbolic).unwrap();
    std::fs::hard_link(&log, &hard).unwrap();
    for output in [&log, &symbolic, &hard] {
        let output = biflag(&["export", path(&log), "-o", path(output), "--force"]);
        assert_eq!(code(&output), 2);
        assert!(stderr(&output).contains("is the log itself"), "{}", stderr(&output));
        assert!(std::fs::read(&log).unwrap() == content);
    }
    let csv = folder.path().join("a.csv");
    // No file may grow beyond eight blocks, as if the disk were full.
    let limited = "trap '' XFSZ; ulimit -f 8; exec \"$@\"";
    let mut shell = Command::new("sh");
    shell.args(["-c", limited, "sh", env!("CARGO_BIN_EXE_biflag"), "export", path(&log), "-o", path(&csv)]);
    let output = shell.output().unwrap();
    assert_eq!(code(&output), 1);
    assert!(stderr(&output).contains("a.csv: cannot be written"), "{}", stderr(&output));
    assert!(!csv.exists());
}

/// Damage in the middle of a log does not show at its end; `info` of a session reads every log through.
#[test]
fn info_of_a_session_finds_a_damaged_log() {
    let folder = tempfile::tempdir().unwrap();
    let log = session(folder.path());
    let mut content = std::fs::read(&log).unwrap();
    // Into the data of a chunk, behind the name of their compression and a length.
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
#[cfg(feature = "parquet")]
fn a_parquet_file_holds_the_same_table() {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::RowAccessor;
    let folder = tempfile::tempdir().unwrap();
    let log = session(folder.path());
    assert_eq!(code(&biflag(&["export", path(&log), "-f", "parquet"])), 0);
    let file = std::fs::File::open(log.with_extension("parquet")).unwrap();
    let reader = SerializedFileReader::new(file).unwrap();
    assert_eq!(reader.metadata().file_metadata().num_rows(), 4401);
    let row = reader.get_row_iter(None).unwrap().nth(1).unwrap().unwrap();
    assert_eq!((row.get_double(0).unwrap(), row.get_long(1).unwrap()), (0.01, 1_700_000_000_010_000_000));
    assert_eq!(row.get_string(34).unwrap(), "RUNNING");
}

#[test]
fn wrong_use_exits_with_two_and_help_with_zero() {
    assert_eq!(code(&biflag(&[])), 2);
    assert_eq!(code(&biflag(&["inform"])), 2);
    assert_eq!(code(&biflag(&["export", "a.mcap", "--format", "xls"])), 2);
    assert_eq!(code(&biflag(&["info", "--help"])), 0);
    let output = biflag(&["info", "no-such.mcap", "--json"]);
    assert_eq!(code(&output), 2);
    assert!(json(&output)["error"].as_str().unwrap().starts_with("no-such.mcap: there is no such log"));
}
