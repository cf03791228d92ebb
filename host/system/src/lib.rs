//! The functions of the operating system beyond the standard library. No other crate calls the system, so support for another
//! system means other bodies of these functions. Linux and Windows have all of them.
//!
//! | module | content | on other systems of POSIX |
//! | --- | --- | --- |
//! | [`signals`] | interruption by the user | ignored signals are not recognised |
//! | [`children`] | programs: their start, and their end with all that they have started | a delay is not recognised |
//! | [`shell`], [`terminal`] | running and quoting a user's command; lines that the user types meanwhile | complete |
//! | [`port`], [`claim`], [`meddlers`] | serial ports, and the programs that hold or disturb them | neither holder nor meddlers |
//! | [`network`] | the computer's name and its own addresses | without a hidden address |
//! | [`disk`], [`mod@file`], [`lock`] | free room, equal files, renames, locks that do not exclude readers | complete |
//! | [`avrdude`], [`folders`], [`clock`] | the flashing program, the user's settings, a thread's time | complete |

pub mod children;
pub mod meddlers;
pub mod network;
pub mod shell;
pub mod signals;

#[cfg_attr(unix, path = "unix/mod.rs")]
#[cfg_attr(windows, path = "windows/mod.rs")]
mod own;

pub use own::{avrdude, claim, clock, disk, file, folders, lock, port, terminal};

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::{Path, PathBuf};

    /// The emulated board and the tests run on Linux only; `features` has no code.
    const MAY_ASK: [&str; 4] = ["host/system", "host/features", "sim/virtual-nano", "tests"];

    const LIBRARIES: [&str; 6] = ["libc", "nix", "rustix", "signal-hook", "winapi", "windows"];

    const WORDS: [&str; 10] = [
        "std::os::",
        "cfg(unix",
        "cfg(windows",
        "target_os",
        "\"/proc",
        "\"/sys/",
        "/dev/pts",
        "/dev/stdout",
        "XDG_",
        "home_dir",
    ];

    /// Returns the sources below a folder, except those of tests.
    fn sources(folder: &Path) -> Vec<PathBuf> {
        let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let is_test = |path: &PathBuf| path.file_stem().is_some_and(|name| name == "tests");
        let (folders, files): (Vec<_>, Vec<_>) = entries.filter(|path| !is_test(path)).partition(|path| path.is_dir());
        let rust = files.into_iter().filter(|path| path.extension().is_some_and(|kind| kind == "rs"));
        rust.chain(folders.iter().flat_map(|folder| sources(folder))).collect()
    }

    #[test]
    fn no_other_crate_asks_the_system() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().and_then(Path::parent).unwrap();
        let workspace = fs::read_to_string(root.join("Cargo.toml")).unwrap();
        let members = workspace.split_once("\nmembers = [").unwrap().1.split_once(']').unwrap().0;
        let members: Vec<&str> = members.split('"').skip(1).step_by(2).filter(|name| !MAY_ASK.contains(name)).collect();
        assert!(members.contains(&"host/rig") && members.len() >= 8, "{members:?}");
        let mut found = Vec::new();
        for member in members.iter().map(|name| root.join(name)) {
            let manifest = fs::read_to_string(member.join("Cargo.toml")).unwrap();
            let needs = |line: &&str| LIBRARIES.contains(&line.split(['.', ' ', '=']).next().unwrap());
            found.extend(manifest.lines().filter(needs).map(|line| format!("{}: {line}", member.display())));
            for file in sources(&member.join("src")) {
                let text = fs::read_to_string(&file).unwrap();
                let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
                let asks =
                    |line: &&str| !line.trim_start().starts_with("//") && WORDS.iter().any(|word| line.contains(word));
                found.extend(code.lines().filter(asks).map(|line| format!("{}: {line}", file.display())));
            }
        }
        assert!(found.is_empty(), "ask it through `host/system`:\n{}", found.join("\n"));
    }
}
