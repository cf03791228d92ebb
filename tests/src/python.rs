//! Virtual environments of Python.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Returns the Python of the virtual environment `venv`, made by `interpreter` with these packages, which is kept between
/// runs.
pub fn python(venv: &Path, interpreter: &Path, packages: &[&str]) -> PathBuf {
    // Tests of one program run at the same time: the first that comes makes the environment, the others wait for it.
    let lock = File::create(venv.with_extension("lock")).expect("the lock of an environment");
    lock.lock().expect("the lock of an environment");
    let python = venv.join("bin/python");
    let ready = venv.join("ready");
    let wanted = packages.join("\n");
    if std::fs::read_to_string(&ready).is_ok_and(|installed| installed == wanted) {
        return python;
    }
    let run = |command: &mut Command| assert!(command.status().expect("Python").success(), "{command:?}");
    run(Command::new(interpreter).args(["-m", "venv", "--clear"]).arg(venv));
    run(Command::new(&python).args(["-m", "pip", "install", "-q"]).args(packages));
    std::fs::write(ready, wanted).expect("an environment");
    python
}
