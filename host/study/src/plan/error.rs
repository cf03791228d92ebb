//! Errors in a plan, a robot file, or a file of board settings. All of them count as wrong use.

use super::shipped::Shipped;
use biflag_log::similar::{did_you_mean, suggest};
use miette::Diagnostic;
use sim::params::BUILT_IN;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// What to do with the folder of a sweep.
pub(crate) const A_SWEEP: &str =
    "it is the folder of a sweep: `biflag sweep status`, `report` and `figure map` read it";

/// Returns the path of the manifest of a sweep.
pub(crate) fn sweep_manifest(folder: &Path) -> PathBuf {
    folder.join("sweep.toml")
}

/// Returns whether a folder has the manifest of a sweep.
pub(crate) fn is_sweep(folder: &Path) -> bool {
    sweep_manifest(folder).is_file()
}

/// Why a file was not accepted.
#[derive(Error, Diagnostic, Debug)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum PlanError {
    /// The file cannot be read.
    #[error("{}: the {noun} cannot be read", path.display())]
    #[diagnostic(code(wrong_use), help("{}", cure(path, noun)))]
    Read { path: PathBuf, noun: &'static str, source: std::io::Error },
    /// The content is wrong.
    #[error("{place}: {what}")]
    #[diagnostic(code(wrong_use), help("{cure}"))]
    Invalid { place: String, what: String, cure: String },
}

/// Returns the help text for a file that cannot be read.
fn cure(path: &Path, noun: &str) -> String {
    if path.is_dir() {
        let folder = path.display();
        return match noun {
            "plan" if is_sweep(path) => format!("name the plan itself, or another command: {A_SWEEP}"),
            "plan" => format!(
                "{folder} is a folder: name the plan itself; `biflag record PLAN --out {folder} --resume` goes on with a session, \
                 and `biflag simulate --from {folder}` repeats its trials in the model"
            ),
            _ => format!("{folder} is a folder: name a file in it"),
        };
    }
    let typed = path.file_name().and_then(OsStr::to_str).unwrap_or_default();
    if noun == "plan"
        && typed.split_once(',').is_some_and(|(one, two)| one.parse::<f64>().and(two.parse::<f64>()).is_ok())
    {
        return format!("simulate and record take a pair of speeds as --speeds={typed}, simulate with --duration 120");
    }
    let shipped = Shipped::all().filter(|file| noun == if file.is_robot() { "robot file" } else { "plan" });
    let built_in = BUILT_IN.into_iter().filter(|_| noun == "robot file");
    let otherwise =
        "check the path; a path in a plan is relative to the plan's folder; `biflag plans` lists those inside biflag";
    did_you_mean(path, &suggest(typed, shipped.map(|file| file.name).chain(built_in), otherwise))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_letter_finds_what_is_inside_biflag() {
        let help = |name: &str, noun| cure(Path::new(name), noun);
        assert_eq!(help("bundlng", "plan"), "did you mean bundling?");
        assert_eq!(help("plans/robot-sotf", "robot file"), "did you mean robot-soft?");
        assert_eq!(help("physcal", "robot file"), "did you mean physical?");
        assert!(help("50,-10", "plan").contains("--speeds=50,-10"), "{}", help("50,-10", "plan"));
        for (name, noun) in
            [("bundlng", "robot file"), ("robot-sotf", "plan"), ("bundlng", "sensor file"), ("x", "plan")]
        {
            assert!(help(name, noun).starts_with("check the path"), "{name} as a {noun}");
        }
    }
}
