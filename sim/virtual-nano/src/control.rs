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
use crate::image;
use crate::imu::hand::{Grip, Hand, Span, parse_axis};
use crate::imu::sensor::Sensor;
use crate::imu::sensor_file;
use crate::mcu::{FREQUENCY_HZ, RunState};
use crate::motor::Motor;
use crate::port::PortCount;
use serde_json::{Value, json};
use std::str::FromStr;

/// Carries out a command. Returns its reply.
///
/// # Errors
/// A line that is not a command, or a command that this board cannot carry out.
pub fn follow(line: &str, board: &mut Board, port: &PortCount) -> Result<Value, String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let serial = &mut board.rig_mut().serial;
    match words[..] {
        ["play"] => {
            let played = board.change_imu(|imu| imu.source.play());
            played.ok_or("the sensor has no recording; start with --imu FILE.csv")?;
        }
        ["rewind"] => board.change_imu(|imu| imu.source.rewind()),
        ["turn", axis, degrees, seconds] => {
            let axis = parse_axis(axis)?;
            let (angle_deg, length_s) = (within("DEGREES", degrees, -1e5, 1e5)?, length_s(seconds)?);
            return by_hand(line, board, |hand, now_s| hand.turn(now_s, axis, angle_deg, length_s));
        }
        ["pose", pose, seconds] => {
            let (pose, length_s) = (pose.parse()?, length_s(seconds)?);
            return by_hand(line, board, |hand, now_s| hand.pose(now_s, pose, length_s));
        }
        ["hand", stop, sway] => {
            let [stop_deg, sway_deg] = [within("STOP", stop, 0.0, 20.0)?, within("SWAY", sway, 0.0, 20.0)?];
            with_hand(board, |hand, _| hand.grip = Grip { stop_deg, sway_deg })?;
        }
        ["exchange", time_us] => return exchange(board, time_us, ""),
        ["exchange", time_us, hex] => return exchange(board, time_us, hex),
        ["truth"] => return truth(board),
        ["status"] => return Ok(status(board, port)),
        ["drop", frames] => serial.drop_frames(number(frames)?),
        ["corrupt", frames] => serial.corrupt_frames(number(frames)?),
        ["fault", "clear"] => board.clear_faults(),
        ["fault", fault] => match fault.parse()? {
            Timed { fault, .. } if let Some(problem) = fault.refused_by(board) => return Err(problem.into()),
            Timed { fault, at_s: None } => board.inject(fault),
            Timed { fault, at_s: Some(at_s) } => board.inject_at(at_s, fault),
        },
        ["reset"] => board.reset(),
        ["quit"] => {}
        _ => return Err(format!("unknown command {line:?}")),
    }
    Ok(json!({ "event": "done", "command": line }))
}

fn number<N: FromStr>(word: &str) -> Result<N, String> {
    word.parse().map_err(|_| format!("{word:?} is not a number that fits here"))
}

fn within(what: &str, word: &str, low: f64, high: f64) -> Result<f64, String> {
    let value: f64 = number(word)?;
    let refused = || format!("{what} must be from {low} to {high}, not {value}");
    (low..=high).contains(&value).then_some(value).ok_or_else(refused)
}

/// Parses the duration of a movement.
fn length_s(word: &str) -> Result<f64, String> {
    within("SECONDS", word, 0.1, 3600.0)
}

/// Lets time pass for the board. Returns the reply to `exchange`: the bytes that the board sent.
fn exchange(board: &mut Board, time_us: &str, hex: &str) -> Result<Value, String> {
    let time_us = within("US", time_us, 1.0, 1e6)? as u64;
    board.send(&image::hex(hex).ok_or_else(|| format!("{hex:?} is not hexadecimal"))?);
    let end = board.cycle() + time_us * (FREQUENCY_HZ / 1_000_000);
    if board.run_until(end) != RunState::Running {
        return Err("the chip has crashed".into());
    }
    let hex: String = board.take_serial().iter().map(|byte| format!("{byte:02x}")).collect();
    Ok(json!({ "event": "exchange", "hex": hex }))
}

