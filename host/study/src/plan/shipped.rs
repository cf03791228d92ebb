//! The plans and robot files that are inside the program, from the folder `host/plans`.

use std::path::Path;

/// A plan or robot file.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Shipped {
    /// Its name, without `.toml`.
    pub name: &'static str,
    /// Its content.
    pub text: &'static str,
}

/// Names and contents, in the order of the names.
const FILES: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/shipped.rs"));

impl Shipped {
    /// Returns all files, in the order of their names.
    pub fn all() -> impl Iterator<Item = Self> {
        FILES.iter().map(|&(name, text)| Self { name, text })
    }

    /// Returns the file of this name, with or without `.toml`; `None` for a path with a folder.
    pub fn find(path: &Path) -> Option<Self> {
        let name = path.to_str()?;
        let name = name.strip_suffix(".toml").unwrap_or(name);
        Self::all().find(|file| file.name == name)
    }

    /// Returns whether it is a robot file.
    pub fn is_robot(&self) -> bool {
        self.name.starts_with("robot-")
    }

    /// Returns the first sentence of the file's opening comment.
    pub fn about(&self) -> String {
        let lines = self.text.lines().map_while(|line| line.strip_prefix("# "));
        let comment = lines.collect::<Vec<_>>().join(" ");
        let end = comment.find(". ").map_or(comment.len(), |end| end + 1);
        comment[..end].to_owned()
    }
}

/// Returns the keys of all robots, such as `flagellum.young_pa`, each with its meaning, unit and source, from the comments of
/// `robot-published`, which has every key.
pub fn robot_keys() -> Vec<(String, String)> {
    comments(Shipped::find(Path::new("robot-published")).map_or("", |file| file.text))
}

/// Returns the keys of a robot file, also those in its comments, each with the comment above it; empty if it has none. Keys share
/// a comment if no blank line or comment separates them.
pub fn comments(text: &str) -> Vec<(String, String)> {
    let (mut table, mut comment, mut is_used, mut keys) = ("", Vec::new(), false, Vec::new());
    for line in text.lines().map(str::trim) {
        let (is_comment, content) = line.strip_prefix('#').map_or((false, line), |content| (true, content.trim()));
        let key = content.split_once(if is_comment { " = " } else { "=" }).map(|(key, _)| key.trim());
        let key = key.filter(|key| key.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_'));
        if let Some(key) = key {
            keys.push((format!("{table}.{key}"), comment.join(" ")));
            is_used = true;
            continue;
        }
        if is_used || !is_comment {
            comment.clear();
            is_used = false;
        }
        if is_comment {
            comment.push(content);
        }
        table = line.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(table);
    }
    keys
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::{Plan, robot};

    #[test]
    fn every_key_of_a_robot_has_a_meaning() {
        let keys = robot_keys();
        let robot = toml::Table::try_from(sim::params::Robot::published()).unwrap();
        let tables = robot.iter().filter_map(|(table, value)| Some((table, value.as_table()?)));
        let known = tables.flat_map(|(table, keys)| keys.keys().map(move |key| format!("{table}.{key}")));
        for key in known {
            let about = keys.iter().find(|(name, _)| *name == key).map(|(_, about)| about.as_str());
            assert!(about.is_some_and(|about| about.ends_with(['.', ':']) && about.len() > 10), "{key}: {about:?}");
        }
        assert!(keys.iter().any(|(key, about)| key == "fluid.glycerol" && about.contains("Cheng 2008")), "{keys:?}");
    }

    #[test]
    fn each_says_what_it_is() {
        for file in Shipped::all() {
            assert!(file.about().ends_with('.'), "{}: {}", file.name, file.about());
            assert!(!file.is_robot() || robot::parse(file.text, file.name).is_ok(), "{}", file.name);
        }
        assert!(Shipped::all().any(|file| file.is_robot()) && !Shipped::all().all(|file| file.is_robot()));
    }

    #[test]
    fn a_plan_finds_its_robot_by_name_too() {
        let plan = Plan::load(Path::new("bundling")).unwrap();
        assert_eq!(plan.robot.name, "robot-soft.toml");
        assert_eq!(plan.robot.text, Shipped::find(Path::new("robot-soft")).unwrap().text);
    }

    #[test]
    fn they_are_found_by_name_alone() {
        let points = Shipped::find(Path::new("published-points")).unwrap();
        assert_eq!(Shipped::find(Path::new("published-points.toml")), Some(points));
        for other in ["./published-points.toml", "plans/published-points.toml", "published-points.json", "", ".toml"] {
            assert_eq!(Shipped::find(Path::new(other)), None, "{other}");
        }
    }
}
