//! The factored covariance of all data, for generalised least squares in which the trials of a sensor share its errors.
//!
//! The errors of the blocks are e = ε + S δ: ε has the covariance V and is independent between trials and angles; δ are
//! the errors of the sensors and of their boards' clocks, in units of their standard uncertainties and so with variance
//! 1; S are their effects. So the covariance is C = V + S Sᵀ, and with V = L Lᵀ, w = L⁻¹ e and A = L⁻¹ S
//!
//! ```text
//! eᵀ C⁻¹ e = |w + A δ̂|² + |δ̂|²,   δ̂ = -K⁻¹ Aᵀ w,   K = I + Aᵀ A
//! C⁻¹ e    = L⁻ᵀ (w + A δ̂)
//! ```
//!
//! (Woodbury; δ̂ are the most probable errors of the sensors, with their data sheet or measurement as the prior). K has a
//! block for each sensor, because different sensors are independent.

use super::errors::TrialErrors;
use super::{Blocks, TwinError, failed};
use crate::statistics::each_once;
use crate::twin::sensor_key::SensorKey;
use nalgebra::linalg::Cholesky;
use nalgebra::{DMatrix, DVector, Dyn};
use rayon::prelude::*;
use sim::functions::powi;

/// The factored covariance of the data of all trials.
pub(super) struct Weights {
    trials: Vec<OfTrial>,
    sensors: Vec<OfSensor>,
}

struct OfTrial {
    /// L of yaw, pitch and roll.
    own: [Cholesky<f64, Dyn>; 3],
    /// A of yaw, pitch and roll.
    common: [DMatrix<f64>; 3],
    /// S of yaw, pitch and roll.
    effects: [DMatrix<f64>; 3],
}

struct OfSensor {
    /// The trials of the sensor.
    trials: Vec<usize>,
    /// K.
    factor: Cholesky<f64, Dyn>,
}

impl Weights {
    /// Factors the covariance of all trials' errors plus a remaining error `rest_deg` of each block, degrees.
    ///
    /// # Errors
    /// [`TwinError::Fit`] if the covariance of a trial is not positive definite.
    pub fn new(trials: &[&TrialErrors], rest_deg: f64) -> Result<Self, TwinError> {
        let one = |trial: &&TrialErrors| {
            let factor = |own: &DMatrix<f64>| {
                Cholesky::new(own + DMatrix::identity(own.nrows(), own.nrows()) * powi(rest_deg, 2))
            };
            let [Some(yaw), Some(pitch), Some(roll)] = trial.own.each_ref().map(factor) else {
                return Err(invalid());
            };
            let own = [yaw, pitch, roll];
            let effects = trial.of_sensor.clone();
            let common = [0, 1, 2].map(|k| {
                let mut common = effects[k].clone();
                // The factor of a positive definite matrix has no zeros on its diagonal.
                own[k].l_dirty().solve_lower_triangular_mut(&mut common);
                common
            });
            Ok(OfTrial { own, common, effects })
        };
        let all: Vec<OfTrial> = trials.par_iter().map(one).collect::<Result<_, _>>()?;
        let ids = each_once(trials.iter().map(|trial| &trial.sensor));
        let of = |id: &Option<SensorKey>| {
            let trials: Vec<usize> = (0..trials.len()).filter(|i| trials[*i].sensor == *id).collect();
            let columns = trials.first().map_or(0, |first| all[*first].common[0].ncols());
            let mut product = DMatrix::identity(columns, columns);
            for common in trials.iter().flat_map(|i| &all[*i].common) {
                product += common.transpose() * common;
            }
            Ok(OfSensor { trials, factor: Cholesky::new(product).ok_or_else(invalid)? })
        };
        let sensors = ids.into_iter().map(of).collect::<Result<_, TwinError>>()?;
        Ok(Self { trials: all, sensors })
    }

    /// Returns independent residuals of variance 1: first of all blocks, then of the sensors.
    pub fn whiten(&self, errors: &[Blocks]) -> DVector<f64> {
        let own = self.own(errors);
        let found = self.found(&own);
        let blocks = self.plus(own, &found, |trial| &trial.common);
        let blocks = blocks.iter().flatten().flat_map(|block| block.iter().copied());
        let of_sensors = found.iter().flat_map(|found| found.iter().copied());
        DVector::from_vec(blocks.chain(of_sensors).collect())
    }

