//! The robot's program.
#![no_std]
