//! Commands to the running program, one line of plain words each; the reply is one line of JSON.
//!
//! | command | does |
//! | --- | --- |
//! | `play` | plays the sensor's recording from its start |
//! | `rewind` | holds the sensor at the start of its recording until the next `play` |
//! | `turn AXIS DEGREES SECONDS` | a hand turns the sensor about its body axis `x`, `y` or `z` |
//! | `pose UP SECONDS` | a hand turns the sensor, by the shortest way, until the body axis `UP` (`+x`, `-z`, ...) points up; `UP` may also be an attitude `W,X,Y,Z`: the quaternion from body axes to world axes, z up |
//! | `hand STOP SWAY` | sets the errors of the hand: standard deviation of its stops, and amplitude of its sway, degrees about each axis |
//! | `exchange US [HEX]` | sends these bytes to the board, lets US µs of its time pass, and returns the bytes that it sent; for `--speed exchange`, where time passes only in exchanges |
//! | `truth` | returns the robot's states since the last `truth`, fifty for each second of the board's time |
//! | `status` | returns the state of chip, bridge, motors, bus and line |
//! | `drop N` | drops the next N frames of the stream |
//! | `corrupt N` | corrupts a byte in each of the next N frames of the stream |
//! | `fault NAME[=VALUE]` | makes a fault begin (`vnano --fault help` lists them) |
//! | `fault clear` | ends all faults |
//! | `reset` | pulls the reset pin |
//! | `quit` | ends |
//!
//! `turn` and `pose` need a board without robot and recording. They return at once. `begin_s` and `end_s` are the
//! board's times (s) at which the movement begins and ends, `off_deg` is the error of the stop about the body axes. A
//! movement waits for earlier ones. In `status`, `seconds` is the board's time, and `moving` whether the hand has
//! movements left.

use crate::board::Board;
use crate::bridge::Drive;
use crate::fault::Timed;
use crate::imu::hand::{Grip, Pose, Span, parse_axis};
use crate::imu::sensor::Sensor;
use crate::imu::sensor_file;
use crate::mcu::{FREQUENCY_HZ, RunState};
use crate::motor::Motor;
use crate::port::PortCount;
use nalgebra::{Unit, Vector3};
use serde_json::{Value, json};
use std::str::FromStr;

/// A command.
#[derive(Clone, PartialEq, Debug)]
pub enum Command {
    /// `play`
    Play,
    /// `rewind`
    Rewind,
    /// `turn AXIS DEGREES SECONDS`
    Turn(Unit<Vector3<f64>>, f64, f64),
    /// `pose UP SECONDS`
    Pose(Pose, f64),
    /// `hand STOP SWAY`
    Hand(Grip),
    /// `exchange US [HEX]`
    Exchange(u64, Vec<u8>),
    /// `truth`
    Truth,
    /// `status`
    Status,
    /// `drop N`
    Drop(u64),
    /// `corrupt N`
    Corrupt(u64),
    /// `fault NAME[=VALUE][@SECONDS]`
    Fault(Timed),
    /// `fault clear`
    ClearFaults,
    /// `reset`
    Reset,
    /// `quit`
    Quit,
}

impl FromStr for Command {
    type Err = String;

    fn from_str(line: &str) -> Result<Self, String> {
        let words: Vec<&str> = line.split_whitespace().collect();
        Ok(match words[..] {
            ["play"] => Self::Play,
            ["rewind"] => Self::Rewind,
            ["turn", axis, degrees, seconds] => {
                Self::Turn(parse_axis(axis)?, within("DEGREES", degrees, -1e5, 1e5)?, length_s(seconds)?)
            }
            ["pose", pose, seconds] => Self::Pose(pose.parse()?, length_s(seconds)?),
            ["hand", stop, sway] => Self::Hand(Grip {
                stop_deg: within("STOP", stop, 0.0, 20.0)?,
                sway_deg: within("SWAY", sway, 0.0, 20.0)?,
            }),
            ["exchange", time_us] => Self::Exchange(exchange_us(time_us)?, Vec::new()),
            ["exchange", time_us, hex] => Self::Exchange(exchange_us(time_us)?, bytes(hex)?),
            ["truth"] => Self::Truth,
            ["status"] => Self::Status,
            ["drop", n] => Self::Drop(number(n)?),
            ["corrupt", n] => Self::Corrupt(number(n)?),
            ["fault", "clear"] => Self::ClearFaults,
            ["fault", fault] => Self::Fault(fault.parse()?),
            ["reset"] => Self::Reset,
            ["quit"] => Self::Quit,
            _ => return Err(format!("unknown command {line:?}")),
        })
    }
}

