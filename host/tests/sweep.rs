//! End-to-end tests of `sweep`: the table, shards, exit codes.

use crate::program::biflag;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output};

/// 24 short points, of which the eight with a spacing of 0.4 are impossible.
const PLAN: &str = "[session]\nname = \"short\"\n[trial]\nrun = 0.4\nmethod = \"trial\"\nphases = 2\n[vary]\n\"group.spacing\" = [0.4, 1, 1.5]\n\
                    \"fluid.viscosity_pa_s\" = { from = 0.5, to = 2, count = 2, scale = \"log\" }\n\
                    [speeds]\npairs = [[50, 10], [0, 45], [-90, 90], [60, 60]]\n";

#[track_caller]
fn expect(output: &Output, code: i32) -> Value {
    assert_eq!(output.status.code(), Some(code), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap_or_default()
}

fn bench(plan: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("plan.toml"), plan).unwrap();
    folder
}

fn tables(folder: &Path) -> [Vec<u8>; 2] {
    ["table.parquet", "table.csv"].map(|name| std::fs::read(folder.join(name)).unwrap())
}

/// Returns the rows of the table as CSV.
fn rows(folder: &Path) -> Vec<BTreeMap<String, String>> {
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_path(folder.join("table.csv")).unwrap();
    reader.deserialize().map(Result::unwrap).collect()
}

fn number(row: &BTreeMap<String, String>, column: &str) -> f64 {
    row[column].parse().unwrap_or_else(|_| panic!("{column} of {row:?}"))
}

#[test]
fn wrong_plan_and_wrong_folder_are_wrong_use() {
    let bench = bench("[vary]\n\"group.pitch\" = []\n[speeds]\npairs = [[50, 10]]\n");
    let folder = bench.path();
    for args in [&["sweep", "plan.toml"][..], &["sweep", "merge", "."], &["sweep", "status", "none"], &["sweep"]] {
        let output = biflag(folder, args);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    }
    assert_eq!(std::fs::read_dir(folder).unwrap().count(), 1, "nothing was made");
    // A session and a sweep do not share a folder.
    std::fs::create_dir(folder.join("s")).unwrap();
    for (manifest, args, said) in [
        ("session.toml", &["sweep", "groups"][..], "is a session folder"),
        ("sweep.toml", &["simulate", "--speeds=50,10", "--duration", "1"], "already contains a sweep"),
    ] {
        std::fs::write(folder.join("s").join(manifest), "").unwrap();
        let output = biflag(folder, &[args, &["--out", "s"]].concat());
        assert!(
            output.status.code() == Some(2) && String::from_utf8_lossy(&output.stderr).contains(said),
            "{output:?}"
        );
        std::fs::remove_file(folder.join("s").join(manifest)).unwrap();
    }
}

