//! The keys of a comparison in JSON. The keys of `biflag compare --json` on which other programs rely are flat.

use super::comparison::{AngleComparison, Comparison, Transient};
use serde::{Serialize, Serializer};
use serde_json::{Value, json};

#[derive(Serialize)]
struct Keys<'a> {
    #[serde(flatten, serialize_with = "Comparison::serialize")]
    own: &'a Comparison,
    #[serde(flatten)]
    derived: Value,
}

impl Serialize for Comparison {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let angles @ [yaw, pitch, roll] = &self.angles;
        let uncertainty = |angle: &AngleComparison| angle.uncertainty.map(|uncertainty| uncertainty.total_deg);
        let model_error_deg = match angles.each_ref().map(|angle| angle.model_error_deg) {
            [Some(yaw), Some(pitch), Some(roll)] => Some([yaw, pitch, roll]),
            _ => None,
        };
        let differs = |angle: &&AngleComparison| angle.transient.is_some_and(Transient::differs);
        let derived = json!({
            "yaw_rmse_deg": yaw.rmse_deg,
            "pitch_rmse_deg": pitch.rmse_deg,
            "roll_rmse_deg": roll.rmse_deg,
            "steady_yaw_error_deg": yaw.error_deg,
            "steady_pitch_error_deg": pitch.error_deg,
            "steady_roll_error_deg": roll.error_deg,
            "steady_measured_deg": self.measured_deg(),
            "steady_modelled_deg": self.modelled_deg(),
            "settle_ratio": self.settling.ratio,
            "yaw_uncertainty_deg": uncertainty(yaw),
            "tilt_uncertainty_deg": [uncertainty(pitch), uncertainty(roll)],
            "model_error_deg": model_error_deg,
            "transient_differences": angles.iter().filter(differs).map(|angle| angle.angle).collect::<Vec<_>>(),
            "agrees": self.agrees(),
        });
        Keys { own: self, derived }.serialize(serializer)
    }
}
