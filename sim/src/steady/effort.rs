//! Estimates the cost of a steady state before it is computed, so that a table can begin with the most expensive ones.
//!
//! The fastest of the two motors' speeds and their difference sets the length of a step. Where the flagella touch, a step
//! takes more sweeps and is shorter. They touch most of the time if the thrust of both pushes towards the base. They touch
//! some of the time if only the faster one pushes, or if both pull at similar speeds. `cost.csv` of `biflag sweep` has the
//! processor times of a table: where the factor for contact below is 1.0, 5 or 30, they are 0.06 to 0.23, 0.45 to 0.87 or 1
//! to 28 s for the built-in robots.

use super::period;
use crate::functions::pow;
use crate::groups::Groups;
use crate::params::Robot;
use crate::rod::helix::Handedness;
use std::f64::consts::PI;

/// Speed below which a slower motor no longer lowers the cost, rpm: the time of decay does not depend on the speed.
const SLOW_RPM: f64 = 40.0;
/// Approximate simulated time until a motion without much contact is found, s.
const FOUND_S: f64 = 40.0;
/// Costs of a step with much, some and little contact, relative to a step without contact.
const MUCH: f64 = 30.0;
const SOME: f64 = 5.0;
const LITTLE: f64 = 3.0;
/// The cost of a step grows as this power of the number of edges (`sim/docs/cost.md`).
const EDGES: f64 = 1.37;

/// Returns the estimated cost of a steady state at these speeds (rpm), in arbitrary units: only the order of estimates is
/// meaningful. `solved`: whether the state is solved for, or simulated for all of `longest_s`.
pub fn estimate(robot: &Robot, rpm: [f64; 2], solved: bool, longest_s: f64) -> f64 {
    let pull = [0, 1].map(|k| match robot.flagellum.handedness[k] {
        Handedness::Right => rpm[k],
        Handedness::Left => -rpm[k],
    });
    let [slow, fast] = if pull[0].abs() < pull[1].abs() { pull } else { [pull[1], pull[0]] };
    let contact = if slow < 0.0 && fast < 0.0 {
        MUCH
    } else if fast < 0.0 && slow < -0.5 * fast {
        SOME
    } else if fast > 0.0 && slow > 0.5 * fast && slow != fast {
        LITTLE
    } else {
        1.0
    };
    let has_period = period::common(rpm.map(|rpm| rpm * PI / 30.0)).is_some();
    let is_found = solved && (has_period || contact <= SOME);
    let simulated_s = if is_found { FOUND_S.min(longest_s) } else { longest_s };
    let turns = rpm[0].abs().max(rpm[1].abs()).max((rpm[0] - rpm[1]).abs()).max(SLOW_RPM);
    // Soft flagella bend until they touch.
    let softness = (Groups::of(robot).stiffness / Groups::of(&Robot::published()).stiffness).clamp(1.0, 10.0);
    simulated_s * turns * contact * softness * pow(robot.flagellum.edges() as f64, EDGES)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The order of these points' processor times in the table of a sweep, with a factor of three between neighbours.
    #[test]
    fn dearer_points_are_known_before() {
        let robot = Robot::default();
        let of = |rpm| estimate(&robot, rpm, true, 120.0);
        let order = [[-90.0, -80.0], [-90.0, 0.0], [-90.0, 90.0], [0.0, 45.0]].map(of);
        assert!(order.is_sorted_by(|dear, cheap| dear > cheap), "{order:?}");
        let mut soft = robot.clone();
        soft.flagellum.young_pa /= 4.0;
        assert!(estimate(&soft, [50.0, 10.0], true, 120.0) > 2.0 * of([50.0, 10.0]));
        assert_eq!(of([50.0, 10.0]), estimate(&robot, [50.0, 10.0], true, 600.0), "it is found long before");
        assert_eq!(2.0 * estimate(&robot, [50.0, 10.0], false, 60.0), estimate(&robot, [50.0, 10.0], false, 120.0));
        let mut mirrored = robot.clone();
        mirrored.flagellum.handedness = [Handedness::Left; 2];
        assert_eq!(estimate(&mirrored, [61.4, 23.7], true, 120.0), of([-61.4, -23.7]));
    }
}
