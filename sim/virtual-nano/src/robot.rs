//! The simulated robot that the board is built into: the board's motors turn the simulator's flagella, and the sensor
//! sits on the simulator's base.
//!
//! The simulator takes steps longer than a tick, and a step needs the motors' speed at its end. So the robot goes ahead in
//! windows of [`WINDOW_S`]: at the end of one, the motors' speeds over the next are foreseen from their present speed and
//! acceleration, and the sensor reads between the solver's steps. What was foreseen wrongly is made good by the speeds of
//! the windows that follow, so that the simulator's flagella stay where the encoders say: on the model of the motors, which
//! have a time constant of 80 ms, within 2 degrees while they start and stop and within 0.001 at a steady speed.

use crate::imu::source::Movement;
use crate::motor::Motor;
use nalgebra::Vector3;
use sim::params::Robot as Parameters;
use sim::robot::clamp;
use sim::robot::closure::Closure;
use sim::sample::Sample;
use sim::step::advance::StepError;
use sim::trial::{Options, Trial};
use std::collections::VecDeque;

/// Windows a second.
const WINDOWS_HZ: f64 = 50.0;
/// How far the robot goes ahead of its motors, s.
pub const WINDOW_S: f64 = 1.0 / WINDOWS_HZ;

/// The sensor may ask for what happened so long before the present window, s: as long as its slowest filter takes.
const REACH_S: f64 = 0.1;

/// The robot has hung at rest for so long when the board gets power, s: the flagella sag under their weight at first, and the
/// slowest motion of the robot dies away with a time constant of 10 s.
const REST_S: f64 = 150.0;

/// Samples with the flagella's shapes are one in so many.
const SHAPES_EVERY: u64 = 5;

/// Samples that wait for whoever asks for them: a minute's.
const WAITING: usize = 60 * WINDOWS_HZ as usize;

/// Angular acceleration is taken over so long, s.
const TURNING_S: f64 = 1e-3;

/// Share of a window's error in a motor's angle that the next one makes good. At 1 what was foreseen wrongly is gone at
/// once, and the speed jumps about; the simulator's formulas want it smooth.
const CATCH_UP: f64 = 0.3;

/// An error of the angle that is not worth a motion, rad.
const STILL_RAD: f64 = 1e-5;

/// The temperature of the base.
#[derive(Clone, Copy, Debug)]
struct Warmth {
    room_c: f64,
    /// What the motors have warmed it by.
    above_c: f64,
}

/// Assumed: both motors at 90 rpm warm the base by so much in the end.
const MOTORS_WARM_C: f64 = 2.0;
/// Assumed: time constant of the base in the fluid, s.
const WARMING_S: f64 = 300.0;

/// The robot.
pub struct Robot {
    trial: Trial,
    /// Windows that have begun.
    windows: u64,
    /// Speeds of the board's motors at the beginning of the window before, rad/s.
    before: [f64; 2],
    warmth: Warmth,
    /// The sensor in body axes, m.
    sensor: Vector3<f64>,
    gravity_m_s2: f64,
    samples: VecDeque<Sample>,
    failure: Option<String>,
}

impl Robot {
    /// Hanging at rest, with motors that do not turn yet.
    ///
    /// # Errors
    /// A parameter that cannot be, or a robot that the simulator cannot bring to rest.
    pub fn new(parameters: &Parameters, room_c: f64) -> Result<Self, String> {
        let options = Options { rate_hz: WINDOWS_HZ, shapes: true };
        let mut robot = Self {
            trial: Trial::open(parameters, Closure::Full, options, WINDOW_S + REACH_S)
                .map_err(|error| error.to_string())?,
            windows: 0,
            before: [0.0; 2],
            warmth: Warmth { room_c, above_c: 0.0 },
            // On the central axis, in the bottom plane of the base.
            sensor: Vector3::new(0.0, 0.0, -parameters.base.height_m),
            gravity_m_s2: parameters.base.gravity_m_s2,
            samples: VecDeque::new(),
            failure: None,
        };
        robot.go_to(0.0, [0.0; 2])?;
        robot.samples.clear();
        Ok(robot)
    }

    /// The board's motors are so at this time in s. Where a window ends, the robot goes on by another.
    pub fn follow(&mut self, time_s: f64, motors: &[Motor; 2]) {
        while self.failure.is_none() && time_s >= self.end_s() {
            if let Err(problem) = self.go_on(time_s, motors) {
                self.failure = Some(problem);
            }
        }
    }

    /// Why the simulator could not go on. From then on the robot's movement means nothing.
    pub fn failure(&self) -> Option<&str> {
        self.failure.as_deref()
    }

