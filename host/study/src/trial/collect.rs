//! Accumulates a trial from its messages, while its log is read or written.

use super::data::{Data, Event, LinkSecond, Records, Want};
use super::fields::{self, FRAME, TRUTH};
use super::shapes::Shapes;
use super::{bounds, clock, imported};
use crate::attitude::Reading;
use biflag_log::schema::biflag::event::Kind;
use biflag_log::schema::biflag::{self, Motor, Telemetry};
use biflag_log::{LONGEST_TRIAL_S, LinkStats, Origin};
use protocol::units::{Q15, Quaternion, TemperatureCounts};
use protocol::{GENUINE_IMU_ID, TICK_HZ};
use std::path::Path;

/// Maximum number of stored events.
const MAX_EVENTS: usize = 2_000;

/// The part of a trial that has been read or recorded so far.
#[derive(Debug, Default)]
pub struct Collector {
    want: Want,
    format: u32,
    /// Time of the last frame.
    last_s: Option<f64>,
    data: Data,
    /// The board's counters in the last frame.
    counters: Option<[u32; 4]>,
    /// When the motors got their target speeds.
    ordered_s: Option<f64>,
    /// The first fault.
    fault: Option<(f64, String)>,
    frames: u64,
    temperature_sum: f64,
}

impl Collector {
    /// Creates an empty collector for a log of this format.
    pub fn new(want: Want, format: u32) -> Self {
        let data = Data { shapes: Shapes::new(want.shapes), ..Data::default() };
        Self { want, format, data, ..Self::default() }
    }

    /// Adds a frame of telemetry.
    pub fn telemetry(&mut self, frame: &Telemetry) {
        let time_s = frame.time_s;
        self.data.link.samples += 1;
        // A frame whose clock goes back or jumps far ahead is damaged.
        if !(0.0..=LONGEST_TRIAL_S).contains(&time_s) || self.last_s.is_some_and(|last| last >= time_s) {
            return;
        }
        self.last_s = Some(time_s);
        self.frames += 1;
        self.temperature_sum += frame.temperature_c;
        if let Some(reading) = self.reading(frame).filter(|_| frame.imu_fresh) {
            self.data.readings.push((time_s, reading));
            if self.want.frames {
                self.data.frames.push(time_s, fields::row(&FRAME, frame));
            }
        }
        if let (Some(one), Some(two)) = (&frame.motor1, &frame.motor2) {
            let ((w1, turns1), (w2, turns2)) = (self.motion(0, one, time_s), self.motion(1, two, time_s));
            self.data.motors.push(time_s, [one.target_rpm, w1, two.target_rpm, w2, turns1, turns2]);
            if one.duty != 0 || two.duty != 0 {
                let on_s = self.data.lit_s.map_or(time_s, |[on_s, _]| on_s);
                self.data.lit_s = Some([on_s, time_s + 1.0 / f64::from(TICK_HZ)]);
            }
            if self.ordered_s.is_none() && (one.target_rpm != 0.0 || two.target_rpm != 0.0) {
                self.ordered_s = Some(time_s);
            }
        }
        if self.fault.is_none() && frame.fault() != biflag::Fault::None {
            // `ImuBusStuck` is `imu bus stuck`.
            let spaced = |c: char| if c.is_uppercase() { format!(" {}", c.to_lowercase()) } else { c.to_string() };
            let name: String = format!("{:?}", frame.fault()).chars().map(spaced).collect();
            self.fault = Some((time_s, name.trim_start().to_owned()));
        }
        let now = [frame.unsent, frame.imu_errors, frame.bad_frames, frame.missed_ticks];
        let grown = |(now, then): (u32, u32)| now.wrapping_sub(then) & 0xFFFF;
        let counted = now.into_iter().zip(self.counters.unwrap_or(now)).map(grown).fold(0, u32::saturating_add);
        self.counters = Some(now);
        let second = self.second(time_s);
        second.received += 1;
        second.board = second.board.saturating_add(counted);
    }

    /// Adds the unrounded state of a modelled robot.
    pub fn truth(&mut self, truth: &biflag::Truth) {
        self.data.truth.push(truth.time_s, fields::row(&TRUTH, truth));
    }

    /// Adds the forces of a modelled robot.
    pub fn forces(&mut self, forces: &biflag::Forces) {
        self.data.forces.push(forces.time_s, forces.columns());
    }

    /// Adds the centre lines of both flagella, body axes, m.
    pub fn shapes(&mut self, time_s: f64, lines: [Vec<[f64; 3]>; 2]) {
        let last = |columns: &[Vec<f64>]| -> Option<[f64; 2]> {
            let [.., one, two] = columns else { return None };
            Some([*one.last()?, *two.last()?])
        };
        let turns = last(&self.data.truth.values).or_else(|| last(&self.data.motors.values)).unwrap_or_default();
        self.data.shapes.push(time_s, turns, lines);
    }

    /// Adds an event.
    pub fn event(&mut self, time_s: f64, kind: Kind, text: &str) {
        match kind {
            Kind::Calibration => self.data.calibrated = self.data.readings.len(),
            Kind::Phase => {
                if text == "run" {
                    self.ordered_s = None;
                }
                self.data.phases.push((text.to_owned(), time_s));
            }
            _ => {}
        }
        if self.data.events.len() < MAX_EVENTS {
            self.data.events.push(Event { time_s, kind, text: text.to_owned() });
        } else {
            self.data.more_events += 1;
        }
    }

    /// Adds a number of lost telemetry frames.
    pub fn dropout(&mut self, time_s: f64, count: u32) {
        self.data.link.lost = self.data.link.lost.saturating_add(count.into());
        let second = self.second(time_s);
        second.lost = second.lost.saturating_add(count);
    }

