//! Spoilt sessions, and what every command says about each: no command is more content than another.

use biflag_log::schema::biflag::event::Kind;
use biflag_log::schema::biflag::{Dropout, Event, Vector};
use biflag_log::{
    Body, CalibrationMeta, ClockMeta, End, LevelMeta, ModelMeta, Reader, RestMeta, SensorMeta, Start, Summary, Writer,
};
use serde_json::Value;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, SystemTime};
use tests::{Bench, Run, repository};

const PLAN: &str = "[session]\nname = \"spoilt\"\n[board]\ndeadline_ms = 5000\n\
                    [trial]\ncalibrate = 2\npreroll = 12\nrun = 12\ndecay = 0\n\
                    [speeds]\npairs = [[67.3, -41.5], [-67.3, 41.5]]\n";

/// The logs of the trials of the plan.
const LOGS: [&str; 2] = ["001_w1+67.3_w2-41.5.mcap", "002_w1-67.3_w2+41.5.mcap"];

/// A log in memory, to be changed and written again.
struct Log {
    start: Start,
    level: Option<LevelMeta>,
    rest: Option<RestMeta>,
    summary: Summary,
    others: (Option<CalibrationMeta>, Option<ClockMeta>, Option<ModelMeta>, Option<SensorMeta>),
    /// Time and content of each message.
    messages: Vec<(f64, Body)>,
}

impl Log {
    fn read(path: &Path) -> Self {
        let mut reader = Reader::open(path).unwrap().only(vec!["/telemetry", "/event"]);
        let mut clock = biflag_log::TrialClock::default();
        let messages = reader.by_ref().map(|message| {
            let message = message.unwrap();
            clock.see(&message);
            (clock.time_s(&message), message.body)
        });
        let messages = messages.collect();
        let start = Start {
            identity: reader.meta().unwrap(),
            plan: reader.meta().unwrap(),
            trial: reader.meta().unwrap(),
            robot: reader.meta().unwrap(),
            board: reader.meta(),
            sensor: reader.meta(),
        };
        let others = (reader.meta(), reader.meta(), reader.meta(), reader.meta());
        Self { start, level: reader.meta(), rest: reader.meta(), summary: reader.meta().unwrap(), others, messages }
    }

    fn write(self, path: &Path) {
        let host = SystemTime::UNIX_EPOCH + Duration::from_secs(1_700_000_000);
        let mut log = Writer::create(path, &self.start, host).unwrap();
        let (calibration, clock, model, sensor) = &self.others;
        model.iter().for_each(|meta| log.meta(meta).unwrap());
        sensor.iter().for_each(|meta| log.meta(meta).unwrap());
        calibration.iter().for_each(|meta| log.meta(meta).unwrap());
        self.level.iter().for_each(|meta| log.meta(meta).unwrap());
        self.rest.iter().for_each(|meta| log.meta(meta).unwrap());
        clock.iter().for_each(|meta| log.meta(meta).unwrap());
        log.board_time(0, host);
        for (time_s, body) in &self.messages {
            match body {
                Body::Telemetry(frame) => log.message_at(frame.time_s, &**frame, host).unwrap(),
                Body::Event(event) => log.message_at(*time_s, event, host).unwrap(),
                Body::Dropout(dropout) => log.message_at(*time_s, dropout, host).unwrap(),
                other => panic!("{other:?}"),
            }
        }
        log.finish(&self.summary).unwrap();
    }

    /// Changes every frame.
    fn frames(&mut self, mut change: impl FnMut(&mut biflag_log::schema::biflag::Telemetry)) {
        for (_, body) in &mut self.messages {
            if let Body::Telemetry(frame) = body {
                change(frame);
            }
        }
    }

    fn run_start_s(&self) -> f64 {
        let begins = |body: &Body| matches!(body, Body::Event(event) if event.text == "run");
        self.messages.iter().find(|(_, body)| begins(body)).unwrap().0
    }

    /// Removes the frames between two times, with the message that says so.
    fn lose(&mut self, from_s: f64, to_s: f64) {
        let before = self.messages.len();
        self.messages.retain(|(_, body)| match body {
            Body::Telemetry(frame) => !(from_s..to_s).contains(&frame.time_s),
            _ => true,
        });
        let count = (before - self.messages.len()) as u32;
        let place = self.messages.partition_point(|(time_s, _)| *time_s < from_s);
        self.messages.insert(place, (from_s, Body::Dropout(Dropout { count, ..Dropout::default() })));
        self.summary.link.lost = count.into();
        self.summary.link.samples -= u64::from(count);
    }

