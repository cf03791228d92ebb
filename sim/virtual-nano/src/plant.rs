//! The simulated robot that the board is built into: the board's motors turn the simulator's flagella, and the sensor
//! sits on the simulator's base.
//!
//! The simulator takes steps longer than a tick, and a step needs the motors' speed at its end. So the plant runs ahead
//! of its motors in windows of [`WINDOW_S`]: at the end of a window, the motors' speeds over the next are extrapolated
//! from their speed and acceleration, and the sensor reads between the solver's steps. A proportional correction of the
//! angle keeps the simulator's flagella at the encoders' angles: for the modelled motors, with a time constant of 80
//! ms, within 2 degrees while they start and stop and within 0.001 degrees at a steady speed.

use crate::motor::Motor;
use crate::push::{Axis, Push};
use nalgebra::{UnitQuaternion, Vector3};
use sim::body::closure::Closure;
use sim::body::imu::specific_force;
use sim::body::shaft::MotorState;
use sim::params::Robot;
use sim::step::StepError;
use sim::trial::sample::Sample;
use sim::trial::{Options, Trial};
use std::collections::VecDeque;
use std::f64::consts::PI;

/// Windows a second.
const WINDOWS_HZ: f64 = 50.0;
/// How far the plant runs ahead of its motors, s.
pub const WINDOW_S: f64 = 1.0 / WINDOWS_HZ;

/// How far behind the present window the sensor may read, s: the delay of its slowest filter.
const REACH_S: f64 = 0.1;

/// Time that the robot has hung at rest when the board gets power, s: the flagella sag under their weight at first, and
/// the slowest motion of the robot dies away with a time constant of 10 s.
const REST_S: f64 = 150.0;

/// One sample in this many keeps the flagella's shapes.
const SHAPES_EVERY: u64 = 5;

/// Samples kept until they are taken: a minute's.
const QUEUE_LENGTH: usize = 60 * WINDOWS_HZ as usize;

/// Interval of the difference quotient for the angular acceleration, s.
const DIFFERENCE_S: f64 = 1e-3;

/// Share of a window's error in a motor's angle that the next window corrects. At 1 an extrapolation error is gone at
/// once, but the speed jumps; the simulator's formulas need a smooth speed.
const ANGLE_GAIN: f64 = 0.3;

/// Error of the angle, and motion in a window, below which a motor at rest stays at rest, rad.
const REST_RAD: f64 = 1e-5;

/// The temperature of the base: first order, from the room's to the warm motors'.
#[derive(Clone, Copy, Debug)]
struct BaseTemperature {
    room_c: f64,
    /// Its temperature above the room's.
    rise_c: f64,
}

/// Speed of both motors for which [`MOTOR_RISE_C`] is assumed, rad/s: 90 rpm.
const WARM_SPEED: f64 = 90.0 * PI / 30.0;
/// Assumed: final rise of the temperature at that speed.
const MOTOR_RISE_C: f64 = 2.0;
/// Assumed: time constant of the base in the fluid, s.
const WARMING_S: f64 = 300.0;

impl BaseTemperature {
    /// Advances by a window with the motors at these speeds, rad/s.
    fn advance(&mut self, speeds: [f64; 2]) {
        let share = speeds.iter().map(|speed| speed.abs()).sum::<f64>() / (2.0 * WARM_SPEED);
        self.rise_c += (MOTOR_RISE_C * share - self.rise_c) * (WINDOW_S / WARMING_S);
    }

    fn celsius(&self) -> f64 {
        self.room_c + self.rise_c
    }
}

/// Movement of the sensor in its own axes.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Movement {
    /// Rate of turn, °/s.
    pub rate_dps: [f64; 3],
    /// Acceleration less gravity, g: `[0, 0, 1]` at rest with z up.
    pub specific_force_g: [f64; 3],
    /// Temperature, °C.
    pub temperature_c: f64,
}

/// The simulated robot behind a board.
pub struct Plant {
    trial: Trial,
    /// Windows that have begun.
    windows: u64,
    /// Speeds of the board's motors at the beginning of the window before, rad/s.
    speeds_before: [f64; 2],
    temperature: BaseTemperature,
    pushes: Vec<Push>,
    /// The sensor in body axes, m.
    sensor: Vector3<f64>,
    gravity_m_s2: f64,
    samples: VecDeque<Sample>,
    /// Why the simulator failed, if it did. From then on the plant's movement is meaningless.
    pub failure: Option<String>,
}

