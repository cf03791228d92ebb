//! A trial: a speed profile in, samples out.
//!
//! ```
//! use sim::{params::Robot, body::closure::Closure, trial::{Options, Trial}};
//! use sim::trial::profile::{Phases, SpeedProfile};
//!
//! let profile = SpeedProfile::phases(&Phases { run: 0.5, ..Phases::default() }, [50.0, 10.0])?;
//! let mut trial = Trial::new(&Robot::default(), Closure::Full, profile, Options::default())?;
//! for sample in trial.by_ref() {
//!     let sample = sample?;
//!     println!("{:.2} s: yaw {:.2} deg", sample.time_s, sample.yaw_rad.to_degrees());
//! }
//! println!("{:?}", trial.summary().steady.attitude);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A trial keeps the values of two windows, and twelve means per turn of the faster motor over at most
//! [`crate::trial::means::STRETCH`].
//!
//! If the motors are outside of the simulator, for instance those of an emulated board, their speeds are not known in
//! advance. Such a trial is open: it is extended by the speeds of a short window, runs to the end of the window, and
//! gives values at any time in between.
//!
//! ```
//! use sim::{params::Robot, body::closure::Closure, trial::{Options, Trial}};
//!
//! let mut trial = Trial::open(&Robot::default(), Closure::Full, Options::default(), 0.1)?;
//! for window in 1..=10 {
//!     trial.extend(0.02 * f64::from(window), [0.5, 0.1])?;
//!     for sample in trial.by_ref() {
//!         println!("{:?}", sample?.attitude);
//!     }
//!     println!("{:?}", trial.at(0.02 * f64::from(window) - 0.005).map(|between| between.rate));
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod means;
pub mod profile;
pub mod quantity;
pub mod sample;
mod samples;

use self::means::{Steady, SteadyCollector};
use self::profile::{ProfileError, SpeedProfile};
use self::sample::{DenseOutput, ForceRecord, Interpolated, StepRecord, shapes_at};
use crate::V3;
use crate::body::attitude::euler_zyx;
use crate::body::shaft::MotorState;
use crate::contact::bundling::Bundling;
use crate::params::{Closure, ParamError, Robot, SolverSettings, within};
use crate::step::state::State;
use crate::step::{Solver, StepControl, StepError, StepReport};
use serde::{Deserialize, Serialize};

/// Output of a trial.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Options {
    /// Samples a second (20; the board's rate is 200).
    pub rate_hz: f64,
    /// Whether samples carry the shapes of the flagella.
    pub shapes: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { rate_hz: 20.0, shapes: false }
    }
}

/// Results of a trial.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Steady state of the run phase.
    pub steady: Steady,
    /// Simulated time, s.
    pub simulated_s: f64,
    /// Least distance of the flagella's surfaces, m.
    pub min_gap_m: f64,
    /// Largest overlap, m.
    pub max_penetration_m: f64,
    /// Largest force in one contact, also of a flagellum with itself, N.
    pub largest_contact_n: f64,
    /// Share of the run phase in which the flagella touch each other.
    pub contact_share: f64,
    /// Time of their first contact, s.
    pub first_contact_s: Option<f64>,
    /// The closest state that the flagella reached.
    pub bundling: Bundling,
    /// Steps taken, including the search if the steady state is solved for.
    pub steps: u64,
    /// Sweeps of all accepted steps, including the search.
    pub sweeps: u64,
    /// Largest estimated error of a step, m.
    pub step_error_m: f64,
}

/// A checkpoint: all data besides the parameters that determine the rest of a trial.
///
/// A restored trial gives the same bits as the uninterrupted one if the file format keeps every bit of a number. JSON
/// by serde_json with the feature `float_roundtrip` does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    state: State,
    control: StepControl,
    dense: DenseOutput,
    steady: SteadyCollector,
    next: u64,
    gap: f64,
    last_gap: f64,
    sweeps: u32,
    contact_time: f64,
    summary: Totals,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Totals {
    min_gap: f64,
    largest_contact: f64,
    first_contact: Option<f64>,
    bundling: Bundling,
    steps: u64,
    sweeps: u64,
    error: f64,
}

/// A trial in progress; an iterator over its samples. An error ends it.
#[derive(Clone, Debug)]
pub struct Trial {
    solver: Solver,
    /// The profile, with the angles of the helices.
    pub(crate) profile: SpeedProfile,
    options: Options,
    /// Time of the first sample, s.
    start: f64,
    progress: Checkpoint,
    failed: bool,
}

