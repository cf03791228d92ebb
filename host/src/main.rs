//! The `biflag` program.
fn main() {}
