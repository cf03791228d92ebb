//! The robot in glycerin.