/// Returns the reply to a line that is not a command, or to a command that failed.
pub fn error(line: &str, problem: &str) -> Value {
    json!({ "event": "error", "command": line, "error": problem })
}

/// Lets the hand do something, at the board's time, s.
fn with_hand<T>(board: &mut Board, act: impl FnOnce(&mut Hand, f64) -> T) -> Result<T, &'static str> {
    let now_s = board.seconds();
    let done = board.change_imu(|imu| imu.source.hand_mut().map(|hand| act(hand, now_s)));
    done.ok_or("no hand holds the sensor; start without --robot and --imu")
}

/// Makes the hand move the sensor. Returns the reply.
fn by_hand(line: &str, board: &mut Board, go: impl FnOnce(&mut Hand, f64) -> Span) -> Result<Value, String> {
    let Span { begin_s, end_s, off_deg } = with_hand(board, go)?;
    Ok(json!({ "event": "done", "command": line, "begin_s": begin_s, "end_s": end_s, "off_deg": off_deg }))
}

/// Returns the reply to `truth`: the simulator's samples, each with the program's clock in µs (`null` before its first
/// frame). It is an error if there is no robot or the simulator failed.
fn truth(board: &mut Board) -> Result<Value, String> {
    let plant = board.plant_mut().ok_or("there is no robot; start with --robot FILE.toml or --robot published")?;
    let samples = plant.take_samples();
    if let (true, Some(problem)) = (samples.is_empty(), &plant.failure) {
        return Err(format!("the simulated robot could not go on: {problem}"));
    }
    let (clock, resonator) = (&board.rig().clock, &board.rig().resonator);
    let board_us = |time_s: f64| clock.at(resonator.cycle(time_s)).map(|time| time.0);
    let samples: Vec<Value> =
        samples.iter().map(|sample| json!({ "board_us": board_us(sample.time_s), "sample": sample })).collect();
    Ok(json!({ "event": "truth", "samples": samples }))
}

/// Returns the errors of the board's sensor, and their kind.
pub fn sensor(board: &Board, kind: &Sensor) -> Value {
    let mut errors = sensor_file::to_json(&board.rig().imu.source.part.errors);
    errors.insert("kind".to_owned(), json!(kind.to_string()));
    errors.into()
}

/// Returns the reply to `status`.
fn status(board: &Board, port: &PortCount) -> Value {
    let bridge = board.rig().bridge;
    let line = board.rig().serial.count;
    let bus = board.rig().imu.count;
    let tick = board.rig().marks.tick;
    json!({
        "event": "status",
        "state": match board.state {
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
        "bytes_overrun": board.mcu.serial_overruns(),
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
    use crate::{BoardOptions, Image};

    #[test]
    fn commands_are_plain_words() {
        // A program that does nothing.
        let image = Image { segments: vec![(0, vec![0xFF, 0xCF])], ..Image::default() };
        let mut board = Board::new(&image, BoardOptions::default()).unwrap();
        let mut follow = |line: &str| follow(line, &mut board, &PortCount::default());
        assert_eq!(follow("  status ").unwrap()["event"], "status");
        for right in [
            "drop 12",
            "fault blocked=2@1.5",
            "turn z 720 24",
            "turn x -12.5 0.5",
            "pose +x 3",
            "pose 0.7,0,-0.7,0 2.5",
            "hand 0 0",
            "exchange 1000 00fF",
        ] {
            assert!(follow(right).is_ok(), "{right}");
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
            assert!(follow(wrong).is_err(), "{wrong}");
        }
        for wrong in
            ["", "drop", "drop x", "drop -1", "fault", "fault jam", "fault nack 3", "fault nack=300", "statuss"]
        {
            assert!(follow(wrong).is_err(), "{wrong}");
        }
    }
}
