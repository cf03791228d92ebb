//! Columns of tables: names, units, types and order, and the metadata.

use parquet::file::reader::{FileReader, SerializedFileReader};
use serde_json::Value;
use std::fmt::Write;
use std::fs::{self, File};
use std::path::Path;
use tests::Bench;
use tests::golden::hold;

/// The tables of CSV, and those of Parquet beside them.
const TABLES: [(&str, Option<&str>); 7] = [
    ("log.csv", Some("log.parquet")),
    ("model.csv", None),
    ("imported.csv", None),
    ("tables/trials.csv", Some("parquet/trials.parquet")),
    ("tables/budget.csv", Some("parquet/budget.parquet")),
    ("sweep/table.csv", Some("sweep/table.parquet")),
    ("sweep/cost.csv", None),
];

/// Compares the columns of the tables in a folder.
pub fn check(bench: &Bench) {
    let mut text = String::new();
    for (csv, parquet) in TABLES {
        let _ = write!(text, "# {csv}\n{}\n", of_csv(&bench.path().join(csv)));
        if let Some(name) = parquet {
            let _ = write!(text, "# {name}\n{}\n", of_parquet(&bench.path().join(name), &bench.path().join(csv)));
        }
    }
    hold("columns", &text);
}

fn is_commit(text: &str) -> bool {
    let hash = text.trim_end_matches("-dirty");
    hash.len() == 8 && hash.bytes().all(|byte| byte.is_ascii_hexdigit())
}

/// Replaces what depends on the program's version, and hashes of files.
fn fixed(line: &str) -> String {
    // The program may be of another commit than this test.
    let line = match line.split_once(" (").and_then(|(before, rest)| Some((before, rest.split_once(')')?))) {
        Some((before, (commit, after))) if is_commit(commit) => format!("{before}{after}"),
        _ => line.to_owned(),
    };
    let line = line.replace(env!("CARGO_PKG_VERSION"), "VERSION");
    let is_hash = |word: &str| word.len() == 64 && word.bytes().all(|byte| byte.is_ascii_hexdigit());
    let words = line.split(' ').map(|word| if is_hash(word.trim_end_matches(':')) { "HASH" } else { word });
    words.collect::<Vec<_>>().join(" ")
}

fn of_csv(path: &Path) -> String {
    let content = fs::read_to_string(path).unwrap();
    let (header, rows): (Vec<&str>, Vec<&str>) = content.lines().partition(|line| line.starts_with('#'));
    let header: String = header.into_iter().map(|line| fixed(line.trim_start_matches("# ")) + "\n").collect();
    format!("{header}columns: {}\n", rows[0].replace(',', " "))
}

/// Returns the header of a CSV file without units, as Parquet has it.
fn header(csv: &Path) -> Vec<String> {
    let content = fs::read_to_string(csv).unwrap();
    let lines = content.lines().map_while(|line| line.strip_prefix("# "));
    let without_unit = |line: &str| match line.split_once(" [") {
        Some((name, rest)) if !name.contains(' ') => format!("{name}:{}", rest.split_once("]:").unwrap().1),
        _ => line.to_owned(),
    };
    lines.map(without_unit).collect()
}

/// Returns the columns, and of the descriptions those that the CSV beside it has not.
fn of_parquet(path: &Path, csv: &Path) -> String {
    let reader = SerializedFileReader::new(File::open(path).unwrap()).unwrap();
    let meta = reader.metadata().file_metadata();
    let mut text = format!("schema: {}\n", meta.schema_descr().root_schema().name());
    let columns = meta.schema_descr().columns().iter().map(|column| {
        let info = column.self_type().get_basic_info();
        let logical = info.logical_type_ref().map_or(String::new(), |kind| format!(" {kind:?}"));
        format!("{}: {:?}{logical} {:?}\n", column.name(), column.physical_type(), info.repetition())
    });
    text.extend(columns);
    let header = header(csv);
    for entry in meta.key_value_metadata().unwrap() {
        let value = entry.value.as_deref().unwrap_or_default();
        if let Ok(Value::Object(columns)) = serde_json::from_str(value) {
            let _ = writeln!(text, "metadata `{}`:", entry.key);
            for (name, about) in columns {
                assert_eq!(about.as_object().unwrap().len(), 2, "{about}");
                let is_of_csv = header.contains(&format!("{name}: {}", about["about"].as_str().unwrap()));
                let about_it = if is_of_csv { "as in CSV" } else { about["about"].as_str().unwrap() };
                let _ = writeln!(text, "  {name} [{}]: {about_it}", about["unit"].as_str().unwrap());
            }
        } else {
            let others: String = value
                .lines()
                .filter(|line| !header.iter().any(|of| of == line))
                .map(|line| format!("  {}\n", fixed(line)))
                .collect();
            let _ = write!(
                text,
                "metadata `{}`: {} lines, others than in CSV:\n{others}",
                entry.key,
                value.lines().count()
            );
        }
    }
    text
}
