//! A table of steady states over the speeds of both motors. It gives the initial speeds.
//!
//! Rows may be anywhere in the plane of speeds. Between them a quadratic polynomial is fitted to the nearest rows, with
//! weights that fall with the distance: local regression (Cleveland 1979, J. Am. Stat. Assoc. 74, 829).

use super::error::AimError;
use super::quantity::Attitude;
use super::target::Target;
use crate::statistics::extremes;
use nalgebra::{DMatrix, SMatrix, SVector};
use sim::functions::{exp, hypot, powi};

/// Terms of a quadratic polynomial of two variables.
const TERMS: usize = 6;
/// Rows in a fit.
const NEAREST: usize = 14;
/// Fewest rows of a table.
const FEWEST: usize = 10;
/// Number of neighbours with which a row's distance to the target is compared.
const NEIGHBOURS: usize = 8;
/// Change of a speed for derivatives, rpm.
const DIFFERENCE: f64 = 0.1;

/// A steady state at a pair of speeds.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Row {
    /// Speeds of flagella 1 and 2.
    pub rpm: [f64; 2],
    /// The attitude.
    pub attitude: Attitude,
    /// Share of the time in which the flagella touch; `None` if the table does not say.
    pub contact_share: Option<f64>,
}

impl Row {
    /// Returns whether the flagella touch, if the table says so.
    pub fn touches(&self) -> Option<bool> {
        self.contact_share.map(|share| share > 0.0)
    }
}

/// A table of steady states of one robot.
#[derive(Clone, PartialEq, Debug)]
pub struct Table {
    /// The rows.
    pub rows: Vec<Row>,
    /// Typical distance between neighbouring rows, rpm.
    pub spacing_rpm: f64,
    /// A hundredth of the range of thrusts, N: the thrust error that counts as much as one degree.
    pub thrust_step_n: f64,
}

impl Table {
    /// Creates a table of these rows and their mirror images: exchanging the speeds of two equal flagella turns the
    /// robot by half a turn, with the same yaw and the opposite pitch and roll.
    ///
    /// # Errors
    /// [`AimError::TooSmall`].
    pub fn new(mut rows: Vec<Row>) -> Result<Self, AimError> {
        for i in 0..rows.len() {
            let Row { rpm: [w1, w2], attitude, contact_share } = rows[i];
            if rows.iter().all(|row| distance(row.rpm, [w2, w1]) > 1e-6) {
                let attitude = Attitude { pitch_deg: -attitude.pitch_deg, roll_deg: -attitude.roll_deg, ..attitude };
                rows.push(Row { rpm: [w2, w1], attitude, contact_share });
            }
        }
        let range = |value: &dyn Fn(&Row) -> f64| {
            let [low, high] = extremes(rows.iter().map(value));
            high - low
        };
        let area = range(&|row| row.rpm[0]) * range(&|row| row.rpm[1]);
        if rows.len() < FEWEST || area.is_nan() || area <= 0.0 {
            return Err(AimError::TooSmall { rows: rows.len() });
        }
        let spacing_rpm = (area / rows.len() as f64).sqrt();
        let thrust_step_n = (0.01 * range(&|row| row.attitude.thrust_n)).max(f64::MIN_POSITIVE);
        Ok(Self { rows, spacing_rpm, thrust_step_n })
    }

    /// Returns the share of contact at the row nearest to these speeds, 0 if the table does not say.
    pub fn contact_share(&self, rpm: [f64; 2]) -> f64 {
        self.next_to(rpm, 1).first().and_then(|(_, row)| self.rows[*row].contact_share).unwrap_or(0.0)
    }

