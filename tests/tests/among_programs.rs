//! Recordings among other programs: shells that send signals, programs that touch the logs, limits, names, and text from
//! elsewhere.

use rustix::fs::{OFlags, fcntl_setfl};
use rustix::process::{Pid, Signal, kill_process, kill_process_group};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Winsize, tcsetwinsize};
use serde_json::Value;
use std::ffi::OsString;
use std::fs::File;
use std::io::{ErrorKind, PipeReader, PipeWriter, Read, Write};
use std::os::unix::ffi::OsStringExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tests::{
    Bench, Run, board_s, is_driven, logs, nano, pass, program, signal, stalling_library, wait_for_line, wait_for_logs,
    wait_for_motion, wait_until,
};

/// Starts a shell command in which `$0` is `biflag`, in a process group of its own, as shells start jobs.
fn shell(bench: &Bench, command: &str, arguments: &[&str]) -> Child {
    let mut shell = Command::new("sh");
    shell.args(["-c", command]).arg(program("biflag")).args(arguments).current_dir(bench.path()).process_group(0);
    shell.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

/// Sends a signal to a process group, as a terminal does.
fn signal_group(leader: &Child, signal: Signal) {
    kill_process_group(Pid::from_child(leader), signal).unwrap();
}

fn end_of(log: &Path) -> Option<biflag_log::End> {
    biflag_log::summary(log).unwrap().map(|summary| summary.end)
}

/// Returns the emulated board that a recording has started.
fn board_of(recording: &Child) -> u32 {
    let id = recording.id();
    let children = std::fs::read_to_string(format!("/proc/{id}/task/{id}/children")).unwrap();
    let is_board =
        |id: &u32| std::fs::read_to_string(format!("/proc/{id}/comm")).is_ok_and(|name| name.trim() == "vnano");
    children.split_whitespace().map(|id| id.parse().unwrap()).find(is_board).expect("a running board")
}

/// A terminal sends Ctrl-C to every program in front; the board must live until the trial has ended.
#[test]
fn ctrl_c_on_the_terminal_ends_a_recording_on_the_emulated_board() {
    let bench = Bench::new();
    let plan = bench.short_plan(60.0, [50.0, 10.0]);
    let arguments = ["record", plan.to_str().unwrap(), "--virtual", "--out", "session"];
    let mut recording = shell(&bench, "exec \"$0\" \"$@\"", &arguments);
    wait_for_line(&mut recording, ": run");
    signal_group(&recording, Signal::INT);
    Run::of(recording).expect_code(130);
    assert_eq!(end_of(&logs(&bench.path().join("session"))[0]), Some(biflag_log::End::Aborted));
}

/// A terminal's Ctrl-\ ends the program without a word, and its board with it.
#[test]
fn board_ends_with_a_program_that_is_killed() {
    let bench = Bench::new();
    for (command, arguments) in [("record", ["--speeds=50,10", "--run=60"]), ("steer", ["--yaw=-67", "--pitch=-4"])] {
        let mut killed =
            shell(&bench, "exec \"$0\" \"$@\"", &[command, arguments[0], arguments[1], "--virtual", "--out", command]);
        wait_for_line(&mut killed, "001_w1");
        let board = board_of(&killed);
        signal_group(&killed, Signal::QUIT);
        assert!(!killed.wait().unwrap().success());
        // Nobody may have asked for its end yet.
        let state = || std::fs::read_to_string(format!("/proc/{board}/stat")).unwrap_or_default();
        wait_until("the board ends", || state().rsplit_once(')').is_none_or(|(_, state)| state.starts_with(" Z")));
    }
}

/// A board whose program is stopped is an error, and is not left behind.
#[test]
fn stopped_emulated_board_ends_the_recording() {
    let bench = Bench::new();
    let plan = bench.short_plan(60.0, [50.0, 10.0]);
    let mut recording = bench.start(["record", plan.to_str().unwrap(), "--virtual", "--out", "session"]);
    wait_for_line(&mut recording, ": run");
    let board = board_of(&recording);
    let stopped = Instant::now();
    kill_process(Pid::from_raw(board.try_into().unwrap()).unwrap(), Signal::STOP).unwrap();
    let run = wait(recording, Duration::from_secs(60));
    println!("ended {:.1} s after its board was stopped", stopped.elapsed().as_secs_f64());
    assert_eq!(run.code, Some(1), "{run:?}");
    assert!(!Path::new(&format!("/proc/{board}")).exists(), "the board is left behind");
    let [log] = logs(&bench.path().join("session")).try_into().unwrap();
    assert_eq!(end_of(&log), Some(biflag_log::End::Failed));
}

/// A disk that hangs makes the first Ctrl-C wait; the second one ends the program, and says what may be lost.
#[test]
fn second_ctrl_c_ends_a_recording_whose_disk_hangs() {
    let bench = Bench::new();
    let plan = bench.short_plan(120.0, [50.0, 10.0]);
    let mut nano = nano(["--speed", "2"]);
    let mut command = Command::new(program("biflag"));
    command.args(["record", plan.to_str().unwrap(), "--port", nano.port(), "--out", "session"]);
    // It begins to hang in the trial, and would for ten minutes.
    command.env("LD_PRELOAD", stalling_library(bench.path())).env("STALL_MS", "600000").env("STALL_AFTER_MS", "4000");
    command.env("XDG_CONFIG_HOME", bench.path().join("config")).current_dir(bench.path());
    let command = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut recording = command.spawn().unwrap();
    wait_for_motion(&mut nano);
    let log = logs(&bench.path().join("session")).remove(0);
    let (mut length, mut grown) = (0, Instant::now());
    wait_until("the disk hangs", || {
        let now = std::fs::metadata(&log).unwrap().len();
        if now != length {
            (length, grown) = (now, Instant::now());
        }
        // It grows four times a second.
        grown.elapsed() > Duration::from_secs(2)
    });
    signal(&recording, Signal::INT);
    // The motors stop at once.
    wait_until("the motors stop", || !is_driven(&mut nano));
    std::thread::sleep(Duration::from_secs(1));
    assert!(recording.try_wait().unwrap().is_none(), "it waits for the disk");
    signal(&recording, Signal::INT);
    let run = wait(recording, Duration::from_secs(60));
    assert_eq!(run.code, Some(130), "{run:?}");
    assert!(run.stderr.contains("interrupted again: ended at once"), "{run:?}");
}

/// Waits for the end of a run, but not for ever.
fn wait(mut child: Child, limit: Duration) -> Run {
    let begun = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if begun.elapsed() > limit {
            child.kill().unwrap();
            panic!("hangs: {:?}", Run::of(child));
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    Run::of(child)
}

/// `nohup` ignores the signal of a closed terminal, and a shell that of Ctrl-C for its jobs in the background.
#[test]
fn ignored_signals_do_not_end_a_recording() {
    for (ignored, sent) in [("HUP", Signal::HUP), ("INT", Signal::INT)] {
        let bench = Bench::new();
        let plan = bench.short_plan(4.0, [50.0, 10.0]);
        let nano = nano(["--speed", "2"]);
        let arguments = ["record", plan.to_str().unwrap(), "--port", nano.port(), "--out", "session", "--json"];
        let recording = shell(&bench, &format!("trap '' {ignored}; exec \"$0\" \"$@\""), &arguments);
        wait_for_logs(&bench.path().join("session"), 1);
        signal(&recording, sent);
        let run = Run::of(recording).expect_code(3);
        assert_eq!(run.json()["trials"][0]["complete"], true, "{ignored}");
    }
}

/// Nothing can be printed on a terminal that has closed.
#[test]
fn closed_terminal_interrupts_a_recording() {
    let bench = Bench::new();
    let plan = bench.short_plan(60.0, [50.0, 10.0]);
    let nano = nano(["--speed", "2"]);
    let arguments = ["record", plan.to_str().unwrap(), "--port", nano.port(), "--out", "session"];
    let recording = shell(&bench, "exec \"$0\" \"$@\" >/dev/full 2>&1", &arguments);
    wait_for_logs(&bench.path().join("session"), 1);
    std::thread::sleep(Duration::from_millis(500));
    signal(&recording, Signal::HUP);
    Run::of(recording).expect_code(130);
    assert_eq!(end_of(&logs(&bench.path().join("session"))[0]), Some(biflag_log::End::Aborted));
}

/// A log that another program removes, truncates or overwrites while it is written is not a complete trial.
#[test]
fn log_that_is_changed_while_it_is_written_is_a_failure() {
    let truncate = |log: &Path, length: u64| {
        let length = length.min(std::fs::metadata(log).unwrap().len() / 2);
        std::fs::File::options().write(true).open(log).unwrap().set_len(length).unwrap();
    };
    let overwrite = |log: &Path| {
        std::fs::File::options().write(true).open(log).unwrap().write_all(&[b'x'; 100]).unwrap();
    };
    type Act<'a> = &'a (dyn Fn(&Path) + Sync);
    let cases: [(&str, Act); 6] = [
        ("removed", &|log| std::fs::remove_file(log).unwrap()),
        ("renamed", &|log| std::fs::rename(log, log.with_extension("other")).unwrap()),
        ("its folder removed", &|log| std::fs::remove_dir_all(log.parent().unwrap()).unwrap()),
        ("emptied", &|log| truncate(log, 0)),
        ("truncated", &|log| truncate(log, u64::MAX)),
        ("overwritten", &overwrite),
    ];
    std::thread::scope(|scope| {
        for (what, act) in cases {
            scope.spawn(move || {
                let bench = Bench::new();
                let plan = bench.short_plan(10.0, [50.0, 10.0]);
                let nano = nano(["--speed", "2"]);
                let arguments = ["record", plan.to_str().unwrap(), "--port", nano.port(), "--out", "session", "--json"];
                let recording = bench.start(arguments);
                wait_for_logs(&bench.path().join("session"), 1);
                let log = logs(&bench.path().join("session")).remove(0);
                let length = || std::fs::metadata(&log).unwrap().len();
                let begun = length();
                wait_until("the log grows", || length() > begun + 10_000);
                act(&log);
                let run = Run::of(recording);
                assert_eq!(run.code, Some(1), "{what}: {run:?}");
                let json = run.json();
                assert!(json["error"].as_str().unwrap().contains("while it was written"), "{what}: {json}");
                let is_complete = |trial: &Value| trial["complete"] == true;
                assert!(!json["trials"].as_array().unwrap().iter().any(is_complete), "{what}: {json}");
            });
        }
    });
}

/// A limit on the size of files (`ulimit -f`) is an error, not the end of the program.
#[test]
fn limit_on_the_size_of_files_ends_the_trial_with_an_error() {
    let bench = Bench::new();
    let plan = bench.short_plan(10.0, [50.0, 10.0]);
    let mut nano = nano(["--speed", "4"]);
    let port = nano.port().to_owned();
    let arguments = ["record", plan.to_str().unwrap(), "--port", &port, "--out", "session", "--json"];
    let run = Run::of(shell(&bench, "ulimit -f 100; exec \"$0\" \"$@\"", &arguments)).expect_code(1);
    assert!(run.json()["error"].as_str().unwrap().contains("cannot be written"), "{run:?}");
    assert!(!is_driven(&mut nano));
}

/// File names are bytes: none of them stops a command.
#[test]
fn names_that_are_not_unicode_work_in_every_command() {
    let bench = Bench::new();
    let plan = bench.short_plan(3.0, [50.0, 10.0]);
    let nano = nano(["--speed", "max"]);
    let folder = OsString::from_vec(b"gl\xfcck".to_vec());
    let os = |text: &str| OsString::from(text);
    let record = [os("record"), plan.into(), os("--port"), os(nano.port()), os("--out"), folder.clone(), os("--json")];
    let run = bench.run(record).expect_code(3);
    assert!(run.json()["session"].as_str().unwrap().starts_with("gl"), "{run:?}");
    let log: PathBuf = logs(&bench.path().join(&folder)).remove(0);
    for path in [folder.clone(), log.clone().into()] {
        for command in ["info", "report", "compare", "export"] {
            for json in [true, false] {
                let mut arguments = vec![os(command), path.clone()];
                arguments.extend(json.then(|| os("--json")));
                arguments.extend((command == "export").then(|| os("--force")));
                let run = bench.run(&arguments).expect_code(3);
                assert!(!json || run.json().is_object());
            }
        }
    }
    bench.run([os("recover"), folder, os("--json")]).expect_code(0).json();
    bench.run([os("recover"), log.into(), os("--json")]).expect_code(0).json();
}

/// A full disk behind stdout is an error on stderr, also for a wrong command line.
#[test]
fn full_outputs_are_errors() {
    let bench = Bench::new();
    for (arguments, code) in
        [(&["--json", "nosuch"][..], 2), (&["--help"], 1), (&["--version"], 1), (&["info", "x", "--json"], 2)]
    {
        let run = Run::of(shell(&bench, "exec \"$0\" \"$@\" >/dev/full", arguments));
        assert_eq!(run.code, Some(code), "{arguments:?}: {run:?}");
        assert!(run.stderr.contains("stdout: No space left"), "{run:?}");
    }
}

/// Text of a plan can neither control the terminal nor change the direction of the text.
#[test]
fn text_of_a_plan_reaches_terminal_and_page_without_control_characters() {
    const ESCAPES: &str = r"\u001b[2J\u009b1m\u0007\u202e";
    let bench = Bench::new();
    let text = format!(
        "[session]\nname = \"a{ESCAPES}\"\noperator = \"b{ESCAPES}\"\nnote = \"c{ESCAPES}\\nerror: d\"\n\
         [trial]\ncalibrate = 0\npreroll = 0\nrun = 1\ndecay = 0\n[speeds]\npairs = [[0, 0]]\n"
    );
    let plan = bench.file("plan.toml", &text);
    let nano = nano(["--speed", "max"]);
    let shown = |run: &Run| {
        let is_harmful = |c: char| c.is_control() && c != '\n' || c == '\u{202e}';
        let text = run.stdout.clone() + &run.stderr;
        assert!(!text.contains(is_harmful), "{text:?}");
        assert!(!text.lines().any(|line| line.starts_with("error: d")), "{text}");
        text
    };
    let run = bench.run(["record", plan.to_str().unwrap(), "--port", nano.port(), "--out", "s"]).expect_code(0);
    shown(&run);
    let log = logs(&bench.path().join("s")).remove(0);
    for path in ["s", log.to_str().unwrap()] {
        let text = shown(&bench.run(["info", path]));
        assert!(text.contains(r"a\u{1b}[2J"), "the name is shown, with its escapes: {text}");
        let run = bench.run(["info", path, "--json"]);
        shown(&run);
        assert!(!run.json().is_null());
        shown(&bench.run(["report", path]));
    }
    let page = std::fs::read_to_string(bench.path().join("s/report.html")).unwrap();
    assert!(!page.contains(|c: char| c.is_control() && c != '\n' && c != '\t' || c == '\u{202e}'));
    let wrong = bench.file("wrong.toml", &format!("[speeds]\n\"x{ESCAPES}\\nerror: d\" = 1\n"));
    shown(&bench.run(["record", wrong.to_str().unwrap(), "--port", "/dev/null"]).expect_code(2));
    let raw = bench.file("raw.toml", "[trial]\nrun = 60 \u{1b}[2J\u{202e}\n");
    shown(&bench.run(["record", raw.to_str().unwrap(), "--port", "/dev/null"]).expect_code(2));
}

/// Only a robot file is taken for one, before anything is recorded.
#[test]
fn robot_of_a_plan_is_a_robot_file() {
    let bench = Bench::new();
    let nano = nano(["--speed", "max"]);
    bench.file("notes.txt", "# only\n# comments\n");
    bench.file("wrong.toml", "[base]\nmass_kgs = 0.1\n");
    let cases = [
        ("notes.txt", "is not a robot file"),
        ("/dev/zero", "is not a robot file"),
        ("plan.toml", "this is a plan, not a robot file"),
        ("wrong.toml", "unknown key `mass_kgs`"),
    ];
    for (robot, what) in cases {
        let text =
            format!("[session]\nname = \"x\"\nrobot = \"{robot}\"\n[trial]\nrun = 1\n[speeds]\npairs = [[50, 10]]\n");
        let plan = bench.file("plan.toml", &text);
        let run = bench.run(["record", plan.to_str().unwrap(), "--port", nano.port(), "--out", "s"]).expect_code(2);
        assert!(run.stderr.contains(what), "{robot}: {run:?}");
        assert!(!bench.path().join("s").exists());
    }
}

/// A wrong place for the output is wrong use.
#[test]
fn output_that_cannot_be_there_is_wrong_use() {
    let bench = Bench::new();
    let plan = bench.short_plan(0.5, [0.0, 0.0]);
    let nano = nano(["--speed", "max"]);
    bench.file("file", "");
    std::os::unix::fs::symlink("nowhere", bench.path().join("dangling")).unwrap();
    let long = "x".repeat(300);
    for out in ["file", "file/below", "dangling", &long] {
        let run = bench.run(["record", plan.to_str().unwrap(), "--port", nano.port(), "--out", out]);
        assert!(run.expect_code(2).stderr.contains("is not a folder and cannot become one"), "{out}");
    }
    bench.run(["record", plan.to_str().unwrap(), "--port", nano.port(), "--out", "s"]).expect_code(0);
    let log = logs(&bench.path().join("s")).remove(0);
    let log = log.to_str().unwrap();
    std::fs::write(bench.path().join("cut.mcap"), &std::fs::read(log).unwrap()[..5000]).unwrap();
    std::fs::create_dir(bench.path().join("empty")).unwrap();
    for arguments in [
        &["export", log, "-o", "none/a.csv"][..],
        &["export", "s", "-o", "file"],
        &["report", log, "--out", "none/a.html"],
        &["recover", "cut.mcap", "-o", "none/a.mcap"],
        &["recover", "cut.mcap", "-o", "file/a.mcap"],
        &["recover", "empty"],
        &["recover", "s", "-o", "a.mcap"],
    ] {
        let run = bench.run(arguments);
        assert_eq!(run.code, Some(2), "{arguments:?}: {run:?}");
        assert!(run.stderr.contains("help: "), "{run:?}");
    }
}

/// Returns a pipe that is full, and that nobody reads while the first end exists.
fn full_pipe() -> (PipeReader, PipeWriter) {
    let (reader, mut writer) = std::io::pipe().unwrap();
    fcntl_setfl(&writer, OFlags::NONBLOCK).unwrap();
    // Bytes still fit where a block does not.
    for length in [4096, 1] {
        let full = std::iter::repeat_with(|| writer.write(&[b'x'; 4096][..length])).find_map(Result::err).unwrap();
        assert_eq!(full.kind(), ErrorKind::WouldBlock);
    }
    // A program that inherits the end would inherit the flag.
    fcntl_setfl(&writer, OFlags::empty()).unwrap();
    (reader, writer)
}

/// Starts a recording on a board whose stderr is `stderr`.
fn record_onto(stderr: impl Into<Stdio>, bench: &Bench, plan: &Path, port: &str) -> Child {
    record_onto_both([Stdio::piped(), stderr.into()], bench, plan, port)
}

fn record_onto_both([stdout, stderr]: [Stdio; 2], bench: &Bench, plan: &Path, port: &str) -> Child {
    let mut command = Command::new(program("biflag"));
    command.arg("record").arg(plan).args(["--port", port, "--out", "session", "--json"]).current_dir(bench.path());
    command.env("XDG_CONFIG_HOME", bench.path().join("config")).env("TERM", "xterm");
    command.stdin(Stdio::null()).stdout(stdout).stderr(stderr).spawn().unwrap()
}

/// Panics unless a recording has all samples of a run of so many seconds. It has no rest, which is a warning.
#[track_caller]
fn expect_all_samples(run: Run, run_s: u64) {
    let json = run.expect_code(3).json();
    let trial = &json["trials"][0];
    assert_eq!((&trial["complete"], &trial["lost"]), (&true.into(), &0.into()), "{json}");
    assert_eq!(trial["samples"], 200 * run_s, "{json}");
}

/// A pipe that is full takes nothing, for as long as nobody reads it.
#[test]
fn stderr_that_nobody_reads_delays_no_recording() {
    let bench = Bench::new();
    let plan = bench.short_plan(16.0, [50.0, 10.0]);
    let nano = nano(["--speed", "4"]);
    let (_reader, writer) = full_pipe();
    let recording = record_onto(writer, &bench, &plan, nano.port());
    expect_all_samples(wait(recording, Duration::from_secs(60)), 16);
}

/// Nor does it keep Ctrl-C from a recording, or the program from its end.
#[test]
fn ctrl_c_ends_a_recording_whose_output_nobody_reads() {
    let bench = Bench::new();
    let plan = bench.short_plan(60.0, [50.0, 10.0]);
    let mut nano = nano(["--speed", "2"]);
    let (_reader, writer) = full_pipe();
    let outputs = [writer.try_clone().unwrap().into(), writer.into()];
    let recording = record_onto_both(outputs, &bench, &plan, nano.port());
    wait_for_motion(&mut nano);
    signal(&recording, Signal::INT);
    let interrupted_s = board_s(&mut nano);
    wait_until("the motors stop", || !is_driven(&mut nano));
    // The board's own deadline is later.
    let stopped_s = board_s(&mut nano) - interrupted_s;
    assert!(stopped_s < 3.0, "{stopped_s} s");
    let run = wait(recording, Duration::from_secs(60));
    assert_eq!(run.code, Some(130), "{run:?}");
    assert_eq!(end_of(&logs(&bench.path().join("session"))[0]), Some(biflag_log::End::Aborted));
}

/// Ctrl-S stops a terminal, and Ctrl-Q lets it go on with what it has missed.
#[test]
fn stopped_terminal_delays_no_recording() {
    let bench = Bench::new();
    let plan = bench.short_plan(24.0, [50.0, 10.0]);
    let mut nano = nano(["--speed", "2"]);
    let keys = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
    grantpt(&keys).and_then(|()| unlockpt(&keys)).unwrap();
    let path = PathBuf::from(OsString::from_vec(ptsname(&keys, Vec::new()).unwrap().into_bytes()));
    let terminal = File::options().read(true).write(true).open(path).unwrap();
    tcsetwinsize(&terminal, Winsize { ws_row: 24, ws_col: 100, ws_xpixel: 0, ws_ypixel: 0 }).unwrap();
    let mut keys = File::from(keys);
    let mut screen = keys.try_clone().unwrap();
    let screen = std::thread::spawn(move || {
        let mut shown = Vec::new();
        // It ends with an error: nobody has the terminal open any more.
        let _ = screen.read_to_end(&mut shown);
        String::from_utf8_lossy(&shown).into_owned()
    });
    let recording = record_onto(terminal, &bench, &plan, nano.port());
    wait_for_motion(&mut nano);
    keys.write_all(b"\x13").unwrap();
    // If the recorder hangs, the link shows the board that it is alive for five seconds more, ten of the board's.
    pass(&mut nano, 14.0);
    keys.write_all(b"\x11").unwrap();
    expect_all_samples(wait(recording, Duration::from_secs(60)), 24);
    let shown = screen.join().unwrap();
    assert!(shown.contains("% 001_w1+50_w2+10: run, "), "{shown}");
    assert!(shown.contains(" 0 lost"), "{shown}");
}
