//! Logs of format 1 give the same results as with the program that wrote them. The expected numbers are from
//! `biflag compare` and `biflag info` of that program (see `tests/data/format1/README.md`).

use serde_json::Value;
use std::path::Path;
use std::process::Command;

/// Runs `biflag` in a folder with copies of both logs.
fn biflag(folder: &Path, args: &[&str], code: i32) -> Value {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/format1");
    for name in ["recorded.mcap", "modelled.mcap"] {
        std::fs::copy(data.join(name), folder.join(name)).unwrap();
    }
    let output = Command::new(env!("CARGO_BIN_EXE_biflag")).current_dir(folder).args(args).output().unwrap();
    assert_eq!(output.status.code(), Some(code), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[track_caller]
fn expect(value: &Value, expected: f64, tolerance: f64) {
    let value = value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"));
    assert!((value - expected).abs() <= tolerance, "{value}, not {expected}");
}

#[test]
fn comparison_of_format_1_logs_is_unchanged() {
    let folder = tempfile::tempdir().unwrap();
    let compared = biflag(folder.path(), &["compare", "recorded.mcap", "modelled.mcap", "--anyway", "--json"], 3);
    let trial = &compared["trials"][0];
    // That program took the zero of the tilt from the whole still phase of 8 s, in whose first half the board's filter
    // still settles by 2 degrees. The tilt turns the axis of the yaw a little.
    for (k, zero, tolerance) in
        [(0, 0.346_600_926_521_635_16, 2e-4), (1, 1.230_788_757_641_103, 0.6), (2, 0.192_626_988_674_908_27, 0.005)]
    {
        expect(&trial["measured_zero_deg"][k], zero, tolerance);
    }
    expect(&trial["run_start_s"][0], 9.035_006, 1e-9);
    // It stated an uncertainty all the same.
    assert_eq!(trial["tilt_uncertainty_deg"], serde_json::json!([null, null]));
    assert!(trial["findings"].to_string().contains("filter had not settled before the run"), "{trial}");
    // That program also subtracted a zero from the model.
    expect(&trial["yaw_rmse_deg"], 4.671_885_452, 0.02);
    expect(&trial["pitch_rmse_deg"], 0.956_608_448, 0.4);
    expect(&trial["roll_rmse_deg"], 0.675_826_263, 0.3);
    let page = std::fs::read_to_string(folder.path().join("recorded.compare.html")).unwrap();
    assert!(page.contains("\"rigid\":false"), "the shapes of the log are on its page");
}

#[test]
fn modelled_log_has_the_steady_state_of_the_solver() {
    let folder = tempfile::tempdir().unwrap();
    let info = biflag(folder.path(), &["info", "modelled.mcap", "--json"], 3);
    for (key, deg) in [
        ("yaw_deg", -43.185_455_578_453_55),
        ("pitch_deg", -1.857_671_266_958_100_8),
        ("roll_deg", -1.119_472_419_874_280_5),
    ] {
        expect(&info["angles"][key], deg, 1e-9);
    }
    biflag(folder.path(), &["report", "modelled.mcap", "--json"], 3);
    let page = std::fs::read_to_string(folder.path().join("modelled.html")).unwrap();
    assert!(page.contains("\"rigid\":false"));
    let replayed = biflag(folder.path(), &["compare", "modelled.mcap", "--json"], 3);
    expect(&replayed["trials"][0]["steady_yaw_error_deg"], 0.0, 0.3);
}
