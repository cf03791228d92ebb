//! Faults of the board and of the devices wired to it, by name: for tests, for the running program (`fault NAME`), and
//! from its start (`--fault NAME`).
//!
//! ```
//! use virtual_nano::fault::Timed;
//!
//! let late: Timed = "spikes=200,2@1.5".parse()?;
//! assert_eq!(late.at_s, Some(1.5));
//! # Ok::<(), String>(())
//! ```

use crate::board::{Board, SUPPLY_MV};
use crate::coupling::Cable;
use crate::encoder::Disturbance;
use crate::imu::fault::{At, Data, Fault as ImuFault};
use crate::mcu::FREQUENCY_HZ;
use crate::motor::Rotor;
use crate::push::Axis;
use std::fmt::Write;
use std::str::FromStr;

/// Supply in a brown-out, mV.
const BROWN_OUT_MV: u32 = 2000;

/// Frames a second of a full stream, one in each tick of the board.
const STREAM_HZ: f64 = 200.0;

/// Largest number of values of a fault.
const MOST: usize = 3;

/// A value of a fault: its name, its default, and its least and largest.
type Value = (&'static str, f64, [f64; 2]);

const fn percent(default: f64, limit: f64) -> Value {
    ("PERCENT", default, [-limit, limit])
}

const BYTE: [f64; 2] = [0.0, 255.0];

/// Motors and channels count from 1, as users do.
const MOTOR: Value = ("MOTOR", 1.0, [1.0, 2.0]);
const CHANNEL: Value = ("CHANNEL", 1.0, [1.0, 2.0]);

/// Returns the place of a motor or a channel in an array.
fn index(number: f64) -> usize {
    number as usize - 1
}

/// Name, values, description, and the function that begins the fault with values within their ranges.
struct Kind(&'static str, &'static [Value], &'static str, fn(&mut Board, [f64; MOST]));

/// Disturbs a line of an encoder.
fn disturb(board: &mut Board, [motor, channel]: [f64; 2], disturbance: Disturbance) {
    board.disturb_encoder(index(motor), index(channel), disturbance);
}

/// Begins a fault of the sensor.
fn spoil(board: &mut Board, fault: ImuFault) {
    board.change_imu(|imu| imu.inject(fault));
}

const SUPPLY: Kind = Kind(
    "supply",
    &[("MILLIVOLT", 4100.0, [0.0, 6000.0])],
    "the chip's supply voltage is MILLIVOLT",
    |board, [mv, ..]| board.set_supply_mv(mv as u32),
);

const PUSH: Kind = Kind(
    "push",
    &[("DEGREES", 20.0, [-180.0, 180.0]), ("AXIS", 3.0, [1.0, 3.0])],
    "something turns the simulated robot by DEGREES within half a second; AXIS 1, 2: about the horizontal direction \
                  of its x or y axis, 3: about the vertical",
    |board, [degrees, axis, _]| {
        let axis = [Axis::X, Axis::Y, Axis::Vertical][index(axis)];
        if let Some(plant) = board.plant_mut() {
            plant.push(axis, degrees.to_radians());
        }
    },
);

/// Faults of encoders, which not every rig has.
const OF_ENCODERS: &[Kind] = &[
    Kind("encoder-swapped", &[MOTOR], "the encoder's C1 and C2 are swapped", |board, [motor, ..]| {
        board.rig_mut().encoders[index(motor)].swapped = true;
    }),
    Kind(
        "encoder-open",
        &[MOTOR, ("CHANNEL", 2.0, [1.0, 2.0])],
        "an encoder line is cut: its input reads the pull-up",
        |board, [motor, channel, _]| disturb(board, [motor, channel], Disturbance::Open),
    ),
    Kind(
        "spikes",
        &[("RATE", 100.0, [0.1, 1e5]), MOTOR, CHANNEL],
        "RATE spikes of 3 us per second on an encoder line",
        |board, [rate_hz, line @ ..]| disturb(board, line, Disturbance::Spikes { rate_hz }),
    ),
    Kind(
        "tone",
        &[("HZ", 100e3, [0.1, 1e6]), MOTOR, CHANNEL],
        "a square wave in place of an encoder's signal",
        |board, [hz, line @ ..]| disturb(board, line, Disturbance::Tone { hz }),
    ),
    Kind(
        "pwm-spikes",
        &[("MICROSECONDS", 2.0, [0.1, 500.0]), ("CABLES", 2.0, [1.0, 2.0]), ("CHANNEL", 0.0, [0.0, 2.0])],
        "each edge of a motor's PWM inverts the encoder lines in its cable for MICROSECONDS; CABLES 2: each motor \
                  has one with its encoder, 1: all share one; CHANNEL 0: both lines of an encoder",
        |board, [us, cables, channel]| {
            board.rig_mut().coupling.cable = Some(Cable {
                width: (us * 1e-6 * FREQUENCY_HZ as f64) as u64,
                shared: cables == 1.0,
                channels: [channel != 2.0, channel != 1.0],
            });
        },
    ),
    Kind(
        "uneven-poles",
        &[percent(20.0, 45.0), MOTOR],
        "the encoder's north poles are PERCENT longer than half a period",
        |board, [percent, motor, _]| board.rig_mut().encoders[index(motor)].uneven = percent / 100.0,
    ),
];

/// All other faults.
const OTHERS: &[Kind] = &[
    Kind("blocked", &[MOTOR], "a flagellum is blocked", |board, [motor, ..]| {
        board.rig_mut().motors[index(motor)].hold(Rotor::Blocked);
    }),
    Kind(
        "slips",
        &[MOTOR],
        "a blocked flagellum slips: one edge of each encoder channel per second",
        |board, [motor, ..]| board.rig_mut().motors[index(motor)].hold(Rotor::Slips),
    ),
    Kind(
        "stiction",
        &[percent(25.0, 100.0), MOTOR],
        "the gear sticks: the motor starts from rest at PERCENT of full voltage",
        |board, [percent, motor, _]| board.rig_mut().motors[index(motor)].parameters.breakaway = percent / 100.0,
    ),
    Kind("motor-reversed", &[MOTOR], "the motor's own two leads are swapped", |board, [motor, ..]| {
        board.rig_mut().motors[index(motor)].reversed = true;
    }),
    Kind("motor-off", &[MOTOR], "a lead of the motor is off", |board, [motor, ..]| {
        board.rig_mut().motors[index(motor)].powered = false;
    }),
    Kind("motors-swapped", &[], "the bridge's outputs are swapped, the encoders are not", |board, _| {
        board.swap_motors(true);
    }),
    Kind(
        "shaking",
        &[("DPS", 1.0, [0.0, 100.0])],
        "the gears shake the sensor by DPS degrees per second, once a turn of each motor's own shaft and at its multiples",
        |board, [dps, ..]| board.rig_mut().shaking_dps = dps,
    ),
    Kind("motor-supply-off", &[], "the supply of the motors is off", |board, _| {
        board.rig_mut().motors.iter_mut().for_each(|motor| motor.powered = false);
    }),
    Kind("motor-supply", &[("VOLT", 5.0, [0.0, 12.0])], "the supply of the motors is VOLT", |board, [volts, ..]| {
        board.rig_mut().supply.forced_v = Some(volts);
    }),
    Kind(
        "nack",
        &[("BYTE", 0.0, BYTE), ("COUNT", 1.0, [1.0, u32::MAX as f64])],
        "the sensor does not acknowledge byte BYTE of the next COUNT transactions",
        |board, [byte, count, _]| spoil(board, ImuFault::Nack { at: At::byte(byte as u8), count: count as u32 }),
    ),
    Kind("gone", &[], "the sensor no longer responds", |board, _| spoil(board, ImuFault::Gone(At::now()))),
    Kind(
        "stuck",
        &[("CLOCKS", 0.0, BYTE)],
        "the sensor holds SDA low for CLOCKS pulses on SCL, for ever if 0",
        |board, [clocks, ..]| {
            let clocks = Some(clocks as u8).filter(|clocks| *clocks > 0);
            spoil(board, ImuFault::Stuck { at: At::now(), clocks });
        },
    ),
    Kind("frozen", &[], "the sensor's data do not change", |board, _| spoil(board, ImuFault::Data(Data::Frozen))),
    Kind("repeats", &[], "the sensor's data do not change, though it says that they are new", |board, _| {
        spoil(board, ImuFault::Data(Data::Repeated));
    }),
    Kind("gyro-zero", &[], "the gyroscope reads zero", |board, _| spoil(board, ImuFault::Data(Data::GyroZero))),
    Kind("glitch", &[], "the sensor loses its supply for a moment", |board, _| spoil(board, ImuFault::Glitch)),
    Kind(
        "register",
        &[("ADDRESS", 0x1B as f64, BYTE), ("VALUE", 0x18 as f64, BYTE)],
        "a register of the sensor changes by itself; 0x1B,0x18 is the gyroscope's range",
        |board, [address, value, _]| board.change_imu(|imu| imu.set_register_behind(address as u8, value as u8)),
    ),
    Kind(
        "sensor-clock",
        &[percent(1.0, 20.0)],
        "the sensor's oscillator is PERCENT too fast",
        |board, [percent, ..]| board.change_imu(|imu| imu.oscillator_error = percent / 100.0),
    ),
    Kind(
        "scale",
        &[percent(3.0, 50.0)],
        "gyroscope and accelerometer read PERCENT too much",
        |board, [percent, ..]| board.change_imu(|imu| imu.source.part.scale = percent / 100.0),
    ),
    Kind(
        "askew",
        &[percent(2.0, 50.0)],
        "each axis of gyroscope and accelerometer also reads PERCENT of the next axis",
        |board, [percent, ..]| board.change_imu(|imu| imu.source.part.askew = percent / 100.0),
    ),
    Kind(
        "spin",
        &[("DPS", 3000.0, [-1e5, 1e5])],
        "the sensor also turns about z, by DPS degrees per second; readings beyond its range are clipped",
        |board, [dps, ..]| board.change_imu(|imu| imu.source.spin_dps = dps),
    ),
    Kind(
        "bus-rise",
        &[("MICROSECONDS", 2.0, [0.0, 1e4])],
        "SCL and SDA rise slowly: every bit takes MICROSECONDS longer",
        |board, [us, ..]| board.set_bus_rise_us(us),
    ),
    SUPPLY,
    Kind(
        "brown-out",
        &[("MILLISECONDS", 50.0, [0.001, 1e5])],
        "the supply falls to 2 V for MILLISECONDS, which resets the chip",
        |board, [ms, ..]| {
            board.set_supply_mv(BROWN_OUT_MV);
            let back_s = board.seconds() + ms * 1e-3;
            board.inject_at(back_s, Fault { kind: &SUPPLY, values: [SUPPLY_MV.into(), 0.0, 0.0] });
        },
    ),
    Kind(
        "bandgap",
        &[("MILLIVOLT", 1200.0, [100.0, 5000.0])],
        "the chip's bandgap reference is MILLIVOLT; the data sheet allows 1000 to 1200",
        |board, [mv, ..]| board.set_bandgap_mv(mv as u32),
    ),
    Kind("resonator", &[percent(0.5, 5.0)], "the board's clock is PERCENT too fast", |board, [percent, ..]| {
        board.set_resonator_error(percent / 100.0);
    }),
    Kind(
        "hang",
        &[("INTERRUPTS", 1.0, [0.0, 1.0])],
        "the firmware enters an endless loop, with interrupts on (1) or off (0)",
        |board, [interrupts, ..]| board.mcu.hang(interrupts == 1.0),
    ),
    Kind(
        "busy",
        &[("MILLISECONDS", 12.0, [0.001, 1e5])],
        "the firmware is blocked for MILLISECONDS, with interrupts on",
        |board, [ms, ..]| board.keep_busy_ms(ms),
    ),
    Kind(
        "usb",
        &[("MILLISECONDS", 16.0, [0.0, 255.0]), ("BYTES", 32.0, [1.0, 4096.0])],
        "the USB bridge collects packets of BYTES bytes, for at most MILLISECONDS",
        |board, [ms, bytes, _]| board.rig_mut().serial.usb.set_packets(bytes as usize, ms * 1e-3),
    ),
    Kind(
        "frames-lost",
        &[("PERCENT", 10.0, [0.0, 100.0])],
        "PERCENT of the telemetry frames are lost on the line, at random",
        |board, [percent, ..]| board.rig_mut().serial.lost = percent / 100.0,
    ),
    Kind(
        "no-frames",
        &[("MILLISECONDS", 100.0, [5.0, 1e5])],
        "no telemetry frame arrives for MILLISECONDS, at 200 frames a second",
        |board, [ms, ..]| board.rig_mut().serial.drop_frames((ms * 1e-3 * STREAM_HZ).round() as u64),
    ),
    PUSH,
];

/// Returns all kinds of faults.
fn kinds() -> impl Iterator<Item = &'static Kind> {
    OF_ENCODERS.iter().chain(OTHERS)
}

/// Returns the list of all faults with their values.
pub fn help() -> String {
    let mut text = String::from("Faults and their values, with defaults in brackets:\n\n");
    for Kind(name, values, meaning, _) in kinds() {
        let join = |parts: Vec<String>| if parts.is_empty() { String::new() } else { format!("={}", parts.join(",")) };
        let names = join(values.iter().map(|(name, ..)| (*name).to_owned()).collect());
        let is_hex = *name == "register";
        let number = |value: f64| if is_hex { format!("{:#x}", value as u8) } else { value.to_string() };
        let defaults = join(values.iter().map(|(_, default, _)| number(*default)).collect());
        let defaults = if defaults.is_empty() { defaults } else { format!(" [{name}{defaults}]") };
        let _ = writeln!(text, "  {name}{names}\n      {meaning}{defaults}");
    }
    text + "\nNAME@SECONDS starts a fault at that time of the board's clock; otherwise it starts at once.\n"
}

/// A fault: its kind and its values.
#[derive(Clone, Copy)]
pub struct Fault {
    kind: &'static Kind,
    values: [f64; MOST],
}

impl Fault {
    /// Begins it now.
    pub(crate) fn begin(&self, board: &mut Board) {
        (self.kind.3)(board, self.values);
    }

    /// Returns the reason why it cannot happen to a board, if there is one.
    pub fn refused_by(&self, board: &Board) -> Option<&'static str> {
        let Kind(name, ..) = self.kind;
        let strikes_encoder = OF_ENCODERS.iter().any(|kind| kind.0 == *name);
        if *name == PUSH.0 && board.plant().is_none() {
            return Some("there is no robot to push; start with --robot FILE.toml or --robot published");
        }
        (strikes_encoder && !board.rig().kind.has_encoders)
            .then_some("this rig has no encoders; start with --rig encoders or --rig in-in")
    }
}

