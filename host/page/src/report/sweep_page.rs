//! The page of a sweep's table: a map of one result over two inputs, with a slider for each other input.

use super::budget::DATA_BYTES;
use super::table::single;
use super::text::{clip, count, json_for_script};
use super::{document, sweep_plan};
use crate::PageError;
use crate::swept::{CONTOUR_NODES, Column, MOST_SPREAD_DEG, MOTIONS, Swept};
use maud::{Markup, PreEscaped, html};
use serde_json::{Value, json};
use std::path::Path;

/// Returns the page of a table, and its number of points.
///
/// # Errors
/// [`PageError::WrongUse`] if the file is not a table with two inputs and a result.
pub(super) fn page(path: &Path) -> Result<(Markup, usize), PageError> {
    let help = "name a log, a session folder, or the table that `biflag sweep` writes";
    let wrong = |reason: String| PageError::wrong_use(path, format!("cannot be shown as a table: {reason}"), help);
    let swept = Swept::read(path).map_err(wrong)?;
    let (rows, inputs, results) = (swept.rows(), &swept.inputs, &swept.results);
    // Four bytes of a number are five and a third bytes of text.
    let most = DATA_BYTES * 3 / 16 / (inputs.len() + results.len());
    let every = rows.div_ceil(most).max(1);
    let about = About { path, header: &swept.header, rows, of_one_phase: swept.of_one_phase(), every };
    let columns = |columns: &[Column]| -> Vec<Value> {
        let one = |column: &Column| {
            let values: Vec<f64> = column.values.iter().step_by(every).copied().collect();
            json!({ "name": column.name, "label": column.label(), "about": column.about, "values": single(&values) })
        };
        columns.iter().map(one).collect()
    };
    let states: Vec<i64> = swept.states.iter().step_by(every).copied().collect();
    let kinds = MOTIONS.map(|motion| motion.name().replace('_', " "));
    let limits = json!({ "contour_nodes": CONTOUR_NODES, "most_spread_deg": MOST_SPREAD_DEG });
    let data = json!({ "inputs": columns(inputs), "results": columns(results), "states": states, "kinds": kinds, "limits": limits });
    let data = html! { script type="application/json" id="sweep-data" { (PreEscaped(json_for_script(&data))) } };
    Ok((document::page(&clip(&about.title(), 200), "one", &body(&about, inputs, results), &data), rows))
}

/// The provenance of the table.
struct About<'a> {
    path: &'a Path,
    header: &'a [String],
    rows: usize,
    of_one_phase: usize,
    /// The page shows one in this many points.
    every: usize,
}

impl About<'_> {
    /// Returns the name of the sweep if the table states it, otherwise the name of the file.
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

fn body(about: &About, inputs: &[Column], results: &[Column]) -> Markup {
    let choice = |name: &str, label: &str, columns: &[Column], first: usize| {
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
                @if about.of_one_phase > 0 {
                    span { (count(about.of_one_phase, "point holds", "points hold")) " for one starting phase of the flagella" }
                }
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
            (sweep_plan::section(about.path))
        }
        footer { p { "Written by " (document::GENERATOR) " (" (study::program::GIT_HASH) ")." } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::swept::tests::TABLE;
    use study::sweep;

    #[test]
    fn the_page_names_its_inputs_in_words() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sweep.csv");
        std::fs::write(&path, TABLE).unwrap();
        let (text, points) = page(&path).unwrap();
        assert_eq!(points, 8);
        let text = text.0;
        let options = [
            "value=\"w1_rpm\" selected>speed of flagellum 1 (w1)<",
            "value=\"length_m\">length<",
            "value=\"tilt_deg\">tilt<",
        ];
        assert!(options.iter().all(|option| text.contains(&format!("<option {option}"))), "{text}");
        assert!(!text.contains("one starting phase"), "the table does not say its phases: {text}");
        std::fs::write(&path, "w1_rpm,w2_rpm,yaw_deg,phases\n50,25,5,1\n51,25,6,1\n50,20,5,1\n51,20,6,1\n").unwrap();
        assert!(page(&path).unwrap().0.0.contains("2 points hold for one starting phase"));
        // Each value of a Sobol design distinguishes all points, so the descriptions of its columns show which of them are
        // inputs.
        let varies = |name: &str| format!("# {name} [1]: {}\n", sweep::VARIES);
        let sobol =
            "w1_rpm,w2_rpm,mu,tether,derived,yaw_deg\n50,10,0.8,1,1.6,1\n50,10,0.9,3,1.8,2\n50,10,1.1,2,2.2,3\n";
        std::fs::write(&path, varies("mu") + &varies("tether") + sobol).unwrap();
        let text = page(&path).unwrap().0.0;
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
            let error = page(&path).unwrap_err().to_string();
            assert!(error.contains(reason), "{error}");
        }
    }
}
