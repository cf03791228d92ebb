//! The frozen inverses: the shapes at which they are built, and which inverses are kept.
//!
//! An inverse in the frames of [`super::corotated`] stays useful for a rod that has turned and bent since, within
//! limits: the equations of a buckled soft flagellum differ from those of its helix at rest. So
//! [`State`](crate::step::state::State) has the shapes about which the equations are linearised: the shapes at rest,
//! until a step without contact needs many sweeps, and then the shapes of that step. A step that fails is tried again
//! with the shapes predicted for its end. An inverse depends only on these shapes and its [`Key`], so a restored state
//! continues bit for bit.
//!
//! Inverses at rest serve for hundreds of steps and are dense; solvers of equal flagella may share them
//! ([`InversesAtRest`]). Free motion also changes to dense inverses, at its present shapes, after its steps have needed
//! one sweep too many for a long time: drag on the spin bends and twists the flagella far from rest, and they keep that
//! shape. Inverses at other shapes are used for few steps, so their construction must be cheap: they stay factors in
//! single precision, of equations with a coarser mobility. `cargo bench -p sim --bench trials -- soft` prints how many
//! of these inverses soft flagella need, and `sim/docs/cost.md` has its table. The mean cost since the last new shapes
//! decides, not the number of sweeps alone. New shapes do not help if contact causes the many sweeps.

use super::key::Key;
use super::model::Model;
use super::preconditioner::{Equations, FluidParams, Preconditioner, Use};
use super::rest::{InversesAtRest, Rest};
use super::state::RodState;
use super::time_step::TimeStep;
use crate::rod::Rod;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Inverses kept for one shape; a ramp visits many keys, a steady trial two to ten.
const KEPT: usize = 24;
/// Cost of new shapes, in sweeps. New shapes save more than they cost if the present step has more sweeps than the
/// average since the last new shapes, with their cost included.
const RENEWAL_SWEEPS: u64 = 30;
/// Least number of sweeps for new shapes: contact and the base need some sweeps with any inverse.
const MANY_SWEEPS: u64 = 8;

/// Half sweeps of a step of free motion without excess: a moving base takes two sweeps, and some steps three.
const ENOUGH: u64 = 5;
/// Excess after which free motion gets new shapes, in half sweeps: about the cost of a few dense inverses.
const LARGEST_EXCESS: u64 = 300;

/// The shapes about which the equations of both rods are linearised, and the cost of the steps with them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Linearisation {
    rods: [RodState; 2],
    /// Steps taken with them.
    steps: u64,
    /// Sweeps taken with them, and [`RENEWAL_SWEEPS`].
    sweeps: u64,
    /// Half sweeps above [`ENOUGH`] since the last contact; it falls in steps with fewer.
    excess: u64,
    /// Number of successive times that an excess has led to new shapes. Each time it must be twice as large, as new shapes
    /// may not help.
    renewals: u32,
}

impl Linearisation {
    /// Returns a linearisation about these shapes.
    pub fn new(rods: [RodState; 2]) -> Self {
        Self { rods, steps: 0, sweeps: RENEWAL_SWEEPS, excess: 0, renewals: 0 }
    }

    /// Records a step that ended with the shapes `rods`. In free motion (`free`), changes to these shapes after a step
    /// with many sweeps, or after many steps with slightly too many.
    pub fn record(&mut self, sweeps: u32, free: bool, rods: &[RodState; 2]) {
        let sweeps = u64::from(sweeps);
        self.steps += 1;
        self.sweeps += sweeps;
        if free && sweeps >= MANY_SWEEPS && sweeps * self.steps > self.sweeps {
            *self = Self::new(rods.clone());
        }
        self.excess = if free { (self.excess + 2 * sweeps).saturating_sub(ENOUGH) } else { 0 };
        if self.excess > LARGEST_EXCESS << self.renewals {
            *self = Self { renewals: self.renewals + 1, ..Self::new(rods.clone()) };
        }
    }
}

/// Inverses for one shape of a rod, oldest first.
#[derive(Clone, Debug)]
struct Kept {
    at: RodState,
    source: Source,
    inverses: Vec<(Key, Arc<Preconditioner>)>,
}

/// The source of the inverses for a shape.
#[derive(Clone, Debug)]
enum Source {
    /// The shape at rest.
    Rest(Arc<Rest>),
    /// Another shape.
    Own(Box<Equations>),
}

