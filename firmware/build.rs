//! Gives the image the commit that it is built from: `BIFLAG_GIT_HASH`, eight hexadecimal digits, zeros if it is not
//! known, and `BIFLAG_GIT_DIRTY`, `1` if the sources of the image differ from that commit.

use std::path::Path;
use std::process::Command;

/// The sources of the image, relative to the root of the repository.
const INPUTS: [&str; 4] = ["firmware", "protocol", "Cargo.toml", "Cargo.lock"];

fn main() {
    for input in INPUTS {
        println!("cargo::rerun-if-changed=../{input}");
    }
    // Every commit and every checkout is written to the log of HEAD.
    if let Some(log) = git(&["rev-parse", "--git-path", "logs/HEAD"]).map(|log| Path::new("..").join(log))
        && log.exists()
    {
        println!("cargo::rerun-if-changed={}", log.display());
    }
    let hash = git(&["rev-parse", "HEAD"]).and_then(|hash| hash.get(..8).map(str::to_owned));
    let changes = git(&[&["status", "--porcelain", "--"], INPUTS.as_slice()].concat());
    println!("cargo::rustc-env=BIFLAG_GIT_HASH={}", hash.as_deref().unwrap_or("00000000"));
    println!("cargo::rustc-env=BIFLAG_GIT_DIRTY={}", u8::from(changes.is_some_and(|changes| !changes.is_empty())));
}

/// Returns the output of `git` at the root of the repository, without its last newline.
fn git(arguments: &[&str]) -> Option<String> {
    // Without this, `status` rewrites the index, which others may be using.
    let output = Command::new("git").arg("--no-optional-locks").args(arguments).current_dir("..").output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim_end().to_owned())
}