/// Every point is a row: with its groups, lengths, and a result like that of `simulate`, or with the reason.
#[test]
fn every_point_is_a_row() {
    let bench = bench(PLAN);
    let folder = bench.path();
    let answer = expect(&biflag(folder, &["sweep", "plan.toml", "--json"]), 3);
    let table = serde_json::json!("short/table.parquet");
    for (key, value) in
        [("table", table), ("points", 24.into()), ("done", 24.into()), ("missing", 0.into()), ("failed", 8.into())]
    {
        assert_eq!(answer[key], value, "{key}");
    }
    let rows = rows(&folder.join("short"));
    assert_eq!(rows.len(), 24);
    assert!(rows.windows(2).all(|pair| pair[0]["point"] < pair[1]["point"]), "sorted by name");
    let failed = expect(&biflag(folder, &["sweep", "status", "short", "--failed", "--json"]), 0)["reasons"].clone();
    assert_eq!((failed.as_array().unwrap().len(), &failed[0]["points"]), (1, &8.into()), "{failed}");
    assert_eq!(failed[0]["values"]["group.spacing"], 0.4);
    assert!(failed[0]["reason"].as_str().unwrap().starts_with("base.motor_distance_m = "), "{failed}");
    let mut costs = csv::ReaderBuilder::new().comment(Some(b'#')).from_path(folder.join("short/cost.csv")).unwrap();
    let costs: Vec<BTreeMap<String, String>> = costs.deserialize().map(Result::unwrap).collect();
    for (cost, row) in costs.iter().zip(&rows) {
        assert_eq!((&cost["point"], &cost["kind"]), (&row["point"], &row["kind"]));
        assert!((0.0..60.0).contains(&number(cost, "processor_s")) && !cost["host"].is_empty(), "{cost:?}");
        assert!((number(cost, "sweeps") > 10.0) == (row["status"] == "ok"), "{cost:?}");
        assert!(cost["program"].starts_with(env!("CARGO_PKG_VERSION")));
    }
    assert_eq!(costs.len(), 24);
    for row in &rows {
        let is_ok = row["group_spacing_relative"] != "0.4";
        assert_eq!(row["status"], if is_ok { "ok" } else { "failed" });
        assert_eq!(row["yaw_deg"].is_empty(), !is_ok);
        assert_eq!(row["reason"].starts_with("base.motor_distance_m = "), !is_ok, "{row:?}");
        let spacing = number(row, "motor_distance_m") / number(row, "contour_length_m");
        assert!((spacing / number(row, "group_spacing") - 1.0).abs() < 1e-12);
        assert_eq!(
            (row["fluid_viscosity_pa_s"].as_str(), row["group_pitch_relative"].as_str()),
            (row["viscosity_pa_s"].as_str(), "1")
        );
        // At 50 and 10 rpm the phase does not matter.
        let phases = if row["w1_rpm"] == "50" { "1" } else { "2" };
        assert!(!is_ok || row["phases"] == phases, "{row:?}");
    }
    let row = rows
        .iter()
        .find(|row| row["w1_rpm"] == "50" && row["group_spacing_relative"] == "1" && row["viscosity_pa_s"] == "2")
        .unwrap();
    // Young's modulus differs from that of `physical` by the rounding of the group, which a run amplifies.
    let thick = format!("[fluid]\nviscosity_pa_s = 2\n[flagellum]\nyoung_pa = {}\n", row["young_pa"]);
    std::fs::write(folder.join("thick.toml"), thick).unwrap();
    let simulate =
        ["simulate", "--speeds=50,10", "--duration", "0.4", "--robot", "thick.toml", "--json", "--out", "one"];
    let trial = expect(&biflag(folder, &simulate), 3)["trials"][0].clone();
    for (column, wanted) in [
        ("yaw_deg", &trial["yaw_deg"]),
        ("pitch_deg", &trial["pitch_deg"]),
        ("roll_deg", &trial["roll_deg"]),
        ("force1_x_n", &trial["force1_n"][0]),
        ("force2_z_n", &trial["force2_n"][2]),
        ("axial_torque2_nm", &trial["axial_torque_nm"][1]),
        ("contact_share", &trial["contact_share"]),
        ("min_gap_m", &trial["min_gap_m"]),
    ] {
        let wanted = wanted.as_f64().unwrap();
        assert!((number(row, column) - wanted).abs() <= 1e-12 * wanted.abs(), "{column}: {row:?} {trial}");
    }
    let header = std::fs::read_to_string(folder.join("short/table.csv")).unwrap();
    for line in header.lines().filter_map(|line| line.strip_prefix("# ")) {
        println!("{line}");
    }
    assert!(header.contains("# force1_z_n [N]: force of flagellum 1 on the base along z (thrust)"), "{header}");
}

#[test]
fn table_does_not_depend_on_jobs_shards_or_order() {
    let bench = bench(PLAN);
    let folder = bench.path();
    expect(&biflag(folder, &["sweep", "plan.toml", "--jobs", "1", "--out", "one"]), 3);
    let wanted = tables(&folder.join("one"));
    for shards in [1, 3, 8] {
        let out = format!("of{shards}");
        let (mut points, mut failed) = (0, 0);
        for shard in (1..=shards).rev() {
            let args = ["sweep", "plan.toml", "--shard", &format!("{shard}/{shards}"), "--out", &out, "--json"];
            let output = biflag(folder, &args);
            let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
            let here = answer["failed"].as_u64().unwrap();
            assert_eq!(output.status.code(), Some(if here > 0 { 3 } else { 0 }));
            assert_eq!((&answer["table"], &answer["missing"]), (&Value::Null, &0.into()));
            points += answer["points"].as_u64().unwrap();
            failed += here;
        }
        assert_eq!((points, failed), (24, 8), "each point belongs to one shard");
        let status = expect(&biflag(folder, &["sweep", "status", &out, "--json"]), 0);
        assert_eq!((&status["done"], &status["missing"], &status["failed"]), (&24.into(), &0.into(), &8.into()));
        expect(&biflag(folder, &["sweep", "merge", &out]), 3);
        assert!(tables(&folder.join(&out)) == wanted, "{shards} shards");
    }
}

