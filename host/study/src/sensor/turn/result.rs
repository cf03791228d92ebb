//! The result of turns about an axis, by least squares.

use super::super::file::{AXES, MeasuredSensor, pair};
use super::super::least_squares::{Fit, expanded};
use super::super::{Estimate, Sensor};
use super::{Turn, TurnPlan};
use sim::functions::{hypot, powi};

/// Tolerance within which the operator places the axis upright, in a mounting, rad: 3°. An unmeasured accelerometer is
/// less accurate.
const UPRIGHT: Estimate = Estimate::within(0.052);

/// Result of turns about an axis.
#[derive(Clone, PartialEq, Debug)]
pub struct TurnResult {
    /// Relative scale error about the axis.
    pub scale: Estimate,
    /// Its uncertainty due to the scatter of the turns; `None` without a degree of freedom.
    pub scatter_u: Option<f64>,
    /// Degrees of freedom of the scatter.
    pub freedom: usize,
    /// Its uncertainty due to the angle of the marks.
    pub reference_u: f64,
    /// Standard deviation of the operator's stops at the marks, degrees.
    pub stops_deg: Option<f64>,
    /// For each other axis, the share of the rate about the turned axis in its reading.
    pub cross: [Option<Estimate>; 3],
    /// The angles as read, degrees.
    pub turned_deg: Vec<f64>,
    /// Whether both sensors found the first turn counter-clockwise, seen from above.
    pub is_consistent: bool,
}

/// Evaluates turns. `force_g` is the mean specific force at the rests.
///
/// A turn by σD about the vertical u (σ = 1 counter-clockwise seen from above) reads, about axis i,
/// k_i D = σ ((1 + s_i) u_i + Σ c_ij u_j) D. For the nearly vertical axis a, σ is the sign of k_a u_a.
pub(super) fn evaluate(
    plan: &TurnPlan,
    turns: &[Turn],
    force_g: [f64; 3],
    reference_deg: f64,
    known: &MeasuredSensor,
    clock: f64,
) -> Option<TurnResult> {
    let axis = plan.axis;
    let (sheet, before) = (known.prior(), known.known());
    let (up, up_u) = vertical(force_g, axis, known);
    let fits = [fit(plan, turns, 0)?, fit(plan, turns, 1)?, fit(plan, turns, 2)?];
    let share = |i: usize| fits[i].values.last().map_or(0.0, |slope| slope / (1.0 + clock));
    let spread = |i: usize| {
        let deviation = fits[i].scatter()? * fits[i].factors.last()?;
        Some(expanded(deviation, fits[i].freedom))
    };
    let noise = |i: usize| {
        let squares: f64 = turns.iter().map(|turn| powi(turn.noise_deg[i], 2)).sum();
        squares.sqrt() / (turns.len() as f64 * plan.degrees)
    };
    let statistical = |i: usize| spread(i).unwrap_or(0.0).max(noise(i));
    let sense = (share(axis) * up[axis]).signum();
    let others = || (0..3).filter(|j| *j != axis);

    // The effect of the other axes on the reading, because the axis leans, and its uncertainty.
    let leaned: f64 = others().map(|j| before.gyro_cross[axis][j].value * up[j]).sum();
    let leaned_u: f64 = others().map(|j| before.gyro_cross[axis][j].u * up[j]).fold(0.0, hypot);
    let cosine_u: f64 = others().map(|j| up[j] * up_u[j]).fold(0.0, hypot);
    let reference_u = reference_deg / 3f64.sqrt() / plan.degrees;
    let value = (share(axis) * sense - leaned) / up[axis] - 1.0;
    let u = [statistical(axis), reference_u, leaned_u, cosine_u].into_iter().fold(0.0, hypot);

    let is_consistent = sense > 0.0;
    let cross = std::array::from_fn(|i| {
        (i != axis && is_consistent).then(|| {
            let value = (share(i) - up[i]) / up[axis];
            combined(Estimate { value, u: hypot(statistical(i), up_u[i]) }, before_turns(&sheet, i, axis))
        })
    });
    Some(TurnResult {
        scale: Estimate { value, u },
        scatter_u: spread(axis),
        freedom: fits[axis].freedom,
        reference_u,
        stops_deg: fits[axis].scatter(),
        cross,
        turned_deg: turns.iter().map(|turn| turn.angle_deg[axis]).collect(),
        is_consistent,
    })
}