    /// The robot's state since the last call, the end of each window, oldest first; a minute at most.
    pub fn take_samples(&mut self) -> Vec<Sample> {
        self.samples.drain(..).collect()
    }

    /// How the sensor moves.
    pub fn movement(&self, time_s: f64) -> Movement {
        let at = |time_s: f64| self.trial.at(REST_S + time_s);
        let (now, before) = (at(time_s), at(time_s - TURNING_S));
        let temperature_c = self.warmth.room_c + self.warmth.above_c;
        let Some((now, before)) = now.zip(before) else {
            return Movement { specific_force_g: [0.0, 0.0, 1.0], temperature_c, ..Movement::default() };
        };
        let turning = (now.rate - before.rate) / TURNING_S;
        let acceleration = turning.cross(&self.sensor) + now.rate.cross(&now.rate.cross(&self.sensor));
        let up = now.attitude.inverse_transform_vector(&Vector3::z());
        Movement {
            rate_dps: now.rate.map(f64::to_degrees).into(),
            specific_force_g: (up + acceleration / self.gravity_m_s2).into(),
            temperature_c,
        }
    }

    fn end_s(&self) -> f64 {
        self.windows as f64 / WINDOWS_HZ
    }

    fn go_on(&mut self, time_s: f64, motors: &[Motor; 2]) -> Result<(), String> {
        let begin_s = self.end_s();
        let modelled = self.motors(begin_s);
        let speeds = [0, 1].map(|k| {
            let speed = motors[k].speed_rad_s();
            let angle = motors[k].angle_rad() - speed * (time_s - begin_s);
            let before = std::mem::replace(&mut self.before[k], speed);
            foresee(clamp::Motor { angle, speed }, before, modelled[k])
        });
        self.windows += 1;
        self.go_to(self.end_s(), speeds)?;
        let share = speeds.iter().map(|speed| speed.abs()).sum::<f64>() / (2.0 * 90.0 * std::f64::consts::PI / 30.0);
        self.warmth.above_c += (MOTORS_WARM_C * share - self.warmth.above_c) * (WINDOW_S / WARMING_S);
        Ok(())
    }

    /// Lets the simulator go on to a time, with speeds of the flagella that change evenly to these (rad/s).
    fn go_to(&mut self, time_s: f64, speeds: [f64; 2]) -> Result<(), String> {
        self.trial.extend(REST_S + time_s, speeds).map_err(|error| error.to_string())?;
        for sample in self.trial.by_ref() {
            let by_board = |error: StepError| StepError { time: error.time - REST_S, ..error }.to_string();
            let mut sample = sample.map_err(by_board)?;
            sample.time_s -= REST_S;
            if !self.windows.is_multiple_of(SHAPES_EVERY) {
                sample.shapes_m = None;
            }
            if self.samples.len() == WAITING {
                self.samples.pop_front();
            }
            self.samples.push_back(sample);
        }
        Ok(())
    }

    /// The simulator's motors.
    fn motors(&self, time_s: f64) -> [clamp::Motor; 2] {
        self.trial.motors(REST_S + time_s)
    }
}

