//! Findings, angles, budgets and intervals, to the last digits: of a sound session and each spoilt one, of imports, and of what
//! `compare` and `calibrate` make of recordings.

use super::recording;
use crate::matrix;
use crate::matrix::spoilt::{SPOILT, Sources};
use serde_json::Value;
use std::fmt::Write;
use std::fs;
use tests::Bench;
use tests::golden::{hold, hold_keys, number, values};
use tests::synthetic_rig::{each, known_but_for};

const COLUMNS: &str = "time=time_s,yaw=yaw_deg,pitch=pitch_deg,roll=roll_deg,turns1=turns1,turns2=turns2";

/// Returns a text without the sizes and places of damage in bytes, which depend on the version of the program.
fn without_bytes(text: &str) -> String {
    let words: Vec<&str> = text.split(' ').collect();
    let of_bytes = |i: usize| {
        let after = words.get(i + 1).is_some_and(|next| *next == "bytes");
        words[i].contains(|c: char| c.is_ascii_digit()) && (after || i > 0 && words[i - 1] == "byte")
    };
    let mask = |i: usize| words[i].replace(|c: char| c.is_ascii_digit(), "");
    (0..words.len()).map(|i| if of_bytes(i) { mask(i) } else { words[i].to_owned() }).collect::<Vec<_>>().join(" ")
}

/// Returns what `info` says about a trial.
fn of_trial(trial: &Value) -> String {
    let mut text = String::new();
    let of_list = |key: &str| trial[key].as_array().cloned().unwrap_or_default();
    for (what, finding) in of_list("findings")
        .into_iter()
        .map(|of| ("", of))
        .chain(of_list("left_out").into_iter().map(|of| ("left out: ", of)))
    {
        let gravity = if finding["grave"] == true { "grave" } else { "note" };
        let [kind, said, cure] = ["kind", "text", "cure"].map(|key| finding[key].as_str().unwrap().to_owned());
        let _ = writeln!(text, "{what}{gravity}, {kind}: {} | {cure}", without_bytes(&said));
    }
    for loss in of_list("losses") {
        let _ = writeln!(text, "loss: {}", without_bytes(loss.as_str().unwrap()));
    }
    for key in ["run_start_s", "run_end_s"].into_iter().filter(|key| !trial[*key].is_null()) {
        let _ = writeln!(text, "{key}: {}", number(&trial[key]));
    }
    text += &values(&serde_json::json!({ "angles": trial["angles"] }));
    for term in of_list("budget") {
        let of = |key: &str| number(&term[key]);
        let [angle, name, kind, common_to] = ["angle", "name", "type", "common_to"].map(of);
        let _ = writeln!(
            text,
            "budget of {angle}: {name}, {kind}, {common_to}: u {}, sensitivity {}, share {}",
            of("u_deg"),
            of("sensitivity"),
            of("share")
        );
    }
    text
}

/// Returns what `info` says about a log or a session.
fn info(bench: &Bench, path: &str) -> Value {
    let run = bench.run(["info", path, "--json"]);
    assert!(matches!(run.code, Some(0 | 3)), "{run:?}");
    run.json()
}

/// Returns what `info` says about each trial of a session.
fn of_session(bench: &Bench, session: &str) -> Vec<(String, String)> {
    let json = info(bench, session);
    let trials = json["trials"].as_array().unwrap();
    trials.iter().map(|trial| (trial["name"].as_str().unwrap().to_owned(), of_trial(trial))).collect()
}

#[test]
fn findings_and_budgets_of_spoilt_sessions_are_the_golden_ones() {
    let bench = Bench::new();
    recording::sessions(&bench, matrix::PLAN, "model", "s");
    let sources = Sources { model: bench.path().join("model") };
    let sound = of_session(&bench, "s");
    let spoilt = each(SPOILT.len(), |i| {
        let spoilt = Bench::new();
        matrix::copy(&bench.path().join("s"), &spoilt.path().join("s"));
        (SPOILT[i].spoil)(&spoilt.path().join("s"), &sources);
        of_session(&spoilt, "s")
    });
    let mut text = String::new();
    let named = SPOILT.iter().map(|spoilt| spoilt.how).zip(&spoilt);
    for (how, trials) in std::iter::once(("sound", &sound)).chain(named) {
        let _ = writeln!(text, "# {how}");
        for (name, said) in trials {
            let is_sound = how != "sound" && sound.iter().any(|trial| trial == &(name.clone(), said.clone()));
            let _ = if is_sound { writeln!(text, "## {name}: as sound") } else { write!(text, "## {name}\n{said}") };
        }
    }
    hold("spoilt", &text);
}

