//! `biflag import`: a table of another instrument becomes a trial that every command reads.

use crate::program::{biflag, code, json};
use serde_json::Value;
use std::path::Path;

const COLUMNS: &str = "time=time_s,yaw=-turned:rad,pitch=pitch_deg,roll=roll_deg,turns1=turns1,turns2=turns2";
const PLAN: &str = "[trial]\npreroll = 40\nrun = 31\ndecay = 4\n[speeds]\npairs = [[-37.3, -12.9]]\n";

/// Returns a table with the yaw of a modelled trial as a camera would give it: clockwise, in radians, from another zero,
/// with noise of 0.1 degrees, and lost at some times.
fn camera(export: &str) -> String {
    let mut rows = export.lines().filter(|line| !line.starts_with('#'));
    let header: Vec<&str> = rows.next().unwrap().split(',').collect();
    let at = |name: &str| header.iter().position(|column| *column == name).unwrap();
    let mut state = 7u64;
    let mut noise = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / (1u64 << 31) as f64 - 0.5
    };
    let row = |(i, row): (usize, &str)| {
        let cells: Vec<&str> = row.split(',').collect();
        let yaw: f64 = cells[at("yaw_deg")].parse().unwrap();
        let turned =
            if i % 50 == 49 { String::new() } else { (-(yaw + 75.5 + 0.35 * noise()).to_radians()).to_string() };
        let others = ["time_s", "pitch_deg", "roll_deg", "turns1", "turns2"].map(|name| cells[at(name)]).join(",");
        format!("{others},{turned}\n")
    };
    let rows: String = rows.enumerate().map(row).collect();
    format!("time_s,pitch_deg,roll_deg,turns1,turns2,turned\n{rows}")
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

#[test]
fn a_camera_agrees_with_the_trial_that_it_saw() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("p.toml"), PLAN).unwrap();
    assert!(matches!(code(&biflag(folder, &["simulate", "p.toml", "--rate", "20", "--out", "s"])), Some(0 | 3)));
    let own = "s/001_w1-37.3_w2-12.9.mcap";
    let export = biflag(folder, &["export", own, "--format", "csv", "-o", "own.csv"]);
    assert!(matches!(code(&export), Some(0 | 3)), "{export:?}");
    let export = std::fs::read_to_string(folder.join("own.csv")).unwrap();
    for line in ["# SHA-256 of the log: ", "# robot physical, closure full\n"] {
        assert!(export.contains(line), "{line} is not in {}", &export[..600]);
    }
    std::fs::write(folder.join("camera.csv"), camera(&export)).unwrap();
    let args = ["import", "camera.csv", "--columns", COLUMNS, "--uncertainty", "0.3,0.1", "--json"];
    let import = biflag(folder, &args);
    let said = json(&import);
    assert_eq!(code(&import), Some(3), "not settled: {said}");
    assert_eq!(
        (&said["log"], &said["samples"], &said["left_out"]),
        (&"camera.mcap".into(), &1569.into(), &32.into()),
        "{said}"
    );
    let (start, end) = (number(&said["run_start_s"]), number(&said["run_end_s"]));
    assert!((start - 45.0).abs() < 0.11 && (end - 76.0).abs() < 0.4, "{said}");
    assert!((number(&said["w1_rpm"]) + 37.3).abs() < 0.02 && (number(&said["w2_rpm"]) + 12.9).abs() < 0.02, "{said}");
    // 0.3 are stated; the zero has the camera's noise.
    let yaw_u_deg = number(&said["yaw_uncertainty_deg"]);
    assert!((0.301..0.31).contains(&yaw_u_deg) && said["origin"] == "import", "{said}");
    // Without --columns it asks for them, and without -o the log has the name of the table.
    let asked = biflag(folder, &["import", "camera.csv"]);
    let (said_of_it, stderr) = (code(&asked), String::from_utf8_lossy(&asked.stderr).into_owned());
    assert!(said_of_it == Some(2) && stderr.contains("camera.csv has the columns "), "{stderr}");
    // The log is a trial: what every command says of it is the same.
    let info = json(&biflag(folder, &["info", "camera.mcap", "--json"]));
    assert_eq!((&info["origin"], &info["angles"]["yaw_deg"]), (&"import".into(), &said["yaw_deg"]), "{info}");
    let both = |args: &[&str]| {
        let output = biflag(folder, &[args, &["--anyway", "--json"]].concat());
        assert!(matches!(code(&output), Some(0 | 3)), "{output:?}");
        json(&output)["trials"][0].clone()
    };
    for compared in [both(&["compare", "camera.mcap", own]), both(&["compare", "camera.mcap"])] {
        assert_eq!(compared["origin"], serde_json::json!(["import", "model"]), "{compared}");
        for (key, most) in [("yaw_rmse_deg", 0.3), ("pitch_rmse_deg", 0.15), ("steady_yaw_error_deg", 0.15)] {
            assert!(number(&compared[key]).abs() < most, "{key}: {compared}");
        }
    }
    for args in [&["report", "camera.mcap", "-o", "page.html"][..], &["figure", "trial", "camera.mcap", "-o", "f.svg"]]
    {
        let output = biflag(folder, args);
        assert!(matches!(code(&output), Some(0 | 3)), "{output:?}");
    }
    let page = std::fs::read_to_string(folder.join("page.html")).unwrap();
    assert!(page.contains("Imported from") && page.contains("yaw=-turned:rad"));
    let again = biflag(folder, &args);
    assert_eq!(code(&again), Some(2), "the log exists: {again:?}");
}

