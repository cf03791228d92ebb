//! Simple ratios of the motors' speeds, and phases that slip because a ratio is only nearly simple.

use std::f64::consts::TAU;

/// Largest p + q of a simple ratio. Over six phases the yaw of the published robot, whose flagella touch there, spreads
/// over 0.8 degrees at (60, 90) rpm and over 0.1 at (60, 80)
/// (`biflag simulate` of a plan with these `pairs`, `phases = 6` and a `run` of 120 s).
const SIMPLE: i32 = 5;

/// The same where the flagella touch: over four phases the pitch of the robot `physical` spreads over 0.33 degrees at (84, 63) rpm.
const SIMPLE_TOUCHING: i32 = 8;

/// A beat of fewer turns over a stretch cannot be seen in it: the motion is that of one starting phase.
pub const SLOWEST_BEAT: f64 = 0.08;

/// A slip below this part of a turn is rounding: the phase of an exact ratio does not slip.
const ROUNDING: f64 = 1e-6;

/// Returns the turns of flagellum 1 and 2 in all simple ratios, without a common divisor; the first is not negative.
pub fn ratios() -> impl Iterator<Item = [i32; 2]> {
    ratios_up_to(SIMPLE)
}

/// Returns the ratios with at most this p + q.
fn ratios_up_to(most: i32) -> impl Iterator<Item = [i32; 2]> {
    (0..=most)
        .flat_map(move |p| (p - most..=most - p).map(move |q| [p, q]))
        .filter(|[p, q]| gcd(p.unsigned_abs(), q.unsigned_abs()) == 1 && [*p, *q] != [0, -1])
}

/// Returns by how many turns the phases of all simple ratios slip over a stretch (s) at these speeds (rad/s). `touches`: whether
/// the flagella touch.
pub fn slipped(speeds: [f64; 2], stretch_s: f64, touches: bool) -> impl Iterator<Item = f64> {
    let turns = move |[p, q]: [i32; 2]| (f64::from(q) * speeds[0] - f64::from(p) * speeds[1]).abs() * stretch_s / TAU;
    ratios_up_to(if touches { SIMPLE_TOUCHING } else { SIMPLE }).map(turns)
}

/// Returns whether the ratio of the speeds (rad/s) is nearly simple: the phase slips, but so little over a stretch (s) that
/// its means cover only the phases that have passed and show nothing of the others.
pub fn slips(speeds: [f64; 2], stretch_s: f64, touches: bool) -> bool {
    slipped(speeds, stretch_s, touches).any(|turns| (ROUNDING..SLOWEST_BEAT).contains(&turns))
}

/// Returns the greatest common divisor.
pub fn gcd(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn a_phase_slips_where_a_ratio_is_nearly_simple() {
        let slips_if = |touches: bool, rpm: [f64; 2]| slips(rpm.map(|rpm| rpm * PI / 30.0), 60.0, touches);
        let slips = |rpm: [f64; 2]| slips_if(false, rpm);
        for rpm in [[45.5, -45.53], [60.0, 60.03], [30.01, 60.0], [50.0, 0.01]] {
            assert!(slips(rpm), "{rpm:?}");
        }
        // Exact ratios, and beats that the stretch shows well enough.
        for rpm in [[45.5, -45.5], [20.1, 60.3], [50.0, 0.0], [0.0, 0.0], [45.5, -45.9], [53.3, 37.1]] {
            assert!(!slips(rpm), "{rpm:?}");
        }
        // 4:3 and 7:1 matter only where the flagella touch.
        for rpm in [[84.0, 63.01], [71.3, 10.19]] {
            assert!(slips_if(true, rpm) && !slips(rpm), "{rpm:?}");
        }
        for rpm in [[84.0, 63.0], [84.0, 63.1], [84.0, 9.34]] {
            assert!(!slips_if(true, rpm), "{rpm:?}");
        }
    }
}
