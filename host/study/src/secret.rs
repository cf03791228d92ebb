//! Unguessable numbers that keep other programs and web pages out.

use std::hash::{BuildHasher, Hasher, RandomState};

/// Returns 32 hexadecimal digits that cannot be guessed: the keys of a hasher come from the system's random numbers.
pub fn secret() -> String {
    let part = || RandomState::new().build_hasher().finish();
    format!("{:016x}{:016x}", part(), part())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_secret_is_new() {
        let secrets: std::collections::HashSet<String> = (0..100).map(|_| secret()).collect();
        assert!(secrets.len() == 100 && secrets.iter().all(|secret| secret.len() == 32));
    }
}