/// Returns the data sheet's share of the rate about axis j in the reading of axis i, relative to the accelerometer's
/// axes. These are turned by half the difference of two of the accelerometer's cross-axis terms ([`super::poses`]).
fn before_turns(sheet: &Sensor, i: usize, j: usize) -> Estimate {
    let turned_u = 0.5 * hypot(sheet.accel_cross[i][j].u, sheet.accel_cross[j][i].u);
    Estimate { u: hypot(sheet.gyro_cross[i][j].u, turned_u), ..sheet.gyro_cross[i][j] }
}

/// Fits the angle about axis i at the rests (see the parent module). The slope is the last coefficient.
fn fit(plan: &TurnPlan, turns: &[Turn], i: usize) -> Option<Fit> {
    let mut reached = vec![0.0];
    for turn in turns {
        reached.push(reached[reached.len() - 1] + turn.angle_deg[i]);
    }
    let mark = |m: usize| if m.is_multiple_of(2) { 0.0 } else { plan.degrees };
    if turns.len() < 3 {
        let rows: Vec<_> = (0..reached.len()).map(|m| [1.0, mark(m)]).collect();
        return Fit::new(&rows, &reached);
    }
    let rows: Vec<_> = (0..reached.len()).map(|m| [1.0, m as f64, mark(m)]).collect();
    Fit::new(&rows, &reached)
}

/// Zero-g output of the accelerometer, x, y, z (data sheet PS-MPU-6000A, section 6.2): ±50, ±50, ±80 mg. Every axis
/// gets the largest value, because axes may be exchanged.
const ZERO_G: Estimate = Estimate::within(0.08);

/// Returns the direction of up in body axes and its transverse standard uncertainty, from a force at rest and the known
/// errors of the accelerometer. Body axis `axis` is nearly vertical.
fn vertical(force_g: [f64; 3], axis: usize, known: &MeasuredSensor) -> ([f64; 3], [f64; 3]) {
    let sensor = known.known();
    let offset = |i: usize| known.get("accel_offset_g", AXES[i]).unwrap_or(ZERO_G);
    let others = |i: usize| (0..3).filter(move |j| *j != i);
    let force = std::array::from_fn(|i| {
        let crossed: f64 = others(i).map(|j| sensor.accel_cross[i][j].value * force_g[j]).sum();
        (force_g[i] - offset(i).value - crossed) / (1.0 + sensor.accel_scale[i].value)
    });
    let up = unit(force);
    let u: [f64; 3] = std::array::from_fn(|i| {
        let crossed = others(i).map(|j| sensor.accel_cross[i][j].u * up[j]).fold(0.0, hypot);
        hypot(hypot(offset(i).u, crossed), sensor.accel_scale[i].u * up[i])
    });
    let across: [Estimate; 3] = std::array::from_fn(|i| combined(Estimate { value: up[i], u: u[i] }, UPRIGHT));
    let squares: f64 = others(axis).map(|i| powi(across[i].value, 2)).sum();
    let upright = (1.0 - squares).max(0.0).sqrt() * up[axis].signum();
    let direction = std::array::from_fn(|i| if i == axis { upright } else { across[i].value });
    (direction, across.map(|across| across.u))
}

pub(super) fn unit(vector: [f64; 3]) -> [f64; 3] {
    let length = vector.iter().map(|part| part * part).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
    vector.map(|part| part / length)
}

/// Returns the mean of a measured value and a prior value, weighted by their uncertainties.
fn combined(measured: Estimate, before: Estimate) -> Estimate {
    let [a, b] = [measured.u, before.u].map(|u| powi(u, -2));
    Estimate { value: (a * measured.value + b * before.value) / (a + b), u: (a + b).sqrt().recip() }
}

impl TurnResult {
    /// Enters the result into the file of the sensor.
    pub fn enter(&self, axis: usize, file: &mut MeasuredSensor) {
        file.set("gyro_scale", AXES[axis], self.scale);
        for i in 0..3 {
            if let Some(cross) = self.cross[i] {
                file.set("gyro_cross", &pair(i, axis), cross);
            }
        }
    }
}
