//! The page of a sweep's table: a map of one result over two inputs, with a slider for each other input.
//!
//! An input is a column of numbers before the first result that does not follow from the inputs before it. A table also
//! has columns that follow from its inputs, such as lengths from groups.

use super::ReportError;
use super::budget::DATA_BYTES;
use super::table::single;
use super::text::{clip, count, json_for_script};
use super::{Written, document, put};
use crate::export::table::Table;
use crate::sweep;
use maud::{Markup, PreEscaped, html};
use serde_json::{Value, json};
use std::collections::HashSet;
use std::path::Path;

/// The first column of results; all numbers before it may be inputs.
const FIRST_RESULT: &str = "yaw_deg";

/// A column of numbers; NaN where there is none.
#[derive(Clone, PartialEq, Debug)]
struct Column {
    name: String,
    values: Vec<f64>,
}

/// Returns whether the extension of a path is that of a table.
pub(super) fn is_table(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "parquet" || extension == "csv")
}

/// Writes the page of a table.
///
/// # Errors
/// [`ReportError::Table`] if the file is not a table with two inputs and a result.
pub(super) fn write(path: &Path, out: &Path) -> Result<Written, ReportError> {
    let wrong = |reason: String| ReportError::Table { path: path.to_owned(), reason };
    let columns = numeric(sweep::columns_of(path).map_err(wrong)?);
    let at = columns.iter().position(|column| column.name == FIRST_RESULT);
    let at = at.ok_or_else(|| wrong(format!("it has no column {FIRST_RESULT}")))?;
    let (before, results) = columns.split_at(at);
    let inputs = inputs(before);
    if inputs.len() < 2 {
        return Err(wrong("fewer than two inputs vary".to_owned()));
    }
    let rows = results[0].values.len();
    // Four bytes a number are five and a third of text.
    let most = DATA_BYTES * 3 / 16 / (inputs.len() + results.len());
    let every = rows.div_ceil(most).max(1);
    let title = path.file_stem().unwrap_or_default().to_string_lossy();
    let names = |columns: &[&Column]| columns.iter().map(|column| column.name.clone()).collect::<Vec<_>>();
    let results: Vec<&Column> = results.iter().collect();
    let body = body(&title, rows, every, &names(&inputs), &names(&results));
    let page = |columns: &[&Column]| -> Vec<Value> {
        let one = |column: &&Column| {
            let values: Vec<f64> = column.values.iter().step_by(every).copied().collect();
            json!({ "name": column.name, "values": single(&values) })
        };
        columns.iter().map(one).collect()
    };
    let data = json!({ "inputs": page(&inputs), "results": page(&results) });
    let data = html! { script type="application/json" id="sweep-data" { (PreEscaped(json_for_script(&data))) } };
    put(out, &document::page(&clip(&title, 200), "one", &body, &data), rows, 0)
}

fn body(title: &str, rows: usize, every: usize, inputs: &[String], results: &[String]) -> Markup {
    let choice = |name: &str, label: &str, columns: &[String], first: usize| {
        html! {
            label { (label) " " select name=(name) {
                @for (i, column) in columns.iter().enumerate() { option value=(column) selected[i == first] { (column) } }
            } }
        }
    };
    html! {
        main {
            h1 { (clip(title, 200)) }
            p.meta {
                span { "table of a sweep with " (count(rows, "point", "points")) }
                span { (count(inputs.len(), "input", "inputs")) ": " (inputs.join(", ")) }
                @if every > 1 { span { "the page shows one of every " (every) " points" } }
            }
            section.sweep data-data="sweep-data" {
                div.choices {
                    (choice("value", "Result", results, 0))
                    (choice("x", "Horizontal axis", inputs, 0))
                    (choice("y", "Vertical axis", inputs, 1))
                }
                div.sliders {}
                h2.unseen { "Map" }
                div.maps { figure { div.head { h3 { "Map" } } svg viewBox="0 0 760 520" role="img" aria-label="Map" {} figcaption {} } }
            }
        }
        footer { p { "Written by " (document::GENERATOR) " (" (crate::program::GIT_HASH) ")." } }
    }
}

/// Returns the columns that distinguish points which the columns before them do not distinguish.
fn inputs(columns: &[Column]) -> Vec<&Column> {
    let mut chosen: Vec<&Column> = Vec::new();
    let mut told = 1;
    for column in columns {
        let rows = column.values.len();
        // Seven digits: results of the same inputs may differ in their last digits.
        let point = |i: usize| -> Vec<u32> {
            chosen.iter().chain([&column]).map(|column| (column.values[i] as f32).to_bits()).collect()
        };
        let distinct = (0..rows).map(point).collect::<HashSet<_>>().len();
        if distinct > told {
            told = distinct;
            chosen.push(column);
        }
    }
    chosen
}

/// Returns the columns that are numbers; a text that is none becomes NaN, and a column of texts is left out.
fn numeric(table: Table) -> Vec<Column> {
    let finite = |value: f64| if value.is_finite() { value } else { f64::NAN };
    let columns = table.columns.into_iter().map(|column| Column {
        values: column.values.numbers().into_iter().map(finite).collect(),
        name: column.name.into_owned(),
    });
    columns.filter(|column| column.values.iter().any(|value| value.is_finite())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two speeds, a length, and a group that follows from the length.
    const TABLE: &str = "# biflag: sweep\npoint,w1_rpm,w2_rpm,length_m,group,same,yaw_deg,tilt_deg,status\n\
                         a,0,10,0.1,1,3,5,1,ok\nb,10,10,0.1,1,3,6,2,ok\nc,0,20,0.1,1,3,7,3,ok\nd,10,20,0.1,1,3,,,failed\n\
                         e,0,10,0.2,2,3,8,1,ok\nf,10,10,0.2,2,3,9,2,ok\ng,0,20,0.2,2,3,7,3,ok\nh,10,20,0.2,2,3,<i>,4,ok\n";

    #[test]
    fn inputs_are_what_varies_by_itself() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sweep.csv");
        std::fs::write(&path, TABLE).unwrap();
        let columns = numeric(sweep::columns_of(&path).unwrap());
        let names: Vec<_> = columns.iter().map(|column| column.name.as_str()).collect();
        assert_eq!(names, ["w1_rpm", "w2_rpm", "length_m", "group", "same", "yaw_deg", "tilt_deg"]);
        let chosen: Vec<_> = inputs(&columns[..5]).iter().map(|column| column.name.as_str()).collect();
        assert_eq!(chosen, ["w1_rpm", "w2_rpm", "length_m"]);
        assert!(columns[5].values[3].is_nan() && columns[5].values[7].is_nan());

        let page = folder.path().join("sweep.html");
        let written = write(&path, &page).unwrap();
        assert_eq!((written.trials, written.html.as_path()), (8, page.as_path()));
        let text = std::fs::read_to_string(&page).unwrap();
        assert!(text.contains("3 inputs: w1_rpm, w2_rpm, length_m") && text.contains("<option value=\"tilt_deg\">"));
        for (broken, reason) in
            [("x,y\n1,2\n", "no column yaw_deg"), ("a,yaw_deg\n1,2\n2,3\n", "fewer than two inputs")]
        {
            std::fs::write(&path, broken).unwrap();
            let error = write(&path, &page).unwrap_err().to_string();
            assert!(error.contains(reason), "{error}");
        }
    }
}
