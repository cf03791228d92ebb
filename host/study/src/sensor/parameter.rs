//! The errors of a sensor as one list, in the same order as the sensitivities.

use super::{Estimate, Sensor};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use sim::functions::powi;
use std::ops::Range;

/// Errors of one kind.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Group {
    /// Name in budgets.
    pub name: &'static str,
    /// Its range in the list.
    pub range: Range<usize>,
}

/// Where each kind begins in the list.
pub mod index {
    #![expect(missing_docs, reason = "the names are those of the fields of a sensor")]
    pub const GYRO_SCALE: usize = 0;
    pub const GYRO_CROSS: usize = 3;
    pub const GYRO_G: usize = 12;
    pub const ACCEL_SCALE: usize = 21;
    pub const ACCEL_CROSS: usize = 24;
    pub const ACCEL_DRIFT: usize = 33;
    pub const MOUNTING: usize = 36;
    /// Rotation in the body about the vertical.
    pub const MOUNTING_YAW: usize = MOUNTING + 2;
}

/// Number of errors.
pub const PARAMETERS: usize = 39;

/// The kinds of errors, in the order of the list. Matrices are stored by rows; a row belongs to a reading axis.
pub const GROUPS: [Group; 7] = [
    Group { name: "gyroscope scale", range: index::GYRO_SCALE..index::GYRO_CROSS },
    Group { name: "gyroscope cross-axis", range: index::GYRO_CROSS..index::GYRO_G },
    Group { name: "gyroscope sensitivity to gravity", range: index::GYRO_G..index::ACCEL_SCALE },
    Group { name: "accelerometer scale", range: index::ACCEL_SCALE..index::ACCEL_CROSS },
    Group { name: "accelerometer cross-axis", range: index::ACCEL_CROSS..index::ACCEL_DRIFT },
    Group { name: "accelerometer offset with temperature", range: index::ACCEL_DRIFT..index::MOUNTING },
    Group { name: "mounting", range: index::MOUNTING..PARAMETERS },
];

impl Sensor {
    /// Returns all errors in the order of [`GROUPS`].
    pub fn parameters(&self) -> [Estimate; PARAMETERS] {
        let all = [
            &self.gyro_scale[..],
            self.gyro_cross.as_flattened(),
            self.gyro_g_dps.as_flattened(),
            &self.accel_scale,
            self.accel_cross.as_flattened(),
            &self.accel_drift_g_per_c,
            &self.mounting_deg,
        ]
        .concat();
        std::array::from_fn(|i| all[i])
    }

    /// Returns a matrix R for which R Rᵀ is the covariance of all errors. Its columns are independent errors of
    /// variance 1; row i is their effect on entry i of [`Self::parameters`].
    pub fn independent_errors(&self) -> DMatrix<f64> {
        let mut root = DMatrix::from_diagonal(&DVector::from_iterator(PARAMETERS, self.parameters().map(|one| one.u)));
        for (k, u) in self.axes.u.into_iter().enumerate().filter(|(_, u)| *u > 0.0) {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let [gyro, accel] =
                [index::GYRO_CROSS, index::ACCEL_CROSS].map(|first| [first + 3 * i + j, first + 3 * j + i]);
            let common = accel[0];
            root[(accel[1], accel[1])] = 0.0;
            root[(accel[1], common)] = u;
            for (row, share) in gyro.into_iter().zip([self.axes.of_gyro[i][j], self.axes.of_gyro[j][i]]) {
                root[(row, common)] = share * u;
                root[(row, row)] = (powi(root[(row, row)], 2) - powi(share * u, 2)).max(0.0).sqrt();
            }
        }
        root
    }

    /// Returns, in the order of [`GROUPS`], the contributions of the known errors to readings, as shares of the
    /// reading: s/(1 + s) for a scale of 1 + s. The mounting is left out, because it turns attitudes as a whole.
    pub fn shares_of_readings(&self) -> [f64; PARAMETERS] {
        let matrix = |rows: &[[Estimate; 3]; 3]| Matrix3::from_fn(|i, j| rows[i][j].value);
        let inverse = |scale: &[Estimate; 3], cross: &[[Estimate; 3]; 3]| {
            let errors = Matrix3::from_diagonal(&scale.map(|scale| scale.value).into()) + matrix(cross);
            // Invertible for a working sensor, because its errors are small.
            (Matrix3::identity() + errors).try_inverse().unwrap_or_else(Matrix3::identity)
        };
        let (gyro, accel) =
            (inverse(&self.gyro_scale, &self.gyro_cross), inverse(&self.accel_scale, &self.accel_cross));
        let gravity = gyro * matrix(&self.gyro_g_dps);
        let drift = accel * Vector3::from(self.accel_drift_g_per_c.map(|drift| drift.value));
        let mut shares = [0.0; PARAMETERS];
        for i in 0..3 {
            shares[index::GYRO_SCALE + i] = 1.0 - gyro[(i, i)];
            shares[index::ACCEL_SCALE + i] = 1.0 - accel[(i, i)];
            shares[index::ACCEL_DRIFT + i] = drift[i];
            for j in 0..3 {
                shares[index::GYRO_G + 3 * i + j] = gravity[(i, j)];
                if i != j {
                    shares[index::GYRO_CROSS + 3 * i + j] = -gyro[(i, j)];
                    shares[index::ACCEL_CROSS + 3 * i + j] = -accel[(i, j)];
                }
            }
        }
        shares
    }
}

