//! Compiles the schemas of the log, in Rust alone: to Rust types, and to the descriptors that every log carries.

use prost::Message;
use std::error::Error;
use std::path::{Path, PathBuf};

const SCHEMAS: [&str; 4] =
    ["biflag.proto", "foxglove/FrameTransform.proto", "foxglove/SceneUpdate.proto", "foxglove/PointCloud.proto"];

fn main() -> Result<(), Box<dyn Error>> {
    for path in ["build.rs", "proto"] {
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
    Ok(())
}
