//! The couple of the fluid on a rod that spins about its own centre line.
//!
//! A round rod of radius a that turns about its tangent t with the rate w_t feels the couple -4 pi mu a^2 w_t t a metre (the
//! rotlets of Chwang and Wu 1974, J. Fluid Mech. 63, 607, for a slender body). The material frame turns against the fluid at
//! rest with the rate w_t = d(theta)/dt + t.W: theta is the angle of an edge in its time-parallel frame, W the angular
//! velocity of the shaft's frame (motor and body). The couple enters the torque balance of every edge and so changes the
//! twist; the couple on the clamped edge acts on the clamp. The flow of the rotlets is left out: it is of the same order as
//! other terms that slender-body theory neglects.

use crate::functions::tanh;

/// Smallest drag on changes of the spin in the shaft's frame, as a share of a round rod's. Without drag, twist has no
/// time constant, and no solution exists where it snaps (soft flagella driven against their winding).
pub const LEAST_SPIN_DRAG: f64 = 0.02;

/// Drag on the spin of a rod, N m s a metre and radian.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpinDrag {
    /// On the rotation of the shaft's frame.
    pub frame: f64,
    /// On the spin in the shaft's frame.
    pub change: f64,
}

impl SpinDrag {
    /// Returns a share of the drag of a round rod (N m s a metre and radian).
    pub fn new(round: f64, share: f64) -> Self {
        Self { frame: share * round, change: share.max(LEAST_SPIN_DRAG) * round }
    }

    /// Returns the arc over which a torque twists a rod within a step, m: l of [`SpinDrag::twist_compliance`].
    pub fn twist_reach(&self, twist: f64, kappa: f64) -> f64 {
        (twist / (self.change * kappa)).sqrt()
    }

    /// Returns the twist of a straight rod within a step for a unit torque about its centre line, rad/(N m).
    ///
    /// GJ theta'' = c kappa theta on both sides of the torque, with the drag c on changes: the part up to the clamp resists
    /// with GJ/l coth(s/l), the part to the free end with GJ/l tanh(s/l), l^2 = GJ/(c kappa). `twist`: GJ, N m2; `above` and
    /// `below`: arc up to the clamp and down to the free end, m; `kappa`: first weight of the time formula, 1/s.
    pub fn twist_compliance(&self, twist: f64, above: f64, below: f64, kappa: f64) -> f64 {
        let reach = self.twist_reach(twist, kappa);
        reach / twist / (1.0 / tanh(above / reach) + tanh(below / reach))
    }

    /// Returns the torque of the fluid on an edge about its tangent, N m. `length`: length of the edge, m; `change`: rate of
    /// its angle, rad/s; `frame`: angular velocity of the shaft's frame along the tangent, rad/s.
    #[inline(always)]
    pub fn torque(&self, length: f64, change: f64, frame: f64) -> f64 {
        -self.change * length * change - self.frame * length * frame
    }
}
