//! Utilities of the end-to-end tests, which run the `biflag` program against the real firmware on the emulated board,
//! as a user would.

pub mod browser;
mod cable;
pub mod golden;
mod lateness;
pub mod markdown;
pub mod python;
pub mod synthetic_rig;
mod viewer;

pub use cable::Cable;
pub use lateness::Lateness;
pub use viewer::{Seen, Viewer};

use host::run::rig::VirtualNano;
use host::signals::is_ignored;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::{Value, json};
use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT};
use signal_hook::flag;
use std::ffi::OsStr;
use std::io::{BufRead, BufReader};
use std::ops::{Deref, DerefMut};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, Once, OnceLock, PoisonError};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Waits until no other test holds the whole computer, and holds it: for long tests on all cores, and for tests that measure
/// times.
pub fn whole_computer() -> MutexGuard<'static, ()> {
    static WHOLE: Mutex<()> = Mutex::new(());
    WHOLE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns a figure of the memory of a child as the kernel reports it in `/proc/PID/status`, kB; 0 once the child has ended.
pub fn memory_kb(child: &Child, figure: &str) -> f64 {
    let text = std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
    let value = text.lines().find_map(|line| line.strip_prefix(figure)?.strip_prefix(':'));
    value.and_then(|value| value.split_whitespace().next()?.parse().ok()).unwrap_or(0.0)
}

/// A temporary folder to work in.
pub struct Bench {
    folder: TempDir,
}

/// The result of a run of `biflag`.
#[derive(Debug)]
pub struct Run {
    /// The exit code; `None` if it was ended by a signal.
    pub code: Option<i32>,
    /// Output on stdout.
    pub stdout: String,
    /// Output on stderr.
    pub stderr: String,
}

impl Bench {
    /// Creates a temporary folder.
    pub fn new() -> Self {
        Self { folder: TempDir::new().expect("a temporary folder") }
    }

    /// Creates a temporary folder in memory, so that no disk delays what is written.
    pub fn in_memory() -> Self {
        Self { folder: TempDir::new_in("/dev/shm").expect("a temporary folder in memory") }
    }

    /// Returns the folder.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Writes a file into the folder.
    pub fn file(&self, name: &str, content: &str) -> PathBuf {
        let path = self.path().join(name);
        std::fs::write(&path, content).expect("a file in the temporary folder");
        path
    }

    /// Writes a plan of one trial without calibration, pre-roll and decay: if the motors turn, all commands exit with 3, because
    /// nothing shows the gyroscope's bias. The motors' deadline is the longest one, because
    /// other programs may delay the pings.
    pub fn short_plan(&self, run_s: f64, speeds: [f64; 2]) -> PathBuf {
        let [w1, w2] = speeds;
        self.file(
            "plan.toml",
            &format!(
                "[session]\nname = \"bench\"\n\
                 [board]\ndeadline_ms = 5000\n\
                 [trial]\ncalibrate = 0\npreroll = 0\nrun = {run_s}\ndecay = 0\n\
                 [speeds]\npairs = [[{w1}, {w2}]]\n"
            ),
        )
    }

    /// Runs `biflag` in the folder to its end.
    pub fn run<I: IntoIterator<Item = S>, S: AsRef<std::ffi::OsStr>>(&self, arguments: I) -> Run {
        Run::of(self.start(arguments))
    }

    /// Starts `biflag` in the folder; [`Run::of`] waits for its end.
    pub fn start<I: IntoIterator<Item = S>, S: AsRef<std::ffi::OsStr>>(&self, arguments: I) -> Child {
        self.command(arguments).spawn().expect("biflag starts")
    }

    /// Returns the command that [`Self::start`] starts.
    pub fn command<I: IntoIterator<Item = S>, S: AsRef<std::ffi::OsStr>>(&self, arguments: I) -> Command {
        let mut command = Command::new(program("biflag"));
        command.args(arguments).current_dir(self.path()).stdin(Stdio::null());
        command.env("XDG_CONFIG_HOME", self.path().join("config"));
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }
}

impl Default for Bench {
    fn default() -> Self {
        Self::new()
    }
}

impl Run {
    /// Waits for the end of a run.
    pub fn of(child: Child) -> Self {
        let output = child.wait_with_output().expect("biflag ends");
        let text = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
        Self { code: output.status.code(), stdout: text(output.stdout), stderr: text(output.stderr) }
    }

