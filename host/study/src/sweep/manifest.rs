//! The manifest of a sweep's folder: everything that its points depend on.
//!
//! It is written once and never changed. Workers that start together may all write it: they write the same bytes, only
//! one of them names the file, and each reads it back.

use super::SweepError;
use super::error::SESSION;
pub(super) use crate::plan::error::sweep_manifest as path;
use crate::session;
use biflag_log::atomic_file;
use serde::{Deserialize, Serialize};
use std::io::ErrorKind;
use std::path::Path;

/// The manifest.
#[derive(Serialize, Deserialize, PartialEq, Debug)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Version of the model's results, [`super::RESULTS`].
    pub results: u32,
    /// Name of the robot or of its file.
    pub robot_name: String,
    /// Text of the robot's file; empty for a built-in robot.
    pub robot: String,
    /// Text of the plan's file.
    pub plan: String,
}

impl Manifest {
    /// Creates the folder with this manifest, unless it exists.
    ///
    /// # Errors
    /// [`SweepError::Other`] if the folder has a different manifest.
    pub fn put_into(&self, folder: &Path) -> Result<(), SweepError> {
        if folder.join(session::MANIFEST).exists() {
            return Err(SweepError::Other { folder: folder.to_owned(), what: SESSION });
        }
        std::fs::create_dir_all(folder).map_err(SweepError::at(folder))?;
        let file = path(folder);
        if !file.exists() {
            let text = toml::to_string(self)
                .map_err(|error| SweepError::Manifest { path: file.clone(), reason: error.to_string() })?;
            match atomic_file::create(&file, &text) {
                // Another worker has just created it.
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                other => other.map_err(SweepError::at(&file))?,
            }
        }
        let found = Self::read(folder)?;
        let differs = |what| Err(SweepError::Other { folder: folder.to_owned(), what });
        if found.plan != self.plan {
            differs("a sweep of another plan")
        } else if (&found.robot_name, &found.robot) != (&self.robot_name, &self.robot) {
            differs("a sweep of another robot")
        } else if found.results != self.results {
            differs("a sweep of another version of the model's results")
        } else {
            Ok(())
        }
    }

    /// Reads the manifest of a folder.
    ///
    /// # Errors
    /// [`SweepError::NotASweep`], [`SweepError::Manifest`].
    pub fn read(folder: &Path) -> Result<Self, SweepError> {
        let path = path(folder);
        let text = match std::fs::read_to_string(&path) {
            Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
                return Err(SweepError::NotASweep { folder: folder.to_owned() });
            }
            other => other.map_err(SweepError::at(&path))?,
        };
        toml::from_str(&text).map_err(|error| SweepError::Manifest { path, reason: error.message().replace('\n', " ") })
    }
}
