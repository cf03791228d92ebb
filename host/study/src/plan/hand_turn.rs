//! A turn of the sensor by hand through a known angle, which checks the gyroscope's scale.

use serde::Deserialize;

/// Tolerance of the gyroscope's scale, per cent (data sheet PS-MPU-6000A, section 6.1).
const TOLERANCE_PERCENT: f64 = 3.0;

/// An axis of the body.
#[derive(Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// From motor 2 to motor 1.
    X,
    /// From z to x.
    Y,
    /// Up.
    Z,
}

/// The turn that the user makes during the run.
#[derive(Deserialize, Clone, Copy, PartialEq, Debug)]
#[serde(deny_unknown_fields)]
pub struct HandTurn {
    /// The axis.
    pub axis: Axis,
    /// The angle.
    pub degrees: f64,
}

impl HandTurn {
    /// Compares the measured turns about the body's axes with the true turn. Returns a sentence, and whether they agree
    /// within the sensor's tolerance.
    pub fn verdict(&self, turned_deg: [f64; 3]) -> (String, bool) {
        let axis = self.axis as usize;
        let name = ["x", "y", "z"][axis];
        let measured = turned_deg[axis];
        let error_percent = 100.0 * (measured / self.degrees - 1.0);
        let agrees = error_percent.abs() <= TOLERANCE_PERCENT;
        let verdict = if agrees { "within" } else { "NOT within" };
        let (degrees, error) = (self.degrees, crate::text::signed(error_percent, 1));
        let text = format!(
            "turned {measured:.1} of {degrees}° about {name} ({error} %), {verdict} the sensor's \
             ±{TOLERANCE_PERCENT} %"
        );
        (text, agrees)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_is_judged_by_the_tolerance_of_the_sensor() {
        let turn = HandTurn { axis: Axis::Z, degrees: 720.0 };
        let (text, agrees) = turn.verdict([1.0, 2.0, 705.2]);
        assert_eq!(text, "turned 705.2 of 720° about z (-2.1 %), within the sensor's ±3 %");
        assert!(agrees);
        assert!(!turn.verdict([720.0, 720.0, 695.0]).1 && !turn.verdict([0.0, 0.0, -720.0]).1);
    }
}
