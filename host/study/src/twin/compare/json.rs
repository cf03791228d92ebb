//! The keys of a comparison in JSON. The keys of `biflag compare --json` on which other programs rely are flat.

use super::comparison::{AngleComparison, Comparison, Difference, Settling, Transient};
use super::sides::Sides;
use crate::trial::{AngleTerm, LogFinding};
use serde::{Serialize, Serializer};
use std::path::Path;

#[derive(Serialize)]
struct Keys<'a> {
    name: &'a str,
    w1_rpm: f64,
    w2_rpm: f64,
    #[serde(serialize_with = "crate::text::path")]
    measured: &'a Path,
    #[serde(serialize_with = "crate::text::path")]
    modelled: &'a Path,
    yaw_rmse_deg: f64,
    pitch_rmse_deg: f64,
    roll_rmse_deg: f64,
    compared_share: f64,
    steady_yaw_error_deg: f64,
    steady_pitch_error_deg: f64,
    steady_roll_error_deg: f64,
    steady_measured_deg: [f64; 3],
    steady_modelled_deg: [f64; 3],
    settle_ratio: Option<f64>,
    settling: Settling,
    yaw_uncertainty_deg: Option<f64>,
    tilt_uncertainty_deg: [Option<f64>; 2],
    model_error_deg: Option<[f64; 3]>,
    angles: [&'a AngleComparison; 3],
    budget: &'a [AngleTerm],
    yaw_drift_deg: f64,
    measured_zero_deg: [f64; 3],
    modelled_zero_deg: [f64; 3],
    time_shift_s: f64,
    run_start_s: [f64; 2],
    differences: &'a [Difference],
    /// Angles whose transients differ; `settling` states whether the settling times differ.
    transient_differences: Vec<&'static str>,
    agrees: bool,
    beyond_chance: bool,
    findings: &'a [LogFinding],
    sides: Sides,
    origin: [&'static str; 2],
    verdict: &'a str,
    warnings: &'a [String],
}

impl Serialize for Comparison {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self { yaw, pitch, roll, .. } = self;
        let angles = self.angles();
        let uncertainty = |angle: &AngleComparison| angle.uncertainty.map(|uncertainty| uncertainty.total_deg);
        let model_error_deg = match angles.map(|angle| angle.model_error_deg) {
            [Some(yaw), Some(pitch), Some(roll)] => Some([yaw, pitch, roll]),
            _ => None,
        };
        let transient = |angle: &&&AngleComparison| angle.transient.is_some_and(Transient::differs);
        let keys = Keys {
            name: &self.name,
            w1_rpm: self.w1_rpm,
            w2_rpm: self.w2_rpm,
            measured: &self.measured,
            modelled: &self.modelled,
            yaw_rmse_deg: yaw.rmse_deg,
            pitch_rmse_deg: pitch.rmse_deg,
            roll_rmse_deg: roll.rmse_deg,
            compared_share: self.compared_share,
            steady_yaw_error_deg: yaw.error_deg,
            steady_pitch_error_deg: pitch.error_deg,
            steady_roll_error_deg: roll.error_deg,
            steady_measured_deg: angles.map(|angle| angle.measured_deg),
            steady_modelled_deg: angles.map(|angle| angle.modelled_deg),
            settle_ratio: self.settling.ratio,
            settling: self.settling,
            yaw_uncertainty_deg: uncertainty(yaw),
            tilt_uncertainty_deg: [uncertainty(pitch), uncertainty(roll)],
            model_error_deg,
            transient_differences: angles.iter().filter(transient).map(|angle| angle.angle).collect(),
            angles,
            budget: &self.budget,
            yaw_drift_deg: self.yaw_drift_deg,
            measured_zero_deg: self.measured_zero_deg,
            modelled_zero_deg: self.modelled_zero_deg,
            time_shift_s: self.time_shift_s,
            run_start_s: self.run_start_s,
            differences: &self.differences,
            agrees: self.agrees(),
            beyond_chance: self.is_beyond_chance,
            findings: &self.findings,
            sides: self.sides,
            origin: self.origin,
            verdict: &self.verdict,
            warnings: &self.warnings,
        };
        keys.serialize(serializer)
    }
}
