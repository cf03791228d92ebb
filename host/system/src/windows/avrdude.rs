//! The program that writes firmware through a bootloader.

use std::ffi::OsString;
use std::fs::read_dir;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Its name for the system's installer ([`crate::shell::INSTALL`]).
pub const PACKAGE: &str = "AVRDudes.AVRDUDE";

/// The folders of avrdude in the Arduino IDE, below the folders in these environment variables: for version 2, which has a folder
/// for each version of avrdude, and for version 1.
const OF_ARDUINO: [(&str, &str); 3] = [
    ("LOCALAPPDATA", r"Arduino15\packages\arduino\tools\avrdude"),
    ("ProgramFiles(x86)", r"Arduino\hardware\tools"),
    ("ProgramFiles", r"Arduino\hardware\tools"),
];

/// Returns the program: beside this one, on the `PATH`, or the Arduino IDE's.
pub fn command() -> Command {
    let beside = std::env::current_exe().unwrap_or_default();
    let search = std::env::var_os("PATH").unwrap_or_default();
    let mut folders = beside.parent().map(Path::to_owned).into_iter().chain(std::env::split_paths(&search));
    if folders.any(|folder| folder.join("avrdude.exe").is_file()) {
        // Where the system looks first.
        return Command::new("avrdude");
    }
    let roots = OF_ARDUINO.iter().filter_map(|(root, tools)| Some(Path::new(&std::env::var_os(root)?).join(tools)));
    roots.filter_map(|root| below(&root)).next().unwrap_or_else(|| Command::new("avrdude"))
}

/// Returns the newest avrdude in the folders below `root`, with its own list of chips.
fn below(root: &Path) -> Option<Command> {
    let mut folders: Vec<PathBuf> = read_dir(root).ok()?.flatten().map(|entry| entry.path()).collect();
    folders.sort();
    folders.iter().rev().find_map(|folder| {
        let program = folder.join(r"bin\avrdude.exe");
        let mut command = program.is_file().then(|| Command::new(&program))?;
        let chips = folder.join(r"etc\avrdude.conf");
        if chips.is_file() {
            command.args([OsString::from("-C"), chips.into()]);
        }
        Some(command)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_avrdude_of_the_arduino_ide_is_found() {
        let root = tempfile::tempdir().unwrap();
        assert!(below(root.path()).is_none() && below(&root.path().join("missing")).is_none());
        for version in ["6.3.0-arduino9", "8.0-arduino1", "9-unpacked-in-part"] {
            std::fs::create_dir_all(root.path().join(version).join("bin")).unwrap();
        }
        for file in [r"6.3.0-arduino9\bin\avrdude.exe", r"8.0-arduino1\bin\avrdude.exe"] {
            std::fs::write(root.path().join(file), "").unwrap();
        }
        assert_eq!(below(root.path()).unwrap().get_program(), root.path().join(r"8.0-arduino1\bin\avrdude.exe"));
    }
}
