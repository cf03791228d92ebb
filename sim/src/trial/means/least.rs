//! Lower bounds of the standard errors, for errors that no stretch of a run shows.

use super::{Level, NO_THRUST, Steady};
use crate::V3;
use crate::functions::hypot;
use std::f64::consts::PI;

/// Standard errors of angles and of forces.
#[derive(Clone, Copy, Debug)]
struct Errors {
    /// Of yaw, pitch and roll, rad.
    angle: f64,
    /// Of forces and torques, as a share of the larger one of both flagella.
    force: f64,
}

/// Standard errors of the solver, whose step errors add up in the slow modes (`sim/docs/steady.md`): for flagella that do not
/// touch, and for flagella that touch.
const FREE: Errors = Errors { angle: 0.045 * PI / 180.0, force: 1e-3 };
const TOUCHING: Errors = Errors { angle: 0.075 * PI / 180.0, force: 2.5e-3 };

/// Time over which errors in contact average out, s. In a shorter period that repeats, steps and contacts fall at the same few
/// angles again and again, and the error of its angles grows with the root of the ratio.
const AVERAGING_S: f64 = 6.0;

/// The motion of flagella that mesh varies over minutes, and changes from one pattern to another. A stretch of this length
/// (s) cannot show this variation and gets these standard errors for it; they fall as the stretch grows, in inverse
/// proportion.
const MESHING_S: f64 = 60.0;
const MESHING: Errors = Errors { angle: 0.2 * PI / 180.0, force: 0.02 };

impl Steady {
    /// Raises the known standard errors to at least those of the solver.
    pub(crate) fn raise_errors(&mut self, touches: bool) {
        let share = (AVERAGING_S / self.window_s).max(1.0).sqrt();
        let least = if touches { Errors { angle: TOUCHING.angle * share, ..TOUCHING } } else { FREE };
        self.change_errors(&least, f64::max);
    }

    /// Adds the variation of meshing flagella that the stretch cannot show to the standard errors, as squares.
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
