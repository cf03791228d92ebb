//! Copies of the boards' settings on this computer, by board id, for a board whose EEPROM has lost them.
//!
//! A copy is a file of `biflag settings`: `~/.config/biflag/boards/7.toml` belongs to board 7. It is written whenever
//! the settings are saved, or read from a board that has them in its EEPROM. Board id 0 means a board without an id,
//! which has no copy.

use biflag_log::atomic_file;
use protocol::Settings;
use std::io::Write;
use std::path::{Path, PathBuf};
use study::plan::line::Lines;
use study::plan::{BoardSettings, PlanError, board};

/// The folder of the copies.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct BoardCopies {
    folder: PathBuf,
}

impl BoardCopies {
    /// Returns the copies in this folder. The folder need not exist.
    pub fn in_folder(folder: &Path) -> Self {
        Self { folder: folder.to_owned() }
    }

    /// Returns the copies of this user; `None` if the user has no folder for settings.
    pub fn of_user() -> Option<Self> {
        Some(Self::in_folder(&system::folders::config()?.join("biflag/boards")))
    }

    /// Returns the path of a board's copy.
    pub fn path(&self, board_id: u16) -> PathBuf {
        self.folder.join(format!("{board_id}.toml"))
    }

    /// Returns the ids of the boards that have a copy, in ascending order.
    pub fn ids(&self) -> Vec<u16> {
        let names = std::fs::read_dir(&self.folder).into_iter().flatten().flatten().map(|entry| entry.file_name());
        let mut ids: Vec<_> =
            names.filter_map(|name| name.to_str()?.strip_suffix(".toml")?.parse::<u16>().ok()).collect();
        ids.sort_unstable();
        ids
    }

    /// Returns the smallest id, from 1, without a copy.
    pub fn unused_id(&self) -> u16 {
        let ids = self.ids();
        (1..u16::MAX).find(|id| ids.binary_search(id).is_err()).unwrap_or(u16::MAX)
    }

    /// Writes the copy of a board that has an id, unless it is up to date.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn keep(&self, settings: &Settings) -> std::io::Result<()> {
        let path = self.path(settings.board_id);
        let text = BoardSettings::all(settings).to_toml();
        if settings.board_id == 0 || std::fs::read_to_string(&path).is_ok_and(|kept| kept == text) {
            return Ok(());
        }
        std::fs::create_dir_all(&self.folder)?;
        atomic_file::replace(&path, |file| file.write_all(text.as_bytes()))
    }

    /// Returns the path of the lines of a board's motors.
    fn lines_path(&self, board_id: u16) -> PathBuf {
        self.folder.join(format!("{board_id}.lines.toml"))
    }

    /// Writes the lines of a board's motors.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn keep_lines(&self, board_id: u16, lines: &Lines) -> std::io::Result<()> {
        std::fs::create_dir_all(&self.folder)?;
        let text = toml::to_string(lines).map_err(std::io::Error::other)?;
        atomic_file::replace(&self.lines_path(board_id), |file| file.write_all(text.as_bytes()))
    }

    /// Returns the lines of a board's motors, if they were measured.
    pub fn lines(&self, board_id: u16) -> Option<Lines> {
        toml::from_str(&std::fs::read_to_string(self.lines_path(board_id)).ok()?).ok()
    }

    /// Reads the copy of a board.
    ///
    /// # Errors
    /// [`PlanError`] if there is no copy or it is not a file of settings.
    pub fn load(&self, board_id: u16) -> Result<BoardSettings, PlanError> {
        board::load(&self.path(board_id))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_copy_gives_the_settings_back() {
        let folder = tempfile::tempdir().unwrap();
        let copies = BoardCopies::in_folder(&folder.path().join("biflag/boards"));
        assert_eq!((copies.ids(), copies.unused_id()), (vec![], 1));
        let settings = Settings { board_id: 1, motor_reversed: [true, false], ..Settings::DEFAULT };
        copies.keep(&settings).unwrap();
        copies.keep(&Settings { board_id: 20, ..settings }).unwrap();
        copies.keep(&Settings { board_id: 0, ..settings }).unwrap();
        assert_eq!((copies.ids(), copies.unused_id()), (vec![1, 20], 2));
        assert_eq!(copies.load(1).unwrap().apply(Settings::DEFAULT), Ok(settings));
        assert!(copies.load(2).is_err());
        let changed = Settings { moving_duty: [30, 40], ..settings };
        copies.keep(&changed).unwrap();
        assert_eq!(copies.load(1).unwrap().apply(Settings::DEFAULT), Ok(changed));
    }
}
