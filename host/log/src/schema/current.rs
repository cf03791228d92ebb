//! The generated types and descriptors are those of the files in `proto`.

use prost_types::FileDescriptorSet;
use std::fs;
use std::path::{Path, PathBuf};

const SCHEMAS: [&str; 4] =
    ["biflag.proto", "foxglove/FrameTransform.proto", "foxglove/SceneUpdate.proto", "foxglove/PointCloud.proto"];

/// Compiles the schemas, in Rust alone: to Rust types, and to the descriptors that every log carries.
fn generate(folder: &Path) {
    let proto = Path::new(env!("CARGO_MANIFEST_DIR")).join("proto");
    let compile = |schemas: &[&str]| -> FileDescriptorSet { protox::compile(schemas, [&proto]).unwrap() };
    for schema in SCHEMAS {
        let stem = Path::new(schema).file_stem().unwrap();
        let descriptors = prost::Message::encode_to_vec(&compile(&[schema]));
        fs::write(folder.join(stem).with_extension("binpb"), descriptors).unwrap();
    }
    prost_build::Config::new()
        .out_dir(folder)
        // The generated code has the comments of the .proto files, but not on every field.
        .type_attribute(".", "#[allow(missing_docs)]")
        .compile_fds(compile(&SCHEMAS))
        .unwrap();
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<_> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

#[test]
fn schema_is_that_of_the_proto_files() {
    let checked_in = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/schema/generated");
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