    /// Adds a command that was sent `attempts` times.
    pub fn command(&mut self, time_s: f64, attempts: u32) {
        let retries = attempts.saturating_sub(1);
        self.data.link.retries = self.data.link.retries.saturating_add(retries.into());
        let second = self.second(time_s);
        second.retries = second.retries.saturating_add(retries);
    }

    /// Returns the trial with its metadata. The log is assumed to be intact.
    pub fn finish(mut self, path: &Path, records: Records) -> Data {
        if records.origin() == Origin::Imported {
            self.take_import(&records);
        }
        let mut data = Data {
            path: path.to_owned(),
            link: link(self.data.link, records.summary.as_ref().map(|summary| summary.link)),
            temperature_c: self.temperature_sum / self.frames.max(1) as f64,
            records,
            duration_s: self.last_s.unwrap_or_default(),
            ..self.data
        };
        data.times = bounds::times(&mut data, self.ordered_s, self.fault.as_ref());
        // Without the event of the calibration, the readings before the still phase may have another bias.
        if data.calibrated == 0 && data.records.calibration.is_some() {
            data.calibrated = data.readings.partition_point(|(time, _)| *time < data.times.preroll.start);
        }
        clock::correct(data)
    }

    /// Converts the states measured by other instruments into the readings of an imported trial.
    fn take_import(&mut self, records: &Records) {
        let states = std::mem::take(&mut self.data.truth);
        let celsius = records.import.as_ref().and_then(|import| import.temperature_c).unwrap_or(f64::NAN);
        let trial = records.trial.clone().unwrap_or_default();
        let [run, after] = ["run", "decay"].map(|name| self.data.phases.iter().find(|(phase, _)| phase == name));
        let run = run.map_or(f64::INFINITY, |(_, start)| *start)..after.map_or(f64::INFINITY, |(_, start)| *start);
        (self.data.readings, self.data.motors) =
            imported::readings(&states, celsius, &run, [trial.w1_rpm, trial.w2_rpm]);
        self.last_s = states.time_s.last().copied();
        (self.frames, self.temperature_sum) = (1, celsius);
        self.data.link.samples = states.len() as u64;
    }

    /// Returns the speed (rpm) and the turns of a motor. A motor without encoder has its commanded speed until the swing is
    /// measured.
    fn motion(&self, index: usize, motor: &Motor, time_s: f64) -> (f64, f64) {
        if !motor.speed_rpm.is_nan() {
            return (motor.speed_rpm, motor.turns);
        }
        let known = self.data.motor_turns(index);
        let before = known.time_s.last().zip(known.value.last());
        let turns = before.map_or(0.0, |(before_s, turns)| turns + motor.target_rpm / 60.0 * (time_s - before_s));
        (motor.target_rpm, turns)
    }

    /// Returns the sensor's reading in a frame, with the attitude as sent by the board; `None` if the frame has no
    /// attitude, or an invalid one that no board sends.
    fn reading(&self, frame: &Telemetry) -> Option<Reading> {
        let q = frame.attitude.as_ref()?;
        let attitude = match &frame.attitude_q15 {
            // In format 1, `attitude` is levelled.
            Some(sent) if self.format < 2 => {
                Quaternion([sent.w, sent.x, sent.y, sent.z].map(|part| Q15(part as i16))).to_f64()
            }
            _ => [q.w, q.x, q.y, q.z],
        };
        if !attitude.iter().sum::<f64>().is_finite() || attitude == [0.0; 4] {
            return None;
        }
        let rates_dps = frame.angular_velocity_dps.as_ref().map(|rate| [rate.x, rate.y, rate.z]);
        // Of an unknown temperature, the changes are known.
        let temperature_c = match frame.temperature_c {
            unknown if unknown.is_nan() => TemperatureCounts(frame.temperature_counts as i16).celsius(GENUINE_IMU_ID),
            known => known,
        };
        Some(Reading { attitude, rates_dps, temperature_c })
    }

    fn second(&mut self, time_s: f64) -> &mut LinkSecond {
        let index = time_s.clamp(0.0, LONGEST_TRIAL_S) as usize;
        if self.data.link_seconds.len() <= index {
            self.data.link_seconds.resize(index + 1, LinkSecond::default());
        }
        &mut self.data.link_seconds[index]
    }
}

/// Returns the link statistics. The trial's summary is more complete than the messages, except for samples that the log has lost
/// since.
fn link(counted: LinkStats, summed_up: Option<LinkStats>) -> LinkStats {
    let Some(summed_up) = summed_up else { return counted };
    let missing = summed_up.samples.saturating_sub(counted.samples);
    LinkStats { samples: counted.samples, lost: summed_up.lost.saturating_add(missing), ..summed_up }
}

#[cfg(test)]
mod tests {
    use super::*;
    use biflag_log::FORMAT;

    #[test]
    fn attitude_that_is_no_number_is_no_reading() {
        let mut collector = Collector::new(Want::default(), FORMAT);
        for (time_s, w) in (0..).map(f64::from).zip([f64::NAN, f64::INFINITY, 0.0, 0.9]) {
            let attitude = Some(biflag::Quaternion { w, ..biflag::Quaternion::default() });
            collector.telemetry(&Telemetry { time_s, attitude, imu_fresh: true, ..Telemetry::default() });
        }
        let readings = collector.finish("log".as_ref(), Records::default()).readings;
        assert!(matches!(readings[..], [(3.0, Reading { attitude: [0.9, ..], .. })]), "{readings:?}");
    }
}
