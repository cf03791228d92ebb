//! The simulated robot behind the emulated board. Its unrounded state is recorded with the board's telemetry.

use super::error::RecordError;
use super::virtual_nano::{TruthSample, VirtualError, VirtualNano};
use crate::link::{Link, LinkError, SLICE_US};
use biflag_log::{Method, ModelMeta, SensorMeta};
use miette::{IntoDiagnostic, WrapErr};
use sim::body::closure::Closure;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::time::{Duration, Instant, SystemTime};
use study::plan::{Plan, TICK_US};
use study::run::Recorder;

/// Sampling rate of the simulated robot.
const RATE_HZ: f64 = 50.0;

/// Interval at which samples are fetched. A killed recording loses this much additional ground truth.
const INTERVAL: Duration = Duration::from_millis(50);

/// Time without a frame, by the board's own clock, after which an emulated board is silent, s: a hundred frames.
const SILENT_S: f64 = 0.5;

/// An emulated board with a simulated robot behind it.
#[derive(Debug)]
pub struct SimulatedRobot {
    nano: Rc<RefCell<VirtualNano>>,
    /// The model's metadata, for the logs.
    pub model: ModelMeta,
    /// The sensor's errors, for the logs.
    pub sensor: SensorMeta,
}

impl SimulatedRobot {
    /// Creates the robot of a plan. `nano` must have been started with it.
    ///
    /// # Errors
    /// [`study::plan::PlanError`].
    pub fn new(nano: VirtualNano, plan: &Plan, seed: u64) -> miette::Result<Self> {
        let robot = plan.robot.parse()?;
        let parameters = toml::to_string(&robot).into_diagnostic().wrap_err("the robot's parameters")?;
        let sensor = SensorMeta { seed, ..nano.sensor.clone() };
        let model =
            ModelMeta { closure: Closure::Full, method: Method::Trial, rate_hz: RATE_HZ, shapes: true, parameters };
        Ok(Self { nano: Rc::new(RefCell::new(nano)), model, sensor })
    }

    /// Opens the link to its board, which must have been started with `--speed exchange` and waits for this program.
    ///
    /// # Errors
    /// [`LinkError`].
    pub fn lock_step(&self) -> Result<Link, LinkError> {
        let nano = Rc::clone(&self.nano);
        let port = nano.borrow().port().to_owned();
        // The ground truth, which is fetched next, contains the reason for a failure.
        let advance = move |bytes: &[u8]| nano.borrow_mut().exchange(bytes, SLICE_US).ok();
        Link::lock_step(&port, Box::new(advance))
    }
}

/// Copies the ground truth of one trial into its log.
pub(super) struct TruthRecorder<'a> {
    robot: &'a SimulatedRobot,
    asked: Instant,
    /// Samples after the last recorded frame.
    ahead: VecDeque<TruthSample>,
    /// The board's time at the first silence since the last frame, s.
    silent_since_s: Option<f64>,
}

impl<'a> TruthRecorder<'a> {
    pub(super) fn new(robot: &'a SimulatedRobot) -> Self {
        Self { robot, asked: Instant::now(), ahead: VecDeque::new(), silent_since_s: None }
    }

    /// Records that a frame has arrived.
    pub(super) fn hear(&mut self) {
        self.silent_since_s = None;
    }

    /// Returns whether the board itself is silent after a second without a frame: a busy computer may have kept it from
    /// running.
    pub(super) fn is_silent(&mut self) -> Result<bool, VirtualError> {
        let status = self.robot.nano.borrow_mut().control("status")?;
        let (Some("running"), Some(now_s)) = (status["state"].as_str(), status["seconds"].as_f64()) else {
            return Ok(true);
        };
        let since_s = *self.silent_since_s.get_or_insert(now_s);
        Ok(now_s - since_s >= SILENT_S)
    }

    /// Returns whether the robot's shape is sampled in the tick that begins at `tick_us` of the board's clock.
    ///
    /// The board samples its robot from power-on, with its shape every tenth of a second. If the trial began at an
    /// arbitrary frame, the times of its samples, and sometimes their number, would differ between recordings.
    pub(super) fn has_shape_in(&mut self, tick_us: u64) -> Result<bool, VirtualError> {
        let since_tick = |sample_us: u32| sample_us.wrapping_sub(tick_us as u32);
        let newest = self.ahead.back().and_then(|sample| sample.board_us);
        if newest.is_none_or(|newest| since_tick(newest).cast_signed() < 0) {
            self.ask()?;
        }
        let shapes = self.ahead.iter().filter(|sample| sample.sample.shapes_m.is_some());
        Ok(shapes.filter_map(|sample| sample.board_us).any(|sample_us| u64::from(since_tick(sample_us)) < TICK_US))
    }

    /// Records the samples up to `until_us` of the board's clock in a trial that began at `begun_us`. Fetches more
    /// samples if they are due.
    pub(super) fn keep(&mut self, trial: &mut Recorder, (begun_us, until_us): (u64, u64)) -> Result<(), RecordError> {
        if self.asked.elapsed() >= INTERVAL {
            self.ask()?;
        }
        let host = SystemTime::now();
        while let Some(TruthSample { board_us, mut sample }) = self.ahead.pop_front() {
            // Samples without a time were taken before the board started.
            let Some(board_us) = board_us else { continue };
            // The sample's board time is the clock of the frames, modulo 2^32.
            let later_us = i64::from(board_us.wrapping_sub(until_us as u32).cast_signed());
            if later_us > 0 {
                self.ahead.push_front(TruthSample { board_us: Some(board_us), sample });
                return Ok(());
            }
            let Some(time_us) = until_us.saturating_add_signed(later_us).checked_sub(begun_us) else { continue };
            sample.time_s = time_us as f64 * 1e-6;
            trial.sample(&sample, host)?;
        }
        Ok(())
    }

    /// Fetches the samples since the last call.
    pub(super) fn ask(&mut self) -> Result<(), VirtualError> {
        self.asked = Instant::now();
        self.ahead.extend(self.robot.nano.borrow_mut().truth()?);
        Ok(())
    }
}
