//! The program `vnano` as other programs use it.

use crate::common::firmware_path;
use protocol::frame::{Accumulator, MAX_FRAME, encode};
use protocol::{Command as Order, Info, Message, Reply, Request};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use serde_json::{Value, json};
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

/// Longest wait for an answer of the board, on a busy machine.
const HANDSHAKE: Duration = Duration::from_secs(60);

struct Vnano {
    child: Child,
    stdin: Option<ChildStdin>,
    stdout: BufReader<ChildStdout>,
    port: String,
}

impl Vnano {
    fn start(arguments: &[&str]) -> Self {
        let mut child = command(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let (stdin, stdout) = (child.stdin.take(), BufReader::new(child.stdout.take().unwrap()));
        let mut vnano = Self { child, stdin, stdout, port: String::new() };
        let ready = vnano.line();
        assert_eq!(ready["event"], "ready");
        vnano.port = ready["port"].as_str().unwrap().to_owned();
        vnano
    }

    fn line(&mut self) -> Value {
        let mut line = String::new();
        self.stdout.read_line(&mut line).unwrap();
        serde_json::from_str(&line).unwrap_or_else(|error| panic!("{error}: {line:?}"))
    }

    fn ask(&mut self, line: &str) -> Value {
        writeln!(self.stdin.as_mut().unwrap(), "{line}").unwrap();
        self.line()
    }

    fn open(&self) -> File {
        let port = OpenOptions::new().read(true).write(true).open(&self.port).unwrap();
        let mut attributes = tcgetattr(&port).unwrap();
        attributes.make_raw();
        // A read that gets nothing within 0.1 s ends.
        attributes.special_codes[rustix::termios::SpecialCodeIndex::VMIN] = 0;
        attributes.special_codes[rustix::termios::SpecialCodeIndex::VTIME] = 1;
        attributes.set_speed(protocol::BAUD).unwrap();
        tcsetattr(&port, OptionalActions::Now, &attributes).unwrap();
        port
    }

    /// Ends standard input. Returns the exit code.
    fn end(mut self) -> Option<i32> {
        drop(self.stdin.take());
        self.child.wait().unwrap().code()
    }
}

impl Drop for Vnano {
    fn drop(&mut self) {
        self.child.kill().ok();
        self.child.wait().ok();
    }
}

fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vnano"));
    command.args(arguments);
    command
}

/// Shakes hands within some seconds.
fn hello(port: &mut File, limit: Duration) -> Option<Info> {
    let start = Instant::now();
    let mut accumulator = Accumulator::new();
    for seq in 0.. {
        let mut buffer = [0; MAX_FRAME];
        let frame = encode(&Request { seq, command: Order::Hello }, &mut buffer).unwrap();
        port.write_all(frame).unwrap();
        // Byte by byte: what follows the answer, such as half of an answer to a repeated request, is left to the caller.
        for byte in BufReader::with_capacity(1, &*port).bytes() {
            if let Some(Ok(Message::Reply { reply: Reply::Info(info), .. })) = accumulator.push(byte.unwrap()) {
                return Some(info);
            }
        }
        if start.elapsed() > limit {
            break;
        }
    }
    None
}

#[test]
fn it_answers_commands_and_ends_with_its_input() {
    let image = firmware_path();
    let mut vnano = Vnano::start(&["--firmware", image.to_str().unwrap(), "--speed", "max"]);
    let mut port = vnano.open();
    assert_eq!(hello(&mut port, HANDSHAKE).unwrap().protocol, protocol::VERSION);
    for line in ["drop 2", "corrupt 1", "fault nack=0,5", "fault stuck=9", "fault usb", "fault blocked=2@1.5"] {
        assert_eq!(vnano.ask(line)["event"], "done", "{line}");
    }
    for line in ["fault clear", "fault hang", "reset"] {
        assert_eq!(vnano.ask(line)["event"], "done", "{line}");
    }
    let turn = vnano.ask("turn z -90 3");
    let length_s = turn["end_s"].as_f64().unwrap() - turn["begin_s"].as_f64().unwrap();
    assert!((length_s - 3.0).abs() < 1e-9, "{turn}");
    assert_eq!(vnano.ask("pose +x 1")["begin_s"], turn["end_s"], "waits for the turn");
    for line in ["turn w 1 1", "pose up 1", "play", "jump", "drop many", "fault jam", "fault blocked=3"] {
        assert_eq!(vnano.ask(line)["event"], "error", "{line}");
    }
    let status = vnano.ask("status");
    assert_eq!(status["event"], "status");
    assert!(status["cycles"].as_u64().unwrap() > 0 && status["state"] == "running");
    drop(port);
    assert_eq!(vnano.end(), Some(0));
}

