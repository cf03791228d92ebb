//! Simulators that are stepped from outside, with speeds that are not known in advance.

use crate::failure::Failure;
use crate::robot::{Robot, to_toml};
use crate::{names, speeds, threads};
use numpy::IntoPyArray;
use numpy::ndarray::Array2;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sim::body::attitude::euler_zyx;
use sim::body::closure::Closure;
use sim::step::Solver;
use sim::trial::profile::{Phases, SpeedProfile};
use sim::trial::sample::shapes_at;
use sim::trial::{Checkpoint, Options, Trial};
use std::f64::consts::{PI, TAU};
use std::process::id;
use study::run::model::{DELAY_S, Motors};

/// Longest step, s: no signal is handled within a step.
const LONGEST_STEP_S: f64 = 60.0;

/// Longest time with linear speeds while the motors of a rig start, s.
const PIECE_S: f64 = 0.1;

/// The dynamics between the speeds of a step and the shafts on a rig: a delay, and motors that follow angles.
#[derive(Serialize, Deserialize, Clone, Copy, Default)]
struct Rig {
    motors: Motors,
    /// Speeds of the last step, rad/s.
    target: [f64; 2],
}

/// The state of one robot in its fluid.
#[derive(Clone)]
struct Simulator {
    /// The dynamics of a rig; `None` for ideal motors.
    rig: Option<Rig>,
    trial: Trial,
    /// The speeds of the trial so far, which [`Trial`] does not return.
    profile: SpeedProfile,
    /// Motors' angles at time 0, rad.
    start_rad: [f64; 2],
    /// Measures distances, and restarts trials with its stored inverses.
    solver: Solver,
}

/// Everything that the next steps depend on.
#[derive(Serialize, Deserialize)]
struct Saved {
    made_with: String,
    checkpoint: Checkpoint,
    profile: SpeedProfile,
    start_rad: [f64; 2],
    rig: Option<Rig>,
}

impl Rig {
    /// Returns times and speeds (rad/s) at the ends of the pieces of a step, between which speeds are linear.
    fn pieces(&mut self, from: f64, speeds: [f64; 2], dt: f64) -> Vec<(f64, [f64; 2])> {
        let mut pieces = Vec::new();
        let (mut passed, before) = (0.0, std::mem::replace(&mut self.target, speeds));
        while passed < dt {
            let (target, until) = if passed < DELAY_S { (before, DELAY_S) } else { (speeds, passed + PIECE_S) };
            let until = if self.motors.follow(target) && passed >= DELAY_S { dt } else { until.min(dt) };
            pieces.push((from + until, self.motors.turn(target, until - passed)));
            passed = until;
        }
        pieces
    }
}

impl Simulator {
    fn new(solver: Solver, start_rad: [f64; 2], is_rig: bool) -> Result<Self, Failure> {
        let rig = is_rig.then(Rig::default);
        let profile = SpeedProfile::open(0.0).from_angles(start_rad);
        let trial = Trial::with_solver(solver.clone(), profile.clone(), Options::default())?;
        Ok(Self { rig, trial, profile, start_rad, solver })
    }

    fn reset(&mut self, start_rad: [f64; 2]) -> Result<(), Failure> {
        *self = Self::new(self.trial.solver().clone(), start_rad, self.rig.is_some())?;
        Ok(())
    }

    /// Advances by `dt` seconds. Ideal motors reach their speeds (rpm) as at the start of a trial's run.
    fn step(&mut self, rpm: [f64; 2], dt: f64) -> Result<(), Failure> {
        let from = self.profile.end();
        let speeds = rpm.map(|rpm| rpm * PI / 30.0);
        let ramp = Phases::default().ramp;
        let pieces = match &mut self.rig {
            Some(rig) => rig.pieces(from, speeds, dt),
            None if dt > ramp => vec![(from + ramp, speeds), (from + dt, speeds)],
            None => vec![(from + dt, speeds)],
        };
        for (time, speeds) in pieces {
            self.profile.extend(time, speeds)?;
            self.trial.extend(time, speeds)?;
        }
        self.trial.finish()?;
        Ok(())
    }

    fn save(&self) -> Saved {
        Saved {
            made_with: self.made_with(),
            checkpoint: self.trial.checkpoint(),
            profile: self.profile.clone(),
            start_rad: self.start_rad,
            rig: self.rig,
        }
    }

