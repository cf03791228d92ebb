//! One implicit step of rods, fluid, contact and body together.
//!
//! From top to bottom: time formulas (`formula`), prediction, then sweeps over flagellum 1,
//! flagellum 2 (`flagellum`), contact (`contact_sweep`) and body (`body_solve`) until the
//! velocity residual, the gap law and the body's rate agree; then the checks that let the step count.
//! The flow between the rods and the body's rate are inside the iteration: extrapolating either is
//! unstable at every step.
//!
//! # Where the time goes
//!
//! Shares of the time of (90, 90) rpm without contact, (90, 60) with light contact and (-90, -80), where the
//! flagella mesh; closure `full`, published robot, AVX2.
//!
//! | part | free | light | hard |
//! | --- | --- | --- | --- |
//! | residuals, `Flagellum::update_residual` | 39 % | 31 % | 30 % |
//! | of these and of the answers: flow of far segments, `Targets::add_flow` | 31 % | 25 % | 25 % |
//! | frames and elastic forces, `Flagellum::update_forces` | 14 % | 11 % | 9 % |
//! | products with the frozen inverse, `Flagellum::precondition` | 9 % | 14 % | 12 % |
//! | answers to contact forces, `Flagellum::respond` | 0 % | 5 % | 8 % |
//! | search for close edges, `BroadPhase::search` | 11 % | 7 % | 5 % |
//! | moving the shapes, `Flagellum::apply` | 2 % | 3 % | 4 % |
//! | frozen inverses, `Design::build` | 2 % | 3 % | 1 % |
//!
//! Printed, for one column, by
//! `perf record --call-graph dwarf,4096 -F 997 -e cpu-clock target/release/examples/point 90 90 full 300 0` and
//! `perf report --children --no-inline -g none`; the rest is spread over the sweep itself.

mod accept;
pub mod advance;
mod anderson;
mod body_solve;
mod contact_sweep;
mod dense;
mod flagellum;
pub mod formula;
mod iterate;
mod plan;
mod preconditioner;
mod predict;
mod unknowns;

use crate::V3;
use crate::contact::pairs::{BroadPhase, Lines};
use crate::fluid::{far::Sources, mobility::rotational_resistance};
use crate::params::{ParamError, Robot};
use crate::robot::body::Base;
use crate::robot::clamp::{Motor, Shaft};
use crate::robot::closure::{Closure, Load};
use crate::rod::Rod;
use crate::state::State;
use anderson::Anderson;
use body_solve::BodySolve;
use contact_sweep::{Contacts, Limits};
use flagellum::Flagellum;
use nalgebra::Matrix3;
use plan::Plan;
use preconditioner::{Cache, FluidNumbers, Key, Preconditioner};
use std::sync::Arc;

/// Why a step does not count; a shorter one may.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum StepFailure {
    /// The iteration stopped getting better.
    #[error(
        "the iteration stalled at a velocity residual of {residual:.1e} m/s (wanted {wanted:.1e}), gap error {gap:.1e} m"
    )]
    Stalled {
        /// Velocity residual, m/s.
        residual: f64,
        /// Its bound, m/s.
        wanted: f64,
        /// Error of the contact law, m.
        gap: f64,
    },
    /// A number overflowed.
    #[error("the iteration diverged")]
    Diverged,
    /// The rods went through each other.
    #[error("the rods passed through each other")]
    PassedThrough,
    /// The prediction was farther off than the motion is resolved.
    #[error("the motion is not resolved: error estimate {error:.1e} m (allowed {allowed:.1e})")]
    Unresolved {
        /// Estimated error of the step, m.
        error: f64,
        /// Its bound, m.
        allowed: f64,
    },
    /// The frozen inverse does not exist.
    #[error("the rod's equations are singular")]
    Singular,
}