#[test]
fn its_first_line_has_the_sensors_errors() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("sensor.toml");
    std::fs::write(&file, "mounting_deg = [0.5, -1, 0.25]\nboard_clock_error = 0.004").unwrap();
    let image = firmware_path();
    let ready = |sensor: &str, seed: &str| {
        let mut child = command(&["--firmware", image.to_str().unwrap(), "--sensor", sensor, "--seed", seed])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        child.wait().unwrap();
        serde_json::from_str::<Value>(&line).unwrap()["sensor"].clone()
    };
    let given = ready(file.to_str().unwrap(), "1");
    assert_eq!((&given["mounting_deg"], &given["board_clock_error"]), (&json!([0.5, -1.0, 0.25]), &json!(0.004)));
    assert_eq!(
        (&given["kind"], &given["gyro_cross"]),
        (&json!("file"), &json!([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]))
    );
    // What the help prints can be given.
    let help = command(&["--sensor", "help"]).output().unwrap();
    assert!(help.status.success());
    std::fs::write(&file, help.stdout).unwrap();
    assert_eq!(ready(file.to_str().unwrap(), "1")["gyro_cross"][0], json!([0.0, 0.007, -0.01]));
    let typical = ready("typical", "6");
    assert_eq!((&typical["kind"], typical == ready("typical", "6")), (&json!("typical"), true));
    assert_ne!(typical["gyro_scale"], ready("typical", "7")["gyro_scale"]);
}

/// The program ends within two seconds of the end of its standard input; a busy machine may take longer.
const SOON: Duration = Duration::from_secs(20);

/// Ends soon after the end of its standard input.
fn ends(vnano: Vnano, state: &str) {
    let begun = Instant::now();
    assert_eq!(vnano.end(), Some(0), "{state}");
    assert!(begun.elapsed() < SOON, "{state}: {:?}", begun.elapsed());
}

