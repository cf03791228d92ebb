//! The book and the other pages: links lead somewhere, and every command of the book works.

use host::run::rig::VirtualNano;
use rustix::process::Signal;
use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use tempfile::TempDir;
use tests::markdown::Page;
use tests::{bare_nano, program, signal, wait_for_line};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

fn book() -> PathBuf {
    root().join("host/book/src")
}

fn page(path: &Path) -> Page {
    Page::parse(&fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display())))
}

/// All Markdown pages under a folder, but what was built.
fn pages(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().and_then(OsStr::to_str).unwrap_or_default();
        if path.is_dir() && !path.is_symlink() && !name.starts_with('.') && name != "target" {
            found.extend(pages(&path));
        } else if path.extension().is_some_and(|kind| kind == "md") {
            found.push(path);
        }
    }
    found
}

#[test]
fn every_link_leads_somewhere() {
    let mut wrong = Vec::new();
    let mut count = 0;
    for path in pages(root()) {
        let this = page(&path);
        for link in this.links.iter().filter(|link| !link.contains("://")) {
            count += 1;
            let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = if file.is_empty() { path.clone() } else { path.parent().unwrap().join(file) };
            let is_anchor = || anchor.is_empty() || page(&target).anchors.contains(anchor);
            // What is not in the book's folder is not in the book.
            let is_in_book = || !path.starts_with(book()) || Path::new(file).components().count() <= 1;
            if !target.exists() || !is_anchor() || !is_in_book() {
                wrong.push(format!("{}: {link}", path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(count > 30, "{count} links");
}

#[test]
fn every_page_is_in_the_summary_or_in_a_page() {
    let summary = page(&book().join("SUMMARY.md"));
    let listed: BTreeSet<String> = summary.links.into_iter().collect();
    let mut files = BTreeSet::new();
    for path in pages(&book()) {
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        let text = fs::read_to_string(&path).unwrap();
        for include in text.split("{{#include ").skip(1) {
            let included = include.split("}}").next().unwrap();
            assert!(book().join(included).exists(), "{name} includes {included}");
            files.remove(included);
            files.insert(format!("included {included}"));
        }
        files.insert(name);
    }
    let is_included = |name: &String| files.contains(&format!("included {name}"));
    let chapters = files.iter().filter(|name| !name.starts_with("included ") && *name != "SUMMARY.md");
    assert_eq!(listed, chapters.filter(|name| !is_included(name)).cloned().collect());
}

/// A folder in which the commands of a page run, and the board on which they do.
struct Reader {
    nano: Option<VirtualNano>,
    /// Another rig and its board.
    other: Option<(&'static Rig, VirtualNano)>,
    folder: TempDir,
    /// The commands that ran, and what they said.
    said: Vec<(String, String)>,
}

/// An emulated rig other than the default one.
struct Rig {
    name: &'static str,
    bridge: &'static str,
    speed_from: &'static str,
    /// What the first test of the motors says, before the board knows its rig.
    before: &'static str,
    /// What the test of the motors says then.
    after: &'static str,
    /// Beginnings of the commands that need encoders, their exit codes and what they say.
    refused: &'static [(&'static str, i32, &'static str)],
}

impl Reader {
    fn new() -> Self {
        Self { folder: TempDir::new().unwrap(), nano: None, other: None, said: Vec::new() }
    }

    /// Returns a reader with another rig. Its board has the program already, and no settings; it is faster than real time, for
    /// which avrdude is too slow, so that `flash` has a board of its own.
    fn with(rig: &'static Rig) -> Self {
        let mut new = Self::new();
        fs::write(new.folder.path().join("eeprom.bin"), [0xff; 1024]).unwrap();
        new.plug(rig, &[]);
        new
    }

    /// Plugs in a board with this rig and the settings of the one before.
    fn plug(&mut self, rig: &'static Rig, more: &[&str]) {
        self.other = None;
        let eeprom = self.folder.path().join("eeprom.bin");
        // Without encoders, the swing of a robot tells the speeds.
        let board = ["--speed", "max", "--rig", rig.name, "--robot", "published", "--eeprom", eeprom.to_str().unwrap()];
        self.other = Some((rig, bare_nano(board.iter().chain(more))));
    }

    fn rig(&self) -> Option<&'static Rig> {
        self.other.as_ref().map(|(rig, _)| *rig)
    }

    /// Returns the port of a board that is new: it has a bootloader and no program.
    fn port(&mut self) -> String {
        let new = || VirtualNano::start(&program("vnano"), ["--bootloader", "optiboot"]).unwrap();
        self.nano.get_or_insert_with(new).port().to_owned()
    }

    /// Follows a page: writes its files, and runs its commands one after the other. They end with exit code 0 or 3, unless the
    /// comment after them says another, or the rig does not have what they need.
    fn follow(&mut self, name: &str) -> usize {
        let mut count = 0;
        // A page begins with a board that has no program.
        self.nano = None;
        for code in page(&book().join(name)).code {
            if let Some(file) = code.file {
                let mut text = code.text.clone();
                if name == "bench.md" {
                    // Other tests may delay the pings to the board for longer than the usual deadline.
                    text += "[board]\ndeadline_ms = 5000\n";
                }
                // The trial of the tutorial without most of its minutes: each command is tested, not what it prints.
                for (long, short) in
                    [("preroll = 20 ", "preroll = 8 "), ("run = 60 ", "run = 20 "), ("decay = 20 ", "decay = 8 ")]
                {
                    text = text.replace(long, short);
                }
                fs::write(self.folder.path().join(file), text).unwrap();
            }
            if code.language != "sh" {
                continue;
            }
            for line in code.text.lines() {
                let (command, comment) = line.split_once(" #").unwrap_or((line, ""));
                let command = command.trim();
                if command.starts_with("biflag ") {
                    let refused = self.rig().and_then(|rig| rig.refused.iter().find(|row| command.starts_with(row.0)));
                    let codes: &[i32] = match (refused, comment.trim()) {
                        (Some((_, code, _)), _) => std::slice::from_ref(code),
                        (None, "exit code 1") => &[1],
                        // Nobody presses a key.
                        _ if command.starts_with("biflag live") || command.starts_with("biflag align") => &[130],
                        _ => &[0, 3],
                    };
                    let said = self.run(command, codes);
                    if let Some((_, _, why)) = refused {
                        assert!(said.contains(why), "{command}: {said}");
                    }
                    if let Some(rig) = self.rig().filter(|_| comment.contains("then change bridge and speed_from")) {
                        let file = self.folder.path().join(command.split("> ").nth(1).unwrap());
                        let text = fs::read_to_string(&file).unwrap();
                        let text = text.replace("bridge = \"enable\"", &format!("bridge = {:?}", rig.bridge));
                        let text =
                            text.replace("speed_from = \"encoders\"", &format!("speed_from = {:?}", rig.speed_from));
                        fs::write(file, text).unwrap();
                    }
                    self.said.push((command.to_owned(), said));
                    count += 1;
                } else {
                    let word = command.split(' ').next().unwrap();
                    assert!(["sudo", "mkdir", "tar", "make", "cargo"].contains(&word), "{name}: what is {line:?}?");
                }
            }
        }
        println!("{name}: {count} commands");
        count
    }

    /// Runs a command in a shell. The emulated board stands for the one that is plugged in.
    fn run(&mut self, line: &str, codes: &[i32]) -> String {
        let words: Vec<&str> = line.split(' ').collect();
        let has = |word: &str| words.iter().any(|other| other.starts_with(word));
        let needs_board = match words[1] {
            "flash" | "settings" | "align" => true,
            "record" => !has("--virtual"),
            "doctor" => has("--motors"),
            _ => false,
        };
        let mut line = line.to_owned();
        if needs_board || has("/dev/ttyUSB0") {
            let other = self.other.as_ref().filter(|_| words[1] != "flash").map(|(_, nano)| nano.port().to_owned());
            let port = other.unwrap_or_else(|| self.port());
            let verb = format!("biflag {}", words[1]);
            line = match has("/dev/ttyUSB0") {
                true => line.replace("/dev/ttyUSB0", &port),
                false => line.replacen(&verb, &format!("{verb} --port {port}"), 1),
            };
        }
        if words[1] == "live" {
            // Another page may be served at the same time.
            line += " --listen 127.0.0.1:0";
        }
        if has("--motors") {
            // Nobody is there to answer.
            line += " --yes";
        }
        if let Some(rig) = self.rig().filter(|_| has("--virtual")) {
            line += &format!(" --rig {}", rig.name);
        }
        if line.starts_with("biflag sensor turn") {
            // One turn each way stands for three.
            line += " --repeats 1";
        }
        println!("$ {line}");
        let mut shell = Command::new("sh");
        shell.args(["-c", &format!("exec {line}")]).current_dir(self.folder.path());
        let programs = program("biflag").parent().unwrap().to_owned();
        shell.env("PATH", format!("{}:{}", programs.display(), std::env::var("PATH").unwrap()));
        shell.env("XDG_CONFIG_HOME", self.folder.path().join("config"));
        shell.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = shell.spawn().unwrap();
        if words[1] == "live" {
            wait_for_line(&mut child, "ws://");
            signal(&child, Signal::INT);
        }
        let output = child.wait_with_output().unwrap();
        let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        let code = output.status.code();
        assert!(code.is_some_and(|code| codes.contains(&code)), "{line}: {code:?}\n{said}");
        said
    }
}

/// The commands of `sweep.md` are those of the tests `sweep` and `slurm`.
#[test]
fn commands_of_the_introduction_and_the_log() {
    assert!(Reader::new().follow("introduction.md") >= 2);
    assert!(Reader::new().follow("log.md") >= 5);
    assert!(Reader::new().follow("import.md") >= 3);
    assert!(Reader::new().follow("plan.md") >= 1);
}

#[test]
fn commands_of_the_tutorial() {
    assert!(Reader::new().follow("tutorial.md") >= 12);
}

#[test]
#[ignore = "a minute of the emulated board: part of `make proof`"]
fn commands_of_a_robot_of_your_own() {
    assert_eq!(Reader::new().follow("own-robot.md"), 8);
}

#[test]
fn commands_at_the_bench() {
    assert!(Reader::new().follow("bench.md") >= 12);
    assert!(Reader::new().follow("phase.md") >= 5);
}

/// The commands of the chapter about the bench, and of the one about angles, on another rig.
fn commands_with(rig: &'static Rig) {
    let mut reader = Reader::with(rig);
    assert!(reader.follow("bench.md") >= 12);
    if rig.speed_from == "duty" {
        // The check of the supply finds what a trial would find after its first minutes.
        reader.plug(rig, &["--fault", "motor-off=1"]);
        assert!(
            reader.run("biflag record glycerin.toml --out off", &[1]).contains("it stands, or is far off its speed")
        );
        assert!(!reader.folder.path().join("off").exists());
        reader.plug(rig, &[]);
    }
    assert!(reader.follow("phase.md") >= 5);
    reader.said.iter().for_each(|(line, said)| println!("$ {line}\n{said}"));
    let tests: Vec<usize> = (0..reader.said.len()).filter(|&i| reader.said[i].0.contains("--motors")).collect();
    let [before, after] = tests[..] else { panic!("{tests:?}") };
    assert!(reader.said[before].1.contains(rig.before) && reader.said[after].1.contains(rig.after));
    // A board that knows its rig has no advice for another one.
    let aligns = reader.said[after..].iter().any(|(_, said)| said.contains("`biflag align"));
    assert_eq!(aligns, rig.speed_from == "encoders");
}

#[test]
fn commands_with_a_bridge_of_two_inputs() {
    commands_with(&Rig {
        name: "in-in",
        bridge: "in-in",
        speed_from: "encoders",
        before: "bridge = \"in-in\"",
        after: "rpm backwards at full duty",
        refused: &[],
    });
}

/// What cannot be done without encoders.
const REFUSED: &[(&str, i32, &str)] = &[
    ("biflag align", 1, "the motors of this board have no encoders"),
    ("biflag record phases.toml", 1, "the motors of this board have no encoders"),
    ("biflag info phases", 2, "no such log"),
    ("biflag record glycerin.toml --virtual --fault encoder-open", 2, "no encoders"),
];

#[test]
#[ignore = "minutes of the emulated board: part of `make proof`"]
fn commands_without_encoders() {
    commands_with(&Rig {
        name: "duty",
        bridge: "enable",
        speed_from: "duty",
        before: "speed_from = \"duty\"",
        after: "kept for board",
        refused: REFUSED,
    });
}

#[test]
#[ignore = "minutes of the emulated board: part of `make proof`"]
fn commands_without_encoders_and_a_bridge_of_two_inputs() {
    commands_with(&Rig {
        name: "duty-in-in",
        bridge: "in-in",
        speed_from: "duty",
        before: "bridge = \"in-in\"",
        after: "kept for board",
        refused: REFUSED,
    });
}

#[test]
#[ignore = "a minute of the emulated board: part of `make proof`"]
fn commands_that_measure_the_sensor() {
    assert!(Reader::new().follow("sensor.md") >= 6);
}

#[test]
#[ignore = "half a minute of the model: part of `make proof`"]
fn commands_about_the_model() {
    assert!(Reader::new().follow("model.md") >= 8);
    assert!(Reader::new().follow("published.md") >= 4);
}
