//! How often the stated 95 % intervals of yaw, pitch and roll contain the truth, for sensors whose errors lie within the
//! data sheet.
//!
//! `cargo run --release -p tests --example coverage -- 200`: sensors per line, three minutes a line on two cores for 200.
//!
//! The motion is that of the model at a point, with its decay; the sensor is made here, from the data sheet alone; the
//! filter is that of the firmware. What follows is what reads every log: [`Collector`] and [`Zeroed`]. A trial after a rest
//! that was cut short begins with the wait of `record` ([`Still`]), or, as `rest_at_most = 0` has it, without.

use biflag_log::schema::biflag::event::Kind;
use biflag_log::schema::biflag::{Motor, Quaternion, Telemetry, Vector};
use biflag_log::{CalibrationMeta, ClockMeta, End, Identity, LevelMeta, MeasuredSensorMeta, Summary, TrialMeta};
use firmware::attitude::{Attitude, Gains};
use host::attitude::Still;
use host::sensor::{Estimate, Sensor};
use host::trial::{Collector, Records, Want, Zeroed};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use sim::body::closure::Closure;
use sim::params::Robot;
use sim::profile::SpeedProfile;
use sim::trial::{Options, Trial};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

const TICK_S: f64 = 0.005;
const CALIBRATE_S: f64 = 5.0;
const PREROLL_S: f64 = 20.0;
const RUN_S: f64 = 120.0;

/// Interval at which `record` judges whether the robot is still, s, and its longest wait.
const CHECK_S: f64 = 0.5;
const LONGEST_WAIT_S: f64 = 300.0;

/// A generator of random numbers: SplitMix64.
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        let (radius, angle) = ((-2.0 * (1.0 - self.uniform()).ln()).sqrt(), std::f64::consts::TAU * self.uniform());
        radius * angle.cos()
    }

    /// Returns a number within ±`limit`.
    fn within(&mut self, limit: f64) -> f64 {
        limit * (2.0 * self.uniform() - 1.0)
    }

    fn three(&mut self, limit: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.within(limit))
    }
}

/// A part: limits of PS-MPU-6000A revision 3.4, sections 6.1 and 6.2, and of a Nano's resonator.
struct Part {
    gyro: Matrix3<f64>,
    gyro_g_dps: Matrix3<f64>,
    accel: Matrix3<f64>,
    accel_offset_g: Vector3<f64>,
    mounting: UnitQuaternion<f64>,
    bias_dps_per_c: Vector3<f64>,
    warming_c: f64,
    clock: f64,
    flicker_dps: f64,
    /// The axis of the gyroscope that flickers.
    flicker: Vector3<f64>,
}

impl Part {
    fn ideal() -> Self {
        Self {
            gyro: Matrix3::identity(),
            gyro_g_dps: Matrix3::zeros(),
            accel: Matrix3::identity(),
            accel_offset_g: Vector3::zeros(),
            mounting: UnitQuaternion::identity(),
            bias_dps_per_c: Vector3::zeros(),
            warming_c: 0.0,
            clock: 0.0,
            flicker_dps: 0.0,
            flicker: Vector3::z(),
        }
    }

    fn typical(random: &mut Random) -> Self {
        let mut matrix = |diagonal: f64, others: f64| {
            Matrix3::identity() + Matrix3::from_fn(|i, j| random.within(if i == j { diagonal } else { others }))
        };
        let (gyro, accel) = (matrix(0.03, 0.02), matrix(0.03, 0.02));
        Self {
            gyro,
            accel,
            gyro_g_dps: Matrix3::from_fn(|_, _| random.within(0.1)),
            accel_offset_g: Vector3::new(random.within(0.05), random.within(0.05), random.within(0.08)),
            mounting: UnitQuaternion::from_scaled_axis(random.three(2f64.to_radians())),
            // A tenth of what ±20 °/s over -40 to 85 °C amounts to.
            bias_dps_per_c: Vector3::from_fn(|_, _| 0.03 * random.normal()),
            warming_c: (1.5 * random.normal()).abs(),
            clock: random.within(0.005),
            flicker_dps: 0.0015,
            flicker: Vector3::ith((3.0 * random.uniform()) as usize, 1.0),
        }
    }

