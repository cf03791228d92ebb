//! `vnano`: the emulated board as a program. Its first line on standard output names the port.

use clap::Parser;
use clap::error::ErrorKind;
use serde_json::json;
use sim::params::Robot;
use std::error::Error;
use std::io::{BufRead, Write, stdin, stdout};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;
use virtual_nano::bootloader::Bootloader;
use virtual_nano::fault::{self, Timed};
use virtual_nano::imu::hand::Grip;
use virtual_nano::imu::part::ROOM_C;
use virtual_nano::imu::recording::Recording;
use virtual_nano::imu::sensor::Sensor;
use virtual_nano::imu::sensor_file;
use virtual_nano::imu::source::Source;
use virtual_nano::pace::{PATIENCE_S, Pace, Speed};
use virtual_nano::plant::Plant;
use virtual_nano::port::{Port, PortCount};
use virtual_nano::rig::{RIGS, RigKind};
use virtual_nano::run::Runner;
use virtual_nano::{Board, BoardOptions, Image, control};

/// The robot's Arduino Nano, emulated.
///
/// Prints {"event":"ready","port":"/dev/pts/N","sensor":{...}}, then replies to each line on standard input with a
/// line of JSON. It ends on `quit` or at the end of standard input.
///
/// `vnano --fault help` lists the faults, `vnano --sensor help` prints a file for `--sensor`.
///
/// Example: vnano --firmware target/firmware.elf --imu tests/data/mpu6050/rotate-z-720.csv
#[derive(Parser)]
#[command(name = "vnano", version)]
struct Arguments {
    /// The program in flash
    #[arg(long, value_name = "ELF", required_unless_present = "bootloader", conflicts_with = "bootloader")]
    firmware: Option<PathBuf>,
    /// A bootloader and no program; opening the port resets the board
    #[arg(long)]
    bootloader: Option<Bootloader>,
    /// What is wired to the board: `encoders` (TB6612, motors with encoders), `duty` (L298N, no encoders, a battery), `in-in`
    /// (DRV8833, encoders) or `duty-in-in` (DRV8833, no encoders, a battery). With --firmware, the board has the settings of
    /// the rig, except for the directions of its motors
    #[arg(long, value_name = "NAME", default_value = "encoders")]
    rig: RigKind,
    /// A recording for the sensor to play; without --imu and --robot the sensor is at rest
    #[arg(long, value_name = "FILE.csv")]
    imu: Option<PathBuf>,
    /// The simulated robot behind the board: a robot file, `physical` or `published`
    #[arg(long, value_name = "FILE.toml|NAME", conflicts_with = "imu")]
    robot: Option<PathBuf>,
    /// Speed relative to real time: a factor, or `max`; with `exchange` the board's time passes only in the command of that
    /// name, so that a run does not depend on the load of the machine. At 1, bytes that the host does not read in time are
    /// lost, as on a real board; at any other speed the board's time waits until they are read
    #[arg(long, default_value = "1", value_name = "1|FACTOR|max|exchange")]
    speed: Speed,
    /// Longest time, s, that a board faster than real time waits for a silent host; more than the default is for hosts that
    /// send something at least every 0.05 s
    #[arg(long, value_name = "S", default_value_t = PATIENCE_S, value_parser = parse_patience)]
    patience: f64,
    /// Errors of the sensor and of the board's clock: `typical` draws all that the data sheet allows; `ideal` has exact
    /// scales, axes and clocks, and biases that drift; a file gives each of them. `help` prints such a file
    #[arg(long, value_name = "ideal|typical|FILE.toml", default_value_t, conflicts_with = "imu")]
    sensor: Sensor,
    /// Seed of the sensor's errors and noise, of the hand, and of damage on the serial line
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// WHO_AM_I of the sensor: 0x68, or 0x70 for a common clone
    #[arg(long, default_value = "0x68", value_parser = parse_byte)]
    who_am_i: u8,
    /// Simulate a fault, from the start or from a second of the board's clock; may be repeated. `help` lists the faults
    #[arg(long = "fault", value_name = "NAME[=VALUE][@SECONDS]")]
    faults: Vec<Timed>,
    /// File that keeps the EEPROM, 1024 bytes; if it does not exist, the board starts as without this option
    #[arg(long, value_name = "FILE")]
    eeprom: Option<PathBuf>,
}

fn parse_byte(text: &str) -> Result<u8, String> {
    let parsed = text.strip_prefix("0x").map_or_else(|| text.parse(), |digits| u8::from_str_radix(digits, 16));
    parsed.map_err(|_| "give a byte, such as 0x68".into())
}

fn parse_patience(text: &str) -> Result<f64, String> {
    let patience_s = text.parse().ok().filter(|patience_s| (0.0..=3600.0).contains(patience_s));
    patience_s.ok_or_else(|| "give seconds from 0 to 3600".into())
}

