//! End-to-end tests of `resistance`.

use serde_json::Value;
use std::process::{Command, Output};

fn biflag(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_biflag")).args(args).output().unwrap()
}

fn matrix(args: &[&str]) -> (Value, Vec<Vec<f64>>) {
    let output = biflag(&[&["resistance", "--json"], args].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    let matrix = serde_json::from_value(json["matrix"].clone()).unwrap();
    (json, matrix)
}

#[test]
fn resistance_prints_a_symmetric_matrix_of_three_parts() {
    let (json, matrix) = matrix(&["--phase=-30,90"]);
    assert_eq!(json["parts"], serde_json::json!(["base", "flagellum 1", "flagellum 2"]));
    assert_eq!((&json["robot"], &json["phase_deg"]), (&"physical".into(), &serde_json::json!([-30.0, 90.0])));
    assert!(json["reciprocity_error"].as_f64().unwrap() < 0.01);
    assert_eq!(matrix.len(), 18);
    for (i, row) in matrix.iter().enumerate() {
        assert_eq!(row.len(), 18);
        assert!(row[i] > 0.0, "motion {i} is resisted");
        for (j, value) in row.iter().enumerate() {
            assert_eq!(*value, matrix[j][i], "{i}, {j}");
        }
    }
    // A right-handed flagellum that turns about +z is pushed up by the fluid, which it pushes down.
    assert!(matrix[8][11] < 0.0 && matrix[14][17] < 0.0);
    // The head resists its own motion, and feels the flagella.
    assert!(matrix[2][2] > 0.1 && matrix[2][11].abs() > 1e-5);
}

#[test]
fn resistance_takes_a_named_robot_a_file_and_a_phase() {
    let (_, physical) = matrix(&[]);
    let (json, published) = matrix(&["--robot", "published"]);
    assert_eq!(json["robot"], "published");
    assert_eq!(published[0], vec![0.0; 18], "the published base has a drag on its rotation and nothing else");
    assert!(published[11][11] < 0.8 * physical[11][11], "its rods spin without drag");
    assert_ne!(matrix(&["--phase", "0,90"]).1, physical);

    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("thick.toml");
    std::fs::write(&file, "[fluid]\nviscosity_pa_s = 2\n").unwrap();
    let (_, thick) = matrix(&["--robot", file.to_str().unwrap()]);
    let error = |i: usize, j: usize| (thick[i][j] - 2.0 * physical[i][j]).abs() / physical[i][i].max(physical[j][j]);
    assert!((0..18).all(|i| (0..18).all(|j| error(i, j) < 1e-9)), "the resistance is proportional to the viscosity");
}

#[test]
fn resistance_prints_a_table_without_json() {
    let output = biflag(&["resistance"]);
    let text = String::from_utf8(output.stdout).unwrap();
    let row = |name: &str| -> Vec<f64> {
        let line = text.lines().find(|line| line.starts_with(name)).unwrap_or_else(|| panic!("{name} in {text}"));
        line[name.len()..].split_whitespace().map(|word| word.parse().unwrap()).collect()
    };
    for name in ["flagellum 1", "flagellum 2"] {
        let [thrust, torque, base, drag] = row(name)[..] else { panic!("{text}") };
        // A single resolved helix has 0.0949 mN and -0.0130 mN m at 1 rpm, and a drag of 0.464 N s/m. The other flagellum and
        // the head, which are held, hold the fluid back: it pushes harder against them.
        assert!((0.0949..0.15).contains(&thrust) && (-0.016..-0.011).contains(&torque), "{text}");
        assert!(base < 0.0 && (0.464..0.7).contains(&drag), "{text}");
    }
    assert!(text.contains("reciprocity error"), "{text}");
}

#[test]
fn resistance_explains_wrong_use() {
    for (args, message) in [
        (&["--phase", "90"][..], "give two angles in degrees"),
        (&["--phase", "0,east"], "\"east\" is not an angle"),
        (&["--robot", "no-such.toml"], "no-such.toml"),
    ] {
        let output = biflag(&[&["resistance"], args].concat());
        assert_eq!(output.status.code(), Some(2));
        let text = String::from_utf8(output.stderr).unwrap();
        assert!(text.contains(message), "{text}");
    }
}
