//! Errors in a plan, a robot file, or a file of board settings. All of them count as wrong use.

use super::Shipped;
use biflag_log::similar::{did_you_mean, most_alike};
use miette::Diagnostic;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a file was not accepted.
#[derive(Error, Diagnostic, Debug)]
pub enum PlanError {
    /// The file cannot be read.
    #[error("{}: the {noun} cannot be read", path.display())]
    #[diagnostic(code(wrong_use), help("{}", cure(path, noun)))]
    Read {
        /// The file.
        path: PathBuf,
        /// Its expected kind, such as `plan`.
        noun: &'static str,
        /// Why.
        source: std::io::Error,
    },
    /// The content is wrong.
    #[error("{place}: {what}")]
    #[diagnostic(code(wrong_use), help("{cure}"))]
    Invalid {
        /// File, line and column; only the file if the error belongs to no line.
        place: String,
        /// What is wrong.
        what: String,
        /// How to correct it.
        cure: String,
    },
}

/// Returns the help text for a file that cannot be read.
fn cure(path: &Path, noun: &str) -> String {
    if path.is_dir() {
        let folder = path.display();
        return match noun {
            "plan" => format!(
                "{folder} is a folder: name the plan itself; `biflag record PLAN --out {folder} --resume` goes on with a session, \
                 and `biflag simulate --from {folder}` repeats its trials in the model"
            ),
            _ => format!("{folder} is a folder: name a file in it"),
        };
    }
    let shipped = Shipped::all()
        .filter(|file| if file.is_robot() { noun == "robot file" } else { noun == "plan" })
        .map(|file| file.name);
    let otherwise = path.to_str().and_then(|typed| most_alike(typed, shipped)).map_or_else(
        || {
            "check the path; a path in a plan is relative to the plan's folder; `biflag plans` lists those inside biflag"
                .to_owned()
        },
        |name| format!("did you mean {name}, which is inside biflag?"),
    );
    did_you_mean(path, &otherwise)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_letter_finds_what_is_inside_biflag() {
        let help = |name: &str, noun| cure(Path::new(name), noun);
        assert_eq!(help("bundlng", "plan"), "did you mean bundling, which is inside biflag?");
        assert_eq!(help("robot-sotf", "robot file"), "did you mean robot-soft, which is inside biflag?");
        for (name, noun) in
            [("bundlng", "robot file"), ("robot-sotf", "plan"), ("bundlng", "sensor file"), ("x", "plan")]
        {
            assert!(help(name, noun).starts_with("check the path"), "{name} as a {noun}");
        }
    }
}
