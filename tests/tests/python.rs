//! The Python package: built by pip and used on the oldest and the newest Python at hand, with its types and notebooks.

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

#[test]
fn package_builds_and_works_on_the_oldest_and_the_newest_python() {
    let pythons = pythons();
    let (Some((oldest, oldest_python)), Some((newest, interpreter))) =
        (pythons.first_key_value(), pythons.last_key_value())
    else {
        panic!("there is no Python with venv: install python3-venv");
    };
    let bench = Bench::new();

    let wheels = bench.path().join("wheels");
    let mut build = Command::new(interpreter);
    run("pip wheel", build.args(["-m", "pip", "wheel", "--no-deps", "-w"]).arg(&wheels).arg(project()));
    let wheel = std::fs::read_dir(&wheels).unwrap().next().unwrap().unwrap().path();
    let size = wheel.metadata().unwrap().len() as f64 / 1e6;
    println!("{}: {size:.1} MB", wheel.file_name().unwrap().display());

    let install = |python: &Path| {
        let mut pip = command(python);
        run(
            "pip install",
            pip.args(["-m", "pip", "install", "-q", "--no-deps", "--no-compile", "--force-reinstall"]).arg(&wheel),
        );
    };
    let pytest = |python: &Path, arguments: &[&str], folder: &str| {
        let folder = bench.path().join(folder);
        std::fs::create_dir_all(&folder).unwrap();
        let mut pytest = command(python);
        pytest.args(["-m", "pytest", "-q", "-s"]).args(arguments).current_dir(project());
        pytest.env("BIFLAG_TEST_FOLDER", folder);
        run(&format!("pytest {arguments:?}"), &mut pytest);
    };
    let on_the_newest = || {
        let python = newest_python();
        install(&python);
        pytest(&python, &["tests"], "newest");
        pytest(&python, &["--nbmake", "--nbmake-timeout=300", "notebooks"], "newest");
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
    };
    let on_the_oldest = || {
        let python = environment(oldest_python, &["host/python/tests/requirements.txt"]);
        install(&python);
        pytest(&python, &["-m", "not slow", "tests"], "oldest");
    };
    println!("Python 3.{newest}, and 3.{oldest} as the oldest");
    std::thread::scope(|scope| {
        if oldest != newest {
            scope.spawn(on_the_oldest);
        }
        on_the_newest();
    });
}
