//! `session.toml`, the manifest of a session folder.

use super::SessionError;
use crate::plan::{PHYSICAL, PUBLISHED, Plan};
use crate::program;
use crate::sensor::note::OF_BOARD;
use biflag_log::{MeasuredSensorMeta, atomic_file};
use serde::{Deserialize, Serialize};
use sim::params::BUILT_IN;
use std::io::ErrorKind;
use std::path::Path;
use std::time::SystemTime;

/// Name of the manifest.
pub const MANIFEST: &str = "session.toml";

/// Version of the folder's layout.
const FORMAT: u32 = 1;

#[derive(Serialize, Deserialize, Debug)]
pub(super) struct Manifest {
    #[serde(default = "format")]
    format: u32,
    /// Start time and starting program of the session, for information only.
    #[serde(default)]
    pub created: String,
    #[serde(default)]
    host_version: String,
    #[serde(default)]
    host_git_hash: String,
    /// Text of the plan's file.
    plan: String,
    /// Text of the robot's file; empty if there is none.
    #[serde(default)]
    robot: Option<String>,
    /// Name of the robot or of its file.
    #[serde(default)]
    robot_name: Option<String>,
    /// Text of the sensor's file, if the plan names one or the board stores measured values.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    sensor: Option<String>,
}

fn format() -> u32 {
    FORMAT
}

impl Manifest {
    pub fn new(plan: &Plan) -> Self {
        Self {
            format: FORMAT,
            created: program::timestamp(SystemTime::now()),
            host_version: program::VERSION.to_owned(),
            host_git_hash: program::GIT_HASH.to_owned(),
            plan: plan.text.clone(),
            robot: Some(plan.robot.text.clone()),
            robot_name: Some(plan.robot.name.clone()),
            sensor: plan.sensor.as_ref().map(|sensor| sensor.text.clone()),
        }
    }

    /// Writes the manifest to a folder that has none. The write is atomic, also if another program starts the same
    /// session, or if this program is killed.
    pub fn write(&self, folder: &Path) -> Result<(), SessionError> {
        let path = folder.join(MANIFEST);
        let text = toml::to_string(self)
            .map_err(|error| SessionError::Manifest { path: path.clone(), reason: error.to_string() })?;
        atomic_file::create(&path, &text).map_err(|source| match source.kind() {
            ErrorKind::AlreadyExists => SessionError::Exists { folder: folder.to_owned(), what: "a session" },
            _ => SessionError::Io { path, source },
        })
    }

    pub fn read(folder: &Path) -> Result<Self, SessionError> {
        let path = folder.join(MANIFEST);
        let wrong = |reason| SessionError::Manifest { path: path.clone(), reason };
        let text = std::fs::read_to_string(&path).map_err(|source| match source.kind() {
            ErrorKind::NotFound | ErrorKind::NotADirectory => SessionError::NotASession { folder: folder.to_owned() },
            ErrorKind::InvalidData => wrong("is not text in UTF-8".to_owned()),
            _ => SessionError::Io { path: path.clone(), source },
        })?;
        // A newer manifest may lack keys that this version needs.
        let newer = text.parse::<toml::Table>().ok().filter(|table| {
            table.get("format").and_then(toml::Value::as_integer).is_some_and(|format| format > FORMAT.into())
        });
        if let Some(newer) = newer {
            let program = newer.get("host_version").and_then(toml::Value::as_str).unwrap_or("(unknown)").to_owned();
            return Err(SessionError::Newer { path, program });
        }
        toml::from_str(&text).map_err(|error| wrong(error.message().to_owned()))
    }

    /// Returns the plan of the session.
    pub fn plan(self, folder: &Path) -> Result<Plan, SessionError> {
        let path = folder.join(MANIFEST);
        let mut plan = Plan::parse(&self.plan, &format!("plan in {}", path.display()))?;
        plan.sensor = self.sensor.map(|text| match plan.sensor {
            Some(sensor) => MeasuredSensorMeta { text, ..sensor },
            None => MeasuredSensorMeta { name: OF_BOARD.to_owned(), text },
        });
        match self.robot_name {
            Some(name) => plan.robot.name = name,
            // A manifest without the name is older than `physical`.
            None if plan.robot.name == PHYSICAL => plan.robot.name = PUBLISHED.to_owned(),
            None => {}
        }
        plan.robot.text = match self.robot {
            Some(text) => text,
            None if BUILT_IN.contains(&plan.robot.name.as_str()) => String::new(),
            None => return Err(SessionError::Manifest { path, reason: "the robot file is missing".to_owned() }),
        };
        Ok(plan)
    }
}