/// What a table lacks is wrong use, and no log is begun.
#[test]
fn what_is_missing_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("t.csv"), "t,ms,psi\n0,0,1.5\n1,32000,1.5\n2,64000,7.25\n3,96000,9\n").unwrap();
    let run = |columns: &str, more: &[&str]| {
        let args = [&["import", "t.csv", "--columns", columns, "-o", "t.mcap"][..], more].concat();
        let output = biflag(folder, &args);
        (code(&output), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let columns = "time=t,yaw=psi,pitch=0,roll=0";
    for (columns, more, why) in [
        ("time=t,yaw=psi,pitch=0", &[][..], "roll is missing"),
        (columns, &[], "the speeds of the motors are not known"),
        (columns, &["--speeds", "50,10", "--run", "1,9"], "the table lasts from 0 to 3 s"),
        ("time=ms,yaw=psi,pitch=0,roll=0", &["--speeds", "50,10"], "lasts 96000 s, longer than a day"),
        (
            "time=ms:us,yaw=psi,pitch=0,roll=0",
            &["--speeds", "50,10", "--run", "0,0.001"],
            "the run lasts 0.001 s, less than 0.005 s",
        ),
        (columns, &["--speeds", "50,10", "--uncertainty", "0.5"], "give two uncertainties in degrees"),
        (columns, &["--speeds", "50,10", "--robot", "none.toml"], "none.toml"),
    ] {
        let (code, said) = run(columns, more);
        assert!(code == Some(2) && said.contains(why), "{why}: {said}");
    }
    assert!(!Path::new(&folder.join("t.mcap")).exists());
    let (code, said) = run(columns, &["--speeds", "5,1", "--run", "1,3"]);
    assert_eq!(code, Some(3), "not settled: {said}");
    // A note is said with its label, and is not grave.
    for command in ["info", "report"] {
        let said = biflag(folder, &[command, "t.mcap"]);
        let lines = String::from_utf8_lossy(&said.stdout).into_owned();
        let note = lines.lines().find(|line| line.ends_with(": state it with --uncertainty"));
        assert!(note.is_some_and(|line| line.starts_with("note: ")), "{command}: {lines}");
    }
    let info = json(&biflag(folder, &["info", "t.mcap", "--json"]));
    let findings = info["findings"].as_array().expect("findings");
    assert!(
        findings.iter().any(|said| said["cure"] == "state it with --uncertainty" && said["grave"] == false),
        "{info}"
    );
    // Of an import that no fit takes, `compare` does not say that a fit finds the phase of its flagella.
    let columns = [columns, "--speeds", "5,5", "--run", "1,3", "-o", "equal.mcap"];
    let import = biflag(folder, &[&["import", "t.csv", "--columns"][..], &columns].concat());
    assert_eq!(import.status.code(), Some(3), "{import:?}");
    let compare = biflag(folder, &["compare", "equal.mcap"]);
    let said = String::from_utf8_lossy(&compare.stdout) + String::from_utf8_lossy(&compare.stderr);
    assert!(said.contains("needs yaw, pitch and roll") && !said.contains("calibrate --fit phase"), "{said}");
    let calibrate = biflag(folder, &["calibrate", "t.mcap", "-o", "fitted.toml"]);
    assert!(String::from_utf8_lossy(&calibrate.stderr).contains("imported without an uncertainty"), "{calibrate:?}");
}

/// A camera whose clock shows 986.5 s at the start of the run and runs 0.12 % slow, and that saw the yaw only.
#[test]
fn a_second_source_of_the_yaw_is_put_on_the_clock_of_the_recording() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("p.toml"), PLAN).unwrap();
    assert!(matches!(code(&biflag(folder, &["simulate", "p.toml", "--rate", "200", "--out", "s"])), Some(0 | 3)));
    let own = "s/001_w1-37.3_w2-12.9.mcap";
    assert!(matches!(code(&biflag(folder, &["export", own, "--format", "csv", "-o", "own.csv"])), Some(0 | 3)));
    let export = std::fs::read_to_string(folder.join("own.csv")).unwrap();
    let whole = camera(&export);
    let mut lines = whole.lines();
    let header = lines.next().unwrap();
    // Every seventh state from 10 s before the run on, on a clock that runs slow. The times of a table are from the run on.
    let late = |line: &str| {
        let (time, rest) = line.split_once(',').unwrap();
        let time: f64 = time.parse().unwrap();
        (time > -10.0).then(|| format!("{},{rest}\n", (time + 987.65) / 1.0012))
    };
    let rows: String = lines.step_by(7).filter_map(late).collect();
    std::fs::write(folder.join("camera.csv"), format!("{header}\n{rows}")).unwrap();
    let columns = "time=time_s,yaw=-turned:rad,pitch=0,roll=0";
    let args =
        ["import", "camera.csv", "--columns", columns, "--trial", own, "--uncertainty", "0.3,0.1", "-o", "c.mcap"];
    let import = biflag(folder, &[&args[..], &["--json"]].concat());
    let said = json(&import);
    assert_eq!(code(&import), Some(0), "{said}");
    let clock = &said["clock"];
    // Time and rate at the middle of the table, since the zero of its clock is far away.
    let middle_s = 1030.0;
    let at = |offset_s: f64, rate_ppm: f64| offset_s + (1.0 + rate_ppm * 1e-6) * middle_s;
    let found = at(number(&clock["offset_s"]), number(&clock["rate_ppm"]));
    assert!((found - at(45.0 - 987.65, 1200.0)).abs() < 0.01, "{clock}");
    assert!((number(&clock["rate_ppm"]) - 1200.0).abs() < 3.0 * number(&clock["rate_u_ppm"]), "{clock}");
    assert_eq!((&said["w1_rpm"], &said["w2_rpm"]), (&(-37.3).into(), &(-12.9).into()), "{said}");

    let compare = biflag(folder, &["compare", own, "c.mcap", "--json"]);
    let trial = &json(&compare)["trials"][0];
    assert!(number(&trial["yaw_rmse_deg"]) < 0.12, "{trial}");
    // The yaw is judged, too, although the camera saw neither pitch nor roll.
    let [yaw, pitch] = [0, 1].map(|k| &trial["angles"][k]["transient"]);
    assert!(number(&yaw["residual_deg"]) < 0.12 && pitch.is_null(), "{trial}");
    let verdict = trial["verdict"].as_str().unwrap();
    assert!(verdict.contains(" agree within ") && !verdict.contains("too short"), "{verdict}");
    let other = biflag(
        folder,
        &["import", "camera.csv", "--columns", columns, "--trial", own, "--speeds", "1,2", "-o", "d.mcap"],
    );
    assert_eq!(code(&other), Some(2));
    std::fs::write(
        folder.join("short.csv"),
        format!("{header}\n{}", rows.lines().take(40).map(|line| format!("{line}\n")).collect::<String>()),
    )
    .unwrap();
    let refused = biflag(folder, &["import", "short.csv", "--columns", columns, "--trial", own, "-o", "d.mcap"]);
    assert_eq!(code(&refused), Some(2), "{refused:?}");
    assert!(!folder.join("d.mcap").exists());
}