    fn settings(&mut self, change: impl FnOnce(&mut toml::Table)) {
        let board = self.start.board.as_mut().unwrap();
        let mut settings: toml::Table = board.settings.parse().unwrap();
        change(&mut settings);
        board.settings = settings.to_string();
    }
}

/// What a command must say about a spoilt session.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Verdict {
    /// The finding, exit code 3, and no uncertainty of the trial.
    Grave,
    /// The finding and exit code 3; the uncertainty holds.
    Loss,
}

/// A way to spoil a session: its name, what every command must say, and how much that is.
struct Spoilt {
    how: &'static str,
    said: &'static str,
    verdict: Verdict,
    spoil: fn(&Path, &Sources),
}

/// Sound sessions that others are made of.
struct Sources {
    model: PathBuf,
}

/// Changes the first log of a session.
fn edit(session: &Path, change: impl FnOnce(&mut Log)) {
    let path = session.join(LOGS[0]);
    let mut log = Log::read(&path);
    fs::remove_file(&path).unwrap();
    change(&mut log);
    log.write(&path);
}

fn swap(session: &Path) {
    let [one, other, third] = [LOGS[0], LOGS[1], "held"].map(|name| session.join(name));
    fs::rename(&one, &third).unwrap();
    fs::rename(&other, &one).unwrap();
    fs::rename(&third, &other).unwrap();
}

fn bytes(session: &Path, change: impl FnOnce(&mut Vec<u8>)) {
    let path = session.join(LOGS[0]);
    let mut content = fs::read(&path).unwrap();
    change(&mut content);
    fs::write(&path, content).unwrap();
}

