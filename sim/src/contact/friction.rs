//! Friction of contacts: Coulomb's law, smoothed where it sticks.
//!
//! Tong et al. 2023 scale the friction mu lambda by 2/(1 + exp(-15 v/v_slip)) - 1 with the sliding
//! speed v of the surfaces. The solver takes the piecewise linear law with the same slope and limits: the force f(v)
//! opposes the sliding velocity, grows in proportion to it up to `slip`, and is mu lambda beyond.
//!
//! A rod's surface moves with v + w x r: v is the velocity of its centre line, w the angular velocity of its cross-sections,
//! spin included, r the arm from the centre line to the contact. So the force has a couple r x f about each centre line,
//! [`Pair::couple`](super::pairs::Pair::couple), which twists and bends the rods. The change of the friction forces in a
//! sweep counts as one of the sweep's errors.
//!
//! Some steps with friction cannot be solved: soft flagella that unwrap when one motor reverses stick and snap. With a
//! coefficient of 0.1 or more the trial then fails; with 0.05 it succeeds. Flagella that mesh, with both speeds negative,
//! succeed with 0.3.

use crate::V3;

/// Returns the friction on the first body (N) after it has changed the sliding velocity.
///
/// Solves v = `free` + `compliance` f and f = f(v). `free`: sliding velocity relative to the second body without
/// friction, m/s; `compliance`: change of the velocity for a unit force, m/s per N, a scalar; `limit` = mu lambda, N;
/// `slip`: sliding speed below which contacts stick, m/s.
pub fn implicit_force(free: V3, compliance: f64, limit: f64, slip: f64) -> V3 {
    let speed = free.norm();
    if limit <= 0.0 || speed == 0.0 {
        return V3::zeros();
    }
    let sticking = speed / (slip / limit + compliance);
    free * (-sticking.min(limit) / speed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn implicit_force_satisfies_the_law() {
        for speed in [1e-6, 1e-4, 3e-4, 1e-2] {
            let free = V3::new(speed, 0.0, 0.0);
            let (compliance, limit, slip) = (0.5, 3e-4, 1e-4);
            let f = implicit_force(free, compliance, limit, slip);
            let velocity = free + f * compliance;
            let law = velocity * (-limit / velocity.norm().max(slip));
            assert!((f - law).norm() < 1e-12, "{speed}");
        }
    }
}