impl Plant {
    /// Returns a robot that hangs at rest, with motors at rest.
    ///
    /// # Errors
    /// A parameter that is impossible, or a robot that the simulator cannot bring to rest.
    pub fn new(robot: &Robot, room_c: f64) -> Result<Self, String> {
        let options = Options { rate_hz: WINDOWS_HZ, shapes: true };
        let mut plant = Self {
            trial: Trial::open(robot, Closure::Full, options, WINDOW_S + REACH_S).map_err(|error| error.to_string())?,
            windows: 0,
            speeds_before: [0.0; 2],
            temperature: BaseTemperature { room_c, rise_c: 0.0 },
            pushes: Vec::new(),
            // On the central axis, in the bottom plane of the base.
            sensor: Vector3::new(0.0, 0.0, -robot.base.height_m),
            gravity_m_s2: robot.base.gravity_m_s2,
            samples: VecDeque::new(),
            failure: None,
        };
        plant.advance_to(0.0, [0.0; 2])?;
        plant.samples.clear();
        Ok(plant)
    }

    /// Reads the board's motors at a time (s). At the end of a window, the simulator advances by another.
    pub fn follow(&mut self, time_s: f64, motors: &[Motor; 2]) {
        while self.failure.is_none() && time_s >= self.end_s() {
            self.failure = self.advance_window(time_s, motors).err();
        }
    }

    /// Takes the samples since the last call, one at the end of each window, oldest first; at most those of a minute.
    pub fn take_samples(&mut self) -> Vec<Sample> {
        self.samples.drain(..).collect()
    }

    /// Turns the robot by an angle (rad) about its joint, from the end of the present window on.
    pub fn push(&mut self, axis: Axis, angle: f64) {
        let yaw = self.trial.state().body.yaw;
        self.pushes.push(Push::new(self.end_s(), axis.at(yaw) * angle));
    }

    /// Returns attitude and angular velocity (body axes, rad/s) at a time (s).
    fn attitude_and_rate(&self, time_s: f64) -> Option<(UnitQuaternion<f64>, Vector3<f64>)> {
        let simulated = self.trial.at(REST_S + time_s)?;
        let pushed = |part: fn(&Push, f64) -> Vector3<f64>| self.pushes.iter().map(|push| part(push, time_s)).sum();
        let attitude = UnitQuaternion::from_scaled_axis(pushed(Push::from_simulated)) * simulated.attitude;
        let rate = simulated.rate + attitude.inverse_transform_vector(&pushed(Push::rate));
        Some((attitude, rate))
    }

    /// Returns the sensor's movement at a time (s).
    pub fn movement(&self, time_s: f64) -> Movement {
        let temperature_c = self.temperature.celsius();
        let at = |time_s| self.attitude_and_rate(time_s);
        let Some(((attitude, rate), (_, rate_before))) = at(time_s).zip(at(time_s - DIFFERENCE_S)) else {
            return Movement { specific_force_g: [0.0, 0.0, 1.0], temperature_c, ..Movement::default() };
        };
        let angular_acceleration = (rate - rate_before) / DIFFERENCE_S;
        let gravity = attitude.inverse_transform_vector(&-Vector3::z()) * self.gravity_m_s2;
        let force = specific_force(self.sensor, rate, angular_acceleration, gravity);
        Movement {
            rate_dps: rate.map(f64::to_degrees).into(),
            specific_force_g: (force / self.gravity_m_s2).into(),
            temperature_c,
        }
    }

    fn end_s(&self) -> f64 {
        self.windows as f64 / WINDOWS_HZ
    }

    fn advance_window(&mut self, time_s: f64, motors: &[Motor; 2]) -> Result<(), String> {
        let begin_s = self.end_s();
        let modelled = self.motors(begin_s);
        let speeds = [0, 1].map(|k| {
            let speed = motors[k].speed_rad_s();
            let angle = motors[k].angle_rad() - speed * (time_s - begin_s);
            let before = std::mem::replace(&mut self.speeds_before[k], speed);
            extrapolate(MotorState { angle, speed }, before, modelled[k])
        });
        self.windows += 1;
        self.advance_to(self.end_s(), speeds)?;
        self.temperature.advance(speeds);
        Ok(())
    }

    /// Advances the simulator to a time (s), with speeds of the flagella that change linearly to these (rad/s).
    fn advance_to(&mut self, time_s: f64, speeds: [f64; 2]) -> Result<(), String> {
        self.pushes.iter_mut().for_each(|push| self.trial.turn(push.advance_to(time_s)));
        self.trial.extend(REST_S + time_s, speeds).map_err(|error| error.to_string())?;
        while let Some(sample) = self.trial.next() {
            let by_board = |error: StepError| StepError { time: error.time - REST_S, ..error }.to_string();
            let mut sample = sample.map_err(by_board)?;
            sample.time_s -= REST_S;
            if let Some((_, rate)) = self.attitude_and_rate(sample.time_s).filter(|_| !self.pushes.is_empty()) {
                sample.rate_rad_s = rate.into();
            }
            if !self.windows.is_multiple_of(SHAPES_EVERY) {
                sample.shapes_m = None;
            }
            if self.samples.len() == QUEUE_LENGTH {
                self.samples.pop_front();
            }
            self.samples.push_back(sample);
        }
        Ok(())
    }