const SPOILT: &[Spoilt] = &[
    Spoilt {
        how: "two logs exchanged",
        said: "holds trial",
        verdict: Verdict::Grave,
        spoil: |session, _| swap(session),
    },
    Spoilt {
        how: "a log under another trial's name",
        said: "holds trial 002",
        verdict: Verdict::Grave,
        spoil: |session, _| fs::rename(session.join(LOGS[1]), session.join(LOGS[0])).unwrap(),
    },
    Spoilt {
        how: "one log copied under another name",
        said: "is a copy of 002",
        verdict: Verdict::Grave,
        spoil: |session, _| _ = fs::copy(session.join(LOGS[1]), session.join(LOGS[0])).unwrap(),
    },
    Spoilt {
        how: "a model's log among recordings",
        said: "computed by the model",
        verdict: Verdict::Grave,
        spoil: |session, sources| _ = fs::copy(sources.model.join(LOGS[0]), session.join(LOGS[0])).unwrap(),
    },
    Spoilt {
        how: "a log of another plan",
        said: "of another plan",
        verdict: Verdict::Grave,
        spoil: |session, _| {
            edit(session, |log| {
                log.start.plan.text = PLAN.replace("run = 12", "run = 13");
                log.start.trial.run_s = 13.0;
            });
        },
    },
    Spoilt {
        how: "a log of another board",
        said: "with board",
        verdict: Verdict::Grave,
        spoil: |session, _| edit(session, |log| log.start.board.as_mut().unwrap().board_id = 8),
    },
    Spoilt {
        how: "a log of an earlier session",
        said: "the session began on",
        verdict: Verdict::Grave,
        spoil: |session, _| edit(session, |log| log.start.identity.created = "2025-01-02T03:04:05Z".to_owned()),
    },
    Spoilt {
        how: "clipped gyroscope",
        said: "at the end of the sensor's range",
        verdict: Verdict::Grave,
        spoil: |session, _| {
            edit(session, |log| {
                let text = "7 readings were at the end of the sensor's range: give a wider gyro_range".to_owned();
                let end_s = log.messages.last().unwrap().0;
                log.messages.push((end_s, Body::Event(Event { kind: Kind::Warning.into(), text })));
            });
        },
    },
    Spoilt {
        how: "a board that stopped",
        said: "did not end as planned",
        verdict: Verdict::Grave,
        spoil: |session, _| {
            edit(session, |log| {
                log.summary.end = End::Faulted;
                log.summary.reason = "motor 1 is blocked".to_owned();
            });
        },
    },
    Spoilt {
        how: "a log that is cut off",
        said: "cut off",
        verdict: Verdict::Grave,
        spoil: |session, _| bytes(session, |content| content.truncate(content.len() * 9 / 10)),
    },
    Spoilt {
        how: "a damaged log",
        said: "damaged",
        verdict: Verdict::Grave,
        spoil: |session, _| {
            bytes(session, |content| {
                let middle = content.len() / 2;
                content[middle..middle + 200].fill(0x55);
            });
        },
    },
    Spoilt {
        how: "a recovered log",
        said: "recovered from",
        verdict: Verdict::Grave,
        spoil: |session, _| {
            bytes(session, |content| content.truncate(content.len() * 9 / 10));
            let log = session.join(LOGS[0]);
            biflag_log::recover(&log, &log.with_extension("recovered.mcap")).unwrap();
            fs::rename(log.with_extension("recovered.mcap"), &log).unwrap();
        },
    },
    Spoilt {
        how: "three frames lost",
        said: "telemetry frames were lost",
        verdict: Verdict::Loss,
        spoil: |session, _| edit(session, |log| log.lose(20.0, 20.014)),
    },
    Spoilt {
        how: "telemetry lost in the averaging time",
        said: "have telemetry",
        verdict: Verdict::Grave,
        spoil: |session, _| {
            edit(session, |log| {
                let end_s = log.messages.last().unwrap().0;
                log.lose(end_s - 8.0, end_s - 3.0);
            });
        },
    },
    Spoilt {
        how: "gyro_axes other than accel_axes",
        said: "contradict each other",
        verdict: Verdict::Grave,
        spoil: |session, _| {
            edit(session, |log| {
                log.frames(|frame| {
                    let rate = frame.angular_velocity_dps.unwrap_or_default();
                    frame.angular_velocity_dps = Some(Vector { x: rate.z, y: rate.x, z: rate.y });
                });
            });
        },
    },
    Spoilt {
        how: "a sensor with other axes than the settings",
        said: "tilt at rest of 91.8",
        verdict: Verdict::Grave,
        spoil: |session, _| {
            edit(session, |log| {
                log.level = Some(LevelMeta { up: [1.0, 0.0, -0.03], force_g: 1.0, tilt_deg: 91.77, used: false });
            });
        },
    },
    Spoilt {
        how: "a slow filter",
        said: "attitude_kp 0.1",
        verdict: Verdict::Grave,
        spoil: |session, _| {
            edit(session, |log| log.settings(|settings| _ = settings.insert("attitude_kp".into(), 0.1.into())));
        },
    },
    Spoilt {
        how: "a robot that still swings",
        said: "was not still before the run",
        verdict: Verdict::Grave,
        spoil: |session, _| {
            edit(session, |log| {
                let run_s = log.run_start_s();
                log.frames(|frame| {
                    // A pitch that grows by a third of a degree a second until the run.
                    let half = (frame.time_s.min(run_s) / 3.0).to_radians() / 2.0;
                    if let Some(q) = &mut frame.attitude {
                        let (c, s) = (half.cos(), half.sin());
                        (q.w, q.x, q.y, q.z) =
                            (c * q.w - s * q.y, c * q.x + s * q.z, c * q.y + s * q.w, c * q.z - s * q.x);
                    }
                });
            });
        },
    },
    Spoilt {
        how: "a wait that ended in a motion",
        said: "was not still after a wait",
        verdict: Verdict::Grave,
        spoil: |session, _| {
            edit(session, |log| {
                let rest = log.rest.as_mut().unwrap();
                (rest.still, rest.yaw_dps) = (false, Some(0.73));
            });
        },
    },
    Spoilt {
        how: "an encoder that misses counts",
        said: "the measured turns are used",
        verdict: Verdict::Grave,
        spoil: |session, _| {
            edit(session, |log| {
                log.frames(|frame| {
                    if let Some(motor) = &mut frame.motor1 {
                        motor.turns *= 0.5;
                    }
                });
            });
        },
    },
    Spoilt {
        how: "a log of a newer biflag",
        said: "recorded with protocol 250",
        verdict: Verdict::Grave,
        spoil: |session, _| edit(session, |log| log.start.identity.protocol = 250),
    },
];

