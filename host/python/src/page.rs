//! The log and the page of a simulated trial.

use crate::failure::Failure;
use crate::log::page;
use crate::simulate::Simulated;
use host::plan::{BoardSettings, Phases, Plan, Schedule, Trial};
use host::run::model::{Course, Model, write_log};
use protocol::Settings;
use protocol::units::CentiRpm;
use std::f64::consts::PI;
use std::path::Path;

/// Returns the page of a trial.
///
/// # Errors
/// A folder for temporary files that cannot be written.
pub fn html(simulated: &Simulated) -> Result<String, Failure> {
    let failed = |error: std::io::Error| Failure::parameter("page", error.to_string());
    let folder = tempfile::tempdir().map_err(failed)?;
    let log = folder.path().join(format!("{}.mcap", simulated.name()));
    simulated.write(&log)?;
    page(&log)
}

impl Simulated {
    fn rpm(&self) -> [f64; 2] {
        self.profile.target().map(|speed| speed * 30.0 / PI)
    }

    fn name(&self) -> String {
        let [w1, w2] = self.rpm().map(|rpm| (rpm * 100.0).round() / 100.0);
        format!("w1{w1:+}_w2{w2:+}")
    }

    /// Writes the log of the trial to `path`, which must not exist.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), Failure> {
        let robot = self.robot.get();
        let trial = Trial {
            name: self.name(),
            index: 0,
            repeat: 1,
            speeds: self.rpm().map(CentiRpm::from_rpm),
            phases: Phases { calibrate_s: 0.0, preroll_s: 0.0, run_s: self.profile.end(), decay_s: 0.0 },
            reverse: None,
            phase_deg: None,
        };
        let course = Course { schedule: Schedule::planned(&trial), profile: self.profile.clone(), replay: None };
        let plan = Plan {
            name: "python".to_owned(),
            operator: String::new(),
            note: "simulated from Python".to_owned(),
            robot: robot.file.clone(),
            seed: None,
            trials: vec![trial.clone()],
            board: BoardSettings::default(),
            hand_turn: None,
            method: biflag_log::Method::Trial,
            text: String::new(),
        };
        let model = Model::new(robot.params.clone(), Settings::DEFAULT, self.closure, self.options);
        write_log(&model, &plan, &trial, &course, (&self.samples, &self.summary), path)
            .map_err(|error| Failure::of_file(path, &error))
    }
}
