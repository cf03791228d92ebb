//! The errors of a sensor as one list, in the order of all sensitivities.

use super::{Estimate, Sensor};
use std::ops::Range;

/// Errors of one kind.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Group {
    /// Name in budgets.
    pub name: &'static str,
    /// Its places in the list.
    pub range: Range<usize>,
}

/// Number of errors.
pub const PARAMETERS: usize = 39;

/// The kinds of errors, in the order of the list. Matrices are in rows: the axis that reads, then the axis that is read.
pub const GROUPS: [Group; 7] = [
    Group { name: "gyroscope scale", range: 0..3 },
    Group { name: "gyroscope cross-axis", range: 3..12 },
    Group { name: "gyroscope sensitivity to gravity", range: 12..21 },
    Group { name: "accelerometer scale", range: 21..24 },
    Group { name: "accelerometer cross-axis", range: 24..33 },
    Group { name: "accelerometer offset with temperature", range: 33..36 },
    Group { name: "mounting", range: 36..39 },
];

/// Place of the rotation of the sensor in the body about the vertical.
pub const MOUNTING_YAW: usize = GROUPS[6].range.start + 2;

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
}

#[cfg(test)]
mod tests {
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
}