#[test]
fn findings_and_intervals_of_imports_and_comparisons_are_the_golden_ones() {
    let bench = Bench::new();
    // A sensor of which some errors are known.
    bench.file("sensor.toml", &known_but_for("gyro_scale", "z", 0.01, 0.002).text);
    let plan = matrix::PLAN.replace("[board]", "sensor = \"sensor.toml\"\n[board]").replace("decay = 0", "decay = 12");
    recording::sessions(&bench, &plan, "model", "recorded");
    let run = |arguments: &str| {
        let run = bench.run(arguments.split_whitespace().chain(["--json"]));
        assert!(matches!(run.code, Some(0 | 3)), "{run:?}");
        run.json()
    };
    let [log, other] = matrix::LOGS;
    let mut text = String::new();
    for log in [log, other] {
        let _ = write!(text, "# recording {log}\n{}", of_trial(&info(&bench, &format!("recorded/{log}"))));
        let _ = write!(text, "# model {log}\n{}", of_trial(&info(&bench, &format!("model/{log}"))));
    }
    run(&format!("export model/{log} -o own.csv"));
    let export = fs::read_to_string(bench.path().join("own.csv")).unwrap();
    let mut rows: Vec<&str> = export.lines().filter(|line| !line.starts_with('#')).step_by(5).collect();
    bench.file("whole.csv", &rows.join("\n"));
    // From 6 s to 9 s of the run.
    rows.drain(1 + 20 * 40..1 + 23 * 40);
    bench.file("gap.csv", &rows.join("\n"));
    let speeds = "--speeds 67.3,-41.5 --run 0,12";
    let recorded = format!("--trial recorded/{log} --uncertainty 0.3,0.1");
    for (name, table, columns, more) in [
        ("an import", "whole", COLUMNS, "--uncertainty 0.3,0.1"),
        ("an import without an uncertainty", "whole", COLUMNS, ""),
        ("an import with a gap", "gap", COLUMNS, "--uncertainty 0.3,0.1"),
        ("an import of a yaw", "whole", "time=time_s,yaw=yaw_deg,pitch=0,roll=0", speeds),
        ("an import of other speeds", "whole", COLUMNS, "--speeds 60,-41.5 --uncertainty 0.3,0.1"),
        ("an import beside a recording", "whole", "time=time_s,yaw=yaw_deg,pitch=0,roll=0", &recorded),
    ] {
        let mut said = run(&format!("import {table}.csv --columns {columns} {more} -o import.mcap"));
        // `info` says the rest.
        said.as_object_mut().unwrap().retain(|key, _| key == "clock" || key.ends_with("rpm"));
        let _ = write!(text, "# {name}\n{}{}", values(&said), of_trial(&info(&bench, "import.mcap")));
        fs::remove_file(bench.path().join("import.mcap")).unwrap();
    }
    hold("trials", &text);

    let mut compared = run("compare recorded");
    hold_keys("compare-session", &compared);
    // The budgets are those above.
    compared["trials"]
        .as_array_mut()
        .unwrap()
        .iter_mut()
        .for_each(|trial| _ = trial.as_object_mut().unwrap().remove("budget"));
    let mut text = format!("# compare\n{}", values(&compared));
    let mut fitted = run(&format!("calibrate recorded/{log} -o fitted.toml --fit righting"));
    hold_keys("calibrate", &fitted);
    fitted["trials"][0].as_object_mut().unwrap().remove("sha256");
    let _ = write!(text, "# calibrate\n{}", values(&fitted));
    hold("intervals", &text);
}