    /// Returns the properties that another simulator must share to continue from the states of this one.
    fn made_with(&self) -> String {
        let model = self.solver.model();
        format!("{:?}, {}, {}", model.closure, self.rig.is_some(), to_toml(&model.robot))
    }

    fn restore(&mut self, saved: Saved) -> Result<(), Failure> {
        let Saved { made_with, checkpoint, profile, start_rad, rig } = saved;
        if made_with != self.made_with() {
            let reason = "is the state of a simulator with another robot, closure or like_rig; make one with the same";
            return Err(Failure::parameter("saved", reason));
        }
        let mut trial = Trial::with_solver(self.trial.solver().clone(), profile.clone(), Options::default())?;
        trial.restore(checkpoint);
        (self.trial, self.profile, self.start_rad, self.rig) = (trial, profile, start_rad, rig);
        Ok(())
    }

    /// Returns yaw, pitch and roll (degrees) and the angular velocity in body axes (degrees/s).
    fn pose(&self) -> [f64; 6] {
        let body = &self.trial.state().body;
        let [_, pitch, roll] = euler_zyx(&body.attitude);
        [body.yaw, pitch, roll, body.rate.x, body.rate.y, body.rate.z].map(f64::to_degrees)
    }
}

/// Robots of the same parameters, each in a fluid of its own, that are stepped together.
#[pyclass(module = "biflag._biflag")]
pub struct Simulators {
    robot: Py<Robot>,
    simulators: Vec<Simulator>,
    /// The threads, with the process that started them.
    pool: Option<(u32, rayon::ThreadPool)>,
}

#[pymethods]
impl Simulators {
    /// `count` robots at rest, with the delay and the motors of a rig if `rig`; more than one are computed on `threads`
    /// threads, all cores if it is `None`.
    #[new]
    #[pyo3(signature = (robot, count, closure, threads, rig))]
    fn new(robot: Py<Robot>, count: usize, closure: &str, threads: Option<usize>, rig: bool) -> Result<Self, Failure> {
        let closure: Closure = names::closure(closure)?;
        let solver = Solver::new(&robot.get().params, closure)?;
        let simulators = (0..count).map(|_| Simulator::new(solver.clone(), [0.0; 2], rig)).collect::<Result<_, _>>()?;
        let pool = if count > 1 && threads != Some(1) { Some((id(), threads::pool(threads)?)) } else { None };
        Ok(Self { robot, simulators, pool })
    }

    /// Returns the robot.
    #[getter]
    fn robot(&self, py: Python<'_>) -> Py<Robot> {
        self.robot.clone_ref(py)
    }

    /// Puts a robot back to rest at time 0, with its motors at these angles.
    fn reset(&mut self, py: Python<'_>, index: usize, phase_deg: [f64; 2]) -> PyResult<()> {
        if phase_deg.iter().any(|angle| !angle.is_finite()) {
            return Err(Failure::parameter("phase_deg", "must be two finite angles").into());
        }
        let simulator = self.at(index)?;
        Ok(py.detach(|| simulator.reset(phase_deg.map(f64::to_radians)))?)
    }

