//! How often the stated 95 % intervals of yaw, pitch and roll contain the truth, for sensors whose errors lie within the
//! data sheet.
//!
//! `cargo run --release -p tests --example coverage -- 200`: sensors per line, three minutes a line on two cores for 200.
//!
//! The motion is that of the model at a point, with its decay; the sensor is made here ([`part`]), from the data sheet alone,
//! and measured on a bench made here, too ([`bench`]), by what evaluates the commands `biflag sensor`; the filter is that of
//! the firmware. What follows is what reads every log: [`Collector`] and [`Zeroed`]. A trial after a rest that was cut short
//! begins with the wait of `record` ([`Still`]), or, as `rest_at_most = 0` has it, without.

mod bench;
mod part;

use biflag_log::schema::biflag::event::Kind;
use biflag_log::schema::biflag::{Motor, Quaternion, Telemetry, Vector};
use biflag_log::{
    CalibrationMeta, ClockMeta, End, Identity, LevelMeta, MeasuredSensorMeta, RestMeta, Summary, TrialMeta,
};
use firmware::attitude::{Attitude, Gains};
use host::attitude::Still;
use host::trial::{Collector, Records, Want, Zeroed};
use nalgebra::{UnitQuaternion, Vector3};
use part::{Part, Powered, Random, TICK_S};
use sim::body::closure::Closure;
use sim::params::Robot;
use sim::profile::SpeedProfile;
use sim::trial::{Options, Trial};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

const CALIBRATE_S: f64 = 5.0;
const PREROLL_S: f64 = 20.0;
const RUN_S: f64 = 120.0;

/// Interval at which `record` judges whether the robot is still, s, and its longest wait.
const CHECK_S: f64 = 0.5;
const LONGEST_WAIT_S: f64 = 300.0;

/// Yaw, pitch and roll of a robot at the board's rate, from the start of its run, radians.
struct Motion {
    angles: Vec<[f64; 3]>,
    run_s: f64,
}

impl Motion {
    fn of(rpm: [f64; 2], decay_s: f64) -> Self {
        let still = [0.0; 2];
        let points = [(0.0, still), (0.5, rpm), (RUN_S, rpm), (RUN_S + 0.5, still), (RUN_S + decay_s, still)];
        let profile = SpeedProfile::from_points(&points).expect("a profile");
        let options = Options { rate_hz: 1.0 / TICK_S, shapes: false };
        let trial = Trial::new(&Robot::default(), Closure::Full, profile, options).expect("a robot");
        let angles = trial.map(|sample| sample.expect("a step")).map(|s| [s.yaw_rad, s.pitch_rad, s.roll_rad]);
        Self { angles: angles.collect(), run_s: RUN_S }
    }

    /// Returns the angles at a time since the start of the run. `late_s`: time since the end of an earlier run like this one
    /// at which the calibration began; infinite if the robot was at rest.
    fn at(&self, time_s: f64, late_s: f64) -> [f64; 3] {
        let own = if time_s > 0.0 { self.angles[self.index(time_s)] } else { [0.0; 3] };
        if late_s.is_infinite() {
            return own;
        }
        // What is left of the earlier motion is added.
        let left = self.left(late_s + time_s + CALIBRATE_S + PREROLL_S);
        [0, 1, 2].map(|k| own[k] + left[k])
    }

    /// Returns the angles at a time after the end of a run.
    fn left(&self, since_s: f64) -> [f64; 3] {
        let index = self.index(self.run_s + since_s);
        if index + 1 < self.angles.len() { self.angles[index] } else { [0.0; 3] }
    }

    fn index(&self, time_s: f64) -> usize {
        ((time_s / TICK_S).round().max(0.0) as usize).min(self.angles.len() - 1)
    }
}

/// Errors over the stated uncertainties of yaw, pitch and roll, and these uncertainties, degrees.
type Result = [[f64; 2]; 3];

/// Which parts are drawn.
#[derive(Clone, Copy, PartialEq)]
enum Lot {
    /// No errors but noise and bias.
    Ideal,
    /// Errors equally likely within their limits.
    Typical,
    /// All errors at their limits, with signs at random.
    Edge,
}

