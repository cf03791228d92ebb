//! Sobol's sequence: evenly distributed points in a box, each computed from its index.
//!
//! Direction numbers: Joe and Kuo 2008, SIAM J. Sci. Comput. 30, 2635 (`new-joe-kuo-6`), in the order of the Gray code
//! (Antonov and Saleev 1979). A seed shifts all points by exclusive or, which keeps their even distribution.

use sim::functions::powi;
use sim::split_mix::split_mix;

/// Largest number of dimensions.
pub const DIMENSIONS: usize = 20;

/// Degree and coefficients of the primitive polynomial of each dimension after the first, and the initial numbers.
const POLYNOMIALS: [(u32, u32, &[u32]); DIMENSIONS - 1] = [
    (1, 0, &[1]),
    (2, 1, &[1, 3]),
    (3, 1, &[1, 3, 1]),
    (3, 2, &[1, 1, 1]),
    (4, 1, &[1, 1, 3, 3]),
    (4, 4, &[1, 3, 5, 13]),
    (5, 2, &[1, 1, 5, 5, 17]),
    (5, 4, &[1, 1, 5, 5, 5]),
    (5, 7, &[1, 1, 7, 11, 19]),
    (5, 11, &[1, 1, 5, 1, 1]),
    (5, 13, &[1, 1, 1, 3, 11]),
    (5, 14, &[1, 3, 5, 5, 31]),
    (6, 1, &[1, 3, 3, 9, 7, 49]),
    (6, 13, &[1, 1, 1, 15, 21, 21]),
    (6, 16, &[1, 3, 1, 13, 27, 49]),
    (6, 19, &[1, 1, 1, 15, 7, 5]),
    (6, 22, &[1, 3, 1, 15, 13, 25]),
    (6, 25, &[1, 1, 5, 5, 19, 61]),
    (7, 1, &[1, 3, 7, 11, 23, 15, 103]),
];

/// Returns coordinate `dimension`, below [`DIMENSIONS`], of the point `index`: the middle of one of 2^32 cells between
/// 0 and 1.
pub fn coordinate(index: u32, dimension: usize, seed: u64) -> f64 {
    let gray = index ^ (index >> 1);
    let directions = directions(dimension);
    let point = (0..32).filter(|bit| gray >> bit & 1 == 1).fold(0, |point, bit| point ^ directions[bit]);
    (f64::from(point ^ shift(dimension, seed)) + 0.5) / powi(2f64, 32)
}

/// Returns the direction numbers of a dimension, the most significant bit first.
fn directions(dimension: usize) -> [u32; 32] {
    let mut v = [0; 32];
    let Some((degree, coefficients, initial)) = dimension.checked_sub(1).map(|row| POLYNOMIALS[row]) else {
        return std::array::from_fn(|bit| 1 << (31 - bit));
    };
    let s = degree as usize;
    for bit in 0..32 {
        v[bit] = if bit < s {
            initial[bit] << (31 - bit)
        } else {
            let sum = v[bit - s] ^ (v[bit - s] >> s);
            (1..s).filter(|k| coefficients >> (s - 1 - k) & 1 == 1).fold(sum, |sum, k| sum ^ v[bit - k])
        };
    }
    v
}

/// Returns the shift of a dimension, which depends on the seed.
fn shift(dimension: usize, seed: u64) -> u32 {
    (split_mix(seed, dimension as u64 + 1) >> 32) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a coordinate without a shift.
    fn plain(index: u32, dimension: usize) -> f64 {
        let cell = (coordinate(index, dimension, 0) * 2f64.powi(32) - 0.5) as u32;
        f64::from(cell ^ shift(dimension, 0)) / 2f64.powi(32)
    }

    /// The points 3 and 37 of `scipy.stats.qmc.Sobol(20, scramble=False)` of SciPy 1.17.1.
    #[test]
    fn points_are_those_of_scipy() {
        let third = [
            0.25, 0.75, 0.75, 0.75, 0.25, 0.25, 0.75, 0.25, 0.25, 0.25, 0.25, 0.25, 0.75, 0.75, 0.25, 0.75, 0.25, 0.75,
            0.25, 0.75,
        ];
        let point_37 = [
            0.921875, 0.640625, 0.578125, 0.921875, 0.765625, 0.296875, 0.171875, 0.796875, 0.609375, 0.171875,
            0.015625, 0.078125, 0.578125, 0.859375, 0.109375, 0.484375, 0.796875, 0.421875, 0.046875, 0.140625,
        ];
        for dimension in 0..DIMENSIONS {
            assert_eq!(plain(3, dimension), third[dimension], "{dimension}");
            assert_eq!(plain(37, dimension), point_37[dimension], "{dimension}");
        }
    }

    /// With any seed, 2^k points fall one into each of 2^k intervals of every coordinate.
    #[test]
    fn every_coordinate_is_even() {
        for (dimension, seed) in (0..DIMENSIONS).flat_map(|dimension| [(dimension, 0), (dimension, 7), (dimension, 8)])
        {
            let mut seen = [false; 256];
            for index in 0..256 {
                seen[(coordinate(index, dimension, seed) * 256.0) as usize] = true;
            }
            assert!(seen.iter().all(|seen| *seen), "{dimension} {seed}");
        }
        assert_ne!(coordinate(5, 0, 7), coordinate(5, 0, 8));
    }
}