/// Returns the overlap of surfaces with this gap, m.
fn overlap(gap: f64) -> f64 {
    (-gap).max(0.0)
}

/// Returns the angles of the helices at zero motor angle, rad.
fn phase(solver: &Solver) -> [f64; 2] {
    solver.model().robot.flagellum.phase_deg.map(f64::to_radians)
}

impl Trial {
    /// Returns a trial with the robot upright and at rest at the start of the profile.
    ///
    /// # Errors
    /// An impossible parameter or rate.
    pub fn new(robot: &Robot, closure: Closure, profile: SpeedProfile, options: Options) -> Result<Self, ParamError> {
        Self::with_solver(Solver::new(robot, closure)?, profile, options)
    }

    /// Returns such a trial with a given solver.
    pub fn with_solver(solver: Solver, profile: SpeedProfile, options: Options) -> Result<Self, ParamError> {
        Self::begin(solver, profile, options, DenseOutput::default())
    }

    /// Returns an open trial: robot upright and at rest at time 0, with motors that [`Trial::extend`] sets. `reach`:
    /// time before the last step for which [`Trial::at`] has values, s.
    pub fn open(robot: &Robot, closure: Closure, options: Options, reach: f64) -> Result<Self, ParamError> {
        Self::begin(Solver::new(robot, closure)?, SpeedProfile::open(0.0), options, DenseOutput::reaching(reach))
    }

    fn begin(solver: Solver, profile: SpeedProfile, options: Options, dense: DenseOutput) -> Result<Self, ParamError> {
        within("rate_hz", options.rate_hz, 1e-3, 1e5)?;
        let profile = profile.from_angles(phase(&solver));
        let mut state = solver.at_rest();
        state.time = profile.start();
        state.motors = profile.motors(state.time);
        let mut trial = Self::from(solver, profile, options, dense, (state, StepControl::default()));
        trial.record(&StepReport::default());
        Ok(trial)
    }

    /// Returns the trial that continues this one from a state over another profile, which starts where this one ended.
    /// Its results and samples cover the new profile alone.
    pub(crate) fn followed_by(self, profile: SpeedProfile, state: State) -> Self {
        let profile = profile.from_angles(phase(&self.solver));
        let last = self.progress.dense.newest().copied();
        let control = self.progress.control;
        let spent = self.progress.summary;
        let mut trial = Self::from(self.solver, profile, self.options, DenseOutput::default(), (state, control));
        trial = trial.with_spent(&spent);
        if let Some(StepRecord { forces, contact, touching, .. }) = last {
            trial.keep(forces, contact, touching);
        }
        trial
    }

    /// Returns the trial with previously collected values added to its steady state.
    pub(crate) fn with_collected(mut self, mut collected: SteadyCollector) -> Self {
        // A collector without values starts with the state at the start of this trial.
        collected.begin_with(&self.progress.steady);
        self.progress.steady = collected;
        self
    }

    /// Returns the trial with these earlier steps and sweeps added to its own.
    pub(crate) fn with_spent(mut self, before: &Totals) -> Self {
        self.progress.summary.steps += before.steps;
        self.progress.summary.sweeps += before.sweeps;
        self
    }

    /// Returns the totals, for [`Self::with_spent`].
    pub(crate) fn totals(&self) -> &Totals {
        &self.progress.summary
    }

    /// Returns the values collected for the steady state.
    pub(crate) fn collected(&self) -> &SteadyCollector {
        &self.progress.steady
    }

    fn from(
        mut solver: Solver,
        profile: SpeedProfile,
        options: Options,
        dense: DenseOutput,
        (state, control): (State, StepControl),
    ) -> Self {
        let gap = solver.least_distance(&state) - 2.0 * solver.model().robot.flagellum.rod_radius_m;
        let [start, stop] = profile.run();
        let collector = SteadyCollector::after_reversal(start, profile.last_reversal(), stop, profile.target());
        let progress = Checkpoint {
            steady: collector.meshing(solver.model().robot.flagellum.mesh(profile.target())),
            dense,
            next: 0,
            gap,
            last_gap: gap,
            sweeps: 0,
            contact_time: 0.0,
            summary: Totals { min_gap: gap, ..Totals::default() },
            state,
            control,
        };
        Self { solver, start: profile.start(), profile, options, progress, failed: false }
    }