fn number<N: FromStr>(word: &str) -> Result<N, String> {
    word.parse().map_err(|_| format!("{word:?} is not a number that fits here"))
}

fn within(what: &str, word: &str, low: f64, high: f64) -> Result<f64, String> {
    let value: f64 = number(word)?;
    match (low..=high).contains(&value) {
        true => Ok(value),
        false => Err(format!("{what} must be from {low} to {high}, not {value}")),
    }
}

/// Parses the duration of a movement.
fn length_s(word: &str) -> Result<f64, String> {
    within("SECONDS", word, 0.1, 3600.0)
}

/// Parses the time of an exchange.
fn exchange_us(word: &str) -> Result<u64, String> {
    within("US", word, 1.0, 1e6).map(|time_us| time_us as u64)
}

/// Parses bytes in hexadecimal.
fn bytes(hex: &str) -> Result<Vec<u8>, String> {
    let digits = hex.as_bytes();
    let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok();
    let parsed: Option<Vec<u8>> = digits.chunks(2).map(byte).collect();
    parsed.filter(|_| digits.len().is_multiple_of(2)).ok_or_else(|| format!("{hex:?} is not hexadecimal"))
}

/// Lets time pass for the board. Returns the reply to `exchange`: the bytes that the board sent.
pub fn exchange(line: &str, board: &mut Board, time_us: u64, bytes: &[u8]) -> Value {
    board.send(bytes);
    let end = board.cycle() + time_us * (FREQUENCY_HZ / 1_000_000);
    if board.run_until(end) != RunState::Running {
        return error(line, "the chip has crashed");
    }
    let hex: String = board.take_serial().iter().map(|byte| format!("{byte:02x}")).collect();
    json!({ "event": "exchange", "hex": hex })
}

/// Returns the reply to a command that asks for nothing.
pub fn done(line: &str) -> Value {
    json!({ "event": "done", "command": line })
}

/// Returns the reply to a line that is not a command, or to a command that failed.
pub fn error(line: &str, problem: &str) -> Value {
    json!({ "event": "error", "command": line, "error": problem })
}

/// Carries out a command to the hand. Returns its reply.
pub fn by_hand(line: &str, board: &mut Board, command: Command) -> Value {
    let now_s = board.seconds();
    let moved: Option<Option<Span>> = board.change_imu(|imu| {
        let hand = imu.source.hand_mut()?;
        Some(match command {
            Command::Turn(axis, angle_deg, length_s) => Some(hand.turn(now_s, axis, angle_deg, length_s)),
            Command::Pose(pose, length_s) => Some(hand.pose(now_s, pose, length_s)),
            Command::Hand(grip) => {
                hand.set_grip(grip);
                None
            }
            _ => None,
        })
    });
    match moved {
        None => error(line, "no hand holds the sensor; start without --robot and --imu"),
        Some(None) => done(line),
        Some(Some(Span { begin_s, end_s, off_deg })) => json!({
            "event": "done", "command": line, "begin_s": begin_s, "end_s": end_s, "off_deg": off_deg,
        }),
    }
}

