//! Programs of the system that take serial ports away, or write to them.

use std::fs;
use std::path::Path;

/// The name of a program in `/proc`, what it does to a board, and how to end that.
const MEDDLERS: [(&str, &str, &str); 2] = [
    (
        "brltty",
        "brltty is running: it takes boards with a CH340 for Braille displays, and their port disappears",
        "if nobody here reads Braille: `sudo apt remove brltty`; otherwise comment the line of 1a86:7523 out in its udev rules",
    ),
    (
        "ModemManager",
        "ModemManager is running: it writes to a new port for some seconds, in which the board answers nothing",
        "if this computer has no modem: `sudo systemctl disable --now ModemManager`",
    ),
];

/// Whether they are looked for on this system.
pub const ARE_LOOKED_FOR: bool = cfg!(target_os = "linux");

/// Returns what each of the running ones does to a board, and how to end that.
pub fn running() -> Vec<(&'static str, &'static str)> {
    among(Path::new("/proc"))
}

/// Returns the same for the processes under `proc`.
fn among(proc: &Path) -> Vec<(&'static str, &'static str)> {
    let names: Vec<String> = (fs::read_dir(proc).into_iter().flatten().flatten())
        .filter_map(|process| fs::read_to_string(process.path().join("comm")).ok())
        .map(|name| name.trim_end().to_owned())
        .collect();
    let runs = |(name, ..): &&(&str, &str, &str)| names.iter().any(|running| running == name);
    MEDDLERS.iter().filter(runs).map(|(_, detail, cure)| (*detail, *cure)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_that_takes_ports_is_named_with_its_cure() {
        let proc = tempfile::tempdir().unwrap();
        let process = |pid: &str, name: &str| {
            fs::create_dir(proc.path().join(pid)).unwrap();
            fs::write(proc.path().join(pid).join("comm"), format!("{name}\n")).unwrap();
        };
        process("1", "systemd");
        process("77", "brltty-helper");
        assert!(among(proc.path()).is_empty());
        process("78", "brltty");
        process("90", "ModemManager");
        let [(braille, _), (_, modem)] = among(proc.path())[..] else { panic!() };
        assert!(braille.starts_with("brltty is running") && modem.contains("systemctl disable --now ModemManager"));
    }
}
