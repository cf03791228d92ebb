//! The Python package: built by pip and used on the newest Python at hand, with its types and notebooks, and on the oldest.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;
use tests::python::{command, environment, newest_python, pythons};
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

/// Builds the wheel of the package.
fn wheel(bench: &Bench, interpreter: &Path) -> PathBuf {
    let folder = bench.path().join("wheels");
    let mut build = command(interpreter);
    run("pip wheel", build.args(["-m", "pip", "wheel", "--no-deps", "-w"]).arg(&folder).arg(project()));
    let wheel = std::fs::read_dir(&folder).unwrap().next().unwrap().unwrap().path();
    let size = wheel.metadata().unwrap().len() as f64 / 1e6;
    println!("{}: {size:.1} MB", wheel.file_name().unwrap().display());
    wheel
}

fn install(python: &Path, wheel: &Path) {
    let mut pip = command(python);
    pip.args(["-m", "pip", "install", "-q", "--no-deps", "--no-compile", "--force-reinstall"]).arg(wheel);
    run("pip install", &mut pip);
}

fn pytest(bench: &Bench, python: &Path, arguments: &[&str]) {
    let folder = bench.path().join("session");
    std::fs::create_dir_all(&folder).unwrap();
    let mut pytest = command(python);
    pytest.args(["-m", "pytest", "-q", "-s"]).args(arguments).current_dir(project());
    run(&format!("pytest {arguments:?}"), pytest.env("BIFLAG_TEST_FOLDER", folder));
}

#[test]
fn package_builds_and_works_on_the_newest_python() {
    let bench = Bench::new();
    let python = newest_python();
    install(&python, &wheel(&bench, &python));
    pytest(&bench, &python, &["tests", "--doctest-modules", "--pyargs", "biflag"]);
    pytest(&bench, &python, &["--nbmake", "--nbmake-timeout=300", "notebooks"]);
    // What it knows of numpy and pandas serves all three.
    let types = bench.path().join("types");
    let tool = |name: &str| {
        let mut tool = command(&python.with_file_name(name));
        tool.env("MYPY_CACHE_DIR", &types);
        tool
    };
    run("mypy of the package", tool("mypy").args(["--strict", "-p", "biflag"]).current_dir(bench.path()));
    run("mypy of its tests", tool("mypy").args(["--strict", "conftest.py", "tests"]).current_dir(project()));
    run("stubtest", tool("stubtest").arg("biflag._biflag").current_dir(bench.path()));
}

#[test]
#[ignore = "a second environment and the same tests again: part of `make proof`"]
fn package_works_on_the_oldest_python() {
    let (oldest, interpreter) = pythons().pop_first().expect("a Python with venv: install python3-venv");
    println!("Python 3.{oldest}");
    let bench = Bench::new();
    let python = environment(&interpreter, &["host/python/tests/requirements.txt"]);
    install(&python, &wheel(&bench, &interpreter));
    pytest(&bench, &python, &["tests"]);
}