/// How long the program may take to end once its standard input has closed.
const LAST_WORDS: Duration = Duration::from_secs(2);

fn main() -> ExitCode {
    // Before the arguments are parsed, because clap would ask for those that a board needs.
    let words: Vec<_> = std::env::args_os().collect();
    let asks_for_help = |option: &str| {
        words.iter().any(|word| *word == *format!("{option}=help"))
            || words.windows(2).any(|pair| pair == [option, "help"])
    };
    for (option, text) in [("--fault", fault::help()), ("--sensor", sensor_file::EXAMPLE.to_owned())] {
        if asks_for_help(option) {
            print!("{text}");
            return ExitCode::SUCCESS;
        }
    }
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("vnano: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    // First, so that the end of standard input ends the program in any state.
    let commands = commands();
    let (errors, seed) = (arguments.sensor.errors(arguments.seed), arguments.seed);
    let source = match (&arguments.imu, &arguments.robot) {
        (Some(path), _) => Source::recording(Recording::read(path)?, seed),
        (None, Some(robot)) => Source::plant(read_robot(robot)?, errors, seed),
        (None, None) => Source::hand(Grip::default(), errors, seed),
    };
    let options = BoardOptions { source, imu_id: arguments.who_am_i, rig: arguments.rig, seed };
    let mut board = match (&arguments.firmware, arguments.bootloader) {
        (_, Some(bootloader)) => Board::with_bootloader(&bootloader.load()?, options)?,
        (Some(path), None) => {
            let image = Image::from_elf(path)?;
            let mut board = Board::new(&image, options)?;
            if arguments.rig != RIGS[0] && !arguments.eeprom.as_ref().is_some_and(|path| path.exists()) {
                board.mcu.eeprom_mut().copy_from_slice(&arguments.rig.eeprom(&image)?);
            }
            board
        }
        (None, None) => unreachable!("clap requires one of them"),
    };
    if let Some(path) = &arguments.eeprom {
        load_eeprom(&mut board, path)?;
    }
    for Timed { fault, at_s } in &arguments.faults {
        if let Some(problem) = fault.refused_by(&board) {
            // Ends as clap does with a wrong value.
            clap::Error::raw(ErrorKind::ValueValidation, format!("invalid value for '--fault': {problem}\n")).exit();
        }
        match at_s {
            Some(at_s) => board.inject_at(*at_s, *fault),
            None => board.inject(*fault),
        }
    }
    let mut runner = Runner {
        pace: Pace::new(arguments.speed, Duration::from_secs_f64(arguments.patience), board.seconds()),
        board,
        port: Port::new()?,
        reset_on_open: arguments.bootloader.is_some(),
        pending: Vec::new(),
        count: PortCount::default(),
    };
    let mut out = stdout().lock();
    let sensor = control::sensor(&runner.board, &arguments.sensor);
    writeln!(out, "{}", json!({ "event": "ready", "port": runner.port.path, "sensor": sensor }))?;
    out.flush()?;
    runner.run(&commands, &mut out)?;
    if let Some(path) = &arguments.eeprom {
        std::fs::write(path, runner.board.mcu.eeprom_mut()).map_err(|error| format!("{}: {error}", path.display()))?;
    }
    Ok(())
}

/// Reads a robot file; the room has the temperature of its fluid.
fn read_robot(path: &Path) -> Result<Plant, String> {
    let robot = match path.to_str().and_then(Robot::built_in) {
        Some(robot) => robot,
        None => {
            let text = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
            toml::from_str(&text).map_err(|error| format!("{}: {error}", path.display()))?
        }
    };
    let room_c = robot.fluid.glycerol.map_or(ROOM_C, |mixture| mixture.temperature_c);
    Plant::new(&robot, room_c).map_err(|error| format!("{}: {error}", path.display()))
}

/// Loads the EEPROM from a file, if it exists.
fn load_eeprom(board: &mut Board, path: &PathBuf) -> Result<(), String> {
    let eeprom = board.mcu.eeprom_mut();
    match std::fs::read(path) {
        Ok(bytes) if bytes.len() == eeprom.len() => eeprom.copy_from_slice(&bytes),
        Ok(bytes) => return Err(format!("{}: {} bytes instead of {}", path.display(), bytes.len(), eeprom.len())),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
        Err(error) => return Err(format!("{}: {error}", path.display())),
    }
    Ok(())
}

/// Returns the lines of standard input. The channel closes at the end of input; the program ends soon after, even if it
/// is stuck, for example because nobody reads its replies.
fn commands() -> Receiver<String> {
    let (sender, receiver) = channel();
    std::thread::spawn(move || {
        for line in stdin().lock().lines().map_while(Result::ok).filter(|line| !line.trim().is_empty()) {
            if sender.send(line).is_err() {
                return;
            }
        }
        drop(sender);
        std::thread::sleep(LAST_WORDS);
        std::process::exit(0);
    });
    receiver
}
