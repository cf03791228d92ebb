//! The steady angles of a trial are the same in every command, on the page and in every export.

use serde_json::Value;
use std::path::Path;
use tests::Bench;

const PLAN: &str = "[session]\nname = \"numbers\"\n[board]\ndeadline_ms = 5000\n[trial]\ncalibrate = 2\npreroll = 16\nrun = 20\ndecay = 16\n\
                    [speeds]\npairs = [[37, 53], [50, 10]]\n";

/// Yaw, pitch and roll in degrees, with the precision of their storage or output.
type Angles = [f64; 3];

fn angles(value: &Value) -> Angles {
    ["yaw_deg", "pitch_deg", "roll_deg"].map(|key| value[key].as_f64().unwrap_or_else(|| panic!("{key} in {value}")))
}

/// Returns the numbers after yaw, pitch and roll in a line.
fn printed(line: &str) -> Angles {
    ["yaw ", "pitch ", "roll "].map(|name| {
        let rest = line.split_once(name).unwrap_or_else(|| panic!("{name} in {line}")).1;
        let end = rest.find(|c: char| !"-0123456789.".contains(c)).unwrap_or(rest.len());
        rest[..end].parse().unwrap_or_else(|_| panic!("{name} in {line}"))
    })
}

fn as_printed(angles: Angles) -> Angles {
    angles.map(|deg| format!("{deg:.2}").parse().unwrap())
}

/// Returns the cells of a row of a CSV file with header lines that begin with `#`.
fn row(csv: &str, i: usize) -> std::collections::BTreeMap<String, String> {
    let mut lines = csv.lines().filter(|line| !line.starts_with('#'));
    let names = lines.next().unwrap().split(',').map(str::to_owned);
    names.zip(lines.nth(i).unwrap().split(',').map(str::to_owned)).collect()
}

/// Returns the steady angles computed from the rows of an exported file: means by the trapezium rule over the time
/// stated in its header.
fn from_rows(csv: &str) -> Angles {
    let header = csv.lines().find(|line| line.starts_with("# steady, from ")).expect("a steady time");
    let words: Vec<&str> = header.split_whitespace().collect();
    let [from, to] = [3, 5].map(|i| words[i].parse::<f64>().unwrap());
    let mut lines = csv.lines().filter(|line| !line.starts_with('#'));
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let columns = ["time_s", "yaw_deg", "pitch_deg", "roll_deg"]
        .map(|name| names.iter().position(|column| *column == name).unwrap());
    let rows: Vec<[f64; 4]> = lines
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            columns.map(|k| cells[k].parse().unwrap_or(f64::NAN))
        })
        .filter(|row: &[f64; 4]| (from - 1e-3..=to + 1e-3).contains(&row[0]))
        .collect();
    let length = rows[rows.len() - 1][0] - rows[0][0];
    [1, 2, 3].map(|k| {
        let area = |pair: &[[f64; 4]]| 0.5 * (pair[0][k] + pair[1][k]) * (pair[1][0] - pair[0][0]);
        rows.windows(2).map(area).sum::<f64>() / length
    })
}

fn page_numbers(page: &Path) -> String {
    // Of the text and of the sections in the data of a session, with an ASCII minus.
    let page = std::fs::read_to_string(page).unwrap().replace('−', "-");
    page.replace("\\u003c", "<").replace("\\u003e", ">").replace("\\\"", "\"")
}

