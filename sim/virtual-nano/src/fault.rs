//! Faults of the board and of the devices wired to it, by name: for tests, for the running program (`fault NAME`), and
//! from its start (`--fault NAME`).
//!
//! ```
//! use virtual_nano::fault::Fault;
//!
//! let fault: Fault = "spikes=200,2".parse()?;
//! assert!(matches!(fault, Fault::Disturbed { motor: 1, channel: 0, .. }));
//! # Ok::<(), String>(())
//! ```

use crate::coupling::Cable;
use crate::encoder::Disturbance;
use crate::imu::fault::{At, Fault as ImuFault};
use crate::mcu::FREQUENCY_HZ;
use crate::motor::Rotor;
use crate::push::Axis;
use std::fmt::Write;
use std::str::FromStr;

/// A fault. Motors and channels count from 0.
#[derive(Clone, Copy, PartialEq, Debug)]
#[expect(missing_docs, reason = "the table below says what each of them is")]
pub enum Fault {
    EncoderSwapped { motor: usize },
    Disturbed { motor: usize, channel: usize, disturbance: Disturbance },
    Coupled(Cable),
    UnevenPoles { motor: usize, fraction: f64 },
    Held { motor: usize, rotor: Rotor },
    Stiction { motor: usize, fraction: f64 },
    MotorReversed { motor: usize },
    MotorOff { motor: usize },
    MotorsSwapped,
    MotorSupplyOff,
    MotorSupply { volts: f64 },
    Imu(ImuFault),
    Register { address: u8, value: u8 },
    SensorClock { fraction: f64 },
    Scale { fraction: f64 },
    Askew { fraction: f64 },
    Spin { dps: f64 },
    BusRise { us: f64 },
    Supply { mv: u32 },
    BrownOut { ms: f64 },
    Bandgap { mv: u32 },
    Resonator { fraction: f64 },
    Hang { interrupts: bool },
    Busy { ms: f64 },
    Usb { latency_ms: f64, packet: usize },
    FramesLost { share: f64 },
    NoFrames { ms: f64 },
    Push { axis: Axis, degrees: f64 },
}