    /// Returns the weighted sum of the squares of the errors of one trial, as if it were the only one.
    pub fn square(&self, trial: usize, errors: &Blocks) -> f64 {
        let of = &self.trials[trial];
        let mut product = DMatrix::identity(of.common[0].ncols(), of.common[0].ncols());
        let (mut square, mut shown) = (0.0, DVector::zeros(product.nrows()));
        for ((factor, common), block) in of.own.iter().zip(&of.common).zip(errors) {
            let mut own = block.clone();
            factor.l_dirty().solve_lower_triangular_mut(&mut own);
            square += own.norm_squared();
            shown += common.tr_mul(&own);
            product += common.transpose() * common;
        }
        // The product is positive definite.
        Cholesky::new(product).map_or(f64::INFINITY, |product| square - shown.dot(&product.solve(&shown)))
    }

    /// Returns the number of residuals.
    pub fn count(&self) -> usize {
        let blocks: usize = self.trials.iter().flat_map(|trial| &trial.common).map(DMatrix::nrows).sum();
        blocks + self.sensors.iter().map(|sensor| sensor.factor.l_dirty().nrows()).sum::<usize>()
    }

    /// Returns the product of the inverse of the covariance with errors.
    pub fn solve(&self, errors: &[Blocks]) -> Vec<Blocks> {
        let own = self.own(errors);
        let found = self.found(&own);
        let mut whole = self.plus(own, &found, |trial| &trial.common);
        for (trial, whole) in self.trials.iter().zip(&mut whole) {
            for (factor, block) in trial.own.iter().zip(whole) {
                factor.l_dirty().tr_solve_lower_triangular_mut(block);
            }
        }
        whole
    }

    /// Returns errors minus the effects of the sensor errors estimated from them.
    pub fn without_sensors(&self, errors: &[Blocks]) -> Vec<Blocks> {
        let found = self.found(&self.own(errors));
        self.plus(errors.to_vec(), &found, |trial| &trial.effects)
    }

    /// Returns the first trial of each sensor, and the sensor's errors ([`crate::trial::sensor_error`]) in standard
    /// uncertainties, estimated from the errors of the data.
    pub fn sensors(&self, errors: &[Blocks]) -> Vec<(usize, DVector<f64>)> {
        let found = self.found(&self.own(errors));
        self.sensors.iter().map(|sensor| sensor.trials[0]).zip(found).collect()
    }

    /// Returns the products of the effects of each sensor with weights of the blocks.
    pub fn of_sensors(&self, weights: &[Blocks]) -> Vec<DVector<f64>> {
        self.products(weights, |trial| &trial.effects)
    }

    /// Returns w.
    fn own(&self, errors: &[Blocks]) -> Vec<Blocks> {
        let mut own = errors.to_vec();
        for (trial, own) in self.trials.iter().zip(&mut own) {
            for (factor, block) in trial.own.iter().zip(own) {
                factor.l_dirty().solve_lower_triangular_mut(block);
            }
        }
        own
    }

    /// Returns δ̂ of each sensor.
    fn found(&self, own: &[Blocks]) -> Vec<DVector<f64>> {
        let products = self.products(own, |trial| &trial.common);
        self.sensors.iter().zip(products).map(|(sensor, product)| -sensor.factor.solve(&product)).collect()
    }

    /// Returns, for each sensor, the transposed matrix of its trials times values.
    fn products(&self, values: &[Blocks], matrix: impl Fn(&OfTrial) -> &[DMatrix<f64>; 3]) -> Vec<DVector<f64>> {
        let of = |sensor: &OfSensor| {
            let mut product = DVector::zeros(sensor.factor.l_dirty().nrows());
            for i in &sensor.trials {
                for (matrix, block) in matrix(&self.trials[*i]).iter().zip(&values[*i]) {
                    product += matrix.tr_mul(block);
                }
            }
            product
        };
        self.sensors.iter().map(of).collect()
    }