impl Lot {
    fn draw(self, random: &mut Random) -> Part {
        match self {
            Self::Ideal => Part::ideal(random),
            Self::Typical => Part::sold(random, Random::within),
            Self::Edge => Part::sold(random, Random::at),
        }
    }
}

#[derive(Clone, Copy)]
struct Case {
    name: &'static str,
    lot: Lot,
    is_measured: bool,
    decay_s: f64,
    /// Time since the end of an earlier run; infinite if the robot was at rest.
    late_s: f64,
    /// Whether the trial begins with a wait until the robot is still.
    waits: bool,
}

/// A sensor, and what is known of it once it was measured.
struct Sensor {
    part: Part,
    measured: MeasuredSensorMeta,
}

impl Sensor {
    fn new(lot: Lot, seed: u64) -> Self {
        let mut random = Random(seed);
        let part = lot.draw(&mut random);
        let measured = match lot {
            Lot::Ideal => bench::without_errors(&part, &mut random),
            Lot::Typical | Lot::Edge => bench::measured(&part, &mut random),
        };
        Self { part, measured }
    }
}

/// Returns the attitude at yaw, pitch and roll, radians.
fn body([yaw, pitch, roll]: [f64; 3]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_euler_angles(roll, pitch, yaw)
}

/// Waits until the robot is still. Returns how long it took, s, and what `record` writes into the log.
fn wait(powered: &mut Powered, motion: &Motion, late_s: f64) -> (f64, Option<RestMeta>) {
    let (mut still, mut before) = (Still::default(), body(motion.left(late_s)));
    for tick in 1.. {
        let passed_s = powered.next_s();
        let now = body(motion.left(late_s + passed_s));
        let part::Reading { rate_dps, force_g, .. } = powered.read(before, now);
        before = now;
        still.push(f64::from(tick) * TICK_S, rate_dps.z, force_g.into());
        let is_due = tick % (CHECK_S / TICK_S) as u32 == 0;
        let motion = if is_due { still.motion() } else { None };
        if let Some(motion) = motion.filter(|motion| motion.is_still()) {
            let (yaw_dps, tilt_dps) = (Some(motion.yaw_dps), Some(motion.tilt_dps));
            // The log begins with the calibration here.
            return (passed_s, Some(RestMeta { still: true, yaw_dps, tilt_dps, ..RestMeta::default() }));
        }
        if passed_s > LONGEST_WAIT_S {
            return (passed_s, None);
        }
    }
    unreachable!("the wait ends")
}