#[cfg(test)]
mod tests {
    use super::super::AxesError;
    use super::*;

    #[test]
    fn groups_cover_the_list_in_order() {
        let ends: Vec<usize> = GROUPS.iter().flat_map(|group| [group.range.start, group.range.end]).collect();
        assert_eq!((ends.first(), ends.last()), (Some(&0), Some(&PARAMETERS)));
        assert!(ends[1..ends.len() - 1].chunks(2).all(|pair| pair[0] == pair[1]));
        let parameters = Sensor::of_data_sheet().parameters();
        let known: Vec<usize> = (0..PARAMETERS).filter(|i| parameters[*i].u == 0.0).collect();
        assert_eq!(known, [3, 7, 11, 24, 28, 32], "the diagonals of the cross-axis matrices");
    }

    #[test]
    fn errors_that_are_one_are_not_added_in_squares() {
        let sheet = Sensor::of_data_sheet();
        let u = sheet.parameters().map(|one| one.u);
        assert_eq!(sheet.independent_errors().diagonal().as_slice(), u);
        let mut of_gyro = [[0.0; 3]; 3];
        (of_gyro[0][1], of_gyro[1][0]) = (0.9, 0.8);
        let mut measured = Sensor { axes: AxesError { u: [0.0, 0.0, 0.005], of_gyro }, ..sheet };
        (measured.accel_cross[0][1].u, measured.accel_cross[1][0].u) = (0.005, 0.005);
        let root = measured.independent_errors();
        let covariance = &root * root.transpose();
        for (i, one) in measured.parameters().into_iter().enumerate() {
            assert!((covariance[(i, i)].sqrt() - one.u).abs() < 1e-15, "{i}");
        }
        // The cross-axis terms xy and yx of both sensors.
        let expected = [(25, 27, 1.0), (25, 4, 0.9), (27, 6, 0.8), (4, 6, 0.72), (25, 26, 0.0)];
        for (i, j, share) in expected {
            assert!((covariance[(i, j)] - share * 0.005f64.powi(2)).abs() < 1e-15, "{i}, {j}");
        }
    }

    /// A sensor at the limits of its data sheet, measured exactly: the reading minus its shares is the true value.
    #[test]
    fn shares_of_readings_are_what_the_errors_add() {
        let exactly = |value: f64| Estimate { value, u: 0.0 };
        let cross = |sign: f64| {
            std::array::from_fn(|i| std::array::from_fn(|j| exactly(if i == j { 0.0 } else { sign * 0.02 })))
        };
        let sensor = Sensor {
            gyro_scale: [0.03, -0.03, 0.03].map(exactly),
            gyro_cross: cross(1.0),
            gyro_g_dps: [[exactly(0.1); 3]; 3],
            accel_scale: [0.03, 0.03, -0.03].map(exactly),
            accel_cross: cross(-1.0),
            ..Sensor::of_data_sheet()
        };
        let (rate, force) = (Vector3::new(5.0, -20.0, 60.0), Vector3::new(0.3, -0.2, 0.9));
        let matrix = |values: [f64; PARAMETERS], diagonal: usize, others: usize| {
            Matrix3::from_fn(|i, j| if i == j { values[diagonal + i] } else { values[others + 3 * i + j] })
        };
        let (errors, shares) = (sensor.parameters().map(|error| error.value), sensor.shares_of_readings());
        let read = rate + matrix(errors, 0, 3) * rate + Matrix3::from_row_slice(&errors[12..21]) * force;
        let of_gravity = Matrix3::from_row_slice(&shares[12..21]) * force;
        assert!((read - matrix(shares, 0, 3) * read - of_gravity - rate).amax() < 1e-12);
        let read = force + matrix(errors, 21, 24) * force;
        assert!((read - matrix(shares, 21, 24) * read - force).amax() < 1e-12);
    }
}