    /// Returns values plus, for each sensor, the matrix of its trials times the sensor's errors.
    fn plus(
        &self,
        mut values: Vec<Blocks>,
        found: &[DVector<f64>],
        matrix: impl Fn(&OfTrial) -> &[DMatrix<f64>; 3],
    ) -> Vec<Blocks> {
        for (sensor, found) in self.sensors.iter().zip(found) {
            for i in &sensor.trials {
                for (matrix, block) in matrix(&self.trials[*i]).iter().zip(&mut values[*i]) {
                    *block += matrix * found;
                }
            }
        }
        values
    }
}

fn invalid() -> TwinError {
    failed("the noise of a trial has no valid covariance", "leave out trials whose logs are damaged")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::{SENSOR_ERRORS, sensor_error};

    /// Returns four trials of three blocks; the first and the third share a sensor.
    fn trials() -> Vec<TrialErrors> {
        let number = |i: usize, j: usize, k: usize| ((7 * i + 3 * j + 5 * k) as f64).sin();
        let one = |t: usize| TrialErrors {
            sensor: Some(SensorKey::of_board([0, 1, 0, 2][t])),
            own: [0, 1, 2].map(|angle| {
                let root = DMatrix::from_fn(3, 3, |i, j| 0.3 * number(i, j, t + angle));
                &root * root.transpose()
            }),
            of_sensor: [0, 1, 2].map(|angle| DMatrix::from_fn(3, SENSOR_ERRORS, |i, k| number(i + angle, k, t))),
        };
        (0..4).map(one).collect()
    }

    fn flat(blocks: &[Blocks]) -> DVector<f64> {
        DVector::from_vec(blocks.iter().flatten().flatten().copied().collect())
    }

    #[test]
    fn weights_are_those_of_the_whole_covariance() {
        let trials = trials();
        let weights = Weights::new(&trials.iter().collect::<Vec<_>>(), 0.1).unwrap();
        let place = |t: usize, angle: usize, i: usize| 9 * t + 3 * angle + i;
        let all = || (0..36).map(|n| (n / 9, n / 3 % 3, n % 3));
        let mut whole = DMatrix::zeros(36, 36);
        for (t, a, i) in all() {
            for (u, b, j) in all() {
                let mut value = 0.0;
                if trials[t].sensor == trials[u].sensor {
                    value += trials[t].of_sensor[a].row(i).dot(&trials[u].of_sensor[b].row(j));
                }
                if t == u && a == b {
                    value += trials[t].own[a][(i, j)] + if i == j { 0.01 } else { 0.0 };
                }
                whole[(place(t, a, i), place(u, b, j))] = value;
            }
        }
        let errors: Vec<Blocks> =
            (0..4).map(|t| [0, 1, 2].map(|a| DVector::from_fn(3, |i, _| (place(t, a, i) as f64).cos()))).collect();
        let expected = whole.cholesky().unwrap().solve(&flat(&errors));
        let solved = flat(&weights.solve(&errors));
        assert!((&solved - &expected).amax() < 1e-8 * expected.amax(), "{}", (&solved - &expected).amax());
        let whitened = weights.whiten(&errors);
        let square = flat(&errors).dot(&expected);
        assert_eq!(whitened.len(), weights.count());
        assert!((whitened.norm_squared() / square - 1.0).abs() < 1e-9, "{} {square}", whitened.norm_squared());
        let alone = Weights::new(&[&trials[1]], 0.1).unwrap().whiten(&errors[1..2]).norm_squared();
        assert!((weights.square(1, &errors[1]) / alone - 1.0).abs() < 1e-9);
    }

    #[test]
    fn errors_of_a_sensor_are_told_from_those_of_the_trial() {
        let trials = trials();
        let weights = Weights::new(&trials.iter().collect::<Vec<_>>(), 0.01).unwrap();
        let of_column = |trial: &TrialErrors| trial.of_sensor.each_ref().map(|effects| effects.column(2) * 50.0);
        let errors: Vec<Blocks> = trials.iter().map(of_column).collect();
        let left = flat(&weights.without_sensors(&errors));
        assert!(left.amax() < 0.05 * flat(&errors).amax(), "{} of {}", left.amax(), flat(&errors).amax());
        let found = weights.sensors(&errors);
        assert_eq!(found.iter().map(|of| of.0).collect::<Vec<_>>(), [0, 1, 3]);
        assert_eq!((sensor_error(0), sensor_error(SENSOR_ERRORS - 1)), ("gyroscope scale", "clock"));
    }
}