    /// Returns the rows that are nearer to the target than all their neighbours, the nearest one first.
    pub fn nearest(&self, target: &Target) -> Vec<Row> {
        let misses: Vec<f64> = self.rows.iter().map(|row| self.miss(target, &row.attitude)).collect();
        let mut found: Vec<(f64, Row)> = Vec::new();
        for (row, miss) in self.rows.iter().zip(&misses) {
            let next = self.next_to(row.rpm, NEIGHBOURS + 1);
            if next.into_iter().all(|(_, other)| misses[other] >= *miss) {
                found.push((*miss, *row));
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found.into_iter().map(|(_, row)| row).collect()
    }

    fn miss(&self, target: &Target, attitude: &Attitude) -> f64 {
        target.misses(attitude, self.thrust_step_n).iter().map(|miss| miss * miss).sum::<f64>()
    }

    /// Returns the squares of the distances and the indices of the rows nearest to these speeds.
    fn next_to(&self, rpm: [f64; 2], count: usize) -> Vec<(f64, usize)> {
        let count = count.min(self.rows.len());
        let mut all: Vec<(f64, usize)> =
            self.rows.iter().enumerate().map(|(i, row)| (powi(distance(row.rpm, rpm), 2), i)).collect();
        all.select_nth_unstable_by(count - 1, |a, b| a.0.total_cmp(&b.0));
        all.truncate(count);
        all
    }

    /// Returns the polynomial about these speeds.
    pub fn about(&self, rpm: [f64; 2]) -> Local {
        let near = self.next_to(rpm, NEAREST);
        let reach = near.iter().map(|(square, _)| *square).fold(0.0, f64::max).sqrt().max(1e-9);
        let mut local = Local { rpm, reach, terms: SMatrix::zeros() };
        let mut left = DMatrix::zeros(near.len(), TERMS);
        let mut right = DMatrix::zeros(near.len(), 4);
        for (i, (square, row)) in near.into_iter().enumerate() {
            let Row { rpm, attitude, .. } = &self.rows[row];
            let weight = exp(-2.0 * square / (reach * reach));
            left.row_mut(i).copy_from(&(local.powers(*rpm).transpose() * weight));
            let Attitude { yaw_deg, pitch_deg, roll_deg, thrust_n } = *attitude;
            for (j, value) in [yaw_deg, pitch_deg, roll_deg, thrust_n].into_iter().enumerate() {
                right[(i, j)] = value * weight;
            }
        }
        // Rows on one or two lines do not determine all terms. The minimum-norm solution sets the undetermined part to
        // zero.
        let across = left.transpose();
        let axes = (&across * left).symmetric_eigen();
        let mut along = axes.eigenvectors.transpose() * (across * right);
        for (mut terms, square) in along.row_iter_mut().zip(&axes.eigenvalues) {
            terms *= if *square > 1e-12 { 1.0 / square } else { 0.0 };
        }
        local.terms.copy_from(&(axes.eigenvectors * along));
        local
    }
}

/// The attitude near some speeds as a polynomial.
#[derive(Clone, PartialEq, Debug)]
pub struct Local {
    rpm: [f64; 2],
    reach: f64,
    terms: SMatrix<f64, TERMS, 4>,
}

impl Local {
    fn powers(&self, rpm: [f64; 2]) -> SVector<f64, TERMS> {
        let [x, y] = [0, 1].map(|k| (rpm[k] - self.rpm[k]) / self.reach);
        SVector::from([1.0, x, y, x * x, x * y, y * y])
    }

    /// Returns the attitude at these speeds.
    pub fn at(&self, rpm: [f64; 2]) -> Attitude {
        let [yaw_deg, pitch_deg, roll_deg, thrust_n] = (self.terms.transpose() * self.powers(rpm)).into();
        Attitude { yaw_deg, pitch_deg, roll_deg, thrust_n }
    }

    /// Returns the derivatives of the target's quantities with respect to the speeds, 1/rpm, one row per quantity.
    pub fn derivatives(&self, target: &Target, thrust_step_n: f64) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(target.wanted.len(), 2);
        for k in 0..2 {
            let [less, more] = [-DIFFERENCE, DIFFERENCE].map(|change| {
                let mut rpm = self.rpm;
                rpm[k] += change;
                target.values(&self.at(rpm), thrust_step_n)
            });
            for i in 0..target.wanted.len() {
                out[(i, k)] = (more[i] - less[i]) / (2.0 * DIFFERENCE);
            }
        }
        out
    }
}

/// Returns the distance of two pairs of speeds, rpm.
pub fn distance(one: [f64; 2], other: [f64; 2]) -> f64 {
    hypot(one[0] - other[0], one[1] - other[1])
}
