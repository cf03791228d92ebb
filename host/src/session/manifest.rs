//! `session.toml`, the manifest of a session folder.

use super::SessionError;
use crate::atomic_file;
use crate::plan::Plan;
use serde::{Deserialize, Serialize};
use std::io::{ErrorKind, Write};
use std::path::Path;

/// Name of the manifest.
pub const MANIFEST: &str = "session.toml";

/// Version of the folder's layout.
const FORMAT: u32 = 1;

#[derive(Serialize, Deserialize, Debug)]
pub(super) struct Manifest {
    format: u32,
    created: String,
    host_version: String,
    host_git_hash: String,
    /// Text of the plan's file.
    plan: String,
    /// Text of the robot's file; empty if there is none.
    robot: String,
    /// Name of the robot's file, if it is not the one in the plan.
    #[serde(default)]
    robot_name: Option<String>,
}

impl Manifest {
    pub fn new(plan: &Plan) -> Self {
        Self {
            format: FORMAT,
            created: jiff::Timestamp::now().to_string(),
            host_version: env!("CARGO_PKG_VERSION").to_owned(),
            host_git_hash: env!("BIFLAG_GIT_HASH").to_owned(),
            plan: plan.text.clone(),
            robot: plan.robot.text.clone(),
            robot_name: Some(plan.robot.name.clone()),
        }
    }

    /// Writes the manifest to a folder that has none. The write is atomic, also if another program starts the same
    /// session, or if this program is killed.
    pub fn write(&self, folder: &Path) -> Result<(), SessionError> {
        let path = folder.join(MANIFEST);
        let text = toml::to_string(self)
            .map_err(|error| SessionError::Manifest { path: path.clone(), reason: error.to_string() })?;
        let draft = atomic_file::draft(&path);
        let written = atomic_file::create(&draft)
            .and_then(|mut file| {
                file.write_all(text.as_bytes())?;
                file.sync_all()
            })
            .and_then(|()| publish(&draft, &path));
        // The draft is no longer needed, whether or not it was published.
        let _ = std::fs::remove_file(&draft);
        written.map_err(|source| match source.kind() {
            ErrorKind::AlreadyExists => SessionError::Exists { folder: folder.to_owned() },
            _ => SessionError::Io { path, source },
        })
    }

    pub fn read(folder: &Path) -> Result<Self, SessionError> {
        let path = folder.join(MANIFEST);
        let text = std::fs::read_to_string(&path).map_err(|source| match source.kind() {
            ErrorKind::NotFound if folder.is_dir() => SessionError::NotASession { folder: folder.to_owned() },
            _ => SessionError::Io { path: path.clone(), source },
        })?;
        let wrong = |reason| SessionError::Manifest { path: path.clone(), reason };
        let manifest: Self = toml::from_str(&text).map_err(|error| wrong(error.message().to_owned()))?;
        if manifest.format > FORMAT {
            return Err(wrong(format!("written by biflag {}, which is newer than this one", manifest.host_version)));
        }
        Ok(manifest)
    }

    /// Returns the plan of the session.
    pub fn plan(self, folder: &Path) -> Result<Plan, SessionError> {
        let source = format!("plan in {}", folder.join(MANIFEST).display());
        let mut plan = Plan::parse(&self.plan, &source)?;
        plan.robot.text = self.robot;
        if let Some(name) = self.robot_name {
            plan.robot.name = name;
        }
        Ok(plan)
    }
}

/// Gives a file its final name, which must not exist.
fn publish(draft: &Path, path: &Path) -> std::io::Result<()> {
    match std::fs::hard_link(draft, path) {
        // Some file systems do not support links.
        Err(error) if error.kind() != ErrorKind::AlreadyExists && !path.exists() => std::fs::rename(draft, path),
        other => other,
    }
}