/// What a step did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepReport {
    /// Sweeps taken.
    pub sweeps: u32,
    /// Last velocity residual before the last update, m/s.
    pub residual: f64,
    /// Estimated error of the nodes, m.
    pub error: f64,
    /// Pairs that press.
    pub touching: u32,
    /// Largest force of a pair, N.
    pub largest_force: f64,
    /// Loads of the fluid on the clamps, body axes.
    pub fluid: [Load; 2],
    /// Loads of contact on the clamps, body axes.
    pub contact: [Load; 2],
    /// Net weight of the flagella, body axes.
    pub weight: [Load; 2],
    /// Rate of change of the base's angular momentum less all moments on it, N m: the iteration's error.
    pub moment_error: f64,
}

/// Solves steps of one robot with one closure. Scratch only: all that matters is in [`State`].
#[derive(Clone, Debug)]
pub struct Solver {
    robot: Robot,
    closure: Closure,
    rods: [Rod; 2],
    feet: [V3; 2],
    base: Base,
    flagella: [Flagellum; 2],
    cache: Cache,
    contacts: Contacts,
    broad: BroadPhase,
    limits: Limits,
    sources: Sources,
    lines: Lines,
    shafts: [Shaft; 2],
    anderson: Anderson,
}

/// Force that the contact stiffness is made for, N.
const CONTACT_FORCE: f64 = 0.5;

impl Solver {
    /// Checks the parameters and prepares the robot.
    pub fn new(robot: &Robot, closure: Closure) -> Result<Self, ParamError> {
        robot.validate()?;
        let edges = robot.flagellum.edges();
        let stiffness = robot.flagellum.stiffness();
        let helix = |k: usize| robot.flagellum.helix(k).nodes(edges);
        let rods = [0, 1].map(|k| Rod::stress_free(helix(k), stiffness).clamped_at_foot());
        Self::with_rods(robot, closure, rods)
    }

    /// The same with flagella of other shapes than the parameters' helices, in their shaft frames; rods
    /// of one handedness must be the same.
    pub fn with_rods(robot: &Robot, closure: Closure, rods: [Rod; 2]) -> Result<Self, ParamError> {
        robot.validate()?;
        let feet = robot.shaft_feet();
        let resistance = match closure {
            Closure::Lumped => pair_resistance(robot, &rods, &feet).ok_or(ParamError {
                key: "flagellum.edge_length_m",
                value: robot.flagellum.edge_length_m,
                reason: "the resistance of the rigid flagella cannot be computed with it".into(),
            })?,
            _ => Matrix3::zeros(),
        };
        let radius = robot.flagellum.rod_radius_m;
        let buckling = rods[0].stiffness.bend_nm2 / robot.flagellum.axial_length_m.powi(2);
        let limits = Limits {
            distance: 2.0 * radius,
            active_gap: radius / 30.0,
            largest_force: 2500.0 * buckling,
            friction: robot.contact.friction,
            slip: robot.contact.slip_speed_m_s,
        };
        let flagella = [Flagellum::new(robot, &rods[0]), Flagellum::new(robot, &rods[1])];
        Ok(Self {
            base: Base::new(robot, closure, resistance),
            broad: BroadPhase::new(&rods, radius),
            lines: [rods[0].shape.clone(), rods[1].shape.clone()],
            robot: robot.clone(),
            closure,
            rods,
            feet,
            flagella,
            cache: Cache::default(),
            contacts: Contacts::default(),
            shafts: [Shaft::new(feet[0], 0.0), Shaft::new(feet[1], 0.0)],
            limits,
            sources: Sources::default(),
            anderson: Anderson::default(),
        })
    }

    /// The state at rest.
    pub fn at_rest(&self) -> State {
        let force = CONTACT_FORCE.min(0.25 * self.limits.largest_force);
        State::at_rest(&self.rods, force / (0.5 * self.robot.contact.tolerance_m))
    }

    /// The robot.
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// The closure.
    pub fn closure(&self) -> Closure {
        self.closure
    }

    /// The rods at rest.
    pub fn rods(&self) -> &[Rod; 2] {
        &self.rods
    }

    /// Frozen inverses built so far.
    pub fn inverses_built(&self) -> usize {
        self.cache.built
    }

    /// Nodes of both flagella in the body frame, m.
    pub fn lines(&self, state: &State) -> Lines {
        [0, 1].map(|k| {
            let shaft = Shaft::new(self.feet[k], state.motors[k].angle);
            state.rods[k].shape.nodes.iter().map(|x| shaft.point_to_body(*x)).collect()
        })
    }