/// Returns the reply to `truth`: the simulator's samples, each with the program's clock in µs (`null` before its first
/// frame). It is an error if there is no robot or the simulator failed.
pub fn truth(line: &str, board: &mut Board) -> Value {
    let Some(plant) = board.plant_mut() else {
        return error(line, "there is no robot; start with --robot FILE.toml or --robot published");
    };
    let samples = plant.take_samples();
    if let (true, Some(problem)) = (samples.is_empty(), plant.failure()) {
        return error(line, &format!("the simulated robot could not go on: {problem}"));
    }
    let (clock, resonator) = (&board.rig().clock, &board.rig().resonator);
    let board_us = |time_s: f64| clock.at(resonator.cycle(time_s)).map(|time| time.0);
    let samples: Vec<Value> =
        samples.iter().map(|sample| json!({ "board_us": board_us(sample.time_s), "sample": sample })).collect();
    json!({ "event": "truth", "samples": samples })
}

/// Returns the errors of the board's sensor, and their kind.
pub fn sensor(board: &Board, kind: &Sensor) -> Value {
    let mut errors = sensor_file::to_json(&board.rig().imu.source.part.errors);
    errors.insert("kind".to_owned(), json!(kind.to_string()));
    errors.into()
}

/// Returns the reply to `status`.
pub fn status(board: &Board, port: &PortCount) -> Value {
    let bridge = board.rig().bridge;
    let line = board.rig().serial.count();
    let bus = board.rig().imu.count();
    let tick = board.rig().marks.tick;
    json!({
        "event": "status",
        "state": match board.state() {
            RunState::Running => "running",
            RunState::Crashed => "crashed",
        },
        "cycles": board.cycle(),
        "seconds": board.seconds(),
        "moving": board.rig().imu.source.is_moving(board.seconds()),
        "pwm": bridge.pwm,
        "bridge": bridge.drive.map(|drive| match drive {
            Drive::Coast => "coast",
            Drive::Brake => "brake",
            Drive::Voltage(share) | Drive::Pulses { share, .. } if share < 0.0 => "backward",
            Drive::Voltage(_) | Drive::Pulses { .. } => "forward",
        }),
        "led": bridge.led,
        "motor_supply_v": board.rig().supply.now_v(),
        "speed_rpm": board.rig().motors.each_ref().map(|motor| motor.speed_rpm),
        "encoder_counts": board.rig().motors.each_ref().map(Motor::encoder_counts),
        "imu_transactions": bus.transactions,
        "imu_bursts": bus.bursts,
        "imu_faults": bus.faults,
        "bytes_sent": line.bytes_sent,
        "frames_sent": line.frames_sent,
        "frames_dropped": line.frames_dropped,
        "frames_corrupted": line.frames_corrupted,
        "bytes_unheard": port.unheard,
        "bytes_lost": port.lost,
        "bytes_received": line.bytes_received,
        "bytes_overrun": board.serial_overruns(),
        "ticks": tick.count,
        "mean_tick_cycles": tick.mean(),
        "worst_tick_cycles": tick.worst,
        "deepest_stack": board.deepest_stack(),
        "static_bytes": board.static_bytes,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_plain_words() {
        assert_eq!("  status ".parse(), Ok(Command::Status));
        assert_eq!("drop 12".parse(), Ok(Command::Drop(12)));
        assert!(matches!("fault blocked=2@1.5".parse(), Ok(Command::Fault(Timed { at_s: Some(1.5), .. }))));
        for right in [
            "turn z 720 24",
            "turn x -12.5 0.5",
            "pose +x 3",
            "pose 0.7,0,-0.7,0 2.5",
            "hand 0 0",
            "exchange 1000 00fF",
        ] {
            assert!(right.parse::<Command>().is_ok(), "{right}");
        }
        for wrong in [
            "turn w 1 1",
            "turn z 720",
            "turn z 720 0",
            "turn z nan 3",
            "pose x 1",
            "pose +x -1",
            "hand 1",
            "hand -1 0",
            "exchange",
            "exchange 0",
            "exchange 1000 0",
            "exchange 1000 gg",
        ] {
            assert!(wrong.parse::<Command>().is_err(), "{wrong}");
        }
        for wrong in
            ["", "drop", "drop x", "drop -1", "fault", "fault jam", "fault nack 3", "fault nack=300", "statuss"]
        {
            assert!(wrong.parse::<Command>().is_err(), "{wrong}");
        }
    }
}
