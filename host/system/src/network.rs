//! This computer in a network.

pub use crate::own::network::{name, wait_for_connection};

use std::hash::{BuildHasher, RandomState};
use std::net::Ipv4Addr;

/// Returns a random address of this computer. On Linux and Windows, all 16 million addresses of 127.0.0.0/8 belong to it: with the port,
/// which the system selects, a web page would have to try 10¹¹ combinations.
pub fn hidden_address() -> Ipv4Addr {
    if cfg!(not(any(target_os = "linux", windows))) {
        return Ipv4Addr::LOCALHOST;
    }
    // Seeded by the system's random numbers.
    let [a, b, c, ..] = RandomState::new().hash_one("address").to_le_bytes().map(|byte| 1 + byte % 254);
    Ipv4Addr::new(127, a, b, c)
}
