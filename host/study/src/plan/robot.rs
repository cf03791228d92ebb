//! The robot: a built-in one by its name, or a file with the parameters of the model that differ from `physical`.
//!
//! Keys, units, defaults and sources are documented at the fields of [`sim::params::Robot`] and in
//! `host/plans/robot-published.toml`. A key that is left out has the value of the robot `physical`.

use super::source::{FileKind, Source, number};
use super::{Fit, PlanError, Shipped, units};
use crate::colour;
use biflag_log::RobotMeta;
use serde::Deserialize;
use sim::params::{BUILT_IN, Base, Contact, Flagellum, Fluid, Head, Joint, Robot, SolverSettings, Tank};
use std::path::{Path, PathBuf};

/// The default robot, which is built in.
pub const PHYSICAL: &str = "physical";

/// The built-in robot with the laboratory's modelling choices, see [`Robot::published`].
pub const PUBLISHED: &str = "published";

/// A robot, as stored in plans, sessions and logs.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct RobotFile {
    /// Name of a built-in robot, or the path that the user gave.
    pub name: String,
    /// The file's content; empty for a built-in robot.
    pub text: String,
}

impl RobotFile {
    /// Returns the built-in robot of this name.
    pub fn built_in(name: &str) -> Self {
        Self { name: name.to_owned(), text: String::new() }
    }

    /// Returns the robot of a log. A log without a robot is older than `physical`: its robot is `published`.
    pub fn of_log(record: Option<RobotMeta>) -> Self {
        match record {
            Some(RobotMeta { name, text }) if !name.is_empty() => Self { name, text },
            _ => Self::built_in(PUBLISHED),
        }
    }

    /// Returns the robot's parameters.
    ///
    /// # Errors
    /// [`PlanError::Invalid`].
    pub fn parse(&self) -> Result<Robot, PlanError> {
        Robot::built_in(&self.name).map_or_else(|| parse(&self.text, &self.name), Ok)
    }

    /// Returns the fit of its parameters, if the file states one.
    ///
    /// # Errors
    /// [`PlanError::Invalid`].
    pub fn fit(&self) -> Result<Option<Fit>, PlanError> {
        let (_, fit) = read(&self.text, &self.name)?;
        Ok(fit.or_else(|| Fit::of_comments(&self.text)))
    }
}

const KIND: FileKind = FileKind {
    noun: "robot file",
    example: "`biflag plans robot-published` prints one with every key",
    tables: &["base", "flagellum", "fluid", "head", "tank", "joint", "contact", "solver", "glycerol", "fit"],
    help: |_| None,
};

/// A robot file.
#[derive(Deserialize, Default)]
#[serde(default, deny_unknown_fields)]
struct File {
    base: Base,
    flagellum: Flagellum,
    fluid: Fluid,
    head: Head,
    tank: Option<Tank>,
    joint: Joint,
    contact: Contact,
    solver: SolverSettings,
    fit: Option<Fit>,
}

/// Returns the robot that the plan at `plan` calls `name`.
pub(crate) fn of_plan(plan: &Path, name: &str) -> Result<RobotFile, PlanError> {
    if BUILT_IN.contains(&name) {
        return Ok(RobotFile::built_in(name));
    }
    Ok(RobotFile { name: name.to_owned(), text: load(&named_by(plan, name))?.text })
}

/// Returns the path of the robot file that the plan at `plan` calls `name`: in the plan's folder, or inside the program.
fn named_by(plan: &Path, name: &str) -> PathBuf {
    let beside = plan.parent().unwrap_or(Path::new("")).join(name);
    match Shipped::find(Path::new(name)) {
        Some(_) if !beside.exists() => PathBuf::from(name),
        _ => beside,
    }
}

/// Returns the built-in robot of this name; reads and checks any other as a robot file, which must set something. Prints a note
/// about a number that is probably in another unit.
///
/// # Errors
/// [`PlanError`].
pub fn load(path: &Path) -> Result<RobotFile, PlanError> {
    if let Some(name) = path.to_str().filter(|name| BUILT_IN.contains(name)) {
        return Ok(RobotFile::built_in(name));
    }
    let file = RobotFile { text: KIND.read(path)?, name: path.display().to_string() };
    file.parse()?;
    // A text that contains only comments is valid TOML, and would be the robot `physical` under another name.
    if file.text.parse::<toml::Table>().is_ok_and(|table| table.is_empty()) {
        return Err(KIND.is_not(&file.name));
    }
    units::doubts(&file.text).iter().for_each(|doubt| colour::eprint(&format!("note: {}: {doubt}\n", file.name)));
    Ok(file)
}

/// Returns the robot that the text of a robot file describes; errors call the file `name`.
///
/// # Errors
/// [`PlanError::Invalid`].
pub fn parse(text: &str, name: &str) -> Result<Robot, PlanError> {
    Ok(read(text, name)?.0)
}

