//! Checks that calibrations recover hidden parameters within the stated intervals, on the model alone with the noise of
//! a sensor.
//!
//! A few fits run with the other tests. To run the others, and a hundred:
//!
//! ```text
//! cargo test --release -p host --test all calibration -- --ignored --nocapture
//! ```

mod hidden;

use biflag_log::{BoardMeta, Condition, Identity, MeasuredSensorMeta, ModelMeta, Origin};
use hidden::{Draw, Hidden, Part};
use host::import::{Conditions, Table, write};
use host::plan::{RobotFile, board};
use host::sensor::{AXES, Estimate, MeasuredSensor};
use host::trial::{Data, Judged, Want};
use host::twin::calibrate::{Calibration, FitTrial, Parameter, Request, calibrate};
use host::twin::{OnMismatch, TwinError, compare};
use protocol::units::CentiRpm;
use protocol::{Info, Settings, SpeedFrom};
use sim::params::{Glycerol, Robot, Tank};
use sim::steady::phase::Ratio;
use sim::trial::sample::Sample;

const SPEEDS: [[f64; 2]; 3] = [[50.0, 10.0], [-90.0, 90.0], [0.0, 45.0]];

fn fit(seed: u64, speeds: &[[f64; 2]]) -> (Hidden, Calibration) {
    let mut draw = Draw(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    draw.normal();
    let hidden = Hidden::draw(&mut draw);
    let trials: Vec<_> = speeds.iter().map(|speeds| hidden.trial(*speeds, &mut draw)).collect();
    (hidden, fitted(&Robot::published(), &[], &trials).unwrap())
}

/// Fits parameters to trials from a robot on.
fn fitted(start: &Robot, parameters: &[Parameter], trials: &[Data]) -> Result<Calibration, TwinError> {
    let request = Request { robot: Some(start.clone()), closure: None, parameters: parameters.to_vec(), jobs: 2 };
    calibrate(trials.iter().map(|trial| FitTrial::new(trial.clone()).unwrap()).collect(), &request, &|| true)
}

/// Number of intervals that contain the truth, for each parameter and for all at once.
#[derive(Default)]
struct Coverage {
    fits: usize,
    each: Vec<(String, usize, f64, f64)>,
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
                self.each.push((estimate.name.clone(), 0, 0.0, 0.0));
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
#[ignore = "the command does so with two parameters (`twin`): part of `make proof`"]
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
fn typical_sensor_is_in_the_intervals_and_a_copy_is_no_evidence() {
    let mut draw = Draw(11);
    let (mut robot, part) = (Robot::published(), Part::typical(&mut draw));
    robot.fluid.viscosity_pa_s = 0.9137;
    robot.joint.tether_full_nm_per_rad *= 1.0713;
    let truths = [robot.fluid.viscosity_pa_s, robot.joint.tether_full_nm_per_rad];
    let hidden = Hidden { robot, part, ..Hidden::default() };
    let trials = [[50.3, 10.7], [-71.9, 83.6]].map(|speeds| hidden.trial(speeds, &mut draw));
    let fit =
        |trials: &[Data]| fitted(&Robot::published(), &[Parameter::Viscosity, Parameter::Tether], trials).unwrap();
    let two = fit(&trials);
    for (estimate, truth) in two.parameters.iter().zip(truths) {
        let [low, high] = estimate.interval_95;
        println!("{} {:.4e} (truth {truth:.4e}), {low:.4e} to {high:.4e}", estimate.name, estimate.value);
        assert!((low..=high).contains(&truth), "{estimate:?}");
    }
    assert!(two.misfits.is_empty() && two.cannot_tell.is_empty() && two.warnings.is_empty(), "{two:?}");
    let mut cut_off = hidden.trial([37.3, -61.9], &mut draw);
    cut_off.condition = Condition::CutOff;
    let [one, other] = &trials;
    let more = fit(&[cut_off.clone(), one.clone(), other.clone(), one.clone(), other.clone()]);
    assert_eq!(more.parameters, two.parameters);
    assert_eq!(more.warnings.iter().filter(|text| text.contains("the same recording")).count(), 2, "{more:?}");
    assert!(more.warnings.iter().any(|text| text == "1 trial with grave findings left out of the fit"), "{more:?}");
    assert_eq!(more.warnings.len(), 3, "{more:?}");
    let none = fitted(&Robot::published(), &[], &[cut_off]).unwrap_err().to_string();
    assert!(none.contains("no trial is sound") && none.contains("the log is cut off"), "{none}");
}

/// A sensor has the same errors in all of its trials, and more trials do not average them; other boards have others.
#[test]
#[ignore = "three fits, ten seconds: part of `make proof`"]
fn errors_of_a_sensor_are_common_to_its_trials() {
    let mut draw = Draw(13);
    let hidden = Hidden { part: Part::typical(&mut draw), ..Hidden::default() };
    let speeds = [61.3, -18.7];
    let motion = hidden.motion(speeds);
    let mut trials: Vec<Data> = (0..4).map(|_| hidden.measured(speeds, &motion, &mut draw)).collect();
    let fit = |trials: &[Data]| {
        let calibration = fitted(&Robot::published(), &[Parameter::Righting], trials).unwrap();
        calibration.parameters[0].std_error / calibration.parameters[0].value
    };
    let [one, four] = [1, 4].map(|count| fit(&trials[..count]));
    for (i, trial) in trials.iter_mut().enumerate() {
        trial.records.board = Some(BoardMeta { board_id: 1 + i as u16, ..BoardMeta::default() });
    }
    let boards = fit(&trials);
    println!("righting, relative standard error: 1 trial {one:.4}, 4 trials {four:.4}, of 4 boards {boards:.4}");
    assert!(four > 0.7 * one, "the sensor's errors remain");
    assert!(boards < 0.65 * one, "those of four boards are averaged, and the solver's remains");
    let mounted = [Parameter::Viscosity, Parameter::MountYaw];
    let error = fitted(&Robot::published(), &mounted, &trials).unwrap_err().to_string();
    assert!(error.contains("mount-yaw is the mounting of one sensor, and the trials are of 4 boards"), "{error}");
}

/// A robot in a tank, fitted by one in an unbounded fluid: whatever tether and viscosity are, neither yaws nor tilts fit.
#[test]
fn wrong_model_is_named() {
    let mut draw = Draw(12);
    let part = Part::typical(&mut draw);
    let robot = Robot { tank: Some(Tank::published()), ..Robot::default() };
    let hidden = Hidden { robot, part, ..Hidden::default() };
    let trials = [[50.3, 10.7], [-71.9, 83.6]].map(|speeds| hidden.trial(speeds, &mut draw));
    let fit = |start: &Robot| fitted(start, &[Parameter::Viscosity, Parameter::Tether], &trials).unwrap();
    let wrong = fit(&Robot::default());
    println!("{:#?}", wrong.misfits);
    assert!(wrong.misfits.iter().any(|text| text.contains("residual of the yaw")), "{wrong:?}");
    // The fit takes what is wrong for an error of the sensor that no part has.
    assert!(wrong.misfits.iter().any(|text| text.contains("takes an error of the sensor")), "{wrong:?}");
    assert!(wrong.misfits.last().unwrap().contains("the model does not describe these trials"), "{wrong:?}");
    assert!(!wrong.fit().is_described);
}

/// Returns the file of a sensor for which all measured errors are exactly zero.
fn exact_sensor() -> String {
    let mut file = MeasuredSensor::new(&Settings::DEFAULT);
    for i in AXES {
        ["gyro_scale", "accel_scale", "mounting_deg"].iter().for_each(|table| file.set(table, i, Estimate::default()));
        for j in AXES {
            file.set("gyro_g_dps", &format!("{i}{j}"), Estimate::default());
            for table in ["gyro_cross", "accel_cross"].iter().filter(|_| i != j) {
                file.set(table, &format!("{i}{j}"), Estimate::default());
            }
        }
    }
    file.to_toml()
}

/// Lines miss more of the swirl of a thick rod than of a thin one: verdicts and intervals of a trial of a real robot have the
/// error of its own rods.
#[test]
#[ignore = "ten seconds: part of `make proof`"]
fn error_of_the_model_is_that_of_the_robots_rods() {
    let [thin, thick] = [0.0021, 0.0043].map(|rod_radius_m| {
        let mut robot = Robot { tank: Some(Tank::published()), ..Robot::default() };
        robot.flagellum.rod_radius_m = rod_radius_m;
        let mut draw = Draw(14);
        let hidden = Hidden { robot: robot.clone(), ..Hidden::default() };
        let mut measured = hidden.trial([50.3, 10.7], &mut draw);
        let text = exact_sensor();
        measured.records.measured_sensor = Some(MeasuredSensorMeta { name: "sensor.toml".to_owned(), text });
        let mut modelled = measured.clone();
        measured.records.model = None;
        // A model that moves as the robot does.
        let angles_deg = Judged::of(measured.clone()).angles.angles_deg;
        for (i, time_s) in angles_deg.time_s.iter().enumerate() {
            let truth = std::array::from_fn(|k| angles_deg.values.get(k).map_or(0.0, |angle| angle[i]));
            modelled.truth.push(*time_s, truth);
        }
        let parameters = toml::to_string(&robot).unwrap();
        modelled.records.model = Some(ModelMeta { parameters, ..ModelMeta::default() });
        modelled.records.identity = Some(Identity { origin: Origin::Model, ..Identity::default() });
        let compared =
            compare(&Judged::of(measured.clone()), &Judged::of(modelled), OnMismatch::Accept).unwrap().comparison;
        let [_, pitch, roll] = &compared.angles;
        let of_compare = pitch.model_error_deg.unwrap() / pitch.modelled_deg.hypot(roll.modelled_deg);
        let fit = fitted(&robot, &[Parameter::Righting], &[measured]).unwrap();
        let righting = &fit.parameters[0];
        let of_fit = righting.model_error.unwrap() / righting.value;
        println!("rod radius {rod_radius_m} m: tilt of compare {of_compare:.3}, righting of calibrate {of_fit:.3}");
        [of_compare, of_fit]
    });
    // The error of the tilt more than doubles. How much of it righting takes up depends on how the robot's tilt answers to it.
    assert!(thin[0] > 0.1 && thick[0] > 0.27 && thick[0] > 2.0 * thin[0], "compare: {thin:?} {thick:?}");
    assert!(thin[1] > 0.05 && thick[1] > 1.4 * thin[1], "calibrate: {thin:?} {thick:?}");
}

#[test]
fn each_trial_has_the_viscosity_of_its_temperature() {
    let at = |temperature_c| Glycerol { mass_fraction: 0.99, temperature_c };
    let trial = |temperature_c, speeds, draw: &mut Draw| {
        let mut robot = Robot::published();
        // What is measured is a little thinner than the mixture.
        robot.fluid.viscosity_pa_s = 0.96 * at(temperature_c).viscosity_pa_s();
        Hidden { robot, temperature_c, ..Hidden::default() }.trial(speeds, draw)
    };
    let mut draw = Draw(3);
    let trials = [trial(19.3, SPEEDS[0], &mut draw), trial(24.7, SPEEDS[2], &mut draw)];
    assert!((trials[1].temperature_c - 24.7).abs() < 1e-6);
    let mut robot = Robot::published();
    robot.fluid.glycerol = Some(at(5.0));
    let calibration = fitted(&robot, &[Parameter::Viscosity], &trials).unwrap();
    let [viscosity] = calibration.parameters.as_slice() else { panic!("{calibration:?}") };
    assert!((viscosity.start / at(22.0).viscosity_pa_s() - 1.0).abs() < 1e-6);
    let text = calibration.notes.join("\n");
    assert!(text.contains("99.0 % glycerol at 22.0 °C") && text.contains("19.3 °C to 24.7 °C"), "{text}");
    assert!(calibration.warnings.is_empty(), "{calibration:?}");
    assert!(calibration.robot.fluid.glycerol.is_none(), "the fitted value replaces the mixture");
    println!("{:.4} of the mixture, standard error {:.4}", viscosity.value / viscosity.start, viscosity.std_error);
    assert!((viscosity.value / viscosity.start - 0.96).abs() < 0.02, "{viscosity:?}");
    assert!(calibration.misfits.is_empty(), "{calibration:?}");
}

/// A fit from a start that is too far is refused at its limit, or says that it did not move, tells nothing, or does not
/// describe the trial.
#[test]
#[ignore = "a quarter of a minute: part of `make proof`"]
fn a_start_that_is_too_far_is_reported() {
    let mut draw = Draw(3);
    let hidden = Hidden::default();
    let trial = hidden.trial(SPEEDS[0], &mut draw);
    let fit = |robot: &Robot, parameter| fitted(robot, &[parameter], std::slice::from_ref(&trial));
    let mut robot = Robot::published();
    robot.fluid.viscosity_pa_s *= 15.0;
    let fitted = fit(&robot, Parameter::Viscosity).unwrap();
    assert!(!fitted.is_sound(), "{fitted:?}");
    // Fifteen times the tether would balance it.
    match fit(&robot, Parameter::Tether) {
        Err(error) => {
            assert!(error.to_string().contains("tether would change by more than a factor of ten"), "{error}")
        }
        Ok(fitted) => assert!(fitted.misfits.iter().any(|text| text.contains("residual of the yaw")), "{fitted:?}"),
    }
}

/// The sensor may be mounted at any angle about the vertical.
#[test]
#[ignore = "ten seconds: part of `make proof`"]
fn a_sensor_that_looks_backwards_is_found() {
    let mut draw = Draw(5);
    let hidden = Hidden { mount_yaw_deg: 175.0, ..Hidden::default() };
    let trials = [hidden.trial(SPEEDS[1], &mut draw)];
    let calibration = fitted(&Robot::published(), &[Parameter::MountYaw], &trials).unwrap();
    let [mount] = calibration.parameters.as_slice() else { panic!("{calibration:?}") };
    assert!((mount.value - 175.0).abs() < 3.0 || (mount.value + 185.0).abs() < 3.0, "{mount:?}");
}

/// A phase is an angle, so the fit has to find it from anywhere.
#[test]
#[ignore = "the command does so from one angle (`twin`): part of `make proof`"]
fn calibration_finds_the_phases_of_the_flagella() {
    find_phases([-100.0, 50.0], &[[0.0, 90.0]]);
}

#[test]
#[ignore = "half a minute: part of `make proof`"]
fn calibration_finds_the_phases_in_two_trials() {
    find_phases([70.0, -130.0], &[[60.0, 60.0], [90.0, 0.0]]);
}

fn find_phases(phase_deg: [f64; 2], speeds: &[[f64; 2]]) {
    let mut draw = Draw(7);
    let mut robot = Robot::published();
    robot.flagellum.phase_deg = phase_deg;
    let hidden = Hidden { robot, ..Hidden::default() };
    let trials: Vec<_> = speeds.iter().map(|speeds| hidden.trial(*speeds, &mut draw)).collect();
    let calibration = fitted(&Robot::published(), &[Parameter::Phase], &trials).unwrap();
    assert_eq!(
        calibration.parameters.iter().map(|estimate| estimate.name.as_str()).collect::<Vec<_>>(),
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
        found.iter().zip(phase_deg).all(|(found, truth)| (found - truth).abs() < 15.0 || (found - truth).abs() > 345.0),
        "{found:?}"
    );
    assert!(calibration.rmse_after_deg < 0.5 * calibration.rmse_before_deg, "{calibration:?}");
}

/// Returns a trial as a board without encoders records it, which only knows the commanded speeds.
fn without_encoders(mut trial: Data, commanded_rpm: [f64; 2]) -> Data {
    let settings = Settings { speed_from: SpeedFrom::Duty, ..Settings::DEFAULT };
    trial.records.board = Some(board::to_log(&Info::default(), &settings));
    let meta = trial.records.trial.as_mut().unwrap();
    [meta.w1_rpm, meta.w2_rpm] = commanded_rpm;
    let run = trial.times.run.clone();
    let [target1, w1, target2, w2, ..] = &mut trial.motors.values;
    for (rpm, of_motor) in commanded_rpm.into_iter().zip([[target1, w1], [target2, w2]]) {
        for column in of_motor {
            let each = column.iter_mut().zip(&trial.motors.time_s);
            each.for_each(|(value, time_s)| *value = if run.contains(time_s) { rpm } else { 0.0 });
        }
    }
    trial
}

/// Returns a trial as a camera sees it, which does not know the turns of the motors.
fn imported(hidden: &Hidden, speeds: [f64; 2], draw: &mut Draw) -> Data {
    let motion = hidden.motion(speeds);
    let row = |sample: &Sample| {
        let angles = [sample.yaw_rad, sample.pitch_rad, sample.roll_rad];
        let [yaw, pitch, roll] = angles.map(|rad| rad.to_degrees() + 0.05 * draw.normal());
        format!("{},{yaw},{pitch},{roll}\n", sample.time_s - motion[0].time_s)
    };
    let table: String = motion.iter().step_by(4).map(row).collect();
    let folder = tempfile::tempdir().unwrap();
    let [csv, log] = ["a.csv", "a.mcap"].map(|name| folder.path().join(name));
    std::fs::write(&csv, table).unwrap();
    let columns = "time=#1,yaw=#2,pitch=#3,roll=#4".parse().unwrap();
    let conditions = Conditions {
        speeds: Some(speeds.map(CentiRpm::from_rpm)),
        run_s: Some(20.0..60.0),
        reverse: None,
        robot: RobotFile { name: "published".to_owned(), text: toml::to_string(&Robot::published()).unwrap() },
        uncertainty_deg: Some([0.3, 0.2]),
        temperature_c: None,
        note: String::new(),
    };
    write(&Table::read(&csv, 0).unwrap().states(&columns).unwrap(), &conditions, "a.csv", &log).unwrap();
    Judged::read(&log, Want::default()).unwrap().data
}

/// A robot whose flagella begin to turn at unknown angles; its tether and viscosity.
fn turned() -> (Hidden, [f64; 2]) {
    let mut robot = Robot::published();
    robot.flagellum.phase_deg = [70.0, -110.0];
    robot.joint.tether_full_nm_per_rad *= 1.0713;
    robot.fluid.viscosity_pa_s = 0.9137;
    let truths = [robot.joint.tether_full_nm_per_rad, robot.fluid.viscosity_pa_s];
    (Hidden { robot, ..Hidden::default() }, truths)
}

/// The swing of a model whose flagella stand otherwise is no evidence against its parameters.
#[test]
#[ignore = "five seconds: part of `make proof`"]
fn trials_of_a_camera_are_fitted_though_it_does_not_know_how_the_flagella_stood() {
    let mut draw = Draw(6);
    let (hidden, truths) = turned();
    let trials = [[47.3, -28.1], [-37.2, 61.9]].map(|speeds| imported(&hidden, speeds, &mut draw));
    let told = fitted(&Robot::published(), &[Parameter::Tether, Parameter::Viscosity], &trials).unwrap();
    for (estimate, truth) in told.parameters.iter().zip(truths) {
        let [low, high] = estimate.interval_95;
        println!("{} {:.4e} (truth {truth:.4e}), {low:.4e} to {high:.4e}", estimate.name, estimate.value);
        assert!((low..=high).contains(&truth) && (estimate.value / truth - 1.0).abs() < 0.03, "{estimate:?}");
    }
    assert!(told.misfits.is_empty(), "{told:?}");
}

/// The angles at which the flagella began to turn are not measured, and the commanded speeds are not those of the motors.
#[test]
fn trials_without_encoders_are_fitted_where_the_swing_tells_their_speeds() {
    let mut draw = Draw(5);
    let (hidden, truths) = turned();
    let trials = [([47.3, -28.1], [52.0, -26.0]), ([-37.2, 61.9], [-40.0, 58.0])].map(|(speeds, commanded)| {
        let trial = without_encoders(hidden.trial(speeds, &mut draw), commanded);
        // Speeds at 2:1 are commanded, and nothing keeps them.
        assert_eq!((trial.speeds(), trial.ratio()), (commanded.map(CentiRpm::from_rpm), None));
        trial
    });
    assert!(Ratio::of(trials[0].speeds().map(CentiRpm::rpm)).is_some());
    let fit = |parameters: &[Parameter]| fitted(&Robot::published(), parameters, &trials);
    let told = fit(&[Parameter::Tether, Parameter::Viscosity]).unwrap();
    for (estimate, truth) in told.parameters.iter().zip(truths) {
        let [low, high] = estimate.interval_95;
        println!("{} {:.4e} (truth {truth:.4e}), {low:.4e} to {high:.4e}", estimate.name, estimate.value);
        assert!((low..=high).contains(&truth) && high < 1.15 * low, "{estimate:?}");
    }
    assert!(told.misfits.is_empty() && told.cannot_tell.is_empty(), "{told:?}");
    assert!(told.warnings.iter().any(|text| text.contains("intervals may be too narrow")), "{told:?}");
    let error = fit(&[Parameter::Phase]).unwrap_err().to_string();
    assert!(error.contains("does not matter at the speeds"), "{error}");
}

#[test]
fn a_phase_that_does_not_matter_or_is_not_one_is_refused() {
    let mut draw = Draw(8);
    let hidden = Hidden::default();
    let board = |boot_count| Some(BoardMeta { board_id: 1, boot_count, ..BoardMeta::default() });
    let mut trials = [[50.0, 10.0], [90.0, 0.0], [90.0, 0.0]].map(|speeds| hidden.trial(speeds, &mut draw));
    trials[1].records.board = board(4);
    trials[2].records.board = board(5);
    for (range, reason) in [(0..1, "does not matter at the speeds"), (1..3, "come from 2 starts of the board")] {
        let error = fitted(&Robot::published(), &[Parameter::Phase], &trials[range]).unwrap_err().to_string();
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
