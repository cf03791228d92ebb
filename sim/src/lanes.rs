//! Registers of several numbers with operators, for formulas that run over many nodes.
//!
//! Every operation is one of [`Simd`], lane by lane.

use crate::V3;
use crate::simd::Simd;
use std::f64::consts::TAU;
use std::ops::{Add, Mul, Neg, Sub};

/// Arrays are padded to a multiple of this, which every vector width divides.
pub const PADDING: usize = 8;

/// A vector register of numbers.
#[derive(Clone, Copy)]
pub struct Wide<S: Simd> {
    simd: S,
    value: S::f64s,
}

impl<S: Simd> Wide<S> {
    /// Returns a register with the same number in every lane.
    #[inline(always)]
    pub fn all(simd: S, value: f64) -> Self {
        Self { simd, value: simd.splat_f64s(value) }
    }

    /// Reads neighbouring entries of a slice.
    #[inline(always)]
    pub fn load(simd: S, values: &[f64], at: usize) -> Self {
        Self { simd, value: S::as_simd_f64s(&values[at..at + S::F64_LANES]).0[0] }
    }

    /// Writes to neighbouring entries of a slice.
    #[inline(always)]
    pub fn store(self, values: &mut [f64], at: usize) {
        S::as_mut_simd_f64s(&mut values[at..at + S::F64_LANES]).0[0] = self.value;
    }

    /// Returns the square roots.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        Self { value: self.simd.sqrt_f64s(self.value), ..self }
    }

    /// Returns the inverses.
    #[inline(always)]
    pub fn inverse(self) -> Self {
        let one = self.simd.splat_f64s(1.0);
        Self { value: self.simd.div_f64s(one, self.value), ..self }
    }

    /// Returns self * factor + term.
    #[inline(always)]
    pub fn times_plus(self, factor: Self, term: Self) -> Self {
        Self { value: self.simd.fused_f64s(self.value, factor.value, term.value), ..self }
    }

    /// Returns self * factor.
    #[inline(always)]
    pub fn scaled(self, factor: f64) -> Self {
        self * Self::all(self.simd, factor)
    }

    /// Returns 1 + self.
    #[inline(always)]
    pub fn plus_one(self) -> Self {
        self + Self::all(self.simd, 1.0)
    }

    /// Returns the smaller number in each lane; the number of `other` if one is a NaN.
    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        // Processors' minimum instructions treat a NaN differently.
        let is_smaller = self.simd.less_than_f64s(self.value, other.value);
        Self { value: self.simd.select_f64s(is_smaller, self.value, other.value), ..self }
    }

    /// Returns the least number; none may be a NaN.
    #[inline(always)]
    pub fn least(self) -> f64 {
        self.simd.reduce_min_f64s(self.value)
    }

    /// Returns whether any lane's number is below that lane's bound.
    #[inline(always)]
    pub fn any_below(self, bound: Self) -> bool {
        self.simd.first_true_m64s(self.simd.less_than_f64s(self.value, bound.value)) < S::F64_LANES
    }

    /// Returns the sum of the terms c_k self^k, lowest first.
    #[inline(always)]
    fn polynomial(self, terms: &[f64]) -> Self {
        let mut sum = Self::all(self.simd, 0.0);
        for term in terms.iter().rev() {
            sum = sum.times_plus(self, Self::all(self.simd, *term));
        }
        sum
    }

    /// Returns the nearest whole numbers, for magnitudes below 2^51.
    #[inline(always)]
    pub fn round(self) -> Self {
        let shift = Self::all(self.simd, 6_755_399_441_055_744.0);
        (self + shift) - shift
    }

    /// Returns sine and cosine, good to rounding for angles up to some thousand revolutions.
    #[inline(always)]
    pub fn sin_cos(self) -> (Self, Self) {
        // The series is short for a quarter of the angle less whole revolutions; the angle is then doubled twice.
        let turns = self.scaled(1.0 / TAU).round();
        let quarter = (self - turns.scaled(TAU_HIGH) - turns.scaled(TAU - TAU_HIGH)).scaled(0.25);
        let square = quarter * quarter;
        let (mut sine, mut cosine) = (quarter * square.polynomial(&SINE), square.polynomial(&COSINE));
        for _ in 0..2 {
            let twice = sine + sine;
            (sine, cosine) = (twice * cosine, (-(twice * sine)).plus_one());
        }
        (sine, cosine)
    }

    /// Returns the angle of a unit vector with these components, in -pi..pi. Its error is 1e-14 / cos(angle / 2), which
    /// grows near half a turn.
    #[inline(always)]
    pub fn angle_of(sine: Self, cosine: Self) -> Self {
        // Tangents of the half angle and three more halvings leave an argument below 0.2.
        let tiny = Self::all(sine.simd, 1e-300);
        let across = cosine.plus_one();
        let chord = sine.times_plus(sine, across * across).sqrt();
        let mut tangent = sine * (across + chord + tiny).inverse();
        for _ in 0..2 {
            tangent = tangent * (tangent * tangent).plus_one().sqrt().plus_one().inverse();
        }
        (tangent * (tangent * tangent).polynomial(&ARC_TANGENT)).scaled(16.0)
    }
}