/// Compares the steady angles of a session's trials in all outputs.
fn ask(bench: &Bench, session: &str, first: &Value, tolerance_of_rows: f64) {
    let run = |args: &[&str]| {
        let run = bench.run(args);
        assert!(matches!(run.code, Some(0 | 3)), "{run:?}");
        run
    };
    let of_session = run(&["info", session, "--json"]).json();
    let lines = run(&["info", session]).stdout;
    let compared = run(&["compare", session, "--json"]).json();
    let compared_text = run(&["compare", session]).stdout;
    let comparison_page = page_numbers(&bench.path().join(compared["report"].as_str().unwrap()));
    let report = run(&["report", session, "--json"]).json();
    let report_page = page_numbers(&bench.path().join(report["html"].as_str().unwrap()));
    run(&["export", session, "-o", "tables", "--force"]);
    let trials = std::fs::read_to_string(bench.path().join("tables/trials.csv")).unwrap();

    for (i, trial) in first["trials"].as_array().unwrap().iter().enumerate() {
        let log = trial["log"].as_str().unwrap();
        let expected = angles(trial);
        println!("{log}: {expected:?}");
        let of_log = run(&["info", log, "--json"]).json();
        assert_eq!(angles(&of_log["angles"]), expected, "info of the log");
        assert_eq!(of_log["angles"]["yaw_uncertainty_deg"], trial["yaw_uncertainty_deg"], "info of the log");
        assert_eq!(angles(&of_session["trials"][i]["angles"]), expected, "info of the session");
        assert_eq!(angles(&of_session["trials"][i]["summary"]), expected, "the summary in the log");
        let measured: Vec<f64> = (compared["trials"][i]["steady_measured_deg"].as_array().unwrap().iter())
            .map(|deg| deg.as_f64().unwrap())
            .collect();
        assert_eq!(measured, expected, "compare");

        let shown = as_printed(expected);
        let name = trial["name"].as_str().unwrap();
        let line = |text: &str| text.lines().find(|line| line.contains(name)).unwrap().to_owned();
        assert_eq!(printed(&line(&lines)), shown, "info of the session, printed");
        assert_eq!(printed(&line(&compared_text)), shown, "compare, printed");
        let text = run(&["info", log]).stdout;
        assert_eq!(printed(text.lines().find(|line| line.starts_with("steady")).unwrap()), shown, "info, printed");
        for page in [&comparison_page, &report_page] {
            for deg in expected {
                assert!(page.contains(&format!("<dd class=\"big\">{deg:.2}°</dd>")), "{deg:.2} on the page");
            }
        }

        let cells = row(&trials, i);
        let exported = ["yaw_deg", "pitch_deg", "roll_deg"].map(|key| cells[key].parse::<f64>().unwrap());
        for k in 0..3 {
            assert!((exported[k] - expected[k]).abs() < 1e-8, "the exported table of trials");
        }
        let rows = from_rows(&std::fs::read_to_string(bench.path().join("tables").join(&cells["file"])).unwrap());
        for k in 0..3 {
            assert!((rows[k] - expected[k]).abs() < tolerance_of_rows, "exported rows: {rows:?}, not {expected:?}");
        }
        // A model has no gyroscope and so no drift.
        let is_model = of_log["origin"] == "model";
        for key in ["drift_deg", "yaw_uncertainty_deg", "still_after_s"] {
            assert_eq!(of_log["angles"][key].is_null(), is_model, "{key}: {of_log}");
        }
        assert_eq!(cells["yaw_uncertainty_deg"].is_empty(), is_model);
    }
}

#[test]
fn steady_angles_of_a_measured_trial_agree() {
    let bench = Bench::new();
    // As short as phases may be from which a drift is estimated.
    bench.file("plan.toml", &PLAN.replace("= 16", "= 12").replace("run = 20", "run = 12").replace("[37, 53], ", ""));
    let recorded = bench.run(["record", "plan.toml", "--virtual", "--seed", "3", "--out", "s", "--json"]);
    assert!(matches!(recorded.code, Some(0 | 3)), "{recorded:?}");
    // At both ends of the mean, the rows contain the noise of the sensor.
    ask(&bench, "s", &recorded.json(), 0.005);
}

#[test]
fn steady_angles_of_a_modelled_trial_agree() {
    let bench = Bench::new();
    bench.file("plan.toml", PLAN);
    let simulated = bench.run(["simulate", "plan.toml", "--rate", "200", "--out", "s", "--json"]);
    assert!(matches!(simulated.code, Some(0 | 3)), "{simulated:?}");
    ask(&bench, "s", &simulated.json(), 0.005);
}
