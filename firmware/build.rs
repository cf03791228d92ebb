//! Tells the image which commit it is built from: `BIFLAG_GIT_HASH`, eight hexadecimal digits, zeros where it is not
//! known, and `BIFLAG_GIT_DIRTY`, `1` where what the image is made of differs from that commit.

use std::path::Path;
use std::process::Command;

/// What the image is made of, seen from the root of the repository.
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

/// What `git` answers at the root of the repository, without its last newline.
fn git(arguments: &[&str]) -> Option<String> {
    // Without this, `status` rewrites the index behind the back of whoever else works in the tree.
    let output = Command::new("git").arg("--no-optional-locks").args(arguments).current_dir("..").output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim_end().to_owned())
}
