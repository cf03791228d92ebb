//! The rate error of the board's clock. A fast clock makes every tick shorter than its nominal length. So the board integrates
//! its rates over too long a time, its times are too long, and its speeds too low.

use super::data::Data;
use crate::attitude::Columns;
use crate::sensor::Estimate;
use biflag_log::ClockMeta;

/// Limit of a Nano's ceramic resonator: ±0.5 % (Murata CSTCE16M0V53).
const RESONATOR: f64 = 0.005;

/// Fewest pings for a measured rate, and the largest rate error of a board in real time. An emulated board that runs
/// faster than real time has no clock to compare.
const LEAST_PINGS: u32 = 10;
const LARGEST: f64 = 0.02;

/// The rate error of a board's clock.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct ClockRate {
    /// Relative error; positive if the clock runs fast.
    pub error: Estimate,
    /// Whether this trial's pings measured it. If not, all trials of the board have the same error.
    pub is_measured: bool,
}

/// Returns the rate error of the board's clock. `duration_s` is the duration of the trial.
pub(super) fn rate(clock: Option<&ClockMeta>, duration_s: f64) -> ClockRate {
    let unknown = ClockRate { error: Estimate::within(RESONATOR), is_measured: false };
    let Some(clock) = clock.filter(|clock| clock.pings >= LEAST_PINGS) else { return unknown };
    let value = clock.drift_ppm * 1e-6;
    if value.is_nan() || value.abs() > LARGEST || duration_s <= 0.0 {
        return unknown;
    }
    // Slope of a line through evenly spread pings.
    let u = clock.residual_us * 1e-6 / duration_s * (12.0 / f64::from(clock.pings)).sqrt();
    if u < unknown.error.u { ClockRate { error: Estimate { value, u }, is_measured: true } } else { unknown }
}

/// Corrects times and speeds of a trial by the rate of the board's clock, if it was measured.
pub(super) fn correct(mut data: Data) -> Data {
    let true_s = 1.0 / (1.0 + rate(data.records.clock.as_ref(), data.duration_s).error.value);
    if true_s == 1.0 {
        return data;
    }
    fn scale<const N: usize>(columns: &mut Columns<N>, factor: f64) {
        columns.time_s.iter_mut().for_each(|time| *time *= factor);
    }
    scale(&mut data.frames, true_s);
    scale(&mut data.motors, true_s);
    scale(&mut data.truth, true_s);
    scale(&mut data.forces, true_s);
    data.shapes.all.iter_mut().for_each(|shape| shape.time_s *= true_s);
    data.readings.iter_mut().for_each(|(time, _)| *time *= true_s);
    data.events.iter_mut().for_each(|event| event.time_s *= true_s);
    data.phases.iter_mut().for_each(|(_, time)| *time *= true_s);
    for phase in [&mut data.times.preroll, &mut data.times.run, &mut data.times.decay] {
        *phase = phase.start * true_s..phase.end * true_s;
    }
    data.lit_s = data.lit_s.map(|lit_s| lit_s.map(|time| time * true_s));
    data.duration_s *= true_s;
    let [_, speed1, _, speed2, ..] = &mut data.motors.values;
    speed1.iter_mut().chain(speed2).for_each(|rpm| *rpm /= true_s);
    data
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::{Collector, Records, Want};
    use biflag_log::FORMAT;
    use biflag_log::schema::biflag::event::Kind;
    use biflag_log::schema::biflag::{Motor, Quaternion, Telemetry};

    /// Returns a trial of 10 s on a clock that is 0.9 % fast, with one turn per second of true time.
    fn trial(clock: ClockMeta) -> Data {
        let mut collector = Collector::new(Want::default(), FORMAT);
        collector.event(0.0, Kind::Phase, "run");
        for i in 0..=2000 {
            let time_s = 0.005 * f64::from(i);
            let motor = Motor { target_rpm: 60.0, speed_rpm: 60.0 / 1.009, turns: time_s / 1.009, ..Motor::default() };
            collector.telemetry(&Telemetry {
                time_s,
                imu_fresh: true,
                attitude: Some(Quaternion { w: 1.0, ..Quaternion::default() }),
                motor1: Some(motor),
                motor2: Some(motor),
                ..Telemetry::default()
            });
        }
        collector.event(10.0, Kind::Phase, "end");
        collector.finish("log".as_ref(), Records { clock: Some(clock), ..Records::default() })
    }

    #[test]
    fn turns_are_counted_over_true_time() {
        let measured = ClockMeta { pings: 300, drift_ppm: 9000.0, residual_us: 200.0, ..ClockMeta::default() };
        let data = trial(measured);
        for (time, turns) in data.motors.time_s.iter().zip(&data.motors.values[4]) {
            assert!((time - turns).abs() < 1e-9, "{turns} turns in {time} s");
        }
        assert!(data.motors.values[1].iter().all(|rpm| (rpm - 60.0).abs() < 1e-9) && data.motors.values[0][7] == 60.0);
        let end_s = 10.0 / 1.009;
        let ends = [data.duration_s, data.times.run.end, data.phases[1].1, data.events[1].time_s];
        let last = data.readings.last().unwrap().0;
        assert!(ends.into_iter().chain([last]).all(|end| (end - end_s).abs() < 1e-9), "{ends:?}, {last}");
    }

    #[test]
    fn times_of_an_unknown_clock_stay() {
        let emulated = ClockMeta { pings: 300, drift_ppm: 9e6, ..ClockMeta::default() };
        for clock in [emulated, ClockMeta { pings: 3, drift_ppm: 9000.0, ..ClockMeta::default() }] {
            assert_eq!(trial(clock).duration_s, 10.0);
            let error = rate(Some(&clock), 10.0).error;
            assert!(error.value == 0.0 && (error.u - 0.005 / 3f64.sqrt()).abs() < 1e-12);
        }
    }
}
