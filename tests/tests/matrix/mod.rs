//! Spoilt sessions, and what every command says about each: no command is more content than another.

mod log;
pub mod spoilt;

use log::Log;
use serde_json::Value;
use spoilt::{SPOILT, Sources, Spoilt, Verdict};
use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::sync::Mutex;
use tests::{Bench, Run, repository};

pub const PLAN: &str = "[session]\nname = \"spoilt\"\n[board]\ndeadline_ms = 5000\n\
                    [trial]\ncalibrate = 2\npreroll = 12\nrun = 12\ndecay = 0\n\
                    [speeds]\npairs = [[67.3, -41.5], [-67.3, 41.5]]\n";

/// The logs of the trials of the plan.
pub const LOGS: [&str; 2] = ["001_w1+67.3_w2-41.5.mcap", "002_w1-67.3_w2+41.5.mcap"];

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

pub fn copy(from: &Path, to: &Path) {
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

/// Sessions that every command is asked about: spoilt as a whole, in one log, and by a loss alone.
const SHOWN: [&str; 3] = ["two logs exchanged", "telemetry lost in the averaging time", "three frames lost"];

#[test]
fn no_command_is_more_content_than_another() {
    assert!(SHOWN.iter().all(|how| SPOILT.iter().any(|spoilt| spoilt.how == *how)));
    matrix(|how, _| SHOWN.contains(&how));
}

#[test]
#[ignore = "every command about every session: part of `make proof`"]
fn no_command_is_more_content_than_another_about_any_session() {
    matrix(|_, _| true);
}

/// Asks commands about spoilt sessions. The matrix is in the book as it is printed here, with the book's cells where nothing is
/// asked; `BIFLAG_WRITE_GOLDEN=1` writes it.
fn matrix(is_asked: impl Fn(&str, &str) -> bool + Sync) {
    let path = repository().join("host/book/src/warnings.md");
    let page = fs::read_to_string(&path).unwrap();
    let (head, rest) = page.split_once("<!-- matrix -->\n").expect("the place of the matrix");
    let (old, tail) = rest.split_once("<!-- end -->").expect("the end of the matrix");
    let in_book = |how: &str, column: usize| {
        let row = old.lines().find(|line| line.split(" | ").next() == Some(&format!("| {how}")));
        row.and_then(|row| row.trim_end_matches(" |").split(" | ").nth(2 + column)).unwrap_or("?").to_owned()
    };
    let begun = std::time::Instant::now();
    let bench = Bench::new();
    let plan = bench.file("plan.toml", PLAN);
    let plan = plan.to_str().unwrap();
    let one = bench.file("one.toml", &PLAN.replace(", [-67.3, 41.5]", ""));
    bench.run(["record", one.to_str().unwrap(), "--virtual", "--out", "one"]).expect_unsettled();
    bench.run(["simulate", plan, "--out", "model"]);
    let recorded = bench.path().join("recorded");
    make_session(&bench.path().join("one").join(LOGS[0]), &bench.path().join("model"), &recorded);
    bench.run(["compare", "recorded"]).expect_unsettled();
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
                    let cells: [String; COMMANDS.len()] = std::array::from_fn(|column| {
                        let command = COMMANDS[column];
                        if !is_asked(spoilt.how, command.0) {
                            return in_book(spoilt.how, column);
                        }
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
    if std::env::var_os("BIFLAG_WRITE_GOLDEN").is_some() {
        fs::write(&path, format!("{head}<!-- matrix -->\n{matrix}<!-- end -->{tail}")).unwrap();
    } else {
        assert_eq!(old, matrix, "BIFLAG_WRITE_GOLDEN=1 writes the matrix of the book again");
    }
}
