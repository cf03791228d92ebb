//! Random numbers that depend on their seed alone, not on the version of a library: SplitMix64.

/// Returns the random number at position `place`, from 1, of a seed's sequence.
pub fn split_mix(seed: u64, place: u64) -> u64 {
    let z = seed.wrapping_add(place.wrapping_mul(0x9E37_79B9_7F4A_7C15));
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// Returns the same number, scaled to be uniform in [0, 1).
pub fn uniform(seed: u64, place: u64) -> f64 {
    (split_mix(seed, place) >> 11) as f64 / (1u64 << 53) as f64
}