    /// Least distance of the two centre lines, m.
    pub fn least_distance(&mut self, state: &State) -> f64 {
        let lines = self.lines(state);
        self.broad.least_distance(&lines).0
    }

    /// Net weight of a flagellum in body axes, moment about the joint; `down`: body axes.
    fn weight_load(&self, plan: &Plan, down: V3, k: usize) -> Load {
        let mut load = Load::default();
        for (x, length) in self.flagella[k].shape.nodes.iter().zip(&self.rods[k].nodal_length) {
            let force = down * (self.robot.net_weight() * length);
            load.force += force;
            load.moment += plan.shafts[k].point_to_body(*x).cross(&force);
        }
        load
    }

    /// Advances the state by `step` seconds, with the motors at `motors` in the end.
    ///
    /// `own_inverse`: with an inverse built at the predicted shape, dear but good where rods are about to
    /// buckle. On failure the state is as it was.
    pub fn step(
        &mut self,
        state: &mut State,
        step: f64,
        motors: [Motor; 2],
        own_inverse: bool,
    ) -> Result<StepReport, StepFailure> {
        let plan = Plan::new(self, state, step, motors);
        self.shafts = plan.shafts;
        self.predict(state, &plan);
        let inverses = if own_inverse { self.own_inverses(state, &plan) } else { self.inverses(&plan) };
        let inverses = inverses.ok_or(StepFailure::Singular)?;
        let mut body = BodySolve::new(state, &plan.body_weights, &plan.body_prediction, step);
        let (report, predicted) = self.iterate(state, &plan, &inverses, &mut body)?;
        self.accept(state, &plan, body, report, predicted)
    }

    fn fluid(&self) -> FluidNumbers {
        FluidNumbers {
            epsilon: self.robot.epsilon(),
            viscosity: self.robot.fluid.viscosity(),
            spin_drag: self.robot.spin_drag(),
        }
    }

    /// Frozen inverses of the stress-free shape.
    fn inverses(&mut self, plan: &Plan) -> Option<[Arc<Preconditioner>; 2]> {
        let fluid = self.fluid();
        let handedness = self.robot.flagellum.handedness;
        let mut find = |k: usize| {
            let design = if handedness[k] == handedness[0] { 0 } else { k };
            let key = Key::new(design, plan.kappa[k], plan.motors[k].speed);
            self.cache.find(key, &self.rods[k], fluid)
        };
        Some([find(0)?, find(1)?])
    }

    /// Inverses at the predicted shapes, for this step alone.
    fn own_inverses(&mut self, state: &State, plan: &Plan) -> Option<[Arc<Preconditioner>; 2]> {
        let fluid = self.fluid();
        let down = self.down(&state.body);
        let mut build = |k: usize| {
            self.update_forces(state, plan, down, k);
            let flagellum = &self.flagella[k];
            let time = (plan.kappa[k], plan.motors[k].speed);
            Preconditioner::at_shape(&self.rods[k], &flagellum.shape, &flagellum.frames, time, fluid).map(Arc::new)
        };
        Some([build(0)?, build(1)?])
    }
}

/// Rotational resistance about the joint of both rigid flagella, N m s: the mean over motor angles.
fn pair_resistance(robot: &Robot, rods: &[Rod; 2], feet: &[V3; 2]) -> Option<Matrix3<f64>> {
    let mut mean = Matrix3::zeros();
    let angles = [0.0, 0.5, 1.0, 1.5].map(|turns| turns * std::f64::consts::PI);
    for angle in angles {
        let lines = [0, 1].map(|k| -> Vec<V3> {
            let shaft = Shaft::new(feet[k], angle);
            rods[k].shape.iter().map(|x| shaft.point_to_body(*x)).collect()
        });
        let views = [lines[0].as_slice(), lines[1].as_slice()];
        let (epsilon, viscosity) = (robot.epsilon(), robot.fluid.viscosity());
        mean += rotational_resistance(&views, V3::zeros(), epsilon, viscosity)? / angles.len() as f64;
    }
    Some(0.5 * (mean + mean.transpose()))
}