/// The leading bits of 2 pi: products with small whole numbers are exact.
const TAU_HIGH: f64 = 6.283_185_243_606_567;
const SINE: [f64; 8] = alternating(1);
const COSINE: [f64; 9] = alternating(0);
const ARC_TANGENT: [f64; 10] =
    [1.0, -1.0 / 3.0, 1.0 / 5.0, -1.0 / 7.0, 1.0 / 9.0, -1.0 / 11.0, 1.0 / 13.0, -1.0 / 15.0, 1.0 / 17.0, -1.0 / 19.0];

/// Returns 1/n! with alternating signs, for each second n from `first`.
const fn alternating<const N: usize>(first: u64) -> [f64; N] {
    let (mut terms, mut k, mut factorial, mut sign) = ([0.0; N], 0, 1, 1.0);
    while k < N {
        let n = first + 2 * k as u64;
        factorial *= if n > 1 { n * (n - 1) } else { 1 };
        terms[k] = sign / factorial as f64;
        (k, sign) = (k + 1, -sign);
    }
    terms
}

macro_rules! operators {
    ($($operator:ident, $name:ident, $of_simd:ident;)*) => {
        $(impl<S: Simd> $operator for Wide<S> {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                Self { value: self.simd.$of_simd(self.value, other.value), ..self }
            }
        })*
    };
}

operators! {
    Add, add, add_f64s;
    Sub, sub, sub_f64s;
    Mul, mul, mul_f64s;
}

impl<S: Simd> Neg for Wide<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: self.simd.neg_f64s(self.value), ..self }
    }
}

/// Registers of x, y and z.
#[derive(Clone, Copy)]
pub struct Wide3<S: Simd>(pub [Wide<S>; 3]);

impl<S: Simd> Wide3<S> {
    /// Returns the scalar product.
    #[inline(always)]
    pub fn dot(self, other: Self) -> Wide<S> {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        a.times_plus(x, b.times_plus(y, c * z))
    }

    /// Returns the scalar product with the roundings of [`V3::dot`].
    #[inline(always)]
    pub fn dot_unfused(self, other: Self) -> Wide<S> {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        a * x + b * y + c * z
    }

    /// Returns the vector product.
    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        Self([b * z - c * y, c * x - a * z, a * y - b * x])
    }

    /// Returns self * factor + term.
    #[inline(always)]
    pub fn times_plus(self, factor: Wide<S>, term: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, term.0);
        Self([a.times_plus(factor, x), b.times_plus(factor, y), c.times_plus(factor, z)])
    }
}

impl<S: Simd> Add for Wide3<S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        Self([a + x, b + y, c + z])
    }
}

impl<S: Simd> Sub for Wide3<S> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        Self([a - x, b - y, c - z])
    }
}

impl<S: Simd> Mul<Wide<S>> for Wide3<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: Wide<S>) -> Self {
        let [a, b, c] = self.0;
        Self([a * factor, b * factor, c * factor])
    }
}