    /// Returns what three measurements of this part give: each error within its scatter of the truth.
    fn measured(&self, random: &mut Random) -> Sensor {
        let mut near = |value: f64, u: f64| Estimate { value: value + u * random.normal(), u };
        let mut sensor = Sensor::of_data_sheet();
        let [_, _, yaw] = <[f64; 3]>::from(self.mounting.scaled_axis().map(f64::to_degrees));
        for i in 0..3 {
            sensor.gyro_scale[i] = near(self.gyro[(i, i)] - 1.0, 0.001);
            sensor.accel_scale[i] = near(self.accel[(i, i)] - 1.0, 0.001);
            for j in 0..3 {
                sensor.gyro_g_dps[i][j] = near(self.gyro_g_dps[(i, j)], 0.003);
                if i != j {
                    sensor.gyro_cross[i][j] = near(self.gyro[(i, j)], 0.002);
                    sensor.accel_cross[i][j] = near(self.accel[(i, j)], 0.002);
                }
            }
        }
        sensor.mounting_deg[2] = near(yaw, 0.2);
        sensor
    }
}

/// Returns the record of a sensor's file.
fn measured_sensor(sensor: &Sensor) -> MeasuredSensorMeta {
    let mut text = "board_id = 0\ndate = \"2026-11-24\"\ngyro_axes = [\"x\", \"y\", \"z\"]\n\
                    accel_axes = [\"x\", \"y\", \"z\"]\n"
        .to_owned();
    let names = ["x", "y", "z"];
    let line = |key: &str, Estimate { value, u }: Estimate| format!("{key} = {{ value = {value:.9}, u = {u:.9} }}\n");
    for (name, values) in [("gyro_scale", &sensor.gyro_scale), ("accel_scale", &sensor.accel_scale)] {
        text += &format!("[{name}]\n");
        (0..3).for_each(|i| text += &line(names[i], values[i]));
    }
    for (name, values, is_whole) in [
        ("gyro_cross", &sensor.gyro_cross, false),
        ("gyro_g_dps", &sensor.gyro_g_dps, true),
        ("accel_cross", &sensor.accel_cross, false),
    ] {
        text += &format!("[{name}]\n");
        let pairs = (0..9).map(|k| (k / 3, k % 3)).filter(|(i, j)| is_whole || i != j);
        pairs.for_each(|(i, j)| text += &line(&format!("{}{}", names[i], names[j]), values[i][j]));
    }
    text += &format!("[mounting_deg]\n{}", line("z", sensor.mounting_deg[2]));
    MeasuredSensorMeta { name: "sensor.toml".to_owned(), text }
}

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

    /// Returns the angles at a time since the start of the run. `rest_s`: time from the end of an earlier run like this one to
    /// the start of the run; infinite if the robot was at rest.
    fn at(&self, time_s: f64, rest_s: f64) -> [f64; 3] {
        let own = if time_s > 0.0 { self.angles[self.index(time_s)] } else { [0.0; 3] };
        // What is left of the earlier motion is added.
        let left = self.left(rest_s + time_s);
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

/// Returns the attitude at yaw, pitch and roll, radians.
fn body([yaw, pitch, roll]: [f64; 3]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_euler_angles(roll, pitch, yaw)
}

/// Errors over the stated uncertainties of yaw, pitch and roll, and these uncertainties, degrees.
type Result = [[f64; 2]; 3];

#[derive(Clone, Copy)]
struct Case {
    name: &'static str,
    is_typical: bool,
    is_measured: bool,
    decay_s: f64,
    /// Rest after an earlier run; infinite if the robot was at rest.
    rest_s: f64,
    /// Whether the trial begins with a wait until the robot is still.
    waits: bool,
}

/// A sensor that turns with the robot. Its errors go on through wait, calibration and trial.
struct Imu {
    part: Part,
    random: Random,
    bias: Vector3<f64>,
    flicker: [f64; 4],
    before: UnitQuaternion<f64>,
    /// Time since it was switched on, s.
    on_s: f64,
}

impl Imu {
    fn new(part: Part, mut random: Random, at: UnitQuaternion<f64>) -> Self {
        let bias = Vector3::from_fn(|_, _| 2.0 * random.normal());
        Self { part, random, bias, flicker: [0.0; 4], before: at, on_s: 0.0 }
    }

    fn noise(&mut self, sd: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| sd * self.random.normal())
    }

    /// Returns by how much it has warmed since it was switched on, some seconds ago, °C.
    fn warming_c(&self, ago_s: f64) -> f64 {
        self.part.warming_c * (1.0 - (-(self.on_s - ago_s).max(0.0) / 150.0).exp())
    }

    /// Returns the rates, °/s, and the forces, g, of a tick at whose end the robot has this attitude.
    fn read(&mut self, now: UnitQuaternion<f64>) -> [Vector3<f64>; 2] {
        // 0.005 °/s/√Hz and 400 µg/√Hz, one-sided, up to 100 Hz.
        let (gyro_dps, accel_g) = (0.05, 0.004);
        // The board's tick is its own.
        let passed_s = TICK_S / (1.0 + self.part.clock);
        self.on_s += passed_s;
        self.bias += self.noise(1e-4 * TICK_S.sqrt());
        // Flicker: walks of several correlation times about one axis.
        for k in 0..self.flicker.len() {
            let share = TICK_S / 4f64.powi(k as i32 + 1);
            let step = self.part.flicker_dps * (2.0 * share).sqrt() * self.random.normal();
            self.flicker[k] += step - share * self.flicker[k];
        }
        let up = now.inverse() * Vector3::z();
        let rate = (self.before.inverse() * now).scaled_axis() / passed_s;
        self.before = now;
        let to_sensor = self.part.mounting.inverse();
        let warming = self.part.bias_dps_per_c * self.warming_c(0.0);
        let drift = warming + self.part.flicker * self.flicker.iter().sum::<f64>();
        let seen_up = to_sensor * up;
        let turned = self.part.gyro * (to_sensor * rate).map(f64::to_degrees) + self.part.gyro_g_dps * seen_up;
        let rate_dps = turned + self.bias + drift + self.noise(gyro_dps);
        let force_g = self.part.accel * seen_up + self.part.accel_offset_g + self.noise(accel_g);
        [rate_dps.map(|rate| (rate * 131.0).round() / 131.0), force_g]
    }
}

