//! Python and the virtual environments of the tests.

use crate::repository;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Returns the Python of the tests' shared environment: the newest one available, with everything that they import.
pub fn newest_python() -> PathBuf {
    environment("newest")
}

/// Returns the Python of an environment with the oldest one available, and the packages that `biflag` itself needs.
pub fn oldest_python() -> PathBuf {
    environment("oldest")
}

/// Returns the Python of an environment that `tests/python.sh` makes, and keeps between runs.
fn environment(which: &str) -> PathBuf {
    let script = repository().join("tests/python.sh");
    let output = Command::new("sh").arg(script).arg(which).stderr(Stdio::inherit()).output().expect("a shell");
    assert!(output.status.success(), "there is no environment of Python");
    String::from_utf8(output.stdout).expect("a path").trim_end().into()
}

/// Returns a command that runs a program of an environment, and compiles the modules that it imports once for all runs.
pub fn command(program: &Path) -> Command {
    let mut command = Command::new(program);
    command
        .env_remove("PYTHONDONTWRITEBYTECODE")
        .env("PYTHONPYCACHEPREFIX", repository().join("target/tmp/python-cache"));
    command
}