/// Vectors along a rod, stored coordinate by coordinate, padded so that whole registers can be read from any index.
#[derive(Clone, Debug, Default)]
pub struct Vectors([Vec<f64>; 3]);

/// Returns the padded length of an array of `count` entries: whole registers can be read and written at each of them.
pub fn padded(count: usize) -> usize {
    count.div_ceil(PADDING) * PADDING + PADDING
}

impl Vectors {
    /// Returns `count` zero vectors.
    pub fn new(count: usize) -> Self {
        Self(std::array::from_fn(|_| vec![0.0; padded(count)]))
    }

    /// Sets the first `count` vectors, and makes room for them.
    #[inline(always)]
    pub fn fill(&mut self, count: usize, value: impl Fn(usize) -> V3) {
        for axis in &mut self.0 {
            axis.resize(padded(count).max(axis.len()), 0.0);
        }
        let [x, y, z] = self.0.each_mut().map(|axis| &mut axis[..count]);
        for i in 0..count {
            let value = value(i);
            (x[i], y[i], z[i]) = (value.x, value.y, value.z);
        }
    }

    /// Returns a vector.
    #[inline(always)]
    pub fn at(&self, i: usize) -> V3 {
        V3::new(self.0[0][i], self.0[1][i], self.0[2][i])
    }

    /// Sets a vector.
    #[inline(always)]
    pub fn set(&mut self, i: usize, value: V3) {
        for axis in 0..3 {
            self.0[axis][i] = value[axis];
        }
    }

    /// Sets the first vectors.
    #[inline(always)]
    pub fn copy_from(&mut self, values: &[V3]) {
        let [x, y, z] = self.0.each_mut().map(|axis| &mut axis[..values.len()]);
        for (i, value) in values.iter().enumerate() {
            (x[i], y[i], z[i]) = (value.x, value.y, value.z);
        }
    }

    /// Copies the first vectors out.
    #[inline(always)]
    pub fn copy_to(&self, values: &mut [V3]) {
        let [x, y, z] = self.0.each_ref().map(|axis| &axis[..values.len()]);
        for (i, value) in values.iter_mut().enumerate() {
            *value = V3::new(x[i], y[i], z[i]);
        }
    }

    /// Reads neighbouring vectors.
    #[inline(always)]
    pub fn load<S: Simd>(&self, simd: S, at: usize) -> Wide3<S> {
        let [x, y, z] = &self.0;
        Wide3([Wide::load(simd, x, at), Wide::load(simd, y, at), Wide::load(simd, z, at)])
    }

    /// Writes to neighbouring vectors.
    #[inline(always)]
    pub fn store<S: Simd>(&mut self, value: Wide3<S>, at: usize) {
        for (axis, wide) in value.0.into_iter().enumerate() {
            wide.store(&mut self.0[axis], at);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{Kernel, dispatch};

    struct Angles<'a>(&'a [f64], &'a mut [[f64; 3]]);

    impl Kernel for Angles<'_> {
        type Output = ();

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) {
            for (angle, out) in self.0.iter().zip(self.1) {
                let (sine, cosine) = Wide::all(simd, *angle).sin_cos();
                let back = Wide::angle_of(sine, cosine);
                let mut lanes = [0.0; PADDING];
                for (slot, wide) in out.iter_mut().zip([sine, cosine, back]) {
                    wide.store(&mut lanes, 0);
                    *slot = lanes[0];
                }
            }
        }
    }

    #[test]
    fn angles_go_both_ways() {
        let angles: Vec<f64> = (-3000..=3000).map(|i| 0.0137 * i as f64).collect();
        let mut out = vec![[0.0; 3]; angles.len()];
        dispatch(Angles(&angles, &mut out));
        for (angle, [sine, cosine, back]) in angles.iter().zip(out) {
            assert!((sine - angle.sin()).abs() < 4e-15 && (cosine - angle.cos()).abs() < 4e-15, "{angle}");
            let want = angle.sin().atan2(angle.cos());
            assert!((back - want).abs() < 1e-14 / (0.5 * want).cos(), "{angle} {back}");
        }
    }
}