fn trial(motion: &Motion, case: &Case, Sensor { part, measured }: &Sensor, seed: u64) -> Option<Result> {
    let mut random = Random(seed ^ 0x7472_6961_6c00);
    let clock_error = part.clock + 1e-5 * random.normal();
    let mut powered = Powered::new(part, &mut random);
    let (mut attitude, mut collector) = (Attitude::default(), Collector::new(Want::default(), 2));
    let gains = Gains { kp: 1.0, ki: 0.0 };
    let mut calibrated = Vector3::zeros();
    let start_s = -CALIBRATE_S - PREROLL_S;
    let ticks = ((RUN_S + case.decay_s - start_s) / TICK_S) as usize;
    let calibration = (CALIBRATE_S / TICK_S) as usize;
    let (waited_s, rest) = if case.waits { wait(&mut powered, motion, case.late_s) } else { (0.0, None) };
    let body = |time: f64| body(motion.at(time, case.late_s + waited_s));
    let (mut before, mut sums, mut forces) = (body(start_s), Vector3::zeros(), Vec::new());
    let mut window = Vec::new();
    collector.event(0.0, Kind::Phase, "calibrate");
    for tick in 0..ticks {
        // The board's tick is its own.
        let time_s = start_s + powered.next_s() - waited_s;
        let clock_s = (tick + 1) as f64 * TICK_S;
        let now = body(time_s);
        let part::Reading { rate_dps, force_g, temperature_c } = powered.read(before, now);
        before = now;
        if tick < calibration {
            sums += rate_dps;
            if tick + 1 == calibration {
                calibrated = sums / calibration as f64;
                collector.event(clock_s, Kind::Calibration, "");
                collector.event(clock_s, Kind::Phase, "preroll");
            }
        }
        let turn = (rate_dps - calibrated) * (0.5 * TICK_S).to_radians();
        attitude.update(turn.map(|half| half as f32).into(), force_g.map(|g| g as f32).into(), TICK_S as f32, gains);
        let is_running = (0.0..RUN_S).contains(&time_s);
        if (-5.0..0.0).contains(&time_s) {
            forces.push(force_g);
        }
        for (name, from) in [("run", 0.0), ("decay", RUN_S)] {
            if time_s >= from && time_s - TICK_S < from {
                collector.event(clock_s, Kind::Phase, name);
            }
        }
        // The means of the truth are over the reported window, which ends with the run.
        if is_running {
            window.push((clock_s / (1.0 + clock_error), motion.at(time_s, f64::INFINITY).map(f64::to_degrees)));
        }
        let [w, x, y, z] = attitude.quaternion().0.map(|part| f64::from(part.0) / 32768.0);
        let rate = rate_dps - calibrated;
        let speed_rpm = if is_running { 60.0 } else { 0.0 };
        let motor = Motor { target_rpm: speed_rpm, speed_rpm, turns: clock_s, ..Motor::default() };
        collector.telemetry(&Telemetry {
            time_s: clock_s,
            imu_fresh: true,
            attitude: Some(Quaternion { w, x, y, z }),
            angular_velocity_dps: Some(Vector { x: rate.x, y: rate.y, z: rate.z }),
            temperature_c,
            motor1: Some(motor),
            motor2: Some(motor),
            ..Telemetry::default()
        });
    }
    collector.event(ticks as f64 * TICK_S, Kind::Phase, "end");
    let force = forces.iter().sum::<Vector3<f64>>() / forces.len() as f64;
    let up = force.normalize();
    let tilt_deg = up.xy().norm().atan2(up.z).to_degrees();
    let level = LevelMeta { up: up.into(), force_g: force.norm(), tilt_deg, used: true };
    let clock = ClockMeta { pings: 300, drift_ppm: clock_error * 1e6, residual_us: 300.0, ..ClockMeta::default() };
    let records = Records {
        identity: Some(Identity { format: 2, ..Identity::default() }),
        trial: Some(TrialMeta {
            w1_rpm: 60.0,
            w2_rpm: 60.0,
            calibrate_s: CALIBRATE_S,
            preroll_s: PREROLL_S,
            run_s: RUN_S,
            decay_s: case.decay_s,
            ..TrialMeta::default()
        }),
        rest,
        level: Some(level),
        clock: Some(clock),
        summary: Some(Summary { end: End::Complete, ..Summary::default() }),
        calibration: Some(CalibrationMeta { still: true, ..CalibrationMeta::default() }),
        measured_sensor: case.is_measured.then(|| measured.clone()),
        ..Records::default()
    };
    let data = collector.finish("coverage".as_ref(), records);
    let zeroed = Zeroed::new(&data);
    let steady = zeroed.steady.as_ref()?;
    let inside: Vec<_> = window.iter().filter(|(time, _)| steady.window.contains(time)).collect();
    let truth = |k: usize| inside.iter().map(|(_, angles)| angles[k]).sum::<f64>() / inside.len() as f64;
    let angles = zeroed.angles()?;
    let stated = [angles.yaw_uncertainty_deg?, angles.pitch_uncertainty_deg?, angles.roll_uncertainty_deg?];
    Some(std::array::from_fn(|k| [(steady.angles_deg[k] - truth(k)) / stated[k], stated[k]]))
}

/// Returns the results of all numbers below `count`, in their order.
fn each<T: Send>(count: usize, of: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let (next, all) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    let work = || {
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            if number >= count {
                return;
            }
            let result = of(number);
            all.lock().expect("no panic").push((number, result));
        }
    };
    std::thread::scope(|scope| (0..2).for_each(|_| drop(scope.spawn(work))));
    let mut all = all.into_inner().expect("no panic");
    all.sort_by_key(|(number, _)| *number);
    all.into_iter().map(|(_, result)| result).collect()
}

