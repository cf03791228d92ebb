//! The robot file: every parameter of the model that differs from the published robot.
//!
//! Keys, units, defaults and sources stand beside the fields of [`sim::params::Robot`], and in
//! `host/plans/robot-published.toml`. A key that is left out has its default.

use super::PlanError;
use super::source::{FileKind, Source, number};
use sim::params::Robot;
use std::path::Path;

/// The robot whose parameters need no file.
pub const PUBLISHED: &str = "published";

/// A robot file, as plans, sessions and logs keep it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct RobotFile {
    /// `published`, or the path that the user gave.
    pub name: String,
    /// The file's content; empty for `published`.
    pub text: String,
}

impl RobotFile {
    /// Returns the robot that the file describes.
    ///
    /// # Errors
    /// [`PlanError::Invalid`].
    pub fn parse(&self) -> Result<Robot, PlanError> {
        parse(&self.text, &self.name)
    }
}

const KIND: FileKind = FileKind {
    noun: "robot file",
    example: "host/plans/robot-published.toml has every key",
    tables: &["base", "flagellum", "fluid", "tank", "joint", "contact", "solver", "glycerol"],
    help: |_| None,
};

/// Reads and checks a robot file, which must set something.
///
/// # Errors
/// [`PlanError`].
pub fn load(path: &Path) -> Result<RobotFile, PlanError> {
    let file = RobotFile { text: KIND.read(path)?, name: path.display().to_string() };
    file.parse()?;
    // Any text whose lines are all comments is TOML, and would be the published robot under another name.
    if file.text.parse::<toml::Table>().is_ok_and(|table| table.is_empty()) {
        return Err(KIND.is_not(&file.name));
    }
    Ok(file)
}

/// Returns the robot that the text of a robot file describes; errors call the file `name`.
///
/// # Errors
/// [`PlanError::Invalid`].
pub fn parse(text: &str, name: &str) -> Result<Robot, PlanError> {
    let source = Source { kind: &KIND, text, name };
    let robot: Robot = source.read()?;
    robot.validate().map_err(|error| {
        let what = format!("{} = {}: {}", error.key, number(error.value), error.reason);
        let cure =
            format!("correct {} or what it depends on; keys that are left out have their published values", error.key);
        source.error_at(error.key.split('.'), what, cure)
    })?;
    Ok(robot)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_keys_have_their_published_values() {
        assert_eq!(parse("", "my.toml").unwrap(), Robot::default());
        let robot =
            parse("[flagellum]\nyoung_pa = 1_000_000\nhandedness = [\"left\", \"right\"]\n", "my.toml").unwrap();
        assert_eq!(robot.flagellum.young_pa, 1e6);
        assert_eq!(robot.base, Robot::default().base);
    }

    #[test]
    fn every_mistake_is_named_with_its_line_and_its_cure() {
        let toml = "a robot file is a TOML file in UTF-8; host/plans/robot-published.toml has every key";
        let tables = "write one of `base`, `flagellum`, `fluid`, `joint`, `contact`, `solver`, or leave it out";
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
                "[fluid]\nregularisation_radii = 2\n",
                "my.toml:2:24: fluid.regularisation_radii = 2: 6.00e-3 m is above the edge length",
            ),
            (
                "[base]\nmotor_distance_m = 0.01\n",
                "my.toml:2:20: base.motor_distance_m = 0.01: the flagella touch when they turn",
            ),
            ("[fluid]\nviscosity_pa_s = nan\n", "my.toml:2:18: fluid.viscosity_pa_s = NaN: must be between"),
            // The file does not set the motors' distance, which is too small for rods so thick.
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
