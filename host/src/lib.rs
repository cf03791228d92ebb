//! The host side of the rig.

pub mod link;