    /// Restores a checkpoint of the same robot, closure, profile and options; the trial continues bit for bit.
    pub fn restore(&mut self, checkpoint: Checkpoint) {
        self.progress = checkpoint;
        self.failed = false;
    }

    /// Extends an open trial to `time` (s), with speeds of the motors that change linearly to these (rad/s). The iterator
    /// then gives the samples up to there.
    ///
    /// # Errors
    /// A time that is not after the last one, or an impossible speed.
    pub fn extend(&mut self, time: f64, speeds: [f64; 2]) -> Result<(), ProfileError> {
        self.profile.extend(time, speeds)
    }

    /// Turns the robot about its joint at the present time, as [`State::turn`] does, also in the values of
    /// [`Trial::at`]. The steady state is computed from the values before and after. `rotation`: rotation vector in
    /// world axes, rad.
    pub fn turn(&mut self, rotation: V3) {
        self.progress.state.turn(rotation);
        self.progress.dense.turn(rotation);
    }

    /// Returns angles and speeds of the motors at a time (s).
    pub fn motors(&self, time: f64) -> [MotorState; 2] {
        self.without_phase(self.profile.motors(time))
    }

    /// Returns motors with the angles that their encoders count.
    fn without_phase(&self, motors: [MotorState; 2]) -> [MotorState; 2] {
        let phase = phase(&self.solver);
        [0, 1].map(|k| MotorState { angle: motors[k].angle - phase[k], ..motors[k] })
    }

    /// Returns attitude, rate and forces at a time (s) that the solver has just passed.
    pub fn at(&self, time: f64) -> Option<Interpolated> {
        self.progress.dense.at(time)
    }

    /// Returns a checkpoint from which the trial can continue.
    pub fn checkpoint(&self) -> Checkpoint {
        self.progress.clone()
    }

    /// Returns the state at the end of the last step.
    pub fn state(&self) -> &State {
        &self.progress.state
    }

    /// Returns the solver, for its robot and rods.
    pub fn solver(&self) -> &Solver {
        &self.solver
    }

    /// Returns the share of the profile that is done, 0 to 1.
    pub fn done(&self) -> f64 {
        let (start, end) = (self.start, self.profile.end());
        ((self.progress.state.time - start) / (end - start)).clamp(0.0, 1.0)
    }

    /// Returns the results so far.
    pub fn summary(&self) -> Summary {
        self.summary_with(self.progress.steady.steady())
    }

    /// Returns the results so far, with means over the window.
    pub(crate) fn window_summary(&self) -> Summary {
        self.summary_with(self.progress.steady.window())
    }

    /// Returns the time of the first contact, s; `None` if there was none.
    pub fn first_contact_s(&self) -> Option<f64> {
        self.progress.summary.first_contact
    }

    fn summary_with(&self, steady: Steady) -> Summary {
        // With the closure `paper` nothing resists a roll: turning over is its documented motion.
        let may_turn = self.solver.model().closure == Closure::Paper;
        let steady = if may_turn { steady } else { self.progress.steady.unless_overturned(steady) };
        let totals = &self.progress.summary;
        let [start, stop] = self.profile.run();
        let run = (self.progress.state.time.min(stop) - start).max(0.0);
        Summary {
            steady,
            simulated_s: self.progress.state.time - self.start,
            min_gap_m: totals.min_gap,
            max_penetration_m: overlap(totals.min_gap),
            largest_contact_n: totals.largest_contact,
            contact_share: if run > 0.0 { self.progress.contact_time / run } else { 0.0 },
            first_contact_s: totals.first_contact,
            bundling: totals.bundling,
            steps: totals.steps,
            sweeps: totals.sweeps,
            step_error_m: totals.error,
        }
    }

    /// Runs to the end without samples and returns the results.
    ///
    /// # Errors
    /// A step that fails at every length.
    pub fn finish(&mut self) -> Result<Summary, StepError> {
        while self.progress.state.time < self.profile.end() {
            self.advance()?;
        }
        Ok(self.summary())
    }

    /// Sets the lengths and the tolerance of the steps to come.
    pub(crate) fn set_accuracy(&mut self, settings: &SolverSettings) {
        self.solver.set_accuracy(settings);
    }

