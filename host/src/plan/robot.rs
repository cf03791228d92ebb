//! The robot's file: every parameter of the model that differs from the published robot.
//!
//! Keys, units, defaults and sources stand beside the fields of [`sim::params::Robot`], and in
//! `host/plans/robot-published.toml`. What is left out takes its default.

use crate::plan::{PUBLISHED, Plan};
use miette::Diagnostic;
use sim::params::{ParamError, Robot};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a robot's file was not accepted. All of it is wrong use.
#[derive(Error, Diagnostic, Debug)]
pub enum RobotFileError {
    /// It cannot be read.
    #[error("{}: cannot be read", path.display())]
    #[diagnostic(code(wrong_use), help("check the path of the robot's file"))]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It is no TOML, or has a key or a type of value that no robot has.
    #[error("{place}: {line}: {what}")]
    #[diagnostic(code(wrong_use), help("correct the key or its value; host/plans/robot-published.toml has them all"))]
    Invalid {
        /// File, line and column.
        place: String,
        /// The line.
        line: String,
        /// What is wrong with it.
        what: String,
    },
    /// A value that cannot be.
    #[error("{file}: {error}")]
    #[diagnostic(code(wrong_use), help("correct {} in {file}, or leave it out for the published value", error.key))]
    Parameter {
        /// The file.
        file: String,
        /// Key, value and reason.
        error: ParamError,
    },
}

/// The robot of a plan.
///
/// # Errors
/// [`RobotFileError`].
pub fn of_plan(plan: &Plan) -> Result<Robot, RobotFileError> {
    if plan.robot.name == PUBLISHED { Ok(Robot::default()) } else { parse(&plan.robot.text, &plan.robot.name) }
}

/// Has a plan run with the robot in a file in the place of its own.
///
/// # Errors
/// [`RobotFileError::Read`].
pub fn put_into(plan: &mut Plan, path: &Path) -> Result<(), RobotFileError> {
    let text =
        std::fs::read_to_string(path).map_err(|source| RobotFileError::Read { path: path.to_owned(), source })?;
    plan.robot = crate::plan::Robot { name: path.display().to_string(), text };
    Ok(())
}

/// A robot from the text of its file, checked; `file` is what errors call it.
///
/// # Errors
/// [`RobotFileError::Invalid`], [`RobotFileError::Parameter`].
pub fn parse(text: &str, file: &str) -> Result<Robot, RobotFileError> {
    let robot: Robot = toml::from_str(text).map_err(|error| {
        let at = text.floor_char_boundary(error.span().map_or(0, |span| span.start));
        let line_start = text[..at].rfind('\n').map_or(0, |end| end + 1);
        let number = text[..line_start].matches('\n').count() + 1;
        let column = text[line_start..at].chars().count() + 1;
        RobotFileError::Invalid {
            place: format!("{file}:{number}:{column}"),
            line: text[line_start..].lines().next().unwrap_or("").trim().to_owned(),
            what: error.message().trim().replace('\n', "; "),
        }
    })?;
    robot.validate().map_err(|error| RobotFileError::Parameter { file: file.to_owned(), error })?;
    Ok(robot)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &str) -> String {
        parse(text, "my.toml").unwrap_err().to_string()
    }

    #[test]
    fn what_is_left_out_is_the_published_robot() {
        assert_eq!(parse("", "my.toml").unwrap(), Robot::default());
        let robot =
            parse("[flagellum]\nyoung_pa = 1_000_000\nhandedness = [\"left\", \"right\"]\n", "my.toml").unwrap();
        assert_eq!(robot.flagellum.young_pa, 1e6);
        assert_eq!(robot.base, Robot::default().base);
    }

    #[test]
    fn every_wrong_file_names_the_place_and_the_reason() {
        for (text, parts) in [
            ("[base]\nmass_g = 94\n", ["my.toml:2:1: mass_g = 94", "unknown field `mass_g`"]),
            ("[base]\nmass_kg = \"94\"\n", ["my.toml:2:11: mass_kg = \"94\"", "expected f64"]),
            ("[base\n", ["my.toml:1:6: [base", "unclosed"]),
            ("[tail]\n", ["my.toml:1:2: [tail]", "unknown field `tail`"]),
            ("[base]\ninertia_kg_m2 = [1e-5, 1e-5]\n", ["my.toml:2:", "length 2"]),
            ("[flagellum]\nhandedness = [\"up\", \"right\"]\n", ["my.toml:2:", "unknown variant `up`"]),
            ("[flagellum]\nrod_radius_m = -0.003\n", ["flagellum.rod_radius_m = -0.003", "must be between"]),
            ("[flagellum]\npitch_m = 0.005\n", ["flagellum.pitch_m = 0.005", "touches itself"]),
            ("[flagellum]\nedge_length_m = 0.02\n", ["flagellum.edge_length_m = 0.02", "resolve the helix"]),
            ("[fluid]\nregularisation_radii = 2\n", ["fluid.regularisation_radii = 2", "above the edge length"]),
            ("[base]\nmotor_distance_m = 0.01\n", ["base.motor_distance_m = 0.01", "touch when they turn"]),
            ("[fluid]\nviscosity_pa_s = nan\n", ["fluid.viscosity_pa_s = NaN", "must be between"]),
        ] {
            let error = error(text);
            assert!(error.starts_with("my.toml") && parts.iter().all(|part| error.contains(part)), "{error}");
        }
    }
}