impl FromStr for Fault {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, given) = match text.split_once('=') {
            Some((name, values)) => (name, values.split(',').map(number).collect::<Result<Vec<_>, _>>()),
            None => (text, Ok(Vec::new())),
        };
        let kind = kinds().find(|kind| kind.0 == name);
        let kind @ Kind(_, known, ..) =
            kind.ok_or_else(|| format!("no fault is called {name:?}; `vnano --fault help` lists them"))?;
        let given = given?;
        if given.len() > known.len() {
            return Err(format!("fault {name}: {} values, and it has {}", given.len(), known.len()));
        }
        let mut values = [0.0; MOST];
        for (index, (what, default, [low, high])) in known.iter().enumerate() {
            let value = given.get(index).unwrap_or(default);
            if !(low..=high).contains(&value) {
                return Err(format!("fault {name}: {what} must be from {low} to {high}, not {value}"));
            }
            values[index] = *value;
        }
        Ok(Self { kind, values })
    }
}

fn number(text: &str) -> Result<f64, String> {
    let parsed = match text.trim().strip_prefix("0x") {
        Some(digits) => u32::from_str_radix(digits, 16).ok().map(f64::from),
        None => text.trim().parse().ok(),
    };
    parsed.filter(|value: &f64| value.is_finite()).ok_or_else(|| format!("{text:?} is not a number"))
}

