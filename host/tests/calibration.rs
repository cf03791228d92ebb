//! Checks that calibrations recover hidden parameters within the stated intervals, on the model alone with the noise of
//! a sensor.
//!
//! A few fits run with the other tests. To run a hundred:
//!
//! ```text
//! cargo test --release -p host --test all calibration -- --ignored --nocapture
//! ```

use biflag_log::schema::biflag::{self, event::Kind};
use biflag_log::{BoardMeta, End, FORMAT, Summary, TrialMeta};
use host::trial::{Collector, Data, Records, Want};
use host::twin::calibrate::{Calibration, Estimate, FitTrial, Parameter, Request, calibrate};
use nalgebra::UnitQuaternion;
use sim::body::closure::Closure;
use sim::params::{Glycerol, Robot};
use sim::profile::{Phases, SpeedProfile};
use sim::trial::{Options, Trial};
use std::f64::consts::TAU;

/// During the calibration phase the flagella sag to their equilibrium.
const PHASES: Phases = Phases { calibrate: 40.0, preroll: 20.0, run: 40.0, decay: 15.0, ramp: 0.25, reverse: None };
const SPEEDS: [[f64; 2]; 3] = [[50.0, 10.0], [-90.0, 90.0], [0.0, 45.0]];

/// A linear congruential generator (Knuth's MMIX): the same draws on every machine.
struct Draw(u64);

impl Draw {
    fn within(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Returns a normal deviate of mean 0 and variance 1: a sum of twelve uniform ones.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.within(-0.5, 0.5)).sum()
    }
}

/// The parameters that a fit must recover.
struct Hidden {
    robot: Robot,
    mount_yaw_deg: f64,
    mount_tilt_deg: [f64; 2],
}

impl Hidden {
    /// Draws each parameter up to 20 % from the published one.
    fn draw(draw: &mut Draw) -> Self {
        let mut robot = Robot::published();
        robot.joint.tether_full_nm_per_rad *= draw.within(0.8, 1.2);
        robot.base.mass_centre_below_joint_m *= draw.within(0.8, 1.2);
        robot.base.rotational_drag *= draw.within(0.8, 1.2);
        robot.fluid.viscosity_pa_s *= draw.within(0.8, 1.2);
        let mount_tilt_deg = [draw.within(-2.0, 2.0), draw.within(-2.0, 2.0)];
        Self { robot, mount_yaw_deg: draw.within(-5.0, 5.0), mount_tilt_deg }
    }

    fn value(&self, estimate: &Estimate) -> f64 {
        match estimate.name {
            "tether" => self.robot.joint.tether_full_nm_per_rad,
            "righting" => self.robot.base.mass_centre_below_joint_m,
            "drag" => self.robot.base.rotational_drag,
            "viscosity" => self.robot.fluid.viscosity_pa_s,
            "mount-yaw" => self.mount_yaw_deg,
            other => panic!("{other} is not hidden"),
        }
    }