/// The commands of the matrix, over a session `s` and its first log.
const COMMANDS: [(&str, &[&str]); 12] = [
    ("info", &["info", "s"]),
    ("info LOG", &["info", "LOG"]),
    ("doctor", &["doctor", "s"]),
    ("export", &["export", "s", "-o", "tables"]),
    ("export LOG", &["export", "LOG", "-o", "log.csv"]),
    ("report", &["report", "s", "--out", "s.html"]),
    ("report LOG", &["report", "LOG", "--out", "log.html"]),
    ("figure map", &["figure", "map", "s", "-o", "map.svg"]),
    ("figure trial", &["figure", "trial", "LOG", "-o", "trial.svg"]),
    ("compare", &["compare", "s"]),
    ("simulate --from", &["simulate", "--from", "LOG", "--out", "again"]),
    ("calibrate", &["calibrate", "LOG", "-o", "fitted.toml", "--fit", "righting"]),
];

/// Returns all values of a key in JSON.
fn values<'a>(json: &'a Value, key: &str, found: &mut Vec<&'a Value>) {
    match json {
        Value::Object(object) => {
            found.extend(object.get(key));
            object.values().for_each(|value| values(value, key, found));
        }
        Value::Array(array) => array.iter().for_each(|value| values(value, key, found)),
        _ => {}
    }
}

/// Returns the parts of a command's answer about the first trial, where it names several.
fn of_first<'a>(name: &str, json: &'a Value) -> Vec<&'a Value> {
    let about = |one: &&Value| one["name"].as_str().is_none_or(|name| name.starts_with("001"));
    match (name, json["trials"].as_array()) {
        ("info" | "compare", Some(trials)) => trials.iter().filter(about).collect(),
        _ => vec![json],
    }
}

/// Runs one command over a spoilt session; returns the cell of the matrix, or what is wrong.
fn cell(bench: &Bench, spoilt: &Spoilt, (name, arguments): (&str, &[&str])) -> Result<String, String> {
    let log = format!("s/{}", LOGS[0]);
    let log = if bench.path().join(&log).exists() { log } else { format!("s/{}", LOGS[1]) };
    let words = arguments.iter().map(|word| if *word == "LOG" { log.as_str() } else { word });
    let arguments: Vec<&str> = words.chain(["--json"]).collect();
    let run: Run = bench.run(&arguments);
    let wrong = |what: &str| Err(format!("{}: biflag {}: {what}: {run:?}", spoilt.how, arguments.join(" ")));
    let code = run.code.expect("an exit code");
    if !format!("{}{}", run.stdout, run.stderr).contains(spoilt.said) {
        return wrong(&format!("does not say {:?}", spoilt.said));
    }
    let expected: &[i32] = match (spoilt.verdict, name) {
        // The run is too short for a replay to settle, or for a fit to tell.
        (Verdict::Loss, _) => &[3],
        // A fit takes no trial whose numbers may be wrong.
        (Verdict::Grave, "calibrate") => &[1],
        // One trial is no map.
        (Verdict::Grave, "figure map") => &[2, 3],
        (Verdict::Grave, _) => &[3],
    };
    if !expected.contains(&code) {
        return wrong("the exit code");
    }
    if spoilt.verdict == Verdict::Loss && name == "info LOG" && run.json()["angles"]["yaw_uncertainty_deg"].is_null() {
        return wrong("prints no ±");
    }
    if spoilt.verdict != Verdict::Grave || code < 3 {
        return Ok(code.to_string());
    }
    let json = run.json();
    let mut intervals = Vec::new();
    of_first(name, &json).into_iter().for_each(|part| values(part, "yaw_uncertainty_deg", &mut intervals));
    if intervals.iter().any(|value| !value.is_null()) {
        return wrong("prints a ±");
    }
    let written = |name: &str| fs::read_to_string(bench.path().join(name)).unwrap();
    let has_interval = match name {
        "export LOG" => {
            let csv = written("log.csv");
            let mut rows = csv.lines().filter(|line| !line.starts_with('#')).map(|line| line.split(','));
            let column = rows.next().unwrap().position(|name| name == "yaw_uncertainty_deg").unwrap();
            rows.any(|mut row| row.nth(column).is_some_and(|cell| !cell.is_empty()))
        }
        "report LOG" => written("log.html").contains(" (95 %)"),
        "figure trial" => written("trial.svg").contains("95 % uncertainty"),
        _ => false,
    };
    if has_interval { wrong("writes a ±") } else { Ok(code.to_string()) }
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap().map(Result::unwrap).filter(|entry| entry.path().is_file()) {
        fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
    }
}