/// A fault and its start: `NAME[=VALUE][@SECONDS]`.
#[derive(Clone, Copy)]
pub struct Timed {
    /// The fault.
    pub fault: Fault,
    /// The board's time, s; `None` for at once.
    pub at_s: Option<f64>,
}

impl FromStr for Timed {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (fault, at_s) = match text.split_once('@') {
            Some((fault, seconds)) => (fault, Some(number(seconds)?)),
            None => (text, None),
        };
        Ok(Self { fault: fault.parse()?, at_s })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_has_defaults_that_it_allows() {
        for Kind(name, ..) in kinds() {
            name.parse::<Fault>().unwrap_or_else(|error| panic!("{error}"));
            assert!(help().contains(&format!("\n  {name}")));
        }
    }

    #[test]
    fn values_follow_the_name() {
        let parsed = |text: &str| {
            let Timed { fault: Fault { kind, values }, at_s } = text.parse().unwrap_or_else(|error| panic!("{error}"));
            (kind.0, values, at_s)
        };
        assert_eq!(parsed("register=0x6B,0x40"), ("register", [107.0, 64.0, 0.0], None));
        assert_eq!(parsed("scale=-2"), ("scale", [-2.0, 0.0, 0.0], None));
        assert_eq!(parsed("spikes=200,2"), ("spikes", [200.0, 2.0, 1.0], None));
        assert_eq!(parsed("blocked=2@2.5"), ("blocked", [2.0, 0.0, 0.0], Some(2.5)));
        for wrong in ["", "blocked=3", "blocked=1,2", "blocked=x", "spikes=", "jam", "supply=nan", "gone=1", "nack=300"]
        {
            assert!(wrong.parse::<Fault>().is_err(), "{wrong}");
        }
        assert!("blocked@soon".parse::<Timed>().is_err());
    }
}