fn read(text: &str, name: &str) -> Result<(Robot, Option<Fit>), PlanError> {
    let source = Source { kind: &KIND, text, name };
    let File { base, flagellum, fluid, head, tank, joint, contact, solver, fit } = source.read()?;
    let robot = Robot { base, flagellum, fluid, head, tank, joint, contact, solver };
    robot.validate().map_err(|error| {
        let what = format!("{} = {}: {}", error.key, number(error.value), error.reason);
        let doubts = units::doubts(text);
        let cure = if doubts.is_empty() { units::diameter(&robot) } else { Some(doubts.join("; ")) };
        let cure = cure.unwrap_or_else(|| {
            let key = error.key;
            format!("correct {key} or what it depends on; keys that are left out have the values of `physical`")
        });
        source.error_at(error.key.split('.'), what, cure)
    })?;
    if let Some(fit) = &fit {
        fit.check(&source, &robot)?;
    }
    Ok((robot, fit))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_keys_have_the_values_of_physical() {
        assert_eq!(parse("", "my.toml").unwrap(), Robot::default());
        let robot =
            parse("[flagellum]\nyoung_pa = 1_000_000\nhandedness = [\"left\", \"right\"]\n", "my.toml").unwrap();
        assert_eq!(robot.flagellum.young_pa, 1e6);
        assert_eq!(robot.base, Robot::default().base);
    }

    #[test]
    fn built_in_robots_are_known_by_name() {
        for (name, robot) in [(PHYSICAL, Robot::default()), (PUBLISHED, Robot::published())] {
            assert!(BUILT_IN.contains(&name));
            let file = load(Path::new(name)).unwrap();
            assert_eq!((file.name.as_str(), file.parse().unwrap()), (name, robot));
        }
        assert!(matches!(load(Path::new("./published")), Err(PlanError::Read { .. })), "a path is a file");
    }

    #[test]
    fn a_log_without_a_name_is_of_the_published_robot() {
        assert_eq!(RobotFile::of_log(None).parse().unwrap(), Robot::published());
        assert_eq!(RobotFile::of_log(Some(RobotMeta::default())).parse().unwrap(), Robot::published());
        let meta = RobotMeta { name: PHYSICAL.to_owned(), text: String::new() };
        assert_eq!(RobotFile::of_log(Some(meta)).parse().unwrap(), Robot::default());
    }

    #[test]
    fn every_mistake_is_named_with_its_line_and_its_cure() {
        let toml = "a robot file is a TOML file in UTF-8; `biflag plans robot-published` prints one with every key";
        let tables = "write one of `base`, `flagellum`, `fluid`, `head`, `tank`, `joint`, `contact`, `solver`, `fit`, or leave it out";
        for (text, message, cure) in [
            ("[base]\nmass_kg = \"94\"\n", "my.toml:2:11: mass_kg cannot be \"94\"", "give a number"),
            (
                "[base]\nmass_kg = 94 g\n",
                "my.toml:2:11: mass_kg = 94 g: give the number without a unit",
                "write mass_kg = 94",
            ),
            ("[base\n", "my.toml:1:6: unclosed table, expected `]`", toml),
            ("base:\n  mass_kg: 1\n", "my.toml: this is not a robot file", toml),
            ("[tail]\n", "my.toml:1:2: unknown key `tail`", tables),
            ("base = [0.1]\n", "my.toml:1:8: base cannot be [0.1]", "write it as a table: [base]"),
            (
                "[base]\ninertia_kg_m2 = [1e-5, 1e-5]\n",
                "my.toml:2:17: inertia_kg_m2 cannot be [1e-5, 1e-5]",
                "give a list of 3",
            ),
            (
                "[flagellum]\nhandedness = [\"up\", \"right\"]\n",
                "my.toml:2:15: handedness cannot hold \"up\"",
                "give `right` or `left`",
            ),
            // A key of older versions, with one value left.
            ("[solver]\nfar_field = \"double\"\n", "my.toml:2:13: far_field cannot be \"double\"", "give `single`"),
        ] {
            let PlanError::Invalid { place, what, cure: found } = parse(text, "my.toml").unwrap_err() else { panic!() };
            assert_eq!((format!("{place}: {what}").as_str(), found.as_str()), (message, cure));
        }
    }

    #[test]
    fn every_impossible_robot_is_named_with_its_line_and_the_reason() {
        for (text, message) in [
            ("[base]\nmass_kg = 0\n", "my.toml:2:11: base.mass_kg = 0: must be between 0.000001 and 1000"),
            ("[base]\nmass_kg = 1e300\n", "my.toml:2:11: base.mass_kg = 1e300: must be between 0.000001 and 1000"),
            ("[flagellum]\nrod_radius_m = -0.003\n", "my.toml:2:16: flagellum.rod_radius_m = -0.003: must be between"),
            ("[flagellum]\npitch_m = 0.005\n", "my.toml:2:11: flagellum.pitch_m = 0.005: the helix touches itself"),
            (
                "[flagellum]\nedge_length_m = 0.02\n",
                "my.toml:2:17: flagellum.edge_length_m = 0.02: too long to resolve the helix",
            ),
            (
                "[fluid]\nregularisation_radii = 11\n",
                "my.toml:2:24: fluid.regularisation_radii = 11: must be between 0.1 and 10",
            ),
            (
                "[base]\nmotor_distance_m = 0.01\n",
                "my.toml:2:20: base.motor_distance_m = 0.01: the flagella touch when they turn",
            ),
            ("[fluid]\nviscosity_pa_s = nan\n", "my.toml:2:18: fluid.viscosity_pa_s = NaN: must be between"),
            // The file does not set the motors' distance, and the default is too small for rods so thick.
            (
                "[flagellum]\nrod_radius_m = 0.015\n",
                "my.toml: base.motor_distance_m = 0.045: the flagella touch when they turn",
            ),
        ] {
            let error = parse(text, "my.toml").unwrap_err().to_string();
            assert!(error.starts_with(message), "{error}\nexpected {message}");
        }
    }
}
