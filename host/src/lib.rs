//! The host side of the rig.