    /// Simulates a trial as measured by a board at 100 Hz. The gyroscope's bias after calibration, its walk and the
    /// random walk of the angle are those of an MPU6050; the noise of the tilts has a correlation time of a second,
    /// like the filter's.
    fn trial(&self, speeds: [f64; 2], draw: &mut Draw) -> Data {
        let profile = SpeedProfile::phases(&PHASES, speeds).unwrap();
        let rate_hz = 100.0;
        let step: f64 = 1.0 / rate_hz;
        let options = Options { rate_hz, shapes: false };
        let deg = |deg: f64| deg.to_radians();
        let mount = UnitQuaternion::from_euler_angles(0.0, 0.0, deg(self.mount_yaw_deg));
        let (mut yaw, mut bias, mut tilt) = (draw.within(-180.0, 180.0), draw.within(-0.05, 0.05), [0.0; 2]);
        let noise = draw.within(0.03, 0.1);
        let mut collector = Collector::new(Want::default(), FORMAT);
        for (time_s, phase) in [(0.0, "preroll"), (20.0, "run"), (60.0, "decay"), (75.0, "end")] {
            collector.event(time_s, Kind::Phase, phase);
        }
        for sample in Trial::new(&self.robot, Closure::Full, profile, options).unwrap() {
            let sample = sample.unwrap();
            let time_s = sample.time_s - PHASES.calibrate;
            if time_s < 0.0 {
                continue;
            }
            bias += 2e-4 * step.sqrt() * draw.normal();
            yaw += bias * step + 0.005 * step.sqrt() * draw.normal();
            for tilt in &mut tilt {
                *tilt += -*tilt * step + noise * (2.0 * step).sqrt() * draw.normal();
            }
            let [w, x, y, z] = sample.attitude;
            let truth = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
            let [pitch, roll] = [0, 1].map(|k| deg(tilt[k] + self.mount_tilt_deg[k]));
            let seen = UnitQuaternion::from_euler_angles(0.0, 0.0, deg(yaw))
                * truth
                * mount
                * UnitQuaternion::from_euler_angles(roll, pitch, 0.0);
            let q15 = |part: f64| (part * 32768.0).round() / 32768.0;
            let attitude = [seen.w, seen.i, seen.j, seen.k].map(q15);
            let [w, x, y, z] = attitude;
            let [motor1, motor2] = sample.motor_angle_rad.map(|angle| {
                Some(biflag::Motor { turns: (angle / TAU * 1204.44).round() / 1204.44, ..biflag::Motor::default() })
            });
            collector.telemetry(&biflag::Telemetry {
                time_s,
                attitude: Some(biflag::Quaternion { w, x, y, z }),
                temperature_c: 20.0,
                imu_fresh: true,
                motor1,
                motor2,
                ..biflag::Telemetry::default()
            });
        }
        let [w1_rpm, w2_rpm] = speeds;
        let trial = TrialMeta { w1_rpm, w2_rpm, calibrate_s: PHASES.calibrate, ..TrialMeta::default() };
        let summary = Some(Summary { end: End::Complete, ..Summary::default() });
        let records = Records { trial: Some(trial), summary, ..Records::default() };
        collector.finish(format!("{speeds:?}").as_ref(), records)
    }
}