    /// Returns the least distance of the centre lines in a state, m.
    pub(crate) fn least_distance(&mut self, state: &State) -> f64 {
        self.solver.least_distance(state)
    }

    /// Takes one step of the solver.
    fn advance(&mut self) -> Result<(), StepError> {
        self.advance_towards(self.profile.end())
    }

    /// Takes one step of the solver, not beyond `latest` (s).
    pub(crate) fn advance_towards(&mut self, latest: f64) -> Result<(), StepError> {
        let time = self.progress.state.time;
        let [start, stop] = self.profile.run();
        let until = [Some(start), Some(stop), self.profile.next_jump(time), Some(self.profile.end()), Some(latest)]
            .into_iter()
            .flatten()
            .filter(|t| *t > time)
            .fold(f64::INFINITY, f64::min);
        let profile = &self.profile;
        // A step that ends at a jump has the speed before the jump.
        let before = |t: f64| {
            if t < until { profile.motors(t) } else { profile.motors(t.next_down()) }
        };
        let Checkpoint { state, control, .. } = &mut self.progress;
        let report = control.advance(&mut self.solver, state, until, &before).inspect_err(|_| self.failed = true)?;
        self.record(&report);
        let run = time >= start && time < stop;
        let state = &self.progress.state;
        if run && report.between > 0 {
            self.progress.contact_time += state.time - time;
        }
        if self.profile.next_jump(time) == Some(state.time) {
            self.progress.state.restart();
            self.progress.dense.restart();
        }
        Ok(())
    }

    fn record(&mut self, report: &StepReport) {
        let weight_counts = self.solver.model().weight_on_base();
        let forces = [0, 1].map(|k| {
            let weight = if weight_counts { report.weight[k].force } else { V3::zeros() };
            ForceRecord {
                smooth: report.fluid[k].force + weight,
                contact: report.contact[k].force,
                smooth_torque: report.fluid[k].axial_torque,
                contact_torque: report.contact[k].axial_torque,
            }
        });
        let distance = self.solver.least_distance(&self.progress.state);
        let gap = distance - 2.0 * self.solver.model().robot.flagellum.rod_radius_m;
        let progress = &mut self.progress;
        progress.gap = progress.gap.min(gap);
        progress.last_gap = gap;
        progress.sweeps += report.sweeps;
        let totals = &mut progress.summary;
        totals.min_gap = totals.min_gap.min(gap);
        totals.largest_contact = totals.largest_contact.max(report.largest_force);
        totals.steps += u64::from(report.sweeps > 0);
        totals.sweeps += u64::from(report.sweeps);
        totals.error = totals.error.max(report.error);
        if report.between > 0 && totals.first_contact.is_none() {
            totals.first_contact = Some(progress.state.time);
        }
        // Only flagella in contact can be bundled; once they have been bundled, no further check is needed.
        if report.between > 0 && totals.bundling != Bundling::Bundled {
            let state = &self.progress.state;
            let lines = shapes_at(state, state.time, &state.motors, &self.solver.model().robot.shaft_feet());
            self.progress.summary.bundling = Bundling::classify(true, self.winding(&lines));
        }
        self.keep(forces, report.touching > 0, report.between > 0);
    }

    /// Keeps the state and these forces for samples and for the steady state. `contact`: whether any pair presses;
    /// `touching`: whether a pair between the flagella does.
    fn keep(&mut self, forces: [ForceRecord; 2], contact: bool, touching: bool) {
        let [start, stop] = self.profile.run();
        let progress = &mut self.progress;
        let state = &progress.state;
        progress.dense.push(StepRecord {
            time: state.time,
            attitude: state.body.attitude,
            yaw: state.body.yaw,
            rate: state.body.rate,
            motors: state.motors,
            forces,
            contact,
            touching,
        });
        if state.time >= start && state.time <= stop {
            let [_, pitch, roll] = euler_zyx(&state.body.attitude);
            let force = |k: usize| forces[k].smooth + forces[k].contact;
            let (f1, f2) = (force(0), force(1));
            let torque = |k: usize| forces[k].smooth_torque + forces[k].contact_torque;
            progress.steady.push(
                state.time,
                [state.body.yaw, pitch, roll, f1.x, f1.y, f1.z, f2.x, f2.y, f2.z, torque(0), torque(1)],
                contact,
            );
        }
    }
}
