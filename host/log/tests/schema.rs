//! Checks that the generated types and descriptors match the files in `proto`.
//!
//! Their generator takes longer to compile than the rest of this crate, so it is only part of the feature `generate`.

use sha2::{Digest, Sha256};
use std::fmt::Write;
use std::fs;
use std::path::Path;

const SCHEMAS: [&str; 4] =
    ["biflag.proto", "foxglove/FrameTransform.proto", "foxglove/SceneUpdate.proto", "foxglove/PointCloud.proto"];

/// Hashes of the files from which the code was generated.
const SOURCES: &str = "sources.sha256";

fn crate_folder() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Returns a line for each file in `proto`, as `sha256sum` prints them.
fn sources() -> String {
    let mut lines = String::new();
    for schema in SCHEMAS {
        let text = fs::read(crate_folder().join("proto").join(schema)).unwrap();
        for byte in Sha256::digest(text) {
            write!(lines, "{byte:02x}").unwrap();
        }
        writeln!(lines, "  {schema}").unwrap();
    }
    lines
}

#[test]
fn schema_was_generated_from_the_proto_files_of_today() {
    let recorded = fs::read_to_string(crate_folder().join("src/schema/generated").join(SOURCES)).unwrap();
    let how = "BIFLAG_WRITE_GOLDEN=1 cargo test --release -p biflag-log --features generate schema";
    assert_eq!(recorded, sources(), "a file in `proto` has changed; write the generated files again: {how}");
}

#[cfg(feature = "generate")]
mod generator {
    use super::{SCHEMAS, SOURCES, crate_folder, sources};
    use prost_types::FileDescriptorSet;
    use std::fs;
    use std::path::{Path, PathBuf};

    /// What a scene can also hold, and the robot's does not: there is no type of these, and a message that has some is read
    /// without them.
    const UNUSED: [&str; 8] = [
        "ArrowPrimitive",
        "CubePrimitive",
        "KeyValuePair",
        "ModelPrimitive",
        "SceneEntityDeletion",
        "SpherePrimitive",
        "TextPrimitive",
        "TriangleListPrimitive",
    ];

    /// Compiles the schemas, without external tools, to Rust types and to the descriptors in every log.
    fn generate(folder: &Path) {
        let proto = crate_folder().join("proto");
        let compile = |schemas: &[&str]| -> FileDescriptorSet { protox::compile(schemas, [&proto]).unwrap() };
        for schema in SCHEMAS {
            let stem = Path::new(schema).file_stem().unwrap();
            let descriptors = prost::Message::encode_to_vec(&compile(&[schema]));
            fs::write(folder.join(stem).with_extension("binpb"), descriptors).unwrap();
        }
        let mut config = prost_build::Config::new();
        for name in UNUSED {
            config.extern_path(format!(".foxglove.{name}"), "()");
        }
        config.out_dir(folder).compile_fds(compile(&SCHEMAS)).unwrap();
        for file in files(folder).iter().filter(|file| file.extension() == Some("rs".as_ref())) {
            fs::write(file, without_names(&fs::read_to_string(file).unwrap())).unwrap();
        }
        fs::write(folder.join(SOURCES), sources()).unwrap();
    }

    /// Leaves out the functions that give the name of a value, or find it by its name: logs have numbers.
    fn without_names(code: &str) -> String {
        let mut end_of_functions = None;
        let is_kept = |line: &&str| {
            let indent = &line[..line.len() - line.trim_start().len()];
            if line.trim_start().starts_with("impl ") {
                end_of_functions = Some(format!("{indent}}}\n"));
            }
            let is_kept = end_of_functions.is_none();
            end_of_functions.take_if(|end| end == *line);
            is_kept
        };
        code.split_inclusive('\n').filter(is_kept).collect()
    }

    fn files(folder: &Path) -> Vec<PathBuf> {
        let mut files: Vec<_> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
        files.sort();
        files
    }

    #[test]
    fn schema_is_that_of_the_proto_files() {
        let checked_in = crate_folder().join("src/schema/generated");
        if std::env::var_os("BIFLAG_WRITE_GOLDEN").is_some() {
            generate(&checked_in);
        }
        let folder = tempfile::tempdir().unwrap();
        generate(folder.path());
        let names = |folder| files(folder).iter().map(|file| file.file_name().unwrap().to_owned()).collect::<Vec<_>>();
        assert_eq!(names(folder.path()), names(&checked_in));
        for file in files(folder.path()) {
            let ours = checked_in.join(file.file_name().unwrap());
            assert!(fs::read(&file).unwrap() == fs::read(&ours).unwrap(), "{} is not current", ours.display());
        }
    }
}
