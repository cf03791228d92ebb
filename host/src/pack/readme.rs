//! The archive's readme.

use crate::program::FULL_VERSION;
use crate::session::{Session, TrialState};
use crate::text;
use crate::trial::Want;
use std::fmt::Write;

/// Facts that the session's files do not contain.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct About {
    /// Who made the recording; empty if nobody is named.
    pub author: String,
    /// SPDX identifier of the data's licence, such as `CC-BY-4.0`; empty if none is named.
    pub license: String,
}

/// Returns the text of the readme. `notes`: about the archive.
pub(super) fn text(session: &Session, states: &[TrialState], about: &About, notes: &[String]) -> String {
    let plan = session.plan();
    let mut text = format!("# {}\n\n", text::line(&plan.name));
    // Writing to a string cannot fail.
    let mut line = |line: &str| _ = writeln!(text, "{line}");
    line(
        "Trials of a robot with two soft helical flagella, turned by two DC motors under a base that hangs on a ball joint in \
         glycerin.\n",
    );
    for (name, value) in [("Author", &about.author), ("Licence", &about.license), ("Note", &plan.note)] {
        if !value.trim().is_empty() {
            line(&format!("- {name}: {}", text::line(value.trim())));
        }
    }
    line(&format!("- Session started: {}", session.created));
    line(&format!("- Packed by biflag {FULL_VERSION}"));
    line("\n## Results\n");
    line("| trial | yaw, deg | pitch, deg | roll, deg | |\n| --- | --- | --- | --- | --- |");
    for state in states {
        let Some(attempt) = state.complete() else {
            line(&format!("| {} | | | | not complete |", state.trial.name));
            continue;
        };
        let Ok(trial) = attempt.read(Want::default()) else {
            line(&format!("| {} | | | | cannot be read |", state.trial.name));
            continue;
        };
        let angles = trial.steady_angles().unwrap_or_default();
        let remark = match trial.findings.iter().filter(|finding| finding.grave).count() {
            0 => String::new(),
            1 if !angles.settled => "not settled".to_owned(),
            grave => text::count(grave, "warning"),
        };
        let [yaw, pitch, roll] = angles.cells();
        line(&format!("| {} | {yaw} | {pitch} | {roll} | {remark} |", state.trial.name));
    }
    line(
        "\nThe name of a trial has the speeds of flagella 1 and 2 in rpm, positive counter-clockwise seen from above. Yaw, pitch \
         and roll are rotations about z, then y, then x that turn body axes into world axes; x points from motor 2 to motor 1, \
         z upwards along the robot. Yaw is zero at the end of the still phase before the run. The values are means over about \
         the last 12 s of the run. The ± is the 95 % uncertainty; \"?\": unknown, because of a warning in `report.html`.\n",
    );
    line("## Files\n");
    let sensor = plan.sensor.as_ref().map(|_| ("sensor.toml", "what was measured of the sensor"));
    let files = [
        ("report.html", "the session as a page to open in a browser"),
        ("tables/", "the trials as CSV; `trials.csv` has the results, `budget.csv` the causes of their uncertainties"),
        ("figures/", "the trials as SVG"),
        ("plan.toml, robot.toml", "what was planned, and the robot's parameters"),
        (
            "session/",
            "the logs (MCAP with protobuf; Foxglove and PlotJuggler open them) and the manifest of the session",
        ),
        ("manifest-sha256.txt", "SHA-256 of each file; check with `sha256sum --check manifest-sha256.txt`"),
        ("ro-crate-metadata.json", "this description for programs (RO-Crate 1.1)"),
    ];
    for (name, about) in files.into_iter().chain(sensor) {
        line(&format!("- `{name}`: {about}"));
    }
    if !notes.is_empty() {
        line("\n## Notes\n");
        notes.iter().for_each(|note| line(&format!("- {}", text::line(note))));
    }
    text
}
