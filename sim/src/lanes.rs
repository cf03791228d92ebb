//! Vectors of numbers with operators, for formulas that run over many nodes.
//!
//! A thin cover over [`pulp`], which picks the machine's vector instructions at run time: formulas keep
//! their shape, and every operation is one instruction.

use pulp::Simd;
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
    /// The same number everywhere.
    #[inline(always)]
    pub fn all(simd: S, value: f64) -> Self {
        Self { simd, value: simd.splat_f64s(value) }
    }

    /// Neighbours of a slice.
    #[inline(always)]
    pub fn load(simd: S, values: &[f64], at: usize) -> Self {
        Self { simd, value: S::as_simd_f64s(&values[at..at + S::F64_LANES]).0[0] }
    }

    /// Writes to neighbours of a slice.
    #[inline(always)]
    pub fn store(self, values: &mut [f64], at: usize) {
        S::as_mut_simd_f64s(&mut values[at..at + S::F64_LANES]).0[0] = self.value;
    }

    /// Square roots.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        Self { value: self.simd.sqrt_f64s(self.value), ..self }
    }

    /// Inverses.
    #[inline(always)]
    pub fn inverse(self) -> Self {
        let one = self.simd.splat_f64s(1.0);
        Self { value: self.simd.div_f64s(one, self.value), ..self }
    }

    /// self * factor + term.
    #[inline(always)]
    pub fn times_plus(self, factor: Self, term: Self) -> Self {
        Self { value: self.simd.mul_add_e_f64s(self.value, factor.value, term.value), ..self }
    }
}

impl<S: Simd> Add for Wide<S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { value: self.simd.add_f64s(self.value, other.value), ..self }
    }
}

impl<S: Simd> Sub for Wide<S> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { value: self.simd.sub_f64s(self.value, other.value), ..self }
    }
}

impl<S: Simd> Mul for Wide<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self { value: self.simd.mul_f64s(self.value, other.value), ..self }
    }
}

impl<S: Simd> Neg for Wide<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: self.simd.neg_f64s(self.value), ..self }
    }
}
