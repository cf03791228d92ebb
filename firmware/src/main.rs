//! The image for the ATmega328P.
fn main() {}