    /// Returns the JSON object on stdout.
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|error| panic!("stdout is not JSON ({error}): {self:?}"))
    }

    /// Panics unless the exit code is `code`.
    #[track_caller]
    pub fn expect_code(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "stdout: {}\nstderr: {}", self.stdout, self.stderr);
        self
    }

    /// Panics unless the only warnings are about trials that are too short to settle.
    #[track_caller]
    pub fn expect_unsettled(self) -> Self {
        let said = self.stdout.replace("{\"cure\"", "\n{\"cure\"") + &self.stderr;
        let is_grave = |line: &&str| line.contains("warning: ") || line.contains("\"grave\":true");
        let others: Vec<&str> = said.lines().filter(is_grave).filter(|line| !line.contains("not settled")).collect();
        assert!(others.is_empty(), "{others:?}");
        self.expect_code(3)
    }
}

/// Sends a signal to a run that has not ended. Starting `kill` takes too long on a busy computer.
pub fn signal(child: &Child, signal: Signal) {
    kill_process(Pid::from_child(child), signal).expect("a running program");
}

/// Stops a run while `act` is carried out. The time of a board in lock-step with it stands still meanwhile.
pub fn while_held<T>(run: &Child, act: impl FnOnce() -> T) -> T {
    signal(run, Signal::STOP);
    let done = act();
    signal(run, Signal::CONT);
    done
}

/// Waits until a run prints `text` on stderr, which is read to its end in the background. Returns the line.
#[track_caller]
pub fn wait_for_line(child: &mut Child, text: &str) -> String {
    let mut lines = BufReader::new(child.stderr.take().expect("a pipe")).lines().map_while(Result::ok);
    let mut said = Vec::new();
    let line = lines.by_ref().inspect(|line| said.push(line.clone())).find(|line| line.contains(text));
    std::thread::spawn(move || lines.for_each(drop));
    line.unwrap_or_else(|| panic!("{text:?} is not in {said:?}"))
}

/// Returns the logs in a session folder, sorted.
pub fn logs(session: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(session) else { return Vec::new() };
    let mut logs: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    logs.retain(|path| path.extension().is_some_and(|extension| extension == "mcap"));
    logs.sort();
    logs
}

/// Asserts the exit code, and one error on stderr that contains all of `words`.
#[track_caller]
pub fn expect_error(run: &Run, code: i32, words: &[&str]) {
    assert_eq!(run.code, Some(code), "{run:?}");
    assert_eq!(run.stderr.matches("error: ").count(), 1, "one error, not {}", run.stderr);
    for word in words {
        assert!(run.stderr.contains(word), "no {word:?} in: {}", run.stderr);
    }
}

/// Waits until a session has `count` logs.
#[track_caller]
pub fn wait_for_logs(session: &Path, count: usize) {
    wait_until("a trial starts", || logs(session).len() >= count);
}

