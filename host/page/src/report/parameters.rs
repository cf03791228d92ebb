//! The parameters of a robot that differ from the built-in robot `physical`, as a table: value, source and meaning of each.
//!
//! Meanings and sources are the comments of the robot file `robot-published`, which has every key, and of the robot's own
//! file.

use super::text::{clip, count};
use maud::{Markup, html};
use sim::params::Robot;
use std::collections::BTreeMap;
use std::path::Path;
use study::plan::{PHYSICAL, PUBLISHED, Shipped};
use toml::{Table, Value};

/// The robot file whose comments say what each key means.
const COMMENTED: &str = "robot-published";

/// A row of the table.
#[derive(Clone, PartialEq, Eq, Debug)]
struct Row {
    /// Table and name.
    key: String,
    value: String,
    /// What the published file says about the key.
    meaning: String,
    /// The robot or the file that has this value.
    source: String,
}

/// Returns the table of those of `parameters`, a robot file with all keys, that differ from the built-in robot. `file`, named
/// `name`, is the robot file that sets some of them.
pub(super) fn table(parameters: &str, name: &str, file: &str) -> Markup {
    let rows = rows(parameters, name, file);
    let built_in = of_robot(&Robot::default());
    let (others, differing): (Vec<Row>, Vec<Row>) =
        rows.into_iter().partition(|row| built_in.get(&row.key).is_some_and(|value| value.to_string() == row.value));
    let rest = format!("of the built-in robot {PHYSICAL}");
    if differing.is_empty() {
        return html! { p { "All parameters are those " (rest) "." } };
    }
    html! {
        div.scroll tabindex="0" role="region" aria-label={ "Parameters of the robot " (clip(name, 100)) } {
            table.facts {
                thead { tr { th scope="col" { "Parameter" } th scope="col" { "Value" } th scope="col" { "Source" } th scope="col" { "Meaning" } } }
                tbody {
                    @for Row { key, value, meaning, source } in differing {
                        tr { td { (clip(&key, 100)) } td { (clip(&value, 100)) } td { (clip(&source, 300)) } td { (meaning) } }
                    }
                }
            }
        }
        @if !others.is_empty() { p.meta { "The other " (count(others.len(), "parameter is", "parameters are")) " " (rest) "." } }
    }
}

/// Returns what the published robot file says about each key.
pub(super) fn meanings() -> BTreeMap<String, String> {
    comments(Shipped::find(Path::new(COMMENTED)).map_or("", |file| file.text))
}

/// Returns the values of a robot by table and name.
fn of_robot(robot: &Robot) -> BTreeMap<String, Value> {
    flat(&toml::to_string(robot).unwrap_or_default())
}

fn rows(parameters: &str, name: &str, file: &str) -> Vec<Row> {
    let (meanings, notes) = (meanings(), comments(file));
    let own = flat(file);
    let built_in =
        [(PHYSICAL, Robot::default()), (PUBLISHED, Robot::published())].map(|(name, robot)| (name, of_robot(&robot)));
    let row = |(key, value): (String, Value)| {
        let source = if own.contains_key(&key) {
            let note = notes.get(&key).map(|note| format!(": {note}")).unwrap_or_default();
            format!("{name}{note}")
        } else {
            // The robot by name first; a file's other values are those of `physical`.
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

/// Returns the comment above each key; successive keys share the comment above the first.
fn comments(text: &str) -> BTreeMap<String, String> {
    let (mut all, mut table, mut comment, mut is_used) = (BTreeMap::new(), String::new(), Vec::new(), false);
    for line in text.lines().map(str::trim) {
        let words = line.strip_prefix('#');
        if words.is_none()
            && let Some((key, _)) = line.split_once('=')
        {
            if !comment.is_empty() {
                all.insert(format!("{table}.{}", key.trim()), comment.join(" "));
            }
            is_used = true;
            continue;
        }
        if is_used || words.is_none() {
            comment.clear();
            is_used = false;
        }
        comment.extend(words.map(str::trim));
        if let Some(name) = line.strip_prefix('[').and_then(|line| line.strip_suffix(']')) {
            name.clone_into(&mut table);
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
