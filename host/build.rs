//! Compiles the schemas of the log, in Rust alone: to Rust types, and to the descriptors that every log carries. Also
//! notes the commit that the program is built from.

use prost::Message;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::Command;

const SCHEMAS: [&str; 4] =
    ["biflag.proto", "foxglove/FrameTransform.proto", "foxglove/SceneUpdate.proto", "foxglove/PointCloud.proto"];

fn main() -> Result<(), Box<dyn Error>> {
    for path in ["build.rs", "proto", "src"] {
        println!("cargo::rerun-if-changed={path}");
    }
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    for schema in SCHEMAS {
        let set = protox::compile([schema], ["proto"])?;
        let stem = Path::new(schema).file_stem().ok_or("a schema has no name")?;
        std::fs::write(out.join(stem).with_extension("binpb"), set.encode_to_vec())?;
    }
    prost_build::Config::new()
        .include_file("schemas.rs")
        // The generated code has the comments of the .proto files, but not on every field.
        .type_attribute(".", "#[allow(missing_docs)]")
        .compile_fds(protox::compile(SCHEMAS, ["proto"])?)?;
    println!("cargo::rustc-env=BIFLAG_GIT_HASH={}", git_hash());
    Ok(())
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