/// Waits until a condition holds, for at most a minute.
#[track_caller]
pub fn wait_until(what: &str, mut holds: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !holds() {
        assert!(begun.elapsed() < Duration::from_secs(60), "not within a minute: {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Waits until the board drives a motor.
#[track_caller]
pub fn wait_for_motion(nano: &mut VirtualNano) {
    wait_until("a motor is driven", || is_driven(nano));
}

/// Returns whether the board drives a motor.
pub fn is_driven(nano: &mut VirtualNano) -> bool {
    nano.control("status").expect("a board")["pwm"] != json!([0, 0])
}

/// Returns the board's own time, s. On a busy computer this time passes slowly, too.
pub fn board_s(nano: &mut VirtualNano) -> f64 {
    nano.control("status").expect("a board")["seconds"].as_f64().expect("a number")
}

/// Waits until this many seconds of the board's own time have passed.
#[track_caller]
pub fn pass(nano: &mut VirtualNano, seconds: f64) {
    let begun_s = board_s(nano);
    wait_until("the board's time passes", || board_s(nano) >= begun_s + seconds);
}

/// An emulated board with the real firmware, and the file of its EEPROM.
pub struct Nano {
    nano: VirtualNano,
    _folder: TempDir,
}

impl Deref for Nano {
    type Target = VirtualNano;

    fn deref(&self) -> &VirtualNano {
        &self.nano
    }
}

impl DerefMut for Nano {
    fn deref_mut(&mut self) -> &mut VirtualNano {
        &mut self.nano
    }
}

/// Starts the emulated board with the real firmware and an EEPROM with settings. At any `--speed` but 1 it is in lock-step with
/// the program at its port: its time stands still while that program is held up. So no result of a trial depends on how busy the
/// computer is. At 1, the default, it is a board in real time, which does not wait.
pub fn nano<I: IntoIterator<Item = S>, S: AsRef<OsStr>>(arguments: I) -> Nano {
    static STORED: OnceLock<Vec<u8>> = OnceLock::new();
    let folder = TempDir::new().expect("a temporary folder");
    let eeprom = folder.path().join("eeprom");
    std::fs::write(&eeprom, STORED.get_or_init(eeprom_with_settings)).expect("an EEPROM's file");
    let arguments = arguments.into_iter().map(|argument| argument.as_ref().to_owned());
    let eeprom = ["--eeprom".into(), eeprom.into_os_string()];
    Nano { nano: bare_nano(arguments.chain(eeprom)), _folder: folder }
}

/// Longest wait of a board in lock-step for a silent program, s, as with `record --virtual`.
const PATIENCE_S: &str = "60";

/// Starts the emulated board with the real firmware; its EEPROM is blank unless a file is given.
pub fn bare_nano<I: IntoIterator<Item = S>, S: AsRef<OsStr>>(arguments: I) -> VirtualNano {
    let mut all = vec!["--firmware".into(), firmware().into_os_string(), "--patience".into(), PATIENCE_S.into()];
    all.extend(arguments.into_iter().map(|argument| argument.as_ref().to_owned()));
    VirtualNano::start(&program("vnano"), all).expect("the emulated board starts")
}

/// Returns the EEPROM of a board whose settings a user has saved.
fn eeprom_with_settings() -> Vec<u8> {
    let bench = Bench::new();
    let eeprom = bench.path().join("eeprom");
    let nano = bare_nano([OsStr::new("--speed"), OsStr::new("max"), OsStr::new("--eeprom"), eeprom.as_os_str()]);
    bench.run(["settings", "--new", "--port", nano.port()]).expect_code(0);
    // The board's program writes the file when it ends.
    drop(nano);
    std::fs::read(eeprom).expect("the EEPROM's file")
}

/// Returns the path of a file of the reference data.
pub fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data").join(name)
}

/// Compiles the library that makes a write take long (`src/stall.c`) into a folder; returns its path.
pub fn stalling_library(folder: &Path) -> PathBuf {
    let (source, library) = (Path::new(env!("CARGO_MANIFEST_DIR")).join("src/stall.c"), folder.join("stall.so"));
    let mut compiler = Command::new("cc");
    compiler.args(["-O1", "-shared", "-fPIC", "-o"]).arg(&library).arg(source).arg("-ldl");
    assert!(compiler.status().expect("a C compiler").success());
    library
}

/// Returns the folder of the repository.
pub fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("a folder of the repository")
}

/// Returns the path of the firmware image.
pub fn firmware() -> PathBuf {
    built(repository().join("target/firmware.elf"))
}

/// Returns the path of a program of the release build, for `biflag` the path in `BIFLAG_PROGRAM` if it is set: `biflag.exe` under
/// Wine. In a debug build the emulated board is too slow.
pub fn program(name: &str) -> PathBuf {
    hear_signals();
    let other = std::env::var_os("BIFLAG_PROGRAM").filter(|_| name == "biflag");
    built(other.map_or_else(|| repository().join("target/release").join(name), PathBuf::from))
}

/// Lets the programs that tests start receive signals. A shell ignores Ctrl-C for what it runs in the background, and programs
/// inherit that, unless the signal has a handler: then a program starts with the system's default reaction.
fn hear_signals() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        for signal in [SIGHUP, SIGINT, SIGQUIT].into_iter().filter(|signal| is_ignored(*signal)) {
            // This process does not react: nothing reads the flag.
            flag::register(signal, Arc::new(AtomicBool::new(false))).expect("a handler");
        }
    });
}

fn built(path: PathBuf) -> PathBuf {
    assert!(path.is_file(), "{} is missing: build it first with `make build`", path.display());
    path
}
