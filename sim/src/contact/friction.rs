//! Friction of contacts: Coulomb's law, smoothed at sticking.
//!
//! Tong et al. 2023 scale the friction mu lambda by 2/(1 + exp(-15 v/v_slip)) - 1 with the sliding
//! speed v. As for contact itself the solver takes the piecewise linear law with the same slope and
//! limits: the force opposes the sliding velocity, grows in proportion to it up to `slip` and is
//! mu lambda beyond.

use crate::V3;

/// Friction on the first body for its sliding velocity relative to the second, m/s; N.
///
/// `limit` = mu lambda in N, `slip` in m/s.
pub fn force(velocity: V3, limit: f64, slip: f64) -> V3 {
    let speed = velocity.norm();
    if speed <= slip { velocity * (-limit / slip) } else { velocity * (-limit / speed) }
}

/// The force after `answer` (m/s per N, the velocity's change for a unit force) has acted.
///
/// Solves v = `free` + answer f and f = `force`(v) for a scalar answer; `free` is the velocity without friction.
pub fn implicit_force(free: V3, answer: f64, limit: f64, slip: f64) -> V3 {
    let speed = free.norm();
    if limit <= 0.0 || speed == 0.0 {
        return V3::zeros();
    }
    let sticking = speed / (slip / limit + answer);
    free * (-sticking.min(limit) / speed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn implicit_force_satisfies_the_law() {
        for speed in [1e-6, 1e-4, 3e-4, 1e-2] {
            let free = V3::new(speed, 0.0, 0.0);
            let (answer, limit, slip) = (0.5, 3e-4, 1e-4);
            let f = implicit_force(free, answer, limit, slip);
            assert!((f - force(free + f * answer, limit, slip)).norm() < 1e-12, "{speed}");
        }
    }
}