/// The speed at which a modelled motor is to be at the end of the next window, rad/s. `before`: the real one's speed a
/// window ago, rad/s.
fn foresee(real: clamp::Motor, before: f64, modelled: clamp::Motor) -> f64 {
    let change = real.speed - before;
    let ahead = real.speed + change;
    // A motor that stops does not turn back.
    let ahead = if ahead * real.speed <= 0.0 { 0.0 } else { ahead };
    let real_angle = real.angle + 0.5 * (real.speed + ahead) * WINDOW_S;
    let error = real_angle - modelled.angle - 0.5 * (modelled.speed + ahead) * WINDOW_S;
    if ahead == 0.0 && error.abs() < STILL_RAD && modelled.speed.abs() * WINDOW_S < STILL_RAD {
        return 0.0;
    }
    ahead + CATCH_UP * error / WINDOW_S
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bridge::Drive;
    use crate::motor::{MotorParameters, STEP_S};

    fn run(
        robot: &mut Robot,
        motors: &mut [Motor; 2],
        from_s: f64,
        length_s: f64,
        mut see: impl FnMut(&Robot, &[Motor; 2], f64),
    ) {
        for i in 1..=(length_s / STEP_S).round() as u64 {
            for motor in motors.iter_mut() {
                motor.advance(STEP_S);
            }
            let time_s = from_s + i as f64 * STEP_S;
            robot.follow(time_s, motors);
            see(robot, motors, time_s);
        }
    }

    #[test]
    fn the_flagella_are_where_the_encoders_say() {
        let mut robot = Robot::new(&Parameters::default(), 20.0).unwrap();
        let mut motors = [0, 1].map(|_| Motor::new(MotorParameters::default()));
        let error = |robot: &Robot, motors: &[Motor; 2], time_s: f64| {
            let modelled = robot.motors(time_s);
            (0..2).map(|k| (modelled[k].angle - motors[k].angle_rad()).abs().to_degrees()).fold(0.0, f64::max)
        };
        let (mut worst, mut steady): (f64, f64) = (0.0, 0.0);
        motors[0].set_drive(Drive::Voltage(0.7));
        motors[1].set_drive(Drive::Voltage(-0.3));
        run(&mut robot, &mut motors, 0.0, 2.0, |robot, motors, time_s| {
            worst = worst.max(error(robot, motors, time_s));
            if time_s > 1.0 {
                steady = steady.max(error(robot, motors, time_s));
            }
        });
        motors.iter_mut().for_each(|motor| motor.set_drive(Drive::Brake));
        let mut after: f64 = 0.0;
        run(&mut robot, &mut motors, 2.0, 2.0, |robot, motors, time_s| {
            worst = worst.max(error(robot, motors, time_s));
            if time_s > 3.8 {
                after = after.max(error(robot, motors, time_s));
            }
        });
        println!(
            "flagella against encoders: {worst:.3} deg at most, {steady:.5} at a steady speed, {after:.5} at rest"
        );
        assert!(worst < 2.5 && steady < 0.001 && after < 0.001, "{worst} {steady} {after}");
        assert_eq!(robot.failure(), None);
        assert_eq!(robot.motors(4.0).map(|motor| motor.speed), [0.0; 2], "comes to rest");
    }

    #[test]
    fn the_sensor_feels_gravity_and_its_own_turning() {
        let mut robot = Robot::new(&Parameters::default(), 20.0).unwrap();
        let mut motors = [0, 1].map(|_| Motor::new(MotorParameters::default()));
        let at_rest = robot.movement(0.0);
        assert!(at_rest.rate_dps.iter().all(|rate| rate.abs() < 1e-3), "{at_rest:?}");
        assert!((Vector3::from(at_rest.specific_force_g) - Vector3::z()).norm() < 1e-3, "{at_rest:?}");
        motors[0].set_drive(Drive::Voltage(0.7));
        let (mut yaw, mut last, mut felt) = (0.0, 0.0, true);
        run(&mut robot, &mut motors, 0.0, 3.0, |robot, _, time_s| {
            let movement = robot.movement(time_s);
            // The rate's integral about the vertical is the yaw, and the force is gravity to within the turning.
            let up = robot.trial.at(REST_S + time_s).unwrap().attitude.inverse_transform_vector(&Vector3::z());
            yaw += Vector3::from(movement.rate_dps).dot(&up) * STEP_S;
            last = robot.trial.at(REST_S + time_s).unwrap().euler[0].to_degrees();
            felt &= (Vector3::from(movement.specific_force_g) - up).norm() < 0.1;
        });
        assert!(last.abs() > 5.0 && (yaw - last).abs() < 0.02 * last.abs(), "{yaw} {last}");
        assert!(felt);
        let samples = robot.take_samples();
        assert_eq!(samples.len(), 151);
        assert_eq!(samples.iter().filter(|sample| sample.shapes_m.is_some()).count(), 30);
        assert!(robot.movement(3.0).temperature_c > 20.0);
    }

    #[test]
    fn what_the_simulator_cannot_do_is_said() {
        let mut parameters = Parameters::default();
        parameters.solver.halvings = 0;
        let mut soft = parameters.clone();
        soft.flagellum.young_pa = 2e4;
        soft.solver.tolerance = 1e-4;
        soft.solver.sweeps = 12;
        parameters.solver.tolerance = 1e-7;
        parameters.solver.sweeps = 2;
        assert!(Robot::new(&parameters, 20.0).is_err_and(|error| error.contains("no step from -150.0")));
        let mut robot = Robot::new(&soft, 20.0).unwrap();
        let mut motors = [0, 1].map(|_| Motor::new(MotorParameters::default()));
        motors[0].set_drive(Drive::Voltage(0.7));
        motors[1].set_drive(Drive::Voltage(-0.7));
        run(&mut robot, &mut motors, 0.0, 8.0, |_, _, _| {});
        assert!(robot.failure().is_some_and(|failure| failure.contains("no step from")), "{:?}", robot.failure());
    }
}
