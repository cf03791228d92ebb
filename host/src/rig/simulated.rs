//! The simulated robot behind the emulated board: what only it can say, brought into the log beside what the board
//! measured.

use super::recorder::RecordError;
use super::virtual_nano::{TruthSample, VirtualError, VirtualNano};
use crate::log::{ModelMeta, SensorMeta, Writer};
use crate::model::{messages, shapes};
use crate::plan::Plan;
use crate::robot_file;
use miette::{IntoDiagnostic, WrapErr};
use protocol::TICK_HZ;
use sim::robot::closure::Closure;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::time::{Duration, Instant, SystemTime};

/// Samples a second that the emulated board's robot gives.
const RATE_HZ: f64 = 50.0;

/// How often the robot is asked: a killed recording loses that and what the log loses anyway.
const INTERVAL: Duration = Duration::from_millis(50);

/// The board's tick.
const TICK_US: u32 = 1_000_000 / TICK_HZ as u32;

/// An emulated board with a simulated robot behind it.
#[derive(Debug)]
pub struct SimulatedRobot {
    nano: RefCell<VirtualNano>,
    rod_radius_m: f64,
    /// What it is computed with, for the logs.
    pub model: ModelMeta,
    /// What its sensor adds, for the logs.
    pub sensor: SensorMeta,
}

impl SimulatedRobot {
    /// The robot of a plan, which `nano` was started with.
    ///
    /// # Errors
    /// [`robot_file::RobotFileError`].
    pub fn new(nano: VirtualNano, plan: &Plan, seed: u64) -> miette::Result<Self> {
        let robot = robot_file::of_plan(plan)?;
        let parameters = toml::to_string(&robot).into_diagnostic().wrap_err("the robot's parameters")?;
        let sensor = SensorMeta { seed, ..nano.sensor().clone() };
        let model = ModelMeta { closure: Closure::Full, rate_hz: RATE_HZ, shapes: true, parameters };
        Ok(Self { nano: RefCell::new(nano), rod_radius_m: robot.flagellum.rod_radius_m, model, sensor })
    }
}

/// The truth of one trial, on its way into the log.
pub(super) struct Truth<'a> {
    robot: &'a SimulatedRobot,
    asked: Instant,
    /// Later than the last frame that was kept.
    ahead: VecDeque<TruthSample>,
}

impl<'a> Truth<'a> {
    pub(super) fn new(robot: &'a SimulatedRobot) -> Self {
        Self { robot, asked: Instant::now(), ahead: VecDeque::new() }
    }

    /// Returns whether the robot's shape is sampled in the tick that begins at `tick_us` of the board's clock.
    ///
    /// The board samples its robot from power-on, each tenth of a second with the shape. A trial that began at any frame
    /// would have its samples at other times, and sometimes one less, each time it is recorded.
    pub(super) fn has_shape_in(&mut self, tick_us: u64) -> Result<bool, VirtualError> {
        let since_tick = |sample_us: u32| sample_us.wrapping_sub(tick_us as u32);
        let newest = self.ahead.back().and_then(|sample| sample.board_us);
        if newest.is_none_or(|newest| since_tick(newest).cast_signed() < 0) {
            self.ask()?;
        }
        let shapes = self.ahead.iter().filter(|sample| sample.sample.shapes_m.is_some());
        Ok(shapes.filter_map(|sample| sample.board_us).any(|sample_us| since_tick(sample_us) < TICK_US))
    }

    /// Keeps what came up to `until_us` of the board's clock in the log of a trial that began at `begun_us`. Asks for more
    /// where that is due.
    pub(super) fn keep(&mut self, log: &mut Writer, (begun_us, until_us): (u64, u64)) -> Result<(), RecordError> {
        if self.asked.elapsed() >= INTERVAL {
            self.ask()?;
        }
        let host = SystemTime::now();
        while let Some(TruthSample { board_us, mut sample }) = self.ahead.pop_front() {
            // What came before the board told its time is of no trial.
            let Some(board_us) = board_us else { continue };
            // The board's clock is that of its frames, modulo 2^32.
            let later_us = i64::from(board_us.wrapping_sub(until_us as u32).cast_signed());
            if later_us > 0 {
                self.ahead.push_front(TruthSample { board_us: Some(board_us), sample });
                return Ok(());
            }
            let Some(time_us) = until_us.saturating_add_signed(later_us).checked_sub(begun_us) else { continue };
            sample.time_s = time_us as f64 * 1e-6;
            log.message_at(sample.time_s, &messages::truth(&sample), host)?;
            log.message_at(sample.time_s, &messages::forces(&sample), host)?;
            if let Some(lines) = &sample.shapes_m {
                // On the same clock as the attitude, or viewers do not find where the body was.
                let log_time_ns = log.time_ns(sample.time_s);
                log.message_at(sample.time_s, &shapes::scene(log_time_ns, lines, self.robot.rod_radius_m), host)?;
                log.message_at(sample.time_s, &shapes::points(log_time_ns, lines), host)?;
            }
        }
        Ok(())
    }

    /// Fetches what the robot has done since it was last asked.
    pub(super) fn ask(&mut self) -> Result<(), VirtualError> {
        self.asked = Instant::now();
        self.ahead.extend(self.robot.nano.borrow_mut().truth()?);
        Ok(())
    }
}