#[test]
fn a_sweep_goes_on_where_it_ended_and_only_when_asked() {
    let bench = bench(PLAN);
    let folder = bench.path();
    // Points belong to a shard by their names, which depend on the version of the results; so may its failing points.
    let half = biflag(folder, &["sweep", "plan.toml", "--shard", "1/2"]);
    assert!(matches!(half.status.code(), Some(0 | 3)), "{}", String::from_utf8_lossy(&half.stderr));
    let again = biflag(folder, &["sweep", "plan.toml", "--shard", "1/2"]);
    assert_eq!(again.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&again.stderr).contains("go on with --resume"));

    let status = expect(&biflag(folder, &["sweep", "status", "short", "--json"]), 0);
    let (done, missing) = (status["done"].as_u64().unwrap(), status["missing"].as_u64().unwrap());
    assert!(done > 0 && missing > 0 && done + missing == 24, "{status}");
    assert_eq!((&status["table"], &status["time_left_s"]), (&Value::Null, &Value::Null));
    let shards = expect(&biflag(folder, &["sweep", "status", "short", "--shards", "2", "--json"]), 0)["shards"].clone();
    let of = |key: &str| [0, 1].map(|shard| shards[shard][key].as_u64().unwrap());
    assert_eq!((of("shard"), of("done"), of("missing")), ([1, 2], [done, 0], [0, missing]));
    let text = biflag(folder, &["sweep", "status", "short", "--shards", "2"]).stdout;
    let wanted = format!("1 of 2 shards done\nshard 2/2: 0 of {missing} points, 0 failed\n");
    assert!(String::from_utf8_lossy(&text).ends_with(&wanted), "{}", String::from_utf8_lossy(&text));

    // A table that lacks points is written only when that is asked for.
    let refused = biflag(folder, &["sweep", "merge", "short"]);
    assert_eq!(refused.status.code(), Some(1));
    let wanted = format!("short: {missing} of 24 points are missing, no table is written");
    assert!(String::from_utf8_lossy(&refused.stderr).contains(&wanted), "{refused:?}");
    assert!(!folder.join("short/table.csv").exists() && !folder.join("short/table.parquet").exists());
    let merged = expect(&biflag(folder, &["sweep", "merge", "short", "--partial", "--json"]), 3);
    assert_eq!(merged["missing"], missing);
    assert_eq!(rows(&folder.join("short")).len() as u64, done, "a table of what is there");

    let whole = expect(&biflag(folder, &["sweep", "plan.toml", "--resume", "--json"]), 3);
    assert_eq!((&whole["done"], &whole["missing"]), (&24.into(), &0.into()));
    expect(&biflag(folder, &["sweep", "plan.toml", "--out", "other"]), 3);
    assert!(tables(&folder.join("short")) == tables(&folder.join("other")));

    std::fs::write(folder.join("plan.toml"), PLAN.replace("0.4, 1, 1.5", "0.4, 1, 1.6")).unwrap();
    let other = biflag(folder, &["sweep", "plan.toml", "--resume"]);
    assert_eq!(other.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&other.stderr).contains("a sweep of another plan"));
}

/// Returns the points that a command has computed itself, from its progress: those of all, less those of its first line.
fn begun_with(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    text.lines().next().unwrap_or_default().to_owned()
}