fn trial(motion: &Motion, case: &Case, seed: u64) -> Option<Result> {
    let mut random = Random(seed);
    let part = if case.is_typical { Part::typical(&mut random) } else { Part::ideal() };
    let (mut attitude, mut collector) = (Attitude::default(), Collector::new(Want::default(), 2));
    let gains = Gains { kp: 1.0, ki: 0.0 };
    let mut calibrated = Vector3::zeros();
    let start_s = -CALIBRATE_S - PREROLL_S;
    let ticks = ((RUN_S + case.decay_s - start_s) / TICK_S) as usize;
    let calibration = (CALIBRATE_S / TICK_S) as usize;
    let measured = case.is_measured.then(|| measured_sensor(&part.measured(&mut random)));
    let clock = part.clock;
    let mut rest_s = case.rest_s;
    let mut imu = Imu::new(part, random, body(motion.left(rest_s)));
    if case.waits {
        let mut still = Still::default();
        for tick in 1.. {
            let waited_s = f64::from(tick) * TICK_S;
            let [rate_dps, force_g] = imu.read(body(motion.left(case.rest_s + waited_s / (1.0 + clock))));
            still.push(waited_s, rate_dps.z, force_g.into());
            let is_over =
                tick % (CHECK_S / TICK_S) as u32 == 0 && still.motion().is_some_and(|motion| motion.is_still());
            if is_over || waited_s > LONGEST_WAIT_S {
                rest_s += waited_s / (1.0 + clock);
                break;
            }
        }
    }
    rest_s -= start_s;
    let (mut sums, mut forces, mut window) = (Vector3::zeros(), Vec::new(), Vec::new());
    collector.event(0.0, Kind::Phase, "calibrate");
    for tick in 0..ticks {
        let time_s = start_s + (tick + 1) as f64 * TICK_S / (1.0 + clock);
        let clock_s = (tick + 1) as f64 * TICK_S;
        let [rate_dps, force_g] = imu.read(body(motion.at(time_s, rest_s)));
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
            window.push((clock_s, motion.at(time_s, f64::INFINITY).map(f64::to_degrees)));
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
            temperature_c: 25.0 + imu.warming_c(3.0) + 0.08 * imu.random.normal(),
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
    let clock = ClockMeta { pings: 300, drift_ppm: clock * 1e6, residual_us: 300.0, ..ClockMeta::default() };
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
        level: Some(level),
        clock: Some(clock),
        summary: Some(Summary { end: End::Complete, ..Summary::default() }),
        calibration: Some(CalibrationMeta { still: true, ..CalibrationMeta::default() }),
        measured_sensor: measured,
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

fn main() {
    let seeds: usize = std::env::args().nth(1).and_then(|count| count.parse().ok()).unwrap_or(20);
    let only = std::env::args().nth(2).unwrap_or_default();
    let base = Case {
        name: "ideal",
        is_typical: false,
        is_measured: false,
        decay_s: 30.0,
        rest_s: f64::INFINITY,
        waits: false,
    };
    let typical = Case { name: "typical", is_typical: true, ..base };
    let cases = [
        base,
        typical,
        Case { name: "typical, measured", is_measured: true, ..typical },
        Case { name: "decay of 20 s", is_measured: true, decay_s: 20.0, ..typical },
        Case { name: "decay of 10 s", is_measured: true, decay_s: 10.0, ..typical },
        Case { name: "no decay", is_measured: true, decay_s: 0.5, ..typical },
        Case { name: "rest cut short, 3 s", is_measured: true, rest_s: 3.0, waits: true, ..typical },
        Case { name: "rest cut short, 10 s", is_measured: true, rest_s: 10.0, waits: true, ..typical },
        Case { name: "rest cut short, 3 s, without a wait", is_measured: true, rest_s: 3.0, ..typical },
    ];
    println!("{seeds} sensors; share of errors within ±, mean ±, median of |error| over ±");
    println!("| sensor and plan | rpm | yaw | pitch | roll |\n| --- | --- | --- | --- | --- |");
    for rpm in [[50.0, 10.0], [-90.0, 90.0], [90.0, 90.0], [0.0, 45.0]] {
        let motion = Motion::of(rpm, 120.0);
        for case in cases.iter().filter(|case| case.name.contains(&only)) {
            let (next, all) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
            let work = || loop {
                let seed = next.fetch_add(1, Ordering::Relaxed);
                if seed >= seeds {
                    return;
                }
                let found = trial(&motion, case, 1000 + seed as u64);
                all.lock().expect("no panic").push(found);
            };
            std::thread::scope(|scope| (0..2).for_each(|_| drop(scope.spawn(work))));
            let all = all.into_inner().expect("no panic");
            let cell = |k: usize| {
                let known: Vec<[f64; 2]> = all.iter().flatten().map(|result| result[k]).collect();
                let mut ratios: Vec<f64> = known.iter().map(|[ratio, _]| ratio.abs()).collect();
                ratios.sort_by(f64::total_cmp);
                let covered = 100.0 * ratios.partition_point(|ratio| *ratio <= 1.0) as f64 / ratios.len() as f64;
                if ratios.is_empty() {
                    return "no ±".to_owned();
                }
                let mean = known.iter().map(|[_, stated]| stated).sum::<f64>() / known.len() as f64;
                format!("{covered:.0} %, {mean:.2}°, {:.2}", ratios[ratios.len() / 2])
            };
            let [w1, w2] = rpm;
            println!("| {} | ({w1}, {w2}) | {} | {} | {} |", case.name, cell(0), cell(1), cell(2));
        }
    }
}