fn main() {
    let seeds: usize = std::env::args().nth(1).and_then(|count| count.parse().ok()).unwrap_or(20);
    let only = std::env::args().nth(2).unwrap_or_default();
    let base =
        Case { name: "ideal", lot: Lot::Ideal, is_measured: true, decay_s: 30.0, late_s: f64::INFINITY, waits: false };
    let typical = Case { name: "typical", lot: Lot::Typical, is_measured: false, ..base };
    let edge = Case { name: "edge", lot: Lot::Edge, ..typical };
    let cases = [
        base,
        typical,
        Case { name: "typical, measured", is_measured: true, ..typical },
        edge,
        Case { name: "edge, measured", is_measured: true, ..edge },
        Case { name: "decay of 20 s", is_measured: true, decay_s: 20.0, ..typical },
        Case { name: "decay of 10 s", is_measured: true, decay_s: 10.0, ..typical },
        Case { name: "no decay", is_measured: true, decay_s: 0.5, ..typical },
        Case { name: "rest cut short, 3 s", is_measured: true, late_s: 3.0, waits: true, ..typical },
        Case { name: "rest cut short, 10 s", is_measured: true, late_s: 10.0, waits: true, ..typical },
        Case { name: "rest cut short, 3 s, without a wait", is_measured: true, late_s: 3.0, ..typical },
    ];
    // A sensor is measured once, for all trials.
    let drawn = |lot| (lot, each(seeds, |seed| Sensor::new(lot, 1000 + seed as u64)));
    let is_used = |lot: &Lot| cases.iter().any(|case| case.lot == *lot && case.name.contains(&only));
    let lots: Vec<_> = [Lot::Ideal, Lot::Typical, Lot::Edge].into_iter().filter(is_used).map(drawn).collect();
    println!("{seeds} sensors; share of errors within ±, mean ±, median of |error| over ±");
    println!("| sensor and plan | rpm | yaw | pitch | roll |\n| --- | --- | --- | --- | --- |");
    let mut means = Vec::new();
    for rpm in [[50.0, 10.0], [-90.0, 90.0], [90.0, 90.0], [0.0, 45.0], [37.3, -61.7], [-23.45, 71.6]] {
        let motion = Motion::of(rpm, 120.0);
        for case in cases.iter().filter(|case| case.name.contains(&only)) {
            let (_, sensors) = lots.iter().find(|(lot, _)| *lot == case.lot).expect("every lot");
            let all = each(seeds, |seed| trial(&motion, case, &sensors[seed], 1000 + seed as u64));
            let cell = |k: usize| {
                let known: Vec<[f64; 2]> = all.iter().flatten().map(|result| result[k]).collect();
                if known.is_empty() {
                    return "no ±".to_owned();
                }
                let mut ratios: Vec<f64> = known.iter().map(|[ratio, _]| ratio.abs()).collect();
                ratios.sort_by(f64::total_cmp);
                let covered = 100.0 * ratios.partition_point(|ratio| *ratio <= 1.0) as f64 / ratios.len() as f64;
                let mean = known.iter().map(|[_, stated]| stated).sum::<f64>() / known.len() as f64;
                let without = match all.len() - known.len() {
                    0 => String::new(),
                    without => format!("; {without} without ±"),
                };
                format!("{covered:.0} %, {mean:.2}°, {:.2}{without}", ratios[ratios.len() / 2])
            };
            let [w1, w2] = rpm;
            println!("| {} | ({w1}, {w2}) | {} | {} | {} |", case.name, cell(0), cell(1), cell(2));
            let stated: Vec<f64> = all.iter().flatten().map(|result| result[0][1]).collect();
            means.push((rpm, case.name, stated.iter().sum::<f64>() / stated.len() as f64));
        }
    }
    for (rpm @ [w1, w2], name, typical) in means.iter().filter(|(_, name, _)| *name == "typical") {
        let measured = means.iter().find(|(at, other, _)| at == rpm && other.strip_prefix(name) == Some(", measured"));
        if let Some((_, _, measured)) = measured {
            println!(
                "({w1}, {w2}) rpm: the ± of the yaw of a measured sensor is {:.1} times smaller",
                typical / measured
            );
        }
    }
}