/// A name, the names and defaults of its values, what it means, and its fault.
struct Kind(&'static str, &'static [(&'static str, f64)], &'static str, fn(&Values) -> Result<Fault, String>);

const MOTOR: (&str, f64) = ("MOTOR", 1.0);
const CHANNEL: (&str, f64) = ("CHANNEL", 1.0);

/// All kinds of faults.
const KINDS: &[Kind] = &[
    Kind("encoder-swapped", &[MOTOR], "the encoder's C1 and C2 are swapped", |v| {
        Ok(Fault::EncoderSwapped { motor: v.motor(0)? })
    }),
    Kind("encoder-open", &[MOTOR, ("CHANNEL", 2.0)], "an encoder line is cut: its input reads the pull-up", |v| {
        v.disturbed(0, Disturbance::Open)
    }),
    Kind("spikes", &[("RATE", 100.0), MOTOR, CHANNEL], "RATE spikes of 3 us per second on an encoder line", |v| {
        v.disturbed(1, Disturbance::Spikes { rate_hz: v.within(0, 0.1, 1e5)? })
    }),
    Kind("tone", &[("HZ", 100e3), MOTOR, CHANNEL], "a square wave in place of an encoder's signal", |v| {
        v.disturbed(1, Disturbance::Tone { hz: v.within(0, 0.1, 1e6)? })
    }),
    Kind(
        "pwm-spikes",
        &[("MICROSECONDS", 2.0), ("CABLES", 2.0), ("CHANNEL", 0.0)],
        "each edge of a motor's PWM inverts the encoder lines in its cable for MICROSECONDS; CABLES 2: each motor \
                  has one with its encoder, 1: all share one; CHANNEL 0: both lines of an encoder",
        |v| {
            let channel = v.within(2, 0.0, 2.0)?;
            Ok(Fault::Coupled(Cable {
                width: (v.within(0, 0.1, 500.0)? * 1e-6 * FREQUENCY_HZ as f64) as u64,
                shared: v.within(1, 1.0, 2.0)? == 1.0,
                channels: [channel != 2.0, channel != 1.0],
            }))
        },
    ),
    Kind(
        "uneven-poles",
        &[("PERCENT", 20.0), MOTOR],
        "the encoder's north poles are PERCENT longer than half a period",
        |v| Ok(Fault::UnevenPoles { fraction: v.percent(0, 45.0)?, motor: v.motor(1)? }),
    ),
    Kind("blocked", &[MOTOR], "a flagellum is blocked", |v| {
        Ok(Fault::Held { motor: v.motor(0)?, rotor: Rotor::Blocked })
    }),
    Kind("slips", &[MOTOR], "a blocked flagellum slips: one edge of each encoder channel per second", |v| {
        Ok(Fault::Held { motor: v.motor(0)?, rotor: Rotor::Slips })
    }),
    Kind(
        "stiction",
        &[("PERCENT", 25.0), MOTOR],
        "the gear sticks: the motor starts from rest at PERCENT of full voltage",
        |v| Ok(Fault::Stiction { fraction: v.percent(0, 100.0)?, motor: v.motor(1)? }),
    ),
    Kind("motor-reversed", &[MOTOR], "the motor's own two leads are swapped", |v| {
        Ok(Fault::MotorReversed { motor: v.motor(0)? })
    }),
    Kind("motor-off", &[MOTOR], "a lead of the motor is off", |v| Ok(Fault::MotorOff { motor: v.motor(0)? })),
    Kind("motors-swapped", &[], "the bridge's outputs are swapped, the encoders are not", |_| Ok(Fault::MotorsSwapped)),
    Kind("motor-supply-off", &[], "the supply of the motors is off", |_| Ok(Fault::MotorSupplyOff)),
    Kind("motor-supply", &[("VOLT", 5.0)], "the supply of the motors is VOLT", |v| {
        Ok(Fault::MotorSupply { volts: v.within(0, 0.0, 12.0)? })
    }),
    Kind(
        "nack",
        &[("BYTE", 0.0), ("COUNT", 1.0)],
        "the sensor does not acknowledge byte BYTE of the next COUNT transactions",
        |v| {
            Ok(Fault::Imu(ImuFault::Nack {
                at: At::byte(v.byte(0)?),
                count: v.within(1, 1.0, f64::from(u32::MAX))? as u32,
            }))
        },
    ),
    Kind("gone", &[], "the sensor no longer responds", |_| Ok(Fault::Imu(ImuFault::Gone(At::now())))),
    Kind("stuck", &[("CLOCKS", 0.0)], "the sensor holds SDA low for CLOCKS pulses on SCL, for ever if 0", |v| {
        let clocks = Some(v.byte(0)?).filter(|clocks| *clocks > 0);
        Ok(Fault::Imu(ImuFault::Stuck { at: At::now(), clocks }))
    }),
    Kind("frozen", &[], "the sensor's data do not change", |_| Ok(Fault::Imu(ImuFault::Frozen))),
    Kind("repeats", &[], "the sensor's data do not change, though it says that they are new", |_| {
        Ok(Fault::Imu(ImuFault::Repeats))
    }),
    Kind("gyro-zero", &[], "the gyroscope reads zero", |_| Ok(Fault::Imu(ImuFault::GyroZero))),
    Kind("glitch", &[], "the sensor loses its supply for a moment", |_| Ok(Fault::Imu(ImuFault::Glitch))),
    Kind(
        "register",
        &[("ADDRESS", 0x1B as f64), ("VALUE", 0x18 as f64)],
        "a register of the sensor changes by itself; 0x1B,0x18 is the gyroscope's range",
        |v| Ok(Fault::Register { address: v.byte(0)?, value: v.byte(1)? }),
    ),
    Kind("sensor-clock", &[("PERCENT", 1.0)], "the sensor's oscillator is PERCENT too fast", |v| {
        Ok(Fault::SensorClock { fraction: v.percent(0, 20.0)? })
    }),
    Kind("scale", &[("PERCENT", 3.0)], "gyroscope and accelerometer read PERCENT too much", |v| {
        Ok(Fault::Scale { fraction: v.percent(0, 50.0)? })
    }),
    Kind(
        "askew",
        &[("PERCENT", 2.0)],
        "each axis of gyroscope and accelerometer also reads PERCENT of the next axis",
        |v| Ok(Fault::Askew { fraction: v.percent(0, 50.0)? }),
    ),
    Kind(
        "spin",
        &[("DPS", 3000.0)],
        "the sensor also turns about z, by DPS degrees per second; readings beyond its range are clipped",
        |v| Ok(Fault::Spin { dps: v.within(0, -1e5, 1e5)? }),
    ),
    Kind("bus-rise", &[("MICROSECONDS", 2.0)], "SCL and SDA rise slowly: every bit takes MICROSECONDS longer", |v| {
        Ok(Fault::BusRise { us: v.within(0, 0.0, 1e4)? })
    }),
    Kind("supply", &[("MILLIVOLT", 4100.0)], "the chip's supply voltage is MILLIVOLT", |v| {
        Ok(Fault::Supply { mv: v.within(0, 0.0, 6000.0)? as u32 })
    }),
    Kind(
        "brown-out",
        &[("MILLISECONDS", 50.0)],
        "the supply falls to 2 V for MILLISECONDS, which resets the chip",
        |v| Ok(Fault::BrownOut { ms: v.within(0, 0.001, 1e5)? }),
    ),
    Kind(
        "bandgap",
        &[("MILLIVOLT", 1200.0)],
        "the chip's bandgap reference is MILLIVOLT; the data sheet allows 1000 to 1200",
        |v| Ok(Fault::Bandgap { mv: v.within(0, 100.0, 5000.0)? as u32 }),
    ),
    Kind("resonator", &[("PERCENT", 0.5)], "the board's clock is PERCENT too fast", |v| {
        Ok(Fault::Resonator { fraction: v.percent(0, 5.0)? })
    }),
    Kind(
        "hang",
        &[("INTERRUPTS", 1.0)],
        "the firmware enters an endless loop, with interrupts on (1) or off (0)",
        |v| Ok(Fault::Hang { interrupts: v.within(0, 0.0, 1.0)? == 1.0 }),
    ),
    Kind("busy", &[("MILLISECONDS", 12.0)], "the firmware is blocked for MILLISECONDS, with interrupts on", |v| {
        Ok(Fault::Busy { ms: v.within(0, 0.001, 1e5)? })
    }),
    Kind(
        "usb",
        &[("MILLISECONDS", 16.0), ("BYTES", 32.0)],
        "the USB bridge collects packets of BYTES bytes, for at most MILLISECONDS",
        |v| Ok(Fault::Usb { latency_ms: v.within(0, 0.0, 255.0)?, packet: v.within(1, 1.0, 4096.0)? as usize }),
    ),
    Kind("frames-lost", &[("PERCENT", 10.0)], "PERCENT of the telemetry frames are lost on the line, at random", |v| {
        Ok(Fault::FramesLost { share: v.within(0, 0.0, 100.0)? / 100.0 })
    }),
    Kind(
        "no-frames",
        &[("MILLISECONDS", 100.0)],
        "no telemetry frame arrives for MILLISECONDS, at 200 frames a second",
        |v| Ok(Fault::NoFrames { ms: v.within(0, 5.0, 1e5)? }),
    ),
    Kind(
        "push",
        &[("DEGREES", 20.0), ("AXIS", 3.0)],
        "something turns the simulated robot by DEGREES within half a second; AXIS 1, 2: about the horizontal direction \
                  of its x or y axis, 3: about the vertical",
        |v| {
            let axes = [Axis::X, Axis::Y, Axis::Vertical];
            Ok(Fault::Push { degrees: v.within(0, -180.0, 180.0)?, axis: axes[v.within(1, 1.0, 3.0)? as usize - 1] })
        },
    ),
];

/// The values after a name, with its defaults.
struct Values {
    name: &'static str,
    known: &'static [(&'static str, f64)],
    given: Vec<f64>,
}