fn fit(seed: u64, speeds: &[[f64; 2]]) -> (Hidden, Calibration) {
    let mut draw = Draw(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    draw.normal();
    let hidden = Hidden::draw(&mut draw);
    let trials: Vec<_> = speeds.iter().map(|speeds| hidden.trial(*speeds, &mut draw)).collect();
    let request = Request { robot: None, closure: None, parameters: Vec::new(), jobs: 2 };
    let trials = trials.iter().map(|trial| FitTrial::new(trial).unwrap()).collect();
    (hidden, calibrate(trials, &request, &|| true).unwrap())
}

/// Number of intervals that contain the truth, for each parameter and for all at once.
#[derive(Default)]
struct Coverage {
    fits: usize,
    each: Vec<(&'static str, usize, f64, f64)>,
    all: usize,
}

impl Coverage {
    fn add(&mut self, hidden: &Hidden, calibration: &Calibration) {
        self.fits += 1;
        let mut all = true;
        for (i, estimate) in calibration.parameters.iter().enumerate() {
            let truth = hidden.value(estimate);
            let [low, high] = estimate.interval_95;
            let held = (low..=high).contains(&truth);
            all &= held;
            if self.each.len() <= i {
                self.each.push((estimate.name, 0, 0.0, 0.0));
            }
            let (_, count, errors, stated) = &mut self.each[i];
            *count += usize::from(held);
            *errors += (estimate.value - truth).powi(2);
            *stated += estimate.std_error.powi(2);
        }
        self.all += usize::from(all);
    }

    fn print(&self) {
        for (name, held, errors, stated) in &self.each {
            let rms = |sum: f64| (sum / self.fits as f64).sqrt();
            let (errors, stated) = (rms(*errors), rms(*stated));
            println!("{name}: {held} of {} within 95 %; errors {errors:.3e} RMS, stated {stated:.3e}", self.fits);
        }
        println!("all at once: {} of {}", self.all, self.fits);
    }
}

#[test]
fn calibration_recovers_hidden_robots() {
    let (hidden, calibration) = fit(1, &SPEEDS[..2]);
    for estimate in &calibration.parameters {
        println!(
            "{} {:.4e} (truth {:.4e}) {:.1e}",
            estimate.name,
            estimate.value,
            hidden.value(estimate),
            estimate.std_error
        );
        // The coverage needs a hundred fits to measure, but an estimate far from the truth shows that the fit is wrong.
        assert!((estimate.value - hidden.value(estimate)).abs() < 4.0 * estimate.std_error, "{estimate:?}");
    }
    println!(
        "{:?} {:?}, {} simulations",
        calibration.condition_number, calibration.cannot_tell, calibration.simulations
    );
    println!("{:.4} deg before, {:.4} deg after", calibration.rmse_before_deg, calibration.rmse_after_deg);
    assert!(calibration.rmse_after_deg < 0.1 * calibration.rmse_before_deg);
}

#[test]
fn viscosity_of_a_mixture_starts_from_the_logged_temperature() {
    let (seen, at) = (20.0, |temperature_c| Glycerol { mass_fraction: 0.99, temperature_c });
    let mut robot = Robot::published();
    robot.fluid.glycerol = Some(at(5.0));
    let mut draw = Draw(3);
    let trial =
        Hidden { robot: Robot::published(), mount_yaw_deg: 0.0, mount_tilt_deg: [0.0; 2] }.trial(SPEEDS[0], &mut draw);
    assert_eq!(trial.temperature_c, seen);
    let request = Request { robot: Some(robot), closure: None, parameters: vec![Parameter::Viscosity], jobs: 1 };
    let calibration = calibrate(vec![FitTrial::new(&trial).unwrap()], &request, &|| true).unwrap();
    let [viscosity] = calibration.parameters.as_slice() else { panic!("{calibration:?}") };
    assert_eq!(viscosity.start, at(seen).viscosity_pa_s());
    assert!(calibration.warnings.iter().any(|text| text.contains("99.0 % glycerol at the sensor's 20.0 °C")));
    assert!(calibration.robot.fluid.glycerol.is_none(), "the fitted value replaces the mixture");
    assert!((viscosity.value - 1.0).abs() < 0.05, "{viscosity:?}");
}

/// A fit from a start that is too far is refused at its limit, or says that it did not move or tells nothing: a sensor with
/// the errors of the data sheet cannot tell such a start from another.
#[test]
fn a_start_that_is_too_far_is_reported() {
    let mut draw = Draw(3);
    let hidden = Hidden { robot: Robot::published(), mount_yaw_deg: 0.0, mount_tilt_deg: [0.0; 2] };
    let trial = hidden.trial(SPEEDS[0], &mut draw);
    let fit = |robot: &Robot, parameter| {
        let robot = Some(robot.clone());
        let request = Request { robot, closure: None, parameters: vec![parameter], jobs: 2 };
        calibrate(vec![FitTrial::new(&trial).unwrap()], &request, &|| true)
    };
    let mut robot = Robot::published();
    robot.fluid.viscosity_pa_s *= 15.0;
    let fitted = fit(&robot, Parameter::Viscosity).unwrap();
    let stayed = fitted.warnings.iter().any(|text| text.contains("did not leave its start"));
    assert!(stayed || fitted.cannot_tell.iter().any(|text| text.starts_with("viscosity")), "{fitted:?}");
    // Fifteen times the tether would balance it.
    match fit(&robot, Parameter::Tether) {
        Err(error) => {
            assert!(error.to_string().contains("tether would change by more than a factor of ten"), "{error}")
        }
        Ok(fitted) => assert!(fitted.cannot_tell.iter().any(|text| text.starts_with("tether")), "{fitted:?}"),
    }
}

/// The sensor may be mounted at any angle about the vertical.
#[test]
fn a_sensor_that_looks_backwards_is_found() {
    let mut draw = Draw(5);
    let hidden = Hidden { robot: Robot::published(), mount_yaw_deg: 175.0, mount_tilt_deg: [0.0; 2] };
    let trials: Vec<_> = SPEEDS.iter().map(|speeds| hidden.trial(*speeds, &mut draw)).collect();
    let trials = trials.iter().map(|trial| FitTrial::new(trial).unwrap()).collect();
    let robot = Some(Robot::published());
    let request = Request { robot, closure: None, parameters: vec![Parameter::MountYaw], jobs: 2 };
    let calibration = calibrate(trials, &request, &|| true).unwrap();
    let [mount] = calibration.parameters.as_slice() else { panic!("{calibration:?}") };
    assert!((mount.value - 175.0).abs() < 3.0 || (mount.value + 185.0).abs() < 3.0, "{mount:?}");
}

/// A phase is an angle, so the fit has to find it from anywhere.
#[test]
fn calibration_finds_the_phases_of_the_flagella() {
    for (phase_deg, speeds) in [([70.0, -130.0], vec![[60.0, 60.0], [90.0, 0.0]]), ([-100.0, 50.0], vec![[0.0, 90.0]])]
    {
        let mut draw = Draw(7);
        let mut robot = Robot::published();
        robot.flagellum.phase_deg = phase_deg;
        let hidden = Hidden { robot, mount_yaw_deg: 0.0, mount_tilt_deg: [0.0; 2] };
        let trials: Vec<_> = speeds.iter().map(|speeds| hidden.trial(*speeds, &mut draw)).collect();
        let trials = trials.iter().map(|trial| FitTrial::new(trial).unwrap()).collect();
        let start = Some(Robot::published());
        let request = Request { robot: start, closure: None, parameters: vec![Parameter::Phase], jobs: 2 };
        let calibration = calibrate(trials, &request, &|| true).unwrap();
        assert_eq!(
            calibration.parameters.iter().map(|estimate| estimate.name).collect::<Vec<_>>(),
            ["phase", "phase-both"]
        );
        for estimate in &calibration.parameters {
            let [one, two] = phase_deg;
            let truth = if estimate.name == "phase" { two - one } else { one };
            let turns = ((estimate.value - truth) / 360.0).round();
            let error = estimate.value - truth - 360.0 * turns;
            let (value, std_error, [low, high]) = (estimate.value, estimate.std_error, estimate.interval_95);
            println!(
                "{speeds:?} {}: {value:.1} deg (truth {truth}), standard error {std_error:.1}, 95 % {low:.1} to {high:.1}, \
                 {} simulations",
                estimate.name, calibration.simulations
            );
            assert!(error.abs() < 4.0 * std_error && std_error < 20.0, "{estimate:?}");
            assert!((-180.0..=180.0).contains(&value) && low < value && value < high);
        }
        let found = calibration.robot.flagellum.phase_deg;
        assert!(
            found
                .iter()
                .zip(phase_deg)
                .all(|(found, truth)| (found - truth).abs() < 15.0 || (found - truth).abs() > 345.0),
            "{found:?}"
        );
        assert!(calibration.rmse_after_deg < 0.5 * calibration.rmse_before_deg, "{calibration:?}");
    }
}

#[test]
fn a_phase_that_does_not_matter_or_is_not_one_is_refused() {
    let mut draw = Draw(8);
    let hidden = Hidden { robot: Robot::published(), mount_yaw_deg: 0.0, mount_tilt_deg: [0.0; 2] };
    let board = |boot_count| Some(BoardMeta { board_id: 1, boot_count, ..BoardMeta::default() });
    let mut trials = [[50.0, 10.0], [90.0, 0.0], [90.0, 0.0]].map(|speeds| hidden.trial(speeds, &mut draw));
    trials[1].records.board = board(4);
    trials[2].records.board = board(5);
    for (range, reason) in [(0..1, "does not matter at the speeds"), (1..3, "come from 2 starts of the board")] {
        let trials = trials[range].iter().map(|trial| FitTrial::new(trial).unwrap()).collect();
        let start = Some(Robot::published());
        let request = Request { robot: start, closure: None, parameters: vec![Parameter::Phase], jobs: 1 };
        let error = calibrate(trials, &request, &|| true).unwrap_err().to_string();
        assert!(error.contains(reason), "{error}");
    }
}

#[test]
#[ignore = "a hundred fits take half an hour on two cores"]
fn intervals_contain_the_truth_in_a_hundred_fits() {
    let mut coverage = Coverage::default();
    for seed in 1..=100 {
        let (hidden, calibration) = fit(seed, &SPEEDS);
        coverage.add(&hidden, &calibration);
        println!("{seed} fits:");
        coverage.print();
    }
    for (name, held, ..) in &coverage.each {
        assert!(*held >= 90, "{name}: {held}");
    }
}
