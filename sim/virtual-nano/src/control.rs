//! Commands to the running program, one line of plain words each; the reply is one line of JSON.
//!
//! | command | does |
//! | --- | --- |
//! | `play` | plays the sensor's recording from its start |
//! | `rewind` | holds the sensor at the start of its recording until the next `play` |
//! | `truth` | returns the robot's states since the last `truth`, fifty for each second of the board's time |
//! | `status` | returns the state of chip, bridge, motors, bus and line |
//! | `drop N` | drops the next N frames of the stream |
//! | `corrupt N` | corrupts a byte in each of the next N frames of the stream |
//! | `fault NAME[=VALUE]` | makes a fault begin (`vnano --fault help` lists them) |
//! | `fault clear` | ends all faults |
//! | `reset` | pulls the reset pin |
//! | `quit` | ends |

use crate::board::Board;
use crate::bridge::Drive;
use crate::fault::Timed;
use crate::mcu::RunState;
use crate::motor::Motor;
use crate::port::PortCount;
use serde_json::{Value, json};
use std::str::FromStr;

/// A command.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Command {
    /// `play`
    Play,
    /// `rewind`
    Rewind,
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

/// Returns the reply to a command that asks for nothing.
pub fn done(line: &str) -> Value {
    json!({ "event": "done", "command": line })
}

/// Returns the reply to a line that is no command or failed.
pub fn error(line: &str, problem: &str) -> Value {
    json!({ "event": "error", "command": line, "error": problem })
}

/// Returns the reply to `truth`: the simulator's samples, each with the program's clock in µs (`null` before its first
/// frame). It is an error where there is no robot, or where the simulator could not go on.
pub fn truth(line: &str, board: &mut Board) -> Value {
    let Some(plant) = board.plant_mut() else {
        return error(line, "there is no robot; start with --robot FILE.toml or --robot published");
    };
    let samples = plant.take_samples();
    if let (true, Some(problem)) = (samples.is_empty(), plant.failure()) {
        return error(line, &format!("the simulated robot could not go on: {problem}"));
    }
    let (clock, resonator) = (board.clock(), board.resonator());
    let board_us = |time_s: f64| clock.at(resonator.cycle(time_s)).map(|time| time.0);
    let samples: Vec<Value> =
        samples.iter().map(|sample| json!({ "board_us": board_us(sample.time_s), "sample": sample })).collect();
    json!({ "event": "truth", "samples": samples })
}

/// Returns the bias and drift of the board's sensor.
pub fn sensor(board: &Board) -> Value {
    let part = board.imu().source().part();
    json!({
        "gyro_bias_dps": part.gyro_bias_dps,
        "gyro_drift_dps_per_c": part.gyro_drift_dps_per_c,
        "accel_bias_g": part.accel_bias_g,
        "accel_drift_g_per_c": part.accel_drift_g_per_c,
        "warming_c": part.warming_c,
    })
}

/// Returns the reply to `status`.
pub fn status(board: &Board, port: &PortCount) -> Value {
    let bridge = board.bridge();
    let line = board.serial().count();
    let bus = board.imu().count();
    let tick = board.marks().tick();
    json!({
        "event": "status",
        "state": match board.state() {
            RunState::Running => "running",
            RunState::Crashed => "crashed",
        },
        "cycles": board.cycle(),
        "seconds": board.seconds(),
        "pwm": bridge.pwm,
        "bridge": bridge.drive.map(|drive| match drive {
            Drive::Coast => "coast",
            Drive::Brake => "brake",
            Drive::Voltage(fraction) if fraction < 0.0 => "backward",
            Drive::Voltage(_) => "forward",
        }),
        "speed_rpm": board.motors().each_ref().map(Motor::speed_rpm),
        "encoder_counts": board.motors().each_ref().map(Motor::encoder_counts),
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
        "static_bytes": board.static_bytes(),
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
        for wrong in
            ["", "drop", "drop x", "drop -1", "fault", "fault jam", "fault nack 3", "fault nack=300", "statuss"]
        {
            assert!(wrong.parse::<Command>().is_err(), "{wrong}");
        }
    }
}