impl Values {
    fn get(&self, index: usize) -> f64 {
        self.given.get(index).copied().unwrap_or(self.known[index].1)
    }

    fn within(&self, index: usize, low: f64, high: f64) -> Result<f64, String> {
        let value = self.get(index);
        if (low..=high).contains(&value) {
            return Ok(value);
        }
        let (name, what) = (self.name, self.known[index].0);
        Err(format!("fault {name}: {what} must be from {low} to {high}, not {value}"))
    }

    fn percent(&self, index: usize, limit: f64) -> Result<f64, String> {
        Ok(self.within(index, -limit, limit)? / 100.0)
    }

    fn byte(&self, index: usize) -> Result<u8, String> {
        Ok(self.within(index, 0.0, 255.0)? as u8)
    }

    /// Returns the index of a motor or a channel.
    fn motor(&self, index: usize) -> Result<usize, String> {
        Ok(self.within(index, 1.0, 2.0)? as usize - 1)
    }

    fn disturbed(&self, motor: usize, disturbance: Disturbance) -> Result<Fault, String> {
        Ok(Fault::Disturbed { motor: self.motor(motor)?, channel: self.motor(motor + 1)?, disturbance })
    }
}

/// Returns the list of all faults with their values.
pub fn help() -> String {
    let mut text = String::from("Faults and their values, with defaults in brackets:\n\n");
    for Kind(name, values, meaning, _) in KINDS {
        let join = |parts: Vec<String>| if parts.is_empty() { String::new() } else { format!("={}", parts.join(",")) };
        let names = join(values.iter().map(|(name, _)| (*name).to_owned()).collect());
        let is_hex = *name == "register";
        let number = |value: f64| if is_hex { format!("{:#x}", value as u8) } else { value.to_string() };
        let defaults = join(values.iter().map(|(_, default)| number(*default)).collect());
        let defaults = if defaults.is_empty() { defaults } else { format!(" [{name}{defaults}]") };
        // Writing to a string does not fail.
        let _ = writeln!(text, "  {name}{names}\n      {meaning}{defaults}");
    }
    text + "\nNAME@SECONDS starts a fault at that time of the board's clock; otherwise it starts at once.\n"
}

