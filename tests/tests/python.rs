//! The Python package: built by pip and used on the oldest and the newest Python at hand, with its types and notebooks.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;
use tests::Bench;

/// Minor versions of Python 3 that are looked for.
const MINORS: std::ops::RangeInclusive<u32> = 10..=20;

/// Prints the minor version of a Python that can make environments.
const PROBE: &str = "import ensurepip, sys, venv; print(sys.version_info[1])";

fn project() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).with_file_name("host").join("python")
}

/// Returns the Pythons at hand by their minor versions: those on the PATH, and those of pyenv.
fn interpreters() -> BTreeMap<u32, PathBuf> {
    let mut candidates = vec![PathBuf::from("python3")];
    candidates.extend(MINORS.map(|minor| format!("python3.{minor}").into()));
    let home = std::env::var_os("HOME").map(|home| Path::new(&home).join(".pyenv"));
    if let Some(root) = std::env::var_os("PYENV_ROOT").map(PathBuf::from).or(home)
        && let Ok(versions) = std::fs::read_dir(root.join("versions"))
    {
        candidates.extend(versions.flatten().map(|version| version.path().join("bin/python3")));
    }
    let probe = |python: PathBuf| {
        let output =
            Command::new(&python).args(["-c", PROBE]).output().ok().filter(|output| output.status.success())?;
        let minor = String::from_utf8(output.stdout).ok()?.trim().parse().ok()?;
        MINORS.contains(&minor).then_some((minor, python))
    };
    candidates.into_iter().rev().filter_map(probe).collect()
}

/// Runs a command to its end and prints how long it took.
#[track_caller]
fn run(what: &str, command: &mut Command) {
    let begun = Instant::now();
    let output = command.env("PYTHONDONTWRITEBYTECODE", "1").output().unwrap();
    let text = [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
    assert!(output.status.success(), "{what}: {command:?}\n{text}");
    println!("{what}: {:.0} s", begun.elapsed().as_secs_f64());
    println!("{}", text.lines().last().unwrap_or_default());
}

#[test]
fn package_builds_and_works_on_the_oldest_and_the_newest_python() {
    let pythons = interpreters();
    let (Some((oldest, _)), Some((newest, newest_python))) = (pythons.first_key_value(), pythons.last_key_value())
    else {
        panic!("there is no Python from 3.{} on with venv: install python3-venv", MINORS.start());
    };
    let bench = Bench::new();
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let requirements = |name: &str| format!("-r{}", project().join("tests").join(name).display());
    let (every, more) = (requirements("requirements.txt"), requirements("requirements-newest.txt"));
    let environment = |minor: &u32, packages: &[&str]| {
        tests::python(&folder.join(format!("package-3.{minor}")), &pythons[minor], packages)
    };

    let wheels = bench.path().join("wheels");
    let mut build = Command::new(newest_python);
    run("pip wheel", build.args(["-m", "pip", "wheel", "--no-deps", "-w"]).arg(&wheels).arg(project()));
    let wheel = std::fs::read_dir(&wheels).unwrap().next().unwrap().unwrap().path();
    let size = wheel.metadata().unwrap().len() as f64 / 1e6;
    println!("{}: {size:.1} MB", wheel.file_name().unwrap().display());

    let install = |python: &Path| {
        let mut pip = Command::new(python);
        run("pip install", pip.args(["-m", "pip", "install", "-q", "--no-deps", "--force-reinstall"]).arg(&wheel));
    };
    let pytest = |python: &Path, arguments: &[&str]| {
        let mut pytest = Command::new(python);
        pytest.args(["-m", "pytest", "-q", "-s"]).args(arguments).current_dir(project());
        // Both record one session.
        pytest.env("BIFLAG_TEST_FOLDER", bench.path());
        run(&format!("pytest {arguments:?}"), &mut pytest);
    };
    let python = environment(newest, &[&every, &more]);
    install(&python);
    println!("Python 3.{newest}");
    pytest(&python, &["tests"]);
    pytest(&python, &["--nbmake", "--nbmake-timeout=300", "notebooks"]);
    let tool = |name: &str| Command::new(python.with_file_name(name));
    run("mypy of the package", tool("mypy").args(["--strict", "-p", "biflag"]).current_dir(bench.path()));
    run("mypy of its tests", tool("mypy").args(["--strict", "conftest.py", "tests"]).current_dir(project()));
    run("stubtest", tool("stubtest").arg("biflag._biflag").current_dir(bench.path()));

    if oldest == newest {
        println!("Python 3.{newest} is the only one here from 3.{} on: older ones are not tested", MINORS.start());
        return;
    }
    let python = environment(oldest, &[&every]);
    install(&python);
    println!("Python 3.{oldest}");
    pytest(&python, &["tests"]);
}
