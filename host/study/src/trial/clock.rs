//! The rate error of the board's clock, by which the board integrates too long or too short.

use super::data::Data;
use crate::sensor::Estimate;

/// Limit of a Nano's ceramic resonator: ±0.5 % (Murata CSTCE16M0V53).
const RESONATOR: f64 = 0.005;

/// Fewest pings of a measured rate, and the largest rate error of a board in real time. An emulated board that runs faster
/// than real time has no clock to compare with.
const LEAST_PINGS: u32 = 10;
const LARGEST: f64 = 0.02;

/// Returns the relative error of the board's clock; positive if it runs fast.
pub(super) fn rate_error(data: &Data) -> Estimate {
    let unknown = Estimate::within(RESONATOR);
    let Some(clock) = data.records.clock.filter(|clock| clock.pings >= LEAST_PINGS) else { return unknown };
    let value = clock.drift_ppm * 1e-6;
    if value.is_nan() || value.abs() > LARGEST || data.duration_s <= 0.0 {
        return unknown;
    }
    // Slope of a line through pings that are spread evenly.
    let u = clock.residual_us * 1e-6 / data.duration_s * (12.0 / f64::from(clock.pings)).sqrt();
    if u < unknown.u { Estimate { value, u } } else { unknown }
}
