//! The machine's vector instructions, chosen at run time, with the same bits from each of them.
//!
//! A thin layer over [`pulp`]. Every operation works lane by lane and rounds once, so that its result does not depend on the
//! width. Code that adds lanes to each other must use the same tree at every width, as [`Simd::sum_f64s`] does.

use pulp::{Arch, Scalar};

/// A kind of vector instructions.
pub trait Simd: pulp::Simd {
    /// Returns a * b + c, rounded once.
    fn fused_f64s(self, a: Self::f64s, b: Self::f64s, c: Self::f64s) -> Self::f64s;

    /// Returns a * b + c, rounded once.
    fn fused_f32s(self, a: Self::f32s, b: Self::f32s, c: Self::f32s) -> Self::f32s;

    /// Returns the sum of `8 / F64_LANES` registers by halves, whatever the width.
    #[inline(always)]
    fn sum_f64s(self, mut registers: [Self::f64s; 8]) -> f64 {
        let mut count = 8 / Self::F64_LANES;
        while count > 1 {
            count /= 2;
            for i in 0..count {
                registers[i] = self.add_f64s(registers[i], registers[i + count]);
            }
        }
        self.reduce_sum_f64s(registers[0])
    }

    /// Returns the sum of `16 / F32_LANES` registers by halves, whatever the width.
    #[inline(always)]
    fn sum_f32s(self, mut registers: [Self::f32s; 16]) -> f32 {
        let mut count = 16 / Self::F32_LANES;
        while count > 1 {
            count /= 2;
            for i in 0..count {
                registers[i] = self.add_f32s(registers[i], registers[i + count]);
            }
        }
        self.reduce_sum_f32s(registers[0])
    }
}

/// Work that is compiled for each kind of vector instructions.
pub trait Kernel {
    /// Its result.
    type Output;

    /// Does the work; inlined, because only the caller is compiled for these instructions.
    fn run<S: Simd>(self, simd: S) -> Self::Output;
}

/// Runs a kernel with the widest vector instructions of the machine.
#[inline(always)]
pub fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(test)]
    if let Some(path) = paths::chosen() {
        return path.run(kernel);
    }
    match Arch::new() {
        #[cfg(target_arch = "x86_64")]
        Arch::V4(simd) => vectorize(simd, kernel, simd),
        #[cfg(target_arch = "x86_64")]
        Arch::V3(simd) => vectorize(simd, kernel, simd),
        #[cfg(target_arch = "aarch64")]
        Arch::Neon(simd) => vectorize(simd, kernel, simd),
        _ => kernel.run(Scalar),
    }
}

/// Compiles a kernel for `instructions`.
#[inline(always)]
fn vectorize<K: Kernel, S: Simd>(instructions: impl pulp::Simd, kernel: K, simd: S) -> K::Output {
    pulp::Simd::vectorize(instructions, On(kernel, simd))
}

struct On<K, S>(K, S);

impl<K: Kernel, L: Simd> pulp::WithSimd for On<K, L> {
    type Output = K::Output;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> K::Output {
        self.0.run(self.1)
    }
}

/// The instructions that multiply and add with one rounding.
macro_rules! fused {
    ($($simd:ty),*) => {$(
        impl Simd for $simd {
            #[inline(always)]
            fn fused_f64s(self, a: Self::f64s, b: Self::f64s, c: Self::f64s) -> Self::f64s {
                pulp::Simd::mul_add_e_f64s(self, a, b, c)
            }

            #[inline(always)]
            fn fused_f32s(self, a: Self::f32s, b: Self::f32s, c: Self::f32s) -> Self::f32s {
                pulp::Simd::mul_add_e_f32s(self, a, b, c)
            }
        }
    )*};
}

#[cfg(target_arch = "x86_64")]
fused!(pulp::x86::V3, pulp::x86::V4);
#[cfg(target_arch = "aarch64")]
fused!(pulp::aarch64::Neon);

/// Processors without such instructions compute the same result with many others.
impl Simd for Scalar {
    #[inline(always)]
    fn fused_f64s(self, a: f64, b: f64, c: f64) -> f64 {
        libm::fma(a, b, c)
    }

    #[inline(always)]
    fn fused_f32s(self, a: f32, b: f32, c: f32) -> f32 {
        libm::fmaf(a, b, c)
    }
}

/// All kinds of vector instructions on which this machine can run a kernel, for the test that they give the same bits.
#[cfg(test)]
pub mod paths {
    use super::{Kernel, Scalar, Simd, vectorize};
    #[cfg(target_arch = "x86_64")]
    use pulp::x86::{V3, V3_512b, V4};
    use std::cell::Cell;

    #[cfg(target_arch = "x86_64")]
    fused!(V3_512b);

    /// A kind of vector instructions, or a width that other processors have.
    #[derive(Clone, Copy)]
    pub enum Path {
        Scalar,
        #[cfg(target_arch = "x86_64")]
        Avx2(V3),
        /// Eight lanes in two registers: the width of AVX-512.
        #[cfg(target_arch = "x86_64")]
        Avx2Pairs(V3_512b),
        #[cfg(target_arch = "x86_64")]
        Avx512(V4),
        #[cfg(target_arch = "aarch64")]
        Neon(pulp::aarch64::Neon),
    }

    thread_local! {
        static CHOSEN: Cell<Option<Path>> = const { Cell::new(None) };
    }

    pub(super) fn chosen() -> Option<Path> {
        CHOSEN.get()
    }

    /// Returns the kinds of vector instructions of this machine.
    pub fn all() -> Vec<Path> {
        let mut all = vec![Path::Scalar];
        #[cfg(target_arch = "x86_64")]
        {
            all.extend(V3::try_new().into_iter().flat_map(|simd| [Path::Avx2(simd), Path::Avx2Pairs(V3_512b(simd))]));
            all.extend(V4::try_new().map(Path::Avx512));
        }
        #[cfg(target_arch = "aarch64")]
        all.extend(pulp::aarch64::Neon::try_new().map(Path::Neon));
        all
    }

    impl Path {
        /// Returns its name.
        pub fn name(self) -> &'static str {
            match self {
                Self::Scalar => "one lane",
                #[cfg(target_arch = "x86_64")]
                Self::Avx2(_) => "AVX2",
                #[cfg(target_arch = "x86_64")]
                Self::Avx2Pairs(_) => "AVX2, eight lanes",
                #[cfg(target_arch = "x86_64")]
                Self::Avx512(_) => "AVX-512",
                #[cfg(target_arch = "aarch64")]
                Self::Neon(_) => "NEON",
            }
        }

        /// Calls a function with its kernels compiled this way.
        pub fn with<T>(self, call: impl FnOnce() -> T) -> T {
            CHOSEN.set(Some(self));
            let out = call();
            CHOSEN.set(None);
            out
        }

        #[inline(always)]
        pub(super) fn run<K: Kernel>(self, kernel: K) -> K::Output {
            match self {
                Self::Scalar => kernel.run(Scalar),
                #[cfg(target_arch = "x86_64")]
                Self::Avx2(simd) => vectorize(simd, kernel, simd),
                #[cfg(target_arch = "x86_64")]
                Self::Avx2Pairs(simd) => vectorize(simd.0, kernel, simd),
                #[cfg(target_arch = "x86_64")]
                Self::Avx512(simd) => vectorize(simd, kernel, simd),
                #[cfg(target_arch = "aarch64")]
                Self::Neon(simd) => vectorize(simd, kernel, simd),
            }
        }
    }
}
