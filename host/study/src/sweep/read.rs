//! Reads tables of steady states: tables of sweeps, and others with the same columns.

use super::SweepError;
use crate::export::parquet;
use crate::export::table::{Column, Table, Values};
use std::fs::File;
use std::path::Path;

/// The column that every table of a sweep has.
const POINT: &str = "point";

/// Reads the table of a sweep, Parquet or CSV. All numbers from a CSV are real.
///
/// # Errors
/// [`SweepError::Table`].
pub fn read_table(path: &Path) -> Result<Table, SweepError> {
    let wrong = |reason: String| SweepError::Table { path: path.to_owned(), reason };
    let table = columns_of(path).map_err(wrong)?;
    let has_points = table.columns.iter().any(|column| column.name == POINT);
    has_points.then_some(table).ok_or_else(|| wrong(format!("it has no column {POINT}")))
}

/// Reads any table, Parquet or CSV.
///
/// # Errors
/// Why it cannot be read.
pub fn columns_of(path: &Path) -> Result<Table, String> {
    let is_parquet = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("parquet"));
    if !is_parquet {
        return of_csv(&std::fs::read_to_string(path).map_err(|error| error.to_string())?);
    }
    let mut table = parquet::read(File::open(path).map_err(|error| error.to_string())?)?;
    let names: Vec<_> = table.columns.iter().map(|column| column.name.clone()).collect();
    table.header.retain(|line| names.iter().all(|name| described(line, name).is_none()));
    Ok(table)
}

/// Returns the table in the text of a CSV. Its comments state the units; a column without a comment is numeric if all
/// its values are numbers.
///
/// # Errors
/// Why it cannot be read.
pub fn of_csv(text: &str) -> Result<Table, String> {
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(text.as_bytes());
    let names = reader.headers().map_err(|error| error.to_string())?.clone();
    let mut cells = vec![Vec::new(); names.len()];
    for record in reader.records() {
        let record = record.map_err(|error| error.to_string())?;
        cells.iter_mut().zip(&record).for_each(|(column, cell)| column.push(cell.to_owned()));
    }
    let mut header: Vec<&str> = text.lines().map_while(|line| line.strip_prefix("# ")).collect();
    let columns = names.iter().zip(cells).map(|(name, cells)| {
        let at = header.iter().position(|line| described(line, name).is_some());
        let line = at.map(|at| header.remove(at));
        let about = line.and_then(|line| described(line, name));
        let is_number = match about {
            Some((unit, _)) => !unit.is_empty(),
            None => cells.iter().all(|cell| cell.is_empty() || cell.parse::<f64>().is_ok()),
        };
        let numbers = || cells.iter().map(|cell| cell.parse().unwrap_or(f64::NAN)).collect();
        let values = if is_number { Values::Exact(numbers()) } else { Values::Text(cells) };
        let (unit, about) = about.unwrap_or_default();
        Column { name: name.to_owned().into(), unit: unit.to_owned().into(), about: about.to_owned().into(), values }
    });
    let columns = columns.collect();
    Ok(Table { header: header.into_iter().map(str::to_owned).collect(), columns })
}

/// Returns the unit and the description of a column from a comment.
fn described<'a>(comment: &'a str, name: &str) -> Option<(&'a str, &'a str)> {
    let rest = comment.strip_prefix(name)?;
    match rest.strip_prefix(" [") {
        Some(rest) => rest.split_once("]: "),
        None => rest.strip_prefix(": ").map(|about| ("", about)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_read_as_they_were_written() {
        let column = |name: &'static str, unit: &'static str, values| Column {
            name: name.into(),
            unit: unit.into(),
            about: "what: it [is]".into(),
            values,
        };
        let table = Table {
            header: vec!["biflag 1: sweep test".to_owned()],
            columns: vec![
                // Names that look like numbers.
                column("point", "", Values::Text(vec!["12e4".to_owned(), "77".to_owned()])),
                column("yaw_deg", "deg", Values::Exact(vec![0.1 + 0.2, -1e-300])),
                column("phases", "1", Values::Int(vec![4, 1])),
                column("reason", "", Values::Text(vec![String::new(); 2])),
            ],
        };
        let folder = tempfile::tempdir().unwrap();
        let (text, binary) = (folder.path().join("table.csv"), folder.path().join("table.parquet"));
        crate::export::csv::Writer::new(&table, File::create(&text).unwrap())
            .and_then(|mut csv| csv.rows(&table).and(csv.close()))
            .unwrap();
        let mut writer = parquet::Writer::new(&table, File::create(&binary).unwrap()).unwrap();
        writer.rows(&table).unwrap();
        writer.close().unwrap();
        assert_eq!(read_table(&binary).unwrap(), table);
        let mut real = table;
        real.columns[2].values = Values::Exact(vec![4.0, 1.0]);
        assert_eq!(read_table(&text).unwrap(), real);
    }

    #[test]
    fn without_comments_numbers_are_told_by_their_values() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table.csv");
        std::fs::write(&path, "w1_rpm,yaw_deg,status\n1,,ok\n2,-0.5,ok\n").unwrap();
        let table = columns_of(&path).unwrap();
        let Values::Exact(yaw) = &table.columns[1].values else { panic!("{table:?}") };
        assert!(yaw[0].is_nan() && yaw[1] == -0.5);
        assert_eq!(table.columns[2].values, Values::Text(vec!["ok".to_owned(); 2]));
        let error = read_table(&path).unwrap_err().to_string();
        assert!(error.ends_with("table.csv: the table cannot be read: it has no column point"), "{error}");
    }
}
