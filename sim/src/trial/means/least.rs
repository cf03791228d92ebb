//! Least standard errors: what no stretch of a run shows.

use super::{Level, NO_THRUST, Steady};
use crate::V3;
use crate::functions::hypot;
use std::f64::consts::PI;

/// Standard errors that belong to each other.
#[derive(Clone, Copy, Debug)]
struct Errors {
    /// Of yaw, pitch and roll, rad.
    angle: f64,
    /// Of forces and torques, as a share of the larger one of both flagella.
    force: f64,
}

/// Those of the solver, which adds up in the slow modes what every step misses (`sim/docs/steady.md`): of a motion in which the
/// flagella do not touch, and of one in which they do.
const FREE: Errors = Errors { angle: 0.045 * PI / 180.0, force: 1e-3 };
const TOUCHING: Errors = Errors { angle: 0.075 * PI / 180.0, force: 2.5e-3 };

/// Flagella that mesh move in ways that vary over minutes, and from one way to another. What a stretch of this length (s) cannot
/// show of it has these errors at least; one of a longer stretch is less by their ratio.
const MESHING_S: f64 = 60.0;
const MESHING: Errors = Errors { angle: 0.2 * PI / 180.0, force: 0.02 };

impl Steady {
    /// Raises the standard errors that are known to those of the solver.
    pub(crate) fn raise_errors(&mut self, touches: bool) {
        let least = if touches { TOUCHING } else { FREE };
        self.change_errors(&least, f64::max);
    }

    /// Adds to the standard errors what the stretch cannot show of flagella that mesh.
    pub(super) fn add_errors_of_meshing(&mut self) {
        let share = MESHING_S / self.window_s;
        self.change_errors(&Errors { angle: MESHING.angle * share, force: MESHING.force * share }, hypot);
    }

    fn change_errors(&mut self, errors: &Errors, change: fn(f64, f64) -> f64) {
        let change = |levels: &mut [Level], by: f64| {
            levels.iter_mut().filter_map(|level| level.standard_error.as_mut()).for_each(|e| *e = change(*e, by));
        };
        let larger = |[one, two]: [f64; 2]| errors.force * one.max(two);
        let of_force = larger(self.force.map(|force| V3::from(force.map(|level| level.mean)).norm().max(NO_THRUST)));
        let of_torque = larger(self.axial_torque.map(|level| level.mean.abs()));
        change(&mut self.attitude, errors.angle);
        change(self.force.as_flattened_mut(), of_force);
        change(&mut self.axial_torque, of_torque);
    }
}