/// A plan that grows in an axis, by an axis, and in its speeds takes over all that it had. Another plan's index, the number
/// of phases where none matter, and the commit of the program are no part of a point.
#[test]
fn a_plan_that_grows_reuses_what_it_had() {
    let bench = bench(PLAN);
    let folder = bench.path();
    expect(&biflag(folder, &["sweep", "plan.toml", "--shard", "1/2", "--out", "old"]), 3);
    expect(&biflag(folder, &["sweep", "plan.toml", "--shard", "2/2", "--resume", "--out", "old"]), 3);
    // A commit does not change results.
    let parts = std::fs::read_dir(folder.join("old")).unwrap().map(|entry| entry.unwrap().path());
    assert_eq!(parts.filter(|path| path.extension().is_some_and(|end| end == "part")).count(), 2);
    let grown = PLAN
        .replace("[0.4, 1, 1.5]", "[0.4, 0.9, 1, 1.5]")
        .replace("[vary]", "[vary]\n\"joint.coulomb_nm\" = [2e-6, OWN]")
        .replace("OWN", &sim::params::Robot::default().joint.coulomb_nm.to_string())
        .replace("pairs = [", "pairs = [[37.3, -52.91], ")
        .replace("short", "grown");
    std::fs::write(folder.join("grown.toml"), &grown).unwrap();
    let swept = biflag(folder, &["sweep", "grown.toml", "--reuse", "old", "--jobs", "1"]);
    expect(&swept, 3);
    assert!(begun_with(&swept).contains("24 of 80 points"), "{}", begun_with(&swept));
    // The same bytes as without.
    expect(&biflag(folder, &["sweep", "grown.toml", "--out", "anew"]), 3);
    assert!(tables(&folder.join("grown")) == tables(&folder.join("anew")));

    // At submission, and for more phases: those of (50, 10) rpm do not matter.
    std::fs::write(folder.join("phases.toml"), PLAN.replace("phases = 2", "phases = 3").replace("short", "phases"))
        .unwrap();
    expect(&biflag(folder, &["sweep", "slurm", "phases.toml", "--shards", "2", "--reuse", "old", "--json"]), 0);
    let status = expect(&biflag(folder, &["sweep", "status", "phases", "--json"]), 0);
    assert_eq!((&status["done"], &status["points"]), (&6.into(), &24.into()));

    // Results of another version of the model are not taken over.
    let manifest = folder.join("old/sweep.toml");
    let text = std::fs::read_to_string(&manifest).unwrap();
    let version = format!("results = {}", host::sweep::RESULTS);
    std::fs::write(&manifest, text.replace(&version, "results = 0")).unwrap();
    let refused = biflag(folder, &["sweep", "grown.toml", "--reuse", "old", "--out", "new"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("has results of version 0"), "{refused:?}");
}

/// A part that was cut off, changed, or copied from another sweep costs its points and nothing else.
#[test]
fn damaged_and_foreign_parts_are_noticed() {
    let plan = PLAN.replace("0.4, 1, 1.5", "1, 1.5");
    let bench = bench(&plan);
    let folder = bench.path();
    expect(&biflag(folder, &["sweep", "plan.toml"]), 0);
    let wanted = tables(&folder.join("short"));
    let part = |sweep: &str| {
        let entries = std::fs::read_dir(folder.join(sweep)).unwrap().map(|entry| entry.unwrap().path());
        entries.into_iter().find(|path| path.extension().is_some_and(|end| end == "part")).unwrap()
    };
    let whole = part("short");
    let bytes = std::fs::read(&whole).unwrap();
    std::fs::write(&whole, &bytes[..bytes.len() / 2]).unwrap();
    let merged = expect(&biflag(folder, &["sweep", "merge", "short", "--partial", "--json"]), 3);
    assert!(merged["missing"].as_u64().unwrap() >= 7, "{merged}");
    assert!(merged["warnings"][0].as_str().unwrap().contains("cut off or damaged"), "{merged}");
    let refused = biflag(folder, &["sweep", "merge", "short"]);
    let error = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(refused.status.code() == Some(1) && error.contains("(cut off or damaged: part-"), "{error}");

    std::fs::write(folder.join("other.toml"), plan.replace("run = 0.4", "run = 0.5").replace("short", "other"))
        .unwrap();
    expect(&biflag(folder, &["sweep", "other.toml"]), 0);
    std::fs::copy(part("other"), folder.join("short/part-0000000000000000.part")).unwrap();
    let whole = expect(&biflag(folder, &["sweep", "plan.toml", "--resume", "--json"]), 0);
    assert_eq!((&whole["done"], &whole["missing"]), (&16.into(), &0.into()));
    assert_eq!(whole["warnings"], serde_json::json!([]), "the damaged part is still there, and nothing is lost");
    assert!(tables(&folder.join("short")) == wanted);
}

#[test]
fn sobol_design_fills_speeds_and_robots() {
    let plan = "[session]\nname = \"sobol\"\n[trial]\nrun = 0.1\nmethod = \"trial\"\n[vary]\ndesign = { sobol = 32, seed = 7 }\n\
                \"speeds.w1_rpm\" = { from = -90, to = 90 }\n\"speeds.w2_rpm\" = { from = 0, to = 90 }\n\
                \"group.stiffness\" = { from = 0.5, to = 2, scale = \"log\" }\n";
    let bench = bench(plan);
    expect(&biflag(bench.path(), &["sweep", "plan.toml"]), 0);
    let rows = rows(&bench.path().join("sobol"));
    assert_eq!(rows.len(), 32);
    for (column, middle) in [("w1_rpm", 0.0), ("w2_rpm", 45.0), ("group_stiffness_relative", 1.0)] {
        assert_eq!(rows.iter().filter(|row| number(row, column) < middle).count(), 16, "{column}");
    }
}

#[test]
fn one_at_a_time_has_the_robot_itself_once() {
    let plan = "[session]\nname = \"one\"\n[trial]\nrun = 0.1\nmethod = \"trial\"\n[vary]\ndesign = \"one at a time\"\n\
                \"group.stiffness\" = [0.5, 2]\n\"group.radius\" = [0.8]\n[speeds]\npairs = [[50, 10], [-50, 10]]\n";
    let bench = bench(plan);
    expect(&biflag(bench.path(), &["sweep", "plan.toml"]), 0);
    let rows = rows(&bench.path().join("one"));
    let mut found: Vec<_> = rows
        .iter()
        .filter(|row| row["w1_rpm"] == "50")
        .map(|row| (row["group_stiffness_relative"].as_str(), row["group_radius_relative"].as_str()))
        .collect();
    found.sort();
    assert_eq!((rows.len(), found), (8, vec![("0.5", "1"), ("1", "0.8"), ("1", "1"), ("2", "1")]));
}

#[test]
fn slurm_script_is_a_valid_shell_script() {
    let bench = bench(&PLAN.replace("\"short\"", "\"it's short\""));
    let output = biflag(bench.path(), &["sweep", "slurm", "plan.toml", "--shards", "12"]);
    assert_eq!(output.status.code(), Some(0));
    std::fs::write(bench.path().join("sweep.sh"), &output.stdout).unwrap();
    let checked = Command::new("bash").args(["-n", "sweep.sh"]).current_dir(bench.path()).output().unwrap();
    assert!(checked.status.success(), "{}", String::from_utf8_lossy(&checked.stderr));
    let script = String::from_utf8(output.stdout).unwrap();
    for part in ["--requeue", "--signal=B:USR1@120", "--array=", "afterany", "MaxArraySize", "it-s-short", "$shard/12"]
    {
        assert!(script.contains(part), "{part} is not in {script}");
    }
    // The submission has written the manifest.
    let status = expect(&biflag(bench.path(), &["sweep", "status", "it-s-short", "--json"]), 0);
    assert_eq!(status["points"], 24);
}

/// Every command states the same value of a quantity, to the last digit, for one starting phase and for several.
#[test]
fn a_sweep_states_what_simulate_states() {
    let speeds = "[speeds]\npairs = [[90, 90], [37.3, -52.91]]\n";
    let bench = bench(&format!("[trial]\nrun = 25\nmethod = \"trial\"\nphases = 2\n{speeds}"));
    let folder = bench.path();
    let trials = format!("[trial]\ncalibrate = 0\npreroll = 0\nrun = 25\ndecay = 0\nphases = 2\n{speeds}");
    std::fs::write(folder.join("trials.toml"), trials).unwrap();
    expect(&biflag(folder, &["sweep", "plan.toml", "--out", "swept"]), 0);
    let output = biflag(folder, &["simulate", "trials.toml", "--out", "simulated", "--json"]);
    assert!(matches!(output.status.code(), Some(0 | 3)), "{}", String::from_utf8_lossy(&output.stderr));
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    let swept = rows(&folder.join("swept"));
    for trial in answer["trials"].as_array().unwrap() {
        let is_same = |row: &&BTreeMap<String, String>| number(row, "w1_rpm") == trial["w1_rpm"].as_f64().unwrap();
        let row = swept.iter().find(is_same).unwrap();
        // Phases that differ matter at a simple ratio only: elsewhere a sweep has one.
        let (trial, spreads) = match row["phases"].as_str() {
            "1" => (&trial["starts"][0], None),
            _ => (trial, Some(&trial["phase_spread_deg"])),
        };
        let named = ["yaw_deg", "pitch_deg", "roll_deg", "tilt_deg", "yaw_se_deg", "contact_share", "min_gap_m"];
        for (column, value) in named.iter().map(|name| (*name, &trial[name])).chain([
            ("force1_z_n", &trial["force1_n"][2]),
            ("force2_x_n", &trial["force2_n"][0]),
            ("axial_torque2_nm", &trial["axial_torque_nm"][1]),
        ]) {
            assert_eq!(number(row, column), value.as_f64().unwrap(), "{column} of {trial}");
        }
        for (i, column) in ["yaw_spread_deg", "pitch_spread_deg", "roll_spread_deg"].into_iter().enumerate() {
            let spread = spreads.map_or(0.0, |spreads| spreads[i].as_f64().unwrap());
            assert_eq!(number(row, column), spread, "{column} of {trial}");
        }
    }
}
