//! The page of a sweep's table: a map of one result over two inputs, with a slider for each other input.
//!
//! Inputs are the speeds, and the keys of the robot's file or the groups that vary. In other tables an input is a column of
//! numbers before the first result that does not follow from the inputs before it: a table also has columns that follow
//! from its inputs, such as lengths from groups.

use super::ReportError;
use super::budget::DATA_BYTES;
use super::table::single;
use super::text::{clip, count, json_for_script};
use super::{Counts, Written, document, put};
use maud::{Markup, PreEscaped, html};
use serde_json::{Value, json};
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use study::export::table::{self, Table, Values};
use study::sweep;

/// The first column of results; all numbers before it may be inputs.
const FIRST_RESULT: &str = "yaw_deg";

/// A column of numbers; NaN where there is none.
#[derive(Clone, PartialEq, Debug)]
struct Column {
    name: String,
    unit: String,
    about: String,
    kind: Kind,
    values: Vec<f64>,
}

impl Column {
    /// Returns the quantity in words, with its unit: `speed of flagellum 1 (w1), rpm`.
    fn label(&self) -> String {
        let words = match self.name.as_str() {
            "w1_rpm" => "speed of flagellum 1 (w1)".to_owned(),
            "w2_rpm" => "speed of flagellum 2 (w2)".to_owned(),
            name => without_unit(name).replace('_', " "),
        };
        let unit = match self.unit.as_str() {
            "deg" => "°",
            "N m" => "N·m",
            unit => unit,
        };
        if unit.is_empty() || unit == "1" { words } else { format!("{words}, {unit}") }
    }
}

/// Returns the name of a column without the unit at its end.
fn without_unit(name: &str) -> &str {
    let units = ["_deg", "_rpm", "_nm_per_rad", "_nm2", "_nm", "_pa_s", "_pa", "_n", "_m", "_s"];
    units.iter().find_map(|unit| name.strip_suffix(unit)).unwrap_or(name)
}

/// What is known about the steady state of a point, as the page's script reads it: the index.
const STATES: [&str; 5] = ["steady", "beating", "unstable", "two_motions", "not_found"];

/// What a column before the results is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Kind {
    Speed,
    /// A key of the robot's file that varies.
    Key,
    /// A group over that of the robot `published`.
    Group,
    Other,
}

impl Kind {
    fn of(column: &table::Column) -> Self {
        let name = column.name.as_ref();
        if column.about == sweep::VARIES {
            Self::Key
        } else if name == "w1_rpm" || name == "w2_rpm" {
            Self::Speed
        } else if name.starts_with("group_") && name.ends_with("_relative") {
            Self::Group
        } else {
            Self::Other
        }
    }
}

/// Returns the table of a sweep: the file itself, or that in the folder of a sweep; `None` for anything else.
pub(super) fn table_of(path: &Path) -> Option<PathBuf> {
    let is_table = path.extension().is_some_and(|extension| extension == "parquet" || extension == "csv");
    match path.is_dir() {
        true => sweep::is_folder(path).then(|| sweep::parquet_path(path)),
        false => is_table.then(|| path.to_owned()),
    }
}

/// Writes the page of a table.
///
/// # Errors
/// [`ReportError::Table`] if the file is not a table with two inputs and a result.
pub(super) fn write(path: &Path, out: &Path) -> Result<Written, ReportError> {
    let wrong = |reason: String| ReportError::Table { path: path.to_owned(), reason };
    let table = sweep::columns_of(path).map_err(wrong)?;
    let (header, states) = (table.header.clone(), states(&table));
    let columns = numeric(table);
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
    let results: Vec<&Column> = results.iter().collect();
    let about = About { path, header: &header, rows, every };
    let page = |columns: &[&Column]| -> Vec<Value> {
        let one = |column: &&Column| {
            let values: Vec<f64> = column.values.iter().step_by(every).copied().collect();
            json!({ "name": column.name, "label": column.label(), "about": column.about, "values": single(&values) })
        };
        columns.iter().map(one).collect()
    };
    let states: Vec<i64> = states.into_iter().step_by(every).collect();
    let data = json!({ "inputs": page(&inputs), "results": page(&results), "states": states });
    let data = html! { script type="application/json" id="sweep-data" { (PreEscaped(json_for_script(&data))) } };
    put(
        out,
        &document::page(&clip(&about.title(), 200), "one", &body(&about, &inputs, &results), &data),
        Counts { trials: rows, warnings: 0, is_sound: true },
        Vec::new(),
    )
}

/// Returns the index in [`STATES`] of each row's steady state; -1 where the point failed or the table does not say.
fn states(table: &Table) -> Vec<i64> {
    let kinds = table.columns.iter().find(|column| column.name == "kind").map(|column| &column.values);
    let index = |kind: &String| STATES.iter().position(|state| state == kind).map_or(-1, |i| i as i64);
    match kinds {
        Some(Values::Text(kinds)) => kinds.iter().map(index).collect(),
        _ => vec![-1; table.rows()],
    }
}

/// Where the table comes from.
struct About<'a> {
    path: &'a Path,
    header: &'a [String],
    rows: usize,
    /// The page shows one of so many points.
    every: usize,
}

