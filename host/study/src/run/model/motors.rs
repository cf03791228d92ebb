//! The rig's motors in the model. They follow the angles of their targets.

use serde::{Deserialize, Serialize};
use sim::functions::exp;

/// Time for which a motor falls behind after its target speed jumps, s. Then it turns faster than the target until it
/// has caught up, because the board's motors follow an angle. On the emulated board, flagella that start to 50 rpm fall
/// behind for 0.35 s, and flagella that start to 10 rpm for 0.27 s.
pub const MOTOR_S: f64 = 0.33;

/// A motor follows its target if its speed differs by less than this, rad/s: a hundredth of a turn in a minute.
const FOLLOWS: f64 = 1e-3;

/// The motors of both flagella.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Default, Debug)]
pub struct Motors {
    /// Speeds of the shafts, rad/s.
    speeds: [f64; 2],
    /// Angles by which the shafts lag behind their targets, rad.
    behind: [f64; 2],
}

impl Motors {
    /// Turns towards speeds (rad/s) for some time, at most 0.1 s, with speeds that change linearly. Returns the speeds
    /// at the end, rad/s.
    ///
    /// A shaft follows the angle of its target with critical damping: its lag e obeys e'' + 2 e'/T + e/T² = 0 while the
    /// target is constant.
    pub fn turn(&mut self, target: [f64; 2], passed_s: f64) -> [f64; 2] {
        let left = exp(-passed_s / MOTOR_S);
        for ((speed, behind), target) in self.speeds.iter_mut().zip(&mut self.behind).zip(target) {
            let before = *speed;
            let slower = target - before;
            let share = (slower + *behind / MOTOR_S) * passed_s / MOTOR_S;
            *speed = target - (slower - share) * left;
            // Integrates the lag with linear speeds.
            *behind += (target - 0.5 * (before + *speed)) * passed_s;
        }
        self.speeds
    }

    /// Returns whether the motors have the speeds (rad/s) and the angles of their targets.
    pub fn follow(&self, target: [f64; 2]) -> bool {
        (0..2).all(|k| (target[k] - self.speeds[k]).abs().max(self.behind[k].abs() / MOTOR_S) < FOLLOWS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motors_make_up_for_their_start() {
        let (mut motors, target) = (Motors::default(), [5.0, -1.3]);
        let mut angles = [0.0; 2];
        let mut speeds = [0.0; 2];
        for _ in 0..80 {
            assert!(!motors.follow([5.1, -1.3]));
            let after = motors.turn(target, 0.05);
            (0..2).for_each(|k| angles[k] += 0.5 * (speeds[k] + after[k]) * 0.05);
            speeds = after;
        }
        assert!(motors.follow(target), "{motors:?}");
        assert!((0..2).all(|k| (angles[k] - 4.0 * target[k]).abs() < 1e-3), "{angles:?}");
    }
}