#[test]
fn it_ends_with_its_input_in_every_state() {
    let image = firmware_path();
    let image = image.to_str().unwrap();
    for (state, fault) in [("runs", "usb"), ("hangs", "hang=0"), ("has no supply", "supply=0")] {
        let vnano = Vnano::start(&["--firmware", image, "--fault", fault, "--speed", "max"]);
        std::thread::sleep(Duration::from_millis(200));
        ends(vnano, state);
    }
    let vnano = Vnano::start(&["--firmware", image, "--speed", "0.01"]);
    ends(vnano, "runs slowly");
    // Nobody reads its answers, until the pipe is full.
    let mut vnano = Vnano::start(&["--firmware", image]);
    for _ in 0..200 {
        writeln!(vnano.stdin.as_mut().unwrap(), "status").unwrap();
    }
    ends(vnano, "is stuck in an answer");
    // It has not even begun: it brings its robot to rest first.
    let mut child = command(&["--firmware", image, "--robot", "published"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    drop(child.stdin.take());
    child.wait().unwrap();
    assert!(begun.elapsed() < SOON, "starts: {:?}", begun.elapsed());
}

#[test]
fn faults_are_listed_and_begin_when_asked() {
    let output = command(&["--fault", "help"]).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success() && text.contains("  spikes=RATE,MOTOR,CHANNEL\n"), "{text}");
    let image = firmware_path();
    let mut vnano = Vnano::start(&["--firmware", image.to_str().unwrap(), "--fault", "supply=0@0.5", "--speed", "max"]);
    let seconds = |status: &Value| status["seconds"].as_f64().unwrap();
    let status = loop {
        let status = vnano.ask("status");
        if seconds(&status) > 0.6 {
            break status;
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    let ticks = status["ticks"].as_u64().unwrap();
    assert!((80..=101).contains(&ticks), "{ticks} ticks in {} s", seconds(&status));
}

#[test]
fn real_time_is_real_time() {
    let image = firmware_path();
    let begun = Instant::now();
    let mut vnano = Vnano::start(&["--firmware", image.to_str().unwrap()]);
    let mut pass = || {
        let (start, before) = (Instant::now(), vnano.ask("status")["seconds"].as_f64().unwrap());
        std::thread::sleep(Duration::from_millis(500));
        let now = vnano.ask("status")["seconds"].as_f64().unwrap();
        assert!(now <= begun.elapsed().as_secs_f64() + 0.05, "{now} s in {:?}", begun.elapsed());
        (now - before) / start.elapsed().as_secs_f64()
    };
    // Where the machine is busy, the board may fall behind, but not always.
    let mut speeds = (0..60).map(|_| pass());
    assert!(speeds.any(|speed| speed > 0.9), "slower than real time for half a minute");
    assert_eq!(vnano.ask("quit")["event"], "done");
    assert_eq!(vnano.end(), Some(0));
}

#[test]
fn no_byte_is_lost_to_a_slow_reader_at_full_speed() {
    let image = firmware_path();
    let mut vnano = Vnano::start(&["--firmware", image.to_str().unwrap(), "--speed", "max"]);
    let mut port = vnano.open();
    hello(&mut port, HANDSHAKE).unwrap();
    let mut buffer = [0; MAX_FRAME];
    let stream = Request { seq: 200, command: Order::Stream { rate_hz: protocol::TICK_HZ } };
    port.write_all(encode(&stream, &mut buffer).unwrap()).unwrap();
    std::thread::sleep(Duration::from_millis(1500));
    let mut accumulator = Accumulator::new();
    let mut last = None;
    let mut frames = 0;
    let mut bytes = [0; 4096];
    while frames < 2000 {
        let length = port.read(&mut bytes).unwrap();
        for byte in &bytes[..length] {
            match accumulator.push(*byte) {
                Some(Ok(Message::Telemetry(telemetry))) => {
                    let seq = telemetry.seq.0;
                    assert!(last.is_none_or(|last: u16| seq == last.wrapping_add(1)), "{last:?} then {seq}");
                    last = Some(seq);
                    frames += 1;
                }
                Some(Err(error)) => panic!("{error}"),
                _ => {}
            }
        }
    }
    let status = vnano.ask("status");
    assert_eq!((status["bytes_lost"].as_u64(), status["frames_dropped"].as_u64()), (Some(0), Some(0)));
}

#[test]
fn bad_input_is_named_and_has_its_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, content: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, content).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let image = firmware_path();
    let image = image.to_str().unwrap();
    let text = file("text.elf", b"not an image");
    let csv = file("short.csv", b"# accel full scale +-2 g\nt_s,ax,ay,az,gx,gy,gz,temp_c\n0,1,2,3\n");
    let eeprom = file("eeprom.bin", b"short");
    let sensor = file("sensor.toml", b"gyro_scale = [0.01, 0.02, 3]\n");
    let host = env!("CARGO_BIN_EXE_vnano");
    for (arguments, code, message) in [
        (vec!["--firmware", "/nowhere.elf"], 1, "cannot read /nowhere.elf"),
        (vec!["--firmware", &text], 1, "is not an ELF file"),
        (vec!["--firmware", host], 1, "not"),
        (vec!["--firmware", image, "--imu", &csv], 1, "short.csv, line 3: 4 columns"),
        (vec!["--firmware", image, "--imu", "/nowhere.csv"], 1, "cannot read /nowhere.csv"),
        (vec!["--firmware", image, "--eeprom", &eeprom], 1, "5 bytes instead of 1024"),
        (vec![], 2, "--firmware"),
        (vec!["--firmware", image, "--bootloader", "old"], 2, "cannot be used with"),
        (vec!["--firmware", image, "--speed", "0"], 2, "factor"),
        (vec!["--firmware", image, "--fault", "jam"], 2, "no fault is called \"jam\""),
        (vec!["--firmware", image, "--fault", "blocked=3"], 2, "MOTOR must be from 1 to 2, not 3"),
        (vec!["--firmware", image, "--who-am-i", "0x168"], 2, "byte"),
        (vec!["--firmware", image, "--rig", "l298n"], 2, "the rigs are encoders, duty, in-in, duty-in-in"),
        (vec!["--firmware", image, "--rig", "duty", "--fault", "tone"], 2, "start with --rig encoders or --rig in-in"),
        (vec!["--firmware", image, "--sensor", "usual"], 2, "usual: No such file"),
        (vec!["--firmware", image, "--sensor", &sensor], 2, "sensor.toml: gyro_scale must be from -0.5 to 0.5, not 3"),
        (vec!["--firmware", image, "--imu", &csv, "--sensor", "typical"], 2, "cannot be used with"),
    ] {
        let output = command(&arguments).stdin(Stdio::null()).output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {stderr}");
        assert!(stderr.contains(message), "{arguments:?}: {stderr}");
        assert!(output.stdout.is_empty());
    }
}

#[test]
fn a_rig_was_set_up_unless_a_file_says_otherwise() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("eeprom.bin");
    let image = firmware_path();
    for is_set_up in [true, false] {
        if !is_set_up {
            std::fs::write(&path, [0xFF; 1024]).unwrap();
        }
        let (image, eeprom) = (image.to_str().unwrap(), path.to_str().unwrap());
        let mut vnano = Vnano::start(&["--firmware", image, "--rig", "duty", "--eeprom", eeprom, "--speed", "max"]);
        assert_eq!(hello(&mut vnano.open(), HANDSHAKE).unwrap().settings_stored, is_set_up);
        let status = vnano.ask("status");
        assert_eq!((&status["led"], &status["motor_supply_v"]), (&json!(false), &json!(6.5)));
        assert_eq!(vnano.end(), Some(0));
    }
}

#[test]
fn the_eeprom_is_kept_in_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("eeprom.bin");
    let image = firmware_path();
    for start in 1..=3 {
        let arguments = ["--firmware", image.to_str().unwrap(), "--eeprom", path.to_str().unwrap(), "--speed", "max"];
        let vnano = Vnano::start(&arguments);
        let info = hello(&mut vnano.open(), HANDSHAKE).unwrap();
        assert_eq!(info.boot_count, start);
        assert_eq!(vnano.end(), Some(0));
    }
}