impl About<'_> {
    /// Returns the name of the sweep if the table says it, otherwise that of the file.
    fn title(&self) -> String {
        let named = self.header.iter().find_map(|line| line.strip_prefix("biflag sweep ")?.split(", version").next());
        let file = || self.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        named.map_or_else(file, str::to_owned)
    }

    /// Returns the other lines of the table's header: robot, method, frames, version of the results.
    fn lines(&self) -> impl Iterator<Item = String> + '_ {
        let line = |line: &String| match line.strip_prefix("biflag sweep ") {
            Some(rest) => rest.split_once(", ").map(|(_, version)| version.to_owned()),
            None => Some(line.clone()),
        };
        self.header.iter().filter_map(line)
    }
}

fn body(about: &About, inputs: &[&Column], results: &[&Column]) -> Markup {
    let choice = |name: &str, label: &str, columns: &[&Column], first: usize| {
        html! {
            label { (label) " " select name=(name) {
                @for (i, column) in columns.iter().enumerate() { option value=(column.name) selected[i == first] { (column.label()) } }
            } }
        }
    };
    html! {
        main {
            h1 { (clip(&about.title(), 200)) }
            p.meta {
                span { "sweep with " (count(about.rows, "point", "points")) }
                @for line in about.lines() { span { (clip(&line, 300)) } }
                span { (about.path.display()) }
                @if about.every > 1 { span { "the page shows one of every " (about.every) " points" } }
            }
            section.sweep data-data="sweep-data" {
                div.choices {
                    (choice("value", "Result", results, 0))
                    (choice("x", "Horizontal axis", inputs, 0))
                    (choice("y", "Vertical axis", inputs, 1))
                    label { "Drawn as " select name="view" { option value="map" selected { "map" } option value="lines" { "lines" } } }
                }
                div.sliders {}
                h2.unseen { "Map" }
                div.maps { figure { div.head { h3 { "Map" } } svg viewBox="0 0 760 520" role="img" aria-label="Map" {} figcaption {} } }
            }
        }
        footer { p { "Written by " (document::GENERATOR) " (" (study::program::GIT_HASH) ")." } }
    }
}

/// Returns the inputs, in the order of the columns. Where each point of a design has a value of its own, a single column
/// distinguishes all points; so the axes of a sweep come first.
fn inputs(columns: &[Column]) -> Vec<&Column> {
    // Seven digits: results of the same inputs may differ in their last digits.
    let distinct = |chosen: &[usize]| {
        let rows = columns.first().map_or(0, |column| column.values.len());
        let point = |i: usize| chosen.iter().map(|k| (columns[*k].values[i] as f32).to_bits()).collect::<Vec<_>>();
        (0..rows).map(point).collect::<HashSet<_>>().len()
    };
    let varying = |kind: Kind| (0..columns.len()).filter(move |k| columns[*k].kind == kind && distinct(&[*k]) > 1);
    // Where a key varies, the groups follow from it.
    let of_robot = if varying(Kind::Key).next().is_some() { Kind::Key } else { Kind::Group };
    let mut chosen: Vec<usize> = varying(Kind::Speed).chain(varying(of_robot)).collect();
    let mut told = distinct(&chosen).max(1);
    for k in 0..columns.len() {
        let with: Vec<usize> = chosen.iter().copied().chain([k]).collect();
        let tells = distinct(&with);
        if tells > told {
            (told, chosen) = (tells, with);
        }
    }
    chosen.sort_unstable();
    chosen.into_iter().map(|k| &columns[k]).collect()
}

/// Returns the columns that are numbers; a text that is none becomes NaN, and a column of texts is left out.
fn numeric(table: Table) -> Vec<Column> {
    let finite = |value: f64| if value.is_finite() { value } else { f64::NAN };
    let columns = table.columns.into_iter().map(|column| Column {
        kind: Kind::of(&column),
        values: column.values.numbers().into_iter().map(finite).collect(),
        name: column.name.into_owned(),
        unit: column.unit.into_owned(),
        about: column.about.into_owned(),
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
        let options = [
            "value=\"w1_rpm\" selected>speed of flagellum 1 (w1)<",
            "value=\"length_m\">length<",
            "value=\"tilt_deg\">tilt<",
        ];
        assert!(options.iter().all(|option| text.contains(&format!("<option {option}"))), "{text}");
        // Each value of a Sobol design distinguishes all points; its columns say which of them vary by themselves.
        let varies = |name: &str| format!("# {name} [1]: {}\n", sweep::VARIES);
        let sobol =
            "w1_rpm,w2_rpm,mu,tether,derived,yaw_deg\n50,10,0.8,1,1.6,1\n50,10,0.9,3,1.8,2\n50,10,1.1,2,2.2,3\n";
        std::fs::write(&path, varies("mu") + &varies("tether") + sobol).unwrap();
        write(&path, &page).unwrap();
        let text = std::fs::read_to_string(&page).unwrap();
        let inputs: Vec<&str> = text
            .split("name=\"x\"")
            .nth(1)
            .unwrap()
            .split("</select>")
            .next()
            .unwrap()
            .split("value=\"")
            .skip(1)
            .map(|option| option.split('"').next().unwrap())
            .collect();
        assert_eq!(inputs, ["mu", "tether"]);
        for (broken, reason) in
            [("x,y\n1,2\n", "no column yaw_deg"), ("a,yaw_deg\n1,2\n2,3\n", "fewer than two inputs")]
        {
            std::fs::write(&path, broken).unwrap();
            let error = write(&path, &page).unwrap_err().to_string();
            assert!(error.contains(reason), "{error}");
        }
    }
}
