//! Notes the commit that the program is built from, as `BIFLAG_GIT_HASH`.

use std::process::Command;

fn main() {
    for path in ["build.rs", "src"] {
        println!("cargo::rerun-if-changed={path}");
    }
    println!("cargo::rustc-env=BIFLAG_GIT_HASH={}", git_hash());
}

/// The commit, with `-dirty` where the tree has changes; `unknown` outside of a repository.
fn git_hash() -> String {
    let git = |args: &[&str]| {
        let output = Command::new("git").args(args).output().ok().filter(|output| output.status.success())?;
        String::from_utf8(output.stdout).ok()
    };
    // This file changes with every commit and every change of branch.
    if let Some(file) = git(&["rev-parse", "--git-path", "logs/HEAD"]) {
        println!("cargo::rerun-if-changed={}", file.trim());
    }
    let Some(hash) = git(&["rev-parse", "--short=8", "HEAD"]) else {
        return "unknown".to_owned();
    };
    let dirty = git(&["--no-optional-locks", "status", "--porcelain", "--untracked-files=no"])
        .is_none_or(|status| !status.is_empty());
    format!("{}{}", hash.trim(), if dirty { "-dirty" } else { "" })
}
