//! Virtual environments of Python.

use crate::repository;
use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Minor versions of Python 3 that are looked for.
const MINORS: std::ops::RangeInclusive<u32> = 10..=20;

/// Prints the minor version of a Python that can make environments.
const PROBE: &str = "import ensurepip, sys, venv; print(sys.version_info[1])";

/// Returns the Pythons at hand by their minor versions: those on the PATH, and those of pyenv.
pub fn pythons() -> BTreeMap<u32, PathBuf> {
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

/// Returns the Python of the environment that the tests share: the newest at hand, with everything that they import.
pub fn newest_python() -> PathBuf {
    let (_, interpreter) = pythons().pop_last().expect("a Python with venv: install python3-venv");
    let package = ["host/python/tests/requirements.txt", "host/python/tests/requirements-newest.txt"];
    environment(&interpreter, &[&package[..], &["tests/requirements.txt"]].concat())
}

/// Returns a command that runs a program of an environment, and compiles the modules that it imports once for all runs. It
/// gives way to tests that run in real time, because it may compute on all cores.
pub fn command(program: &Path) -> Command {
    let mut command = Command::new("nice");
    command
        .args(["-n", "10"])
        .arg(program)
        .env_remove("PYTHONDONTWRITEBYTECODE")
        .env("PYTHONPYCACHEPREFIX", repository().join("target/tmp/python-cache"));
    command
}

/// Returns the Python of a virtual environment, made by `interpreter` with the packages in these files of the repository. It
/// is kept between runs.
pub fn environment(interpreter: &Path, requirements: &[&str]) -> PathBuf {
    let files = requirements.iter().map(|name| repository().join(name));
    let wanted: String = files.clone().map(|file| std::fs::read_to_string(file).expect("requirements")).collect();
    let folder = repository().join("target/tmp");
    std::fs::create_dir_all(&folder).expect("a folder for environments");
    let venv = folder.join(format!("python-{}", requirements.len()));
    // Tests of one program run at the same time: the first that comes makes the environment, the others wait for it.
    let lock = File::create(venv.with_extension("lock")).expect("the lock of an environment");
    lock.lock().expect("the lock of an environment");
    let python = venv.join("bin/python");
    let ready = venv.join("ready");
    if std::fs::read_to_string(&ready).is_ok_and(|installed| installed == wanted) {
        return python;
    }
    let run = |command: &mut Command| assert!(command.status().expect("Python").success(), "{command:?}");
    run(Command::new(interpreter).args(["-m", "venv", "--clear"]).arg(&venv));
    let named = files.flat_map(|file| ["-r".into(), file]);
    run(Command::new(&python)
        .args(["-m", "pip", "install", "-q", "-r"])
        .arg(repository().join("tests/requirements-uv.txt")));
    // uv takes a third of the time of pip. The certificates of the system, as pip.
    run(Command::new(&python)
        .args(["-m", "uv", "pip", "install", "-q", "--native-tls", "--python"])
        .arg(&python)
        .args(named));
    std::fs::write(ready, wanted).expect("an environment");
    python
}
