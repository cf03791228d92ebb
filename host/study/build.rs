//! Puts into the library what it needs outside of the repository: the commit that it is built from (`BIFLAG_GIT_HASH`), and
//! the plans and robot files.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

const PLANS: &str = "../plans";

/// Where a change of the numbers or of the logs can come from; it makes the commit `-dirty`.
const SOURCES: [&str; 4] = ["src", "../log/src", "../../sim/src", "../../protocol/src"];

fn main() {
    for path in ["build.rs", PLANS].iter().chain(&SOURCES) {
        println!("cargo::rerun-if-changed={path}");
    }
    println!("cargo::rustc-env=BIFLAG_GIT_HASH={}", git_hash());
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    fs::write(out.join("shipped.rs"), shipped(Path::new(PLANS))).expect("OUT_DIR can be written");
}

/// Returns the files of a folder as a Rust list of names, without `.toml`, and contents.
fn shipped(folder: &Path) -> String {
    let entries = fs::read_dir(folder).expect("the folder of the plans").map(|entry| entry.expect("a file").path());
    let mut files: Vec<PathBuf> = entries.filter(|path| path.extension().is_some_and(|kind| kind == "toml")).collect();
    files.sort();
    let mut list = String::from("&[");
    for file in files {
        let path = fs::canonicalize(&file).expect("a file");
        let name = file.file_stem().expect("a name");
        write!(list, "({name:?}, include_str!({path:?})), ").expect("text");
    }
    list + "]"
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