    /// Advances every robot by `dt` seconds with its row of speeds (rpm). Returns yaw, pitch, roll and rates of each, and the
    /// reason if the solver failed, otherwise empty.
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        speeds: &Bound<'py, PyAny>,
        dt: f64,
    ) -> PyResult<(Bound<'py, PyAny>, Vec<String>)> {
        let pairs = speeds::pairs(speeds)?;
        let (simulators, pool) = (&mut self.simulators, &mut self.pool);
        if pairs.len() != simulators.len() {
            let reason = format!("{} rows for {} robots", pairs.len(), simulators.len());
            return Err(Failure::parameter("speeds", reason).into());
        }
        if !(dt > 0.0 && dt <= LONGEST_STEP_S) {
            let reason = format!("{dt} s must be above 0 and at most {LONGEST_STEP_S} s");
            return Err(Failure::parameter("dt", reason).into());
        }
        let one = |(simulator, rpm): (&mut Simulator, &[f64; 2])| {
            simulator.step(*rpm, dt).map_or_else(|failure| failure.to_string(), |()| String::new())
        };
        if let Some((process, pool)) = pool
            && *process != id()
        {
            // Threads that do not exist after a fork cannot be ended.
            let new = threads::pool(Some(pool.current_num_threads()))?;
            std::mem::forget(std::mem::replace(pool, new));
            *process = id();
        }
        let failures = py.detach(|| match pool {
            Some((_, pool)) => {
                pool.install(|| simulators.par_iter_mut().zip(&pairs).with_max_len(1).map(one).collect())
            }
            None => simulators.iter_mut().zip(&pairs).map(one).collect(),
        });
        py.check_signals()?;
        Ok((self.poses(py)?, failures))
    }

    /// Returns yaw, pitch, roll (degrees) and rates (degrees/s) of each robot.
    fn poses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let poses: Vec<[f64; 6]> = self.simulators.iter().map(Simulator::pose).collect();
        Ok(Array2::from(poses).into_pyarray(py).into_any())
    }

    /// Returns the state of a robot as a dictionary.
    fn state<'py>(&mut self, py: Python<'py>, index: usize) -> PyResult<Bound<'py, PyDict>> {
        let simulator = self.at(index)?;
        let Simulator { trial, solver, start_rad, .. } = simulator;
        let state = trial.state();
        let distance = solver.least_distance(state);
        let robot = &solver.model().robot;
        let gap = distance - 2.0 * robot.flagellum.rod_radius_m;
        let lines = shapes_at(state, state.time, &state.motors, &robot.shaft_feet());
        let body = &state.body;
        let q = body.attitude;
        let [_, pitch, roll] = euler_zyx(&q);
        let forces = trial.at(state.time).map(|at| at.forces).unwrap_or_default();
        let vectors = forces.map(|f| f.smooth + f.contact).map(|v| [v.x, v.y, v.z]);
        let phase = robot.flagellum.phase_deg.map(f64::to_radians);
        let dict = PyDict::new(py);
        dict.set_item("time", state.time)?;
        dict.set_item("yaw", body.yaw.to_degrees())?;
        dict.set_item("pitch", pitch.to_degrees())?;
        dict.set_item("roll", roll.to_degrees())?;
        dict.set_item("attitude", vec![q.w, q.i, q.j, q.k].into_pyarray(py))?;
        dict.set_item("rates", body.rate.iter().map(|rate| rate.to_degrees()).collect::<Vec<_>>().into_pyarray(py))?;
        dict.set_item("speeds", state.motors.map(|m| m.speed * 30.0 / PI).to_vec().into_pyarray(py))?;
        let turns = [0, 1].map(|k| (state.motors[k].angle - phase[k] - start_rad[k]) / TAU);
        dict.set_item("turns", turns.to_vec().into_pyarray(py))?;
        dict.set_item("forces", Array2::from(vectors.to_vec()).into_pyarray(py))?;
        dict.set_item("torques", forces.map(|f| f.smooth_torque + f.contact_torque).to_vec().into_pyarray(py))?;
        dict.set_item("gap", gap)?;
        let nodes = lines.each_ref().map(|line| line.iter().map(|x| [x.x, x.y, x.z]).collect::<Vec<_>>());
        let count = nodes[0].len();
        let flat: Vec<f64> = nodes.into_iter().flatten().flatten().collect();
        let shapes = numpy::ndarray::Array3::from_shape_vec((2, count, 3), flat)
            .map_err(|error| Failure::parameter("shape", error.to_string()))?;
        dict.set_item("shapes", shapes.into_pyarray(py))?;
        Ok(dict)
    }

    /// Returns everything that the next steps of a robot depend on.
    fn save<'py>(&mut self, py: Python<'py>, index: usize) -> PyResult<Bound<'py, PyBytes>> {
        let saved = serde_json::to_vec(&self.at(index)?.save());
        let saved = saved.map_err(|error| Failure::parameter("state", error.to_string()))?;
        Ok(PyBytes::new(py, &saved))
    }

    /// Restores the state that [`Self::save`] returned for a robot with the same parameters. Later steps are the same bit for
    /// bit.
    fn restore(&mut self, index: usize, saved: &[u8]) -> PyResult<()> {
        let saved = serde_json::from_slice(saved)
            .map_err(|error| Failure::parameter("saved", format!("is not a state that `save` returned: {error}")))?;
        Ok(self.at(index)?.restore(saved)?)
    }
}

impl Simulators {
    fn at(&mut self, index: usize) -> Result<&mut Simulator, Failure> {
        let count = self.simulators.len();
        self.simulators.get_mut(index).ok_or_else(|| Failure::parameter("index", format!("{index} of {count} robots")))
    }
}