/// Makes a session of two trials from one recording: the second is the first with the signs of its speeds changed.
fn make_session(log: &Path, model: &Path, session: &Path) {
    fs::create_dir(session).unwrap();
    fs::copy(model.join("session.toml"), session.join("session.toml")).unwrap();
    for (i, name) in LOGS.iter().enumerate() {
        let (mut log, planned) = (Log::read(log), Log::read(&model.join(name)).start);
        (log.start.plan, log.start.trial) = (planned.plan, planned.trial);
        log.start.board.as_mut().unwrap().board_id = 7;
        if i == 1 {
            log.frames(|frame| {
                for motor in [&mut frame.motor1, &mut frame.motor2].into_iter().flatten() {
                    (motor.target_rpm, motor.speed_rpm, motor.turns) =
                        (-motor.target_rpm, -motor.speed_rpm, -motor.turns);
                }
            });
        }
        log.write(&session.join(name));
    }
}

/// The matrix is in the book as it is printed here; `BIFLAG_WRITE_GOLDEN=1` writes it.
#[test]
fn no_command_is_more_content_than_another() {
    let begun = std::time::Instant::now();
    let bench = Bench::new();
    let plan = bench.file("plan.toml", PLAN);
    let plan = plan.to_str().unwrap();
    let one = bench.file("one.toml", &PLAN.replace(", [-67.3, 41.5]", ""));
    bench.run(["record", one.to_str().unwrap(), "--virtual", "--out", "one"]).expect_code(0);
    bench.run(["simulate", plan, "--out", "model"]);
    let recorded = bench.path().join("recorded");
    make_session(&bench.path().join("one").join(LOGS[0]), &bench.path().join("model"), &recorded);
    bench.run(["compare", "recorded"]).expect_code(0);
    let sources = Sources { model: bench.path().join("model") };
    let replays = bench.path().join("recorded-replay");
    println!("sessions: {:.1} s", begun.elapsed().as_secs_f64());

    let rows: Mutex<Vec<(usize, String)>> = Mutex::default();
    let problems: Mutex<Vec<String>> = Mutex::default();
    let next = Mutex::new(0..SPOILT.len());
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                loop {
                    let Some(i) = next.lock().unwrap().next() else { break };
                    let spoilt = &SPOILT[i];
                    let bench = Bench::new();
                    copy(&recorded, &bench.path().join("s"));
                    copy(&replays, &bench.path().join("s-replay"));
                    (spoilt.spoil)(&bench.path().join("s"), &sources);
                    let cells = COMMANDS.map(|command| {
                        cell(&bench, spoilt, command).unwrap_or_else(|wrong| {
                            problems.lock().unwrap().push(wrong);
                            "?".to_owned()
                        })
                    });
                    let row = format!("| {} | {} | {} |\n", spoilt.how, spoilt.said, cells.join(" | "));
                    rows.lock().unwrap().push((i, row));
                }
            });
        }
    });
    let mut rows = rows.into_inner().unwrap();
    rows.sort();
    let mut matrix = String::new();
    let names: Vec<_> = COMMANDS.iter().map(|(name, _)| *name).collect();
    let _ = writeln!(
        matrix,
        "| spoilt by | every command says | {} |\n|{}",
        names.join(" | "),
        " --- |".repeat(names.len() + 2)
    );
    rows.iter().for_each(|(_, row)| matrix += row);
    println!("{matrix}{:.1} s", begun.elapsed().as_secs_f64());

    let problems = problems.into_inner().unwrap();
    assert!(problems.is_empty(), "{}", problems.join("\n"));
    let path = repository().join("host/book/src/warnings.md");
    let page = fs::read_to_string(&path).unwrap();
    let (head, rest) = page.split_once("<!-- matrix -->\n").expect("the place of the matrix");
    let (old, tail) = rest.split_once("<!-- end -->").expect("the end of the matrix");
    if std::env::var_os("BIFLAG_WRITE_GOLDEN").is_some() {
        fs::write(&path, format!("{head}<!-- matrix -->\n{matrix}<!-- end -->{tail}")).unwrap();
    } else {
        assert_eq!(old, matrix, "BIFLAG_WRITE_GOLDEN=1 writes the matrix of the book again");
    }
}
