//! Times of a log.

/// Longest trial, s (one week). A log with later times is damaged.
pub const LONGEST_TRIAL_S: f64 = 7.0 * 86_400.0;

/// Converts nanoseconds to seconds. The quotient is the number closest to the time, so a time rounded to nanoseconds is
/// restored exactly. A product with 1e-9 could lie after the end of the trial.
pub(super) fn seconds(time_ns: u64) -> f64 {
    time_ns as f64 / 1e9
}