    /// Returns the simulator's motors at a time (s).
    fn motors(&self, time_s: f64) -> [MotorState; 2] {
        self.trial.motors(REST_S + time_s)
    }
}

/// Returns the speed of the simulator's motor at the end of the next window, rad/s. `real`: the board's motor, `before`: its
/// speed a window ago, rad/s; `modelled`: the simulator's motor.
fn extrapolate(real: MotorState, before: f64, modelled: MotorState) -> f64 {
    let change = real.speed - before;
    let ahead = real.speed + change;
    // A motor that stops does not turn back.
    let ahead = if ahead * real.speed <= 0.0 { 0.0 } else { ahead };
    let real_angle = real.angle + 0.5 * (real.speed + ahead) * WINDOW_S;
    let error = real_angle - modelled.angle - 0.5 * (modelled.speed + ahead) * WINDOW_S;
    if ahead == 0.0 && error.abs() < REST_RAD && modelled.speed.abs() * WINDOW_S < REST_RAD {
        return 0.0;
    }
    ahead + ANGLE_GAIN * error / WINDOW_S
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bridge::Drive;
    use crate::motor::{MotorParameters, STEP_S};

    fn run(
        plant: &mut Plant,
        motors: &mut [Motor; 2],
        from_s: f64,
        length_s: f64,
        mut see: impl FnMut(&Plant, &[Motor; 2], f64),
    ) {
        for i in 1..=(length_s / STEP_S).round() as u64 {
            for motor in motors.iter_mut() {
                motor.advance(STEP_S);
            }
            let time_s = from_s + i as f64 * STEP_S;
            plant.follow(time_s, motors);
            see(plant, motors, time_s);
        }
    }

    #[test]
    fn the_flagella_are_where_the_encoders_say() {
        let mut robot = Robot::published();
        robot.flagellum.phase_deg = [30.0, -70.0];
        let mut plant = Plant::new(&robot, 20.0).unwrap();
        let mut motors = [0, 1].map(|_| Motor::new(MotorParameters::PUBLISHED));
        let error = |plant: &Plant, motors: &[Motor; 2], time_s: f64| {
            let modelled = plant.motors(time_s);
            (0..2).map(|k| (modelled[k].angle - motors[k].angle_rad()).abs().to_degrees()).fold(0.0, f64::max)
        };
        let (mut worst, mut steady): (f64, f64) = (0.0, 0.0);
        motors[0].drive = Drive::Voltage(0.7);
        motors[1].drive = Drive::Voltage(-0.3);
        run(&mut plant, &mut motors, 0.0, 2.0, |plant, motors, time_s| {
            worst = worst.max(error(plant, motors, time_s));
            if time_s > 1.0 {
                steady = steady.max(error(plant, motors, time_s));
            }
        });
        motors.iter_mut().for_each(|motor| motor.drive = Drive::Brake);
        let mut after: f64 = 0.0;
        run(&mut plant, &mut motors, 2.0, 2.0, |plant, motors, time_s| {
            worst = worst.max(error(plant, motors, time_s));
            if time_s > 3.8 {
                after = after.max(error(plant, motors, time_s));
            }
        });
        println!(
            "flagella against encoders: {worst:.3} deg at most, {steady:.5} at a steady speed, {after:.5} at rest"
        );
        assert!(worst < 2.5 && steady < 0.001 && after < 0.001, "{worst} {steady} {after}");
        assert_eq!(plant.failure, None);
        assert_eq!(plant.motors(4.0).map(|motor| motor.speed), [0.0; 2], "comes to rest");
    }

    #[test]
    fn the_sensor_feels_gravity_and_its_own_turning() {
        let mut plant = Plant::new(&Robot::published(), 20.0).unwrap();
        let mut motors = [0, 1].map(|_| Motor::new(MotorParameters::PUBLISHED));
        let at_rest = plant.movement(0.0);
        assert!(at_rest.rate_dps.iter().all(|rate| rate.abs() < 1e-3), "{at_rest:?}");
        assert!((Vector3::from(at_rest.specific_force_g) - Vector3::z()).norm() < 1e-3, "{at_rest:?}");
        motors[0].drive = Drive::Voltage(0.7);
        let (mut yaw, mut last, mut felt) = (0.0, 0.0, true);
        run(&mut plant, &mut motors, 0.0, 3.0, |plant, _, time_s| {
            let movement = plant.movement(time_s);
            // The rate's integral about the vertical is the yaw, and the force is gravity to within the turning.
            let up = plant.trial.at(REST_S + time_s).unwrap().attitude.inverse_transform_vector(&Vector3::z());
            yaw += Vector3::from(movement.rate_dps).dot(&up) * STEP_S;
            last = plant.trial.at(REST_S + time_s).unwrap().euler[0].to_degrees();
            felt &= (Vector3::from(movement.specific_force_g) - up).norm() < 0.1;
        });
        assert!(last.abs() > 5.0 && (yaw - last).abs() < 0.02 * last.abs(), "{yaw} {last}");
        assert!(felt);
        let samples = plant.take_samples();
        assert_eq!(samples.len(), 151);
        assert_eq!(samples.iter().filter(|sample| sample.shapes_m.is_some()).count(), 30);
        assert!(plant.movement(3.0).temperature_c > 20.0);
    }

    /// A push turns the robot by its angle, and the sensor measures it: the integral of its rate is the turn, and its
    /// force shows the vertical.
    #[test]
    fn a_push_turns_the_robot_and_the_sensor_feels_it() {
        for (axis, angle_deg) in [(Axis::X, 20.0_f64), (Axis::Y, -20.0), (Axis::Vertical, 170.0)] {
            let mut plant = Plant::new(&Robot::published(), 20.0).unwrap();
            let mut motors = [0, 1].map(|_| Motor::new(MotorParameters::PUBLISHED));
            motors[0].drive = Drive::Voltage(0.5);
            motors[1].drive = Drive::Voltage(-0.2);
            run(&mut plant, &mut motors, 0.0, 2.0, |_, _, _| {});
            let begun = plant.attitude_and_rate(2.0).unwrap().0;
            let yaw = plant.trial.at(REST_S + 2.0).unwrap().euler[0];
            plant.push(axis, angle_deg.to_radians());
            let (mut integrated, mut off_g) = (begun, 0.0_f64);
            run(&mut plant, &mut motors, 2.0, 0.6, |plant, _, time_s| {
                let movement = plant.movement(time_s);
                let rate = Vector3::from(movement.rate_dps).map(f64::to_radians);
                integrated *= UnitQuaternion::from_scaled_axis(rate * STEP_S);
                let up = plant.attitude_and_rate(time_s).unwrap().0.inverse_transform_vector(&Vector3::z());
                off_g = off_g.max((Vector3::from(movement.specific_force_g) - up).norm());
            });
            let end = plant.attitude_and_rate(2.6).unwrap().0;
            let turned = (end * begun.inverse()).scaled_axis().dot(&axis.at(yaw)).to_degrees();
            let missed = integrated.angle_to(&end).to_degrees();
            println!("{axis:?}: {turned:.2} deg after 0.6 s, {missed:.3} deg off by the rate, {off_g:.4} g off");
            // The tether brings it back within seconds, and the flagella swing it by some degrees.
            assert!((0.6..1.2).contains(&(turned / angle_deg)), "{axis:?}: {turned}");
            assert!(missed < 0.3 && off_g < 0.2, "{axis:?}: {missed} deg, {off_g} g");
            let samples = plant.take_samples();
            let fastest = samples.iter().map(|sample| Vector3::from(sample.rate_rad_s).norm()).fold(0.0, f64::max);
            assert!(fastest > 3.0 * angle_deg.abs().to_radians(), "{axis:?}: {fastest} rad/s in the samples");
        }
    }

    #[test]
    fn what_the_simulator_cannot_do_is_said() {
        let mut robot = Robot::published();
        robot.solver.halvings = 0;
        let mut soft = robot.clone();
        soft.flagellum.young_pa = 2e4;
        soft.solver.tolerance = 1e-4;
        soft.solver.sweeps = 12;
        robot.solver.tolerance = 1e-7;
        robot.solver.sweeps = 2;
        assert!(Plant::new(&robot, 20.0).is_err_and(|error| error.contains("no step from -150.0")));
        let mut plant = Plant::new(&soft, 20.0).unwrap();
        let mut motors = [0, 1].map(|_| Motor::new(MotorParameters::PUBLISHED));
        motors[0].drive = Drive::Voltage(0.7);
        motors[1].drive = Drive::Voltage(-0.7);
        run(&mut plant, &mut motors, 0.0, 8.0, |_, _, _| {});
        assert!(plant.failure.as_ref().is_some_and(|failure| failure.contains("no step from")), "{:?}", plant.failure);
    }
}
