//! Formats words and numbers for messages and pages.

use biflag_log::ClockMeta;

/// Formats a number with a noun: `1 trial`, `2 trials`.
pub fn count(number: usize, noun: &str) -> String {
    format!("{number} {noun}{}", if number == 1 { "" } else { "s" })
}

/// Formats a number with this number of decimals. Zero has no sign, also after rounding.
pub fn decimal(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let is_zero = text.bytes().all(|byte| matches!(byte, b'-' | b'0' | b'.'));
    if is_zero { text.trim_start_matches('-').to_owned() } else { text }
}

/// Formats a number like [`decimal`], with a sign unless it is zero.
pub fn signed(value: f64, decimals: usize) -> String {
    let text = decimal(value, decimals);
    let is_positive = text.bytes().any(|byte| matches!(byte, b'1'..=b'9')) && !text.starts_with('-');
    if is_positive { format!("+{text}") } else { text }
}

/// Describes the clock of the board relative to that of the computer. An emulated board may run several times as fast as
/// real time.
pub fn clock(clock: &ClockMeta) -> String {
    let rate = match clock.drift_ppm {
        drift if drift.abs() < 1e4 => format!("{} ppm", signed(drift, 1)),
        drift => format!("{:.2} times real time", 1.0 + drift * 1e-6),
    };
    format!("{rate}, residual {:.0} µs, {}", clock.residual_us, count(clock.pings as usize, "ping"))
}

/// Returns the name of a value in JSON, with spaces instead of underscores.
pub fn word(value: &impl serde::Serialize) -> String {
    serde_json::to_value(value).ok().and_then(|name| Some(name.as_str()?.replace('_', " "))).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_formatted() {
        assert_eq!([decimal(-0.001, 2), decimal(-0.006, 2), decimal(2.449, 1)], ["0.00", "-0.01", "2.4"]);
        assert_eq!([signed(0.001, 2), signed(0.5, 2), signed(-0.5, 2)], ["0.00", "+0.50", "-0.50"]);
        assert_eq!([count(1, "trial"), count(0, "trial"), count(75, "trial")], ["1 trial", "0 trials", "75 trials"]);
    }
}