impl FromStr for Fault {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, values) = match text.split_once('=') {
            Some((name, values)) => (name, values.split(',').collect()),
            None => (text, Vec::new()),
        };
        let kind = KINDS.iter().find(|kind| kind.0 == name);
        let Kind(name, known, _, make) =
            kind.ok_or_else(|| format!("no fault is called {name:?}; `vnano --fault help` lists them"))?;
        let given = values.iter().map(|value| number(value)).collect::<Result<Vec<_>, _>>()?;
        if given.len() > known.len() {
            return Err(format!("fault {name}: {} values, and it has {}", given.len(), known.len()));
        }
        make(&Values { name, known, given })
    }
}

fn number(text: &str) -> Result<f64, String> {
    let parsed = match text.trim().strip_prefix("0x") {
        Some(digits) => u32::from_str_radix(digits, 16).ok().map(f64::from),
        None => text.trim().parse().ok(),
    };
    parsed.filter(|value: &f64| value.is_finite()).ok_or_else(|| format!("{text:?} is not a number"))
}

/// A fault and its begin: `NAME[=VALUE][@SECONDS]`.
#[derive(Clone, Copy, PartialEq, Debug)]
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

/// Supply of a board on a good port, and the bandgap reference (data sheet, section 29.5), mV.
pub(crate) const SUPPLY_MV: u32 = 5000;
pub(crate) const BANDGAP_MV: u32 = 1100;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_has_defaults_that_it_allows() {
        for kind in KINDS {
            kind.0.parse::<Fault>().unwrap_or_else(|error| panic!("{error}"));
            assert!(help().contains(&format!("\n  {}", kind.0)));
        }
    }

    #[test]
    fn values_follow_the_name() {
        assert_eq!("register=0x6B,0x40".parse(), Ok(Fault::Register { address: 0x6B, value: 0x40 }));
        assert_eq!("scale=-2".parse(), Ok(Fault::Scale { fraction: -0.02 }));
        let late = Timed { fault: Fault::Held { motor: 1, rotor: Rotor::Blocked }, at_s: Some(2.5) };
        assert_eq!("blocked=2@2.5".parse(), Ok(late));
        for wrong in ["", "blocked=3", "blocked=1,2", "blocked=x", "spikes=", "jam", "supply=nan", "gone=1", "nack=300"]
        {
            assert!(wrong.parse::<Fault>().is_err(), "{wrong}");
        }
        assert!("blocked@soon".parse::<Timed>().is_err());
    }
}
