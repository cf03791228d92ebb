//! What `record` knew of a trial, every later command tells, with the exit code that follows.

use tests::{Bench, Run, nano};

/// Returns the grave findings about the log of the first trial in a command's answer.
fn grave(run: &Run) -> Vec<String> {
    let json = run.json();
    let findings = json["findings"].as_array().unwrap_or_else(|| panic!("no findings in {json}")).clone();
    let grave = findings.iter().filter(|finding| finding["grave"] == true);
    grave.map(|finding| format!("{}: {}", finding["kind"], finding["text"])).collect()
}

/// The sensor turns faster than its range for a while: the yaw is wrong by whole turns.
#[test]
fn a_clipped_gyroscope_is_told_by_every_command() {
    let bench = Bench::new();
    let plan = bench.short_plan(4.0, [50.0, 10.0]);
    let nano = nano(["--speed", "max", "--fault", "spin=3000@2"]);
    let record = ["record", plan.to_str().unwrap(), "--port", nano.port(), "--out", "session", "--resume", "--json"];
    let recorded = bench.run(record).expect_code(3).json();
    let said = recorded["trials"][0]["warnings"].to_string();
    assert!(said.contains("readings were at the end of the sensor's range"), "{recorded}");
    let log = recorded["trials"][0]["log"].as_str().unwrap();

    let resumed = bench.run(record).expect_code(3).json();
    assert_eq!(tests::logs(&bench.path().join("session")).len(), 1, "nothing is recorded again");
    assert!(resumed["trials"][0]["warnings"].to_string().contains("end of the sensor's range"), "{resumed}");
    for command in
        [&["info", log, "--json"][..], &["export", log, "-o", "log.csv", "--json"], &["export", "session", "--json"]]
    {
        let run = bench.run(command).expect_code(3);
        let grave = grave(&run);
        assert!(
            grave.iter().any(|text| text.contains("conduct") && text.contains("end of the sensor's range")),
            "{command:?}: {grave:?}"
        );
    }
    let info = bench.run(["info", log]).expect_code(3).stdout;
    assert!(info.contains("warning: ") && info.contains("give a wider gyro_range"), "{info}");
    let session = bench.run(["info", "session"]).expect_code(3).stdout;
    assert!(session.contains("end of the sensor's range"), "{session}");
    bench.run(["report", log]).expect_code(3);
    let page = std::fs::read_to_string(bench.path().join(log).with_extension("html")).unwrap();
    assert!(
        page.contains("end of the sensor’s range")
            || page.contains("end of the sensor&#39;s range")
            || page.contains("end of the sensor's range")
    );
}
