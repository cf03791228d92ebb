//! Programs of the system that take serial ports away, or write to them.

use super::Finding;
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

/// Returns a finding for each that runs, by the processes under `proc`; a fine one if none does.
pub fn check(proc: &Path) -> Vec<Finding> {
    let names: Vec<String> = (fs::read_dir(proc).into_iter().flatten().flatten())
        .filter_map(|process| fs::read_to_string(process.path().join("comm")).ok())
        .map(|name| name.trim_end().to_owned())
        .collect();
    let runs = |(name, ..): &&(&str, &str, &str)| names.iter().any(|running| running == name);
    let found: Vec<Finding> =
        MEDDLERS.iter().filter(runs).map(|(_, detail, cure)| Err(((*detail).into(), (*cure).into()))).collect();
    if found.is_empty() { vec![Ok("none that takes serial ports".into())] } else { found }
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
        assert!(matches!(check(proc.path())[..], [Ok(_)]));
        process("78", "brltty");
        process("90", "ModemManager");
        let [Err((braille, _)), Err((_, modem))] = &check(proc.path())[..] else { panic!() };
        assert!(braille.starts_with("brltty is running") && modem.contains("systemctl disable --now ModemManager"));
    }
}
