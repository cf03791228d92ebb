//! The Python package: beside its library on the newest Python at hand, and built and installed by pip on the oldest.

use sim::trial::quantity::{Shape, steady};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;
use tests::python::{command, newest_python, oldest_python};
use tests::{Bench, repository};

fn project() -> PathBuf {
    repository().join("host/python")
}

/// Runs a command to its end and prints how long it took.
#[track_caller]
fn run(what: &str, command: &mut Command) {
    let begun = Instant::now();
    let output = command.output().unwrap();
    let text = [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
    assert!(output.status.success(), "{what}: {command:?}\n{text}");
    println!("{what}: {:.0} s", begun.elapsed().as_secs_f64());
    println!("{}", text.lines().last().unwrap_or_default());
}

/// Runs the tests of the package that a Python imports from a folder, or has.
fn pytest(bench: &Bench, python: &Path, packages: &Path, arguments: &[&str]) {
    let mut pytest = command(python);
    pytest.args(["-m", "pytest", "-q", "-s"]).args(arguments).current_dir(project());
    pytest.env("PYTHONPATH", packages).env("BIFLAG_TEST_FOLDER", bench.path());
    run(&format!("pytest {arguments:?}"), &mut pytest);
}

#[test]
fn package_works_on_the_newest_python() {
    let bench = Bench::new();
    let packages = bench.path().join("packages");
    run("lay.sh", Command::new("sh").arg(project().join("lay.sh")).arg(&packages));
    pytest(&bench, &newest_python(), &packages, &["tests", "--doctest-modules", "--pyargs", "biflag"]);
}

#[test]
#[ignore = "a wheel, a second environment and the same tests again: part of `make proof`"]
fn package_is_built_by_pip_and_works_on_the_oldest_python() {
    let bench = Bench::new();
    let python = oldest_python();
    let (wheels, packages) = (bench.path().join("wheels"), bench.path().join("packages"));
    let mut pip = command(&python);
    run("pip wheel", pip.args(["-m", "pip", "wheel", "--no-deps", "-w"]).arg(&wheels).arg(project()));
    let wheel = std::fs::read_dir(&wheels).unwrap().next().unwrap().unwrap().path();
    println!("{}: {:.1} MB", wheel.file_name().unwrap().display(), wheel.metadata().unwrap().len() as f64 / 1e6);
    let mut pip = command(&python);
    pip.args(["-m", "pip", "install", "-q", "--no-deps", "--no-compile", "--target"]).arg(&packages).arg(wheel);
    run("pip install", &mut pip);
    pytest(&bench, &python, &packages, &["tests"]);
}

/// `BIFLAG_WRITE_GOLDEN=1` writes the module of Python with the fields of a steady state.
#[test]
fn quantities_of_python_are_those_of_the_model() {
    let mut module = String::from(
        "\"\"\"The quantities of a steady state, as the model lists them.\"\"\"\n\n\
         from __future__ import annotations\n\nfrom dataclasses import dataclass\nfrom typing import TypeAlias\n\n\
         import numpy as np\nfrom numpy.typing import NDArray\n\nFloats: TypeAlias = NDArray[np.float64]\n\n\n\
         @dataclass(frozen=True, eq=False, kw_only=True)\nclass Quantities:\n    \"\"\"Quantities of a steady state.\"\"\"\n\n",
    );
    for quantity in steady() {
        let number = match quantity.shape {
            Shape::Count => "int",
            _ if quantity.is_single() => "float",
            _ => "Floats",
        };
        for (at, (key, _)) in quantity.keys("").into_iter().enumerate() {
            let about = quantity.label((quantity.shape == Shape::VectorOfEach).then_some(at));
            let unit = if quantity.unit == "1" { String::new() } else { format!(", {}", quantity.unit) };
            module +=
                &format!("    {key}: {number}\n    \"\"\"{}{}{unit}.\"\"\"\n", about[..1].to_uppercase(), &about[1..]);
        }
        for (key, _) in quantity.keys("_se").into_iter().filter(|_| quantity.shape.has_error()) {
            module += &format!(
                "    {key}: {number} | None = None\n    \"\"\"Its standard error; ``None`` where it is unknown.\"\"\"\n"
            );
        }
    }
    let path = project().join("python/biflag/_quantities.py");
    if std::env::var_os("BIFLAG_WRITE_GOLDEN").is_some() {
        std::fs::write(&path, &module).unwrap();
    }
    assert_eq!(std::fs::read_to_string(&path).unwrap_or_default(), module, "BIFLAG_WRITE_GOLDEN=1 writes it again");
}
