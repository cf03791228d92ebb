//! The parameters of a robot that differ from the built-in robot `physical`, as a table: value, source and meaning of each.
//!
//! Meanings and sources are the comments of the robot file `robot-published`, which has every key, and of the robot's own
//! file.

use super::scroll::scrolled;
use super::text::{clip, count};
use maud::{Markup, html};
use sim::params::Robot;
use std::collections::BTreeMap;
use study::plan::{PHYSICAL, PUBLISHED, comments, robot_keys};
use toml::{Table, Value};

/// A row of the table.
#[derive(Clone, PartialEq, Eq, Debug)]
struct Row {
    /// Table and name.
    key: String,
    value: String,
    /// The comment on the key in the published file.
    meaning: String,
    /// The robot or the file that has this value.
    source: String,
}

/// Returns the table of the values in `parameters`, a robot file with all keys, that differ from the built-in robot. `file`,
/// named `name`, is the robot file that sets some of them.
pub(super) fn table(parameters: &str, name: &str, file: &str) -> Markup {
    let rows = rows(parameters, name, file);
    let built_in = of_robot(&Robot::default());
    let (others, differing): (Vec<Row>, Vec<Row>) =
        rows.into_iter().partition(|row| built_in.get(&row.key).is_some_and(|value| value.to_string() == row.value));
    let rest = format!("of the built-in robot {PHYSICAL}");
    if differing.is_empty() {
        return html! { p { "All parameters are those " (rest) "." } };
    }
    let body = html! {
        @for Row { key, value, meaning, source } in differing {
            tr { td { (clip(&key, 100)) } td { (clip(&value, 100)) } td { (clip(&source, 300)) } td { (meaning) } }
        }
    };
    html! {
        (scrolled(&format!("Parameters of the robot {}", clip(name, 100)), &["Parameter", "Value", "Source", "Meaning"], &body))
        @if !others.is_empty() { p.meta { "The other " (count(others.len(), "parameter is", "parameters are")) " " (rest) "." } }
    }
}

/// Returns the comment on each key in the published robot file.
pub(super) fn meanings() -> BTreeMap<String, String> {
    robot_keys().into_iter().collect()
}

/// Returns the values of a robot by table and name.
fn of_robot(robot: &Robot) -> BTreeMap<String, Value> {
    flat(&toml::to_string(robot).unwrap_or_default())
}

fn rows(parameters: &str, name: &str, file: &str) -> Vec<Row> {
    let (meanings, notes) = (meanings(), BTreeMap::from_iter(comments(file)));
    let own = flat(file);
    let built_in =
        [(PHYSICAL, Robot::default()), (PUBLISHED, Robot::published())].map(|(name, robot)| (name, of_robot(&robot)));
    let row = |(key, value): (String, Value)| {
        let source = if own.contains_key(&key) {
            let note = notes.get(&key).filter(|note| !note.is_empty());
            note.map_or_else(|| name.to_owned(), |note| format!("{name}: {note}"))
        } else {
            // The named robot comes first, then `physical`, which gives a file's other values.
            let same = |robot: &str| {
                built_in.iter().any(|(built_in, all)| *built_in == robot && all.get(&key) == Some(&value))
            };
            [name, PHYSICAL, PUBLISHED].into_iter().find(|robot| same(robot)).unwrap_or(name).to_owned()
        };
        let meaning = meanings.get(&key).cloned().unwrap_or_default();
        Row { value: value.to_string(), meaning, source, key }
    };
    flat(parameters).into_iter().map(row).collect()
}

/// Returns the values of a TOML file by table and name.
fn flat(text: &str) -> BTreeMap<String, Value> {
    let tables = text.parse::<Table>().unwrap_or_default();
    let mut all = BTreeMap::new();
    for (table, values) in tables {
        match values {
            Value::Table(values) => {
                all.extend(values.into_iter().map(|(key, value)| (format!("{table}.{key}"), value)))
            }
            value => drop(all.insert(table, value)),
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_value_has_its_meaning_and_its_source() {
        let file = "[fluid]\n# Measured on a Tuesday.\nviscosity_pa_s = 1.25\n";
        let mut robot = Robot::default();
        robot.fluid.viscosity_pa_s = 1.25;
        let parameters = toml::to_string(&robot).unwrap();
        let rows = rows(&parameters, "mine.toml", file);
        let row = |key: &str| rows.iter().find(|row| row.key == key).unwrap();
        let viscosity = row("fluid.viscosity_pa_s");
        assert_eq!(
            (viscosity.value.as_str(), viscosity.source.as_str()),
            ("1.25", "mine.toml: Measured on a Tuesday.")
        );
        assert_eq!(viscosity.meaning, "Dynamic viscosity, Pa s (publication).");
        assert_eq!(row("base.mass_kg").source, PHYSICAL);
        let spin = |name: &str, robot: &Robot| {
            let rows = super::rows(&toml::to_string(robot).unwrap(), name, "");
            rows.into_iter().find(|row| row.key == "fluid.spin_drag").unwrap().source
        };
        assert_eq!(spin(PUBLISHED, &Robot::published()), PUBLISHED);
        assert_eq!(spin(PHYSICAL, &Robot::default()), PHYSICAL);
        assert!(rows.iter().filter(|row| row.meaning.is_empty()).count() == 0, "every key is explained: {rows:#?}");
    }

    #[test]
    fn the_table_has_only_what_differs_from_the_built_in_robot() {
        let text = |robot: &Robot| toml::to_string(robot).unwrap();
        let mut robot = Robot::default();
        assert_eq!(
            table(&text(&robot), PHYSICAL, "").into_string(),
            "<p>All parameters are those of the built-in robot physical.</p>"
        );
        robot.fluid.viscosity_pa_s = 1.25;
        let shown = table(&text(&robot), "mine.toml", "[fluid]\nviscosity_pa_s = 1.25\n").into_string();
        assert!(shown.contains("<td>fluid.viscosity_pa_s</td><td>1.25</td><td>mine.toml</td>"), "{shown}");
        assert!(!shown.contains("base.mass_kg") && shown.contains(" parameters are of the built-in robot"), "{shown}");
        assert!(!table(&text(&Robot::published()), PUBLISHED, "").into_string().contains("All parameters"));
    }

    #[test]
    fn what_is_no_robot_file_has_no_rows() {
        assert_eq!(rows("<script>", "x", "also not"), []);
    }
}