impl Source {
    fn new(rod: &Rod, at: &RodState, fluid: FluidParams, lasting: bool, at_rest: &InversesAtRest) -> Self {
        if at.shape.nodes == rod.shape {
            return Self::Rest(at_rest.of(rod, at, fluid));
        }
        let wanted = if lasting { Use::Lasting } else { Use::Passing };
        Self::Own(Box::new(Equations::new(rod, at, fluid, wanted)))
    }

    fn inverse(&self, rod: &Rod, key: Key) -> Option<Arc<Preconditioner>> {
        match self {
            Self::Rest(rest) => rest.inverse(key),
            Self::Own(equations) => key.invert(equations, rod).map(Arc::new),
        }
    }
}

/// Inverses of both rods for the present shapes.
#[derive(Clone, Debug)]
pub struct Cache {
    at_rest: InversesAtRest,
    rods: [Option<Kept>; 2],
    /// Inverses used so far.
    pub used: usize,
}

impl Cache {
    /// Returns a cache without inverses of its own.
    pub fn new(at_rest: InversesAtRest) -> Self {
        Self { at_rest, rods: [None, None], used: 0 }
    }

    /// Returns the inverses of both rods for a step; `None` when a matrix is singular.
    pub fn find(&mut self, about: &Linearisation, model: &Model, step: &TimeStep) -> Option<[Arc<Preconditioner>; 2]> {
        let hands = model.robot.flagellum.handedness;
        // Equal rods of equal shape share their inverses.
        let shared = hands[0] == hands[1] && about.rods[0] == about.rods[1];
        let mut find = |k: usize| {
            let slot = if shared { 0 } else { k };
            let key = Key::new(step.kappa(k), step.motors[k].speed);
            self.find_one(slot, &about.rods[k], about.renewals > 0, key, &model.rods[k], FluidParams::new(&model.robot))
        };
        Some([find(0)?, find(1)?])
    }

    fn find_one(
        &mut self,
        slot: usize,
        at: &RodState,
        lasting: bool,
        key: Key,
        rod: &Rod,
        fluid: FluidParams,
    ) -> Option<Arc<Preconditioner>> {
        if self.rods[slot].as_ref().is_none_or(|kept| kept.at != *at) {
            let source = Source::new(rod, at, fluid, lasting, &self.at_rest);
            self.rods[slot] = Some(Kept { at: at.clone(), source, inverses: Vec::new() });
        }
        let kept = self.rods[slot].as_mut()?;
        if let Some((_, known)) = kept.inverses.iter().find(|(k, _)| *k == key) {
            return Some(known.clone());
        }
        let inverse = kept.source.inverse(rod, key)?;
        self.used += 1;
        if kept.inverses.len() == KEPT {
            kept.inverses.remove(0);
        }
        kept.inverses.push((key, inverse.clone()));
        Some(inverse)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::Robot;
    use crate::step::state::State;

    fn at_rest() -> State {
        let robot = Robot::default();
        let edges = robot.flagellum.edges();
        let rods = [0, 1].map(|k| {
            Rod::stress_free(robot.flagellum.helix(k).nodes(edges), robot.flagellum.stiffness()).clamped_at_foot()
        });
        State::at_rest(&rods, 1.0)
    }

    /// Returns the steps, of 3000 with `sweeps`, after which new shapes are chosen.
    fn renewals(sweeps: impl Fn(u32) -> u32, free: bool) -> Vec<u32> {
        let mut state = at_rest();
        for rod in &mut state.rods {
            rod.shape.angles[1] = 0.1;
        }
        let mut renewals = 0;
        let mut steps = Vec::new();
        for step in 0..3000 {
            state.linearisation.record(sweeps(step), free, &state.rods);
            if state.linearisation.renewals != renewals {
                renewals = state.linearisation.renewals;
                assert_eq!(state.linearisation.rods, state.rods);
                steps.push(step);
            }
        }
        steps
    }

    #[test]
    fn free_motion_with_a_sweep_too_many_gets_new_shapes_ever_more_rarely() {
        let steps = renewals(|_| 3, true);
        let waits: Vec<u32> = steps.windows(2).map(|s| s[1] - s[0]).collect();
        assert_eq!((steps[0], waits), (300, vec![601, 1201]));
    }

    #[test]
    fn shapes_stay_about_contact_and_where_few_steps_need_more_sweeps() {
        assert!(renewals(|_| 4, false).is_empty());
        assert!(renewals(|step| 2 + step % 2, true).is_empty());
    }
}
