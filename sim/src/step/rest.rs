//! Inverses at rest, which solvers of equal flagella may share.
//!
//! The trials of a map are trials of one robot, and a short trial or a search for a steady state spends a tenth of its
//! time on inverses at rest. They depend on the flagellum, the fluid and their [`Key`] alone, so results are the same
//! whichever trial built them. A program with many trials has one [`InversesAtRest`] for all of them.

use super::key::Key;
use super::preconditioner::{Equations, FluidParams, Preconditioner, Use};
use super::state::RodState;
use crate::rod::Rod;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Flagella whose inverses are kept after their last solver: two for each of two robots.
const FLAGELLA: usize = 4;
/// Inverses kept for one flagellum: the published map needs 55.
const KEPT: usize = 64;
/// Largest number of nodes of a shared flagellum. With more nodes, inverses take too much memory (0.4 MB each for 80
/// nodes).
const LARGEST: usize = 80;

/// The last flagella, the latest one first. A clone is the same list, also on another thread.
#[derive(Clone, Debug, Default)]
pub struct InversesAtRest(Arc<Mutex<Vec<Arc<Rest>>>>);

/// A flagellum at rest, with its inverses.
#[derive(Debug)]
pub struct Rest {
    rod: Rod,
    fluid: FluidParams,
    at: RodState,
    equations: Equations,
    inverses: Mutex<Vec<(Key, Arc<Preconditioner>)>>,
}

impl InversesAtRest {
    /// Returns the inverses of a rod in this state, at rest. Equal rods share them.
    pub(super) fn of(&self, rod: &Rod, at: &RodState, fluid: FluidParams) -> Arc<Rest> {
        let same = |rest: &Arc<Rest>| rest.rod == *rod && rest.fluid == fluid && rest.at == *at;
        let known = |all: &mut Vec<Arc<Rest>>| {
            let rest = all.remove(all.iter().position(same)?);
            all.insert(0, rest.clone());
            Some(rest)
        };
        if let Some(rest) = known(&mut lock(&self.0)) {
            return rest;
        }
        // Built without the lock, so another thread may finish first.
        let equations = Equations::new(rod, at, fluid, Use::Lasting);
        let rest = Arc::new(Rest { rod: rod.clone(), fluid, at: at.clone(), equations, inverses: Mutex::default() });
        if rod.nodes() > LARGEST {
            return rest;
        }
        let mut all = lock(&self.0);
        known(&mut all).unwrap_or_else(|| {
            all.insert(0, rest.clone());
            all.truncate(FLAGELLA);
            rest
        })
    }
}

impl Rest {
    /// Returns an inverse; `None` if its matrix is singular.
    pub fn inverse(&self, key: Key) -> Option<Arc<Preconditioner>> {
        type Inverses = [(Key, Arc<Preconditioner>)];
        let known = |all: &Inverses| all.iter().find(|(k, _)| *k == key).map(|(_, inverse)| inverse.clone());
        if let Some(inverse) = known(&lock(&self.inverses)) {
            return Some(inverse);
        }
        // Built without the lock, so another thread may finish first.
        let inverse = Arc::new(key.invert(&self.equations, &self.rod)?);
        if self.rod.nodes() > LARGEST {
            return Some(inverse);
        }
        let mut all = lock(&self.inverses);
        Some(known(&all).unwrap_or_else(|| {
            if all.len() == KEPT {
                all.remove(0);
            }
            all.push((key, inverse.clone()));
            inverse
        }))
    }
}

/// Locks a mutex, also after a panic of another thread: its contents are consistent at any time.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::Robot;
    use crate::step::state::State;

    fn rest(shared: &InversesAtRest, robot: &Robot) -> Arc<Rest> {
        let rods = [0, 1].map(|k| {
            let nodes = robot.flagellum.helix(k).nodes(robot.flagellum.edges());
            Rod::stress_free(nodes, robot.flagellum.stiffness()).clamped_at_foot()
        });
        let state = State::at_rest(&rods, 1.0);
        shared.of(&rods[0], &state.rods[0], FluidParams::new(robot))
    }

    #[test]
    fn equal_robots_share_their_inverses_and_others_do_not() {
        let robot = Robot::default();
        let shared = InversesAtRest::default();
        let rest = |robot: &Robot| rest(&shared.clone(), robot);
        let one = rest(&robot);
        let key = Key::new(10.0, 3.0);
        let inverse = one.inverse(key).expect("regular");
        assert!(Arc::ptr_eq(&inverse, &one.inverse(key).expect("regular")));
        assert!(!Arc::ptr_eq(&inverse, &one.inverse(Key::new(10.0, 9.0)).expect("regular")));
        assert!(Arc::ptr_eq(&one, &rest(&robot)));
        let mut other = robot.clone();
        other.flagellum.pitch_m *= 1.001;
        assert!(!Arc::ptr_eq(&one, &rest(&other)));
        other = robot.clone();
        other.fluid.viscosity_pa_s *= 1.001;
        assert!(!Arc::ptr_eq(&one, &rest(&other)));
        let mut large = robot.clone();
        large.flagellum.edge_length_m *= 0.3;
        let one = rest(&large);
        assert!(one.rod.nodes() > LARGEST && !Arc::ptr_eq(&one, &rest(&large)), "{} nodes", one.rod.nodes());
        for i in 0..2 * FLAGELLA {
            other.fluid.viscosity_pa_s = 0.8 + 1e-3 * i as f64;
            rest(&other);
        }
        assert!(lock(&shared.0).len() <= FLAGELLA);
    }
}
