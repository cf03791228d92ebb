//! Formats words, numbers, paths and foreign text for messages and pages.

use biflag_log::{ClockMeta, Origin, RestMeta};
use serde::Serializer;
use std::error::Error;
use std::path::Path;

/// Formats a number with a noun: `1 trial`, `2 trials`.
pub fn count(number: usize, noun: &str) -> String {
    format!("{number} {noun}{}", if number == 1 { "" } else { "s" })
}

/// Joins words: `yaw, pitch and roll`.
pub fn listed(words: &[impl AsRef<str>]) -> String {
    let words: Vec<&str> = words.iter().map(AsRef::as_ref).collect();
    match words.as_slice() {
        [] => String::new(),
        [one] => (*one).to_owned(),
        [most @ .., last] => format!("{} and {last}", most.join(", ")),
    }
}

/// Joins alternatives: `yaw, or as if pitch`.
pub fn either(clauses: &[impl AsRef<str>]) -> String {
    clauses.iter().map(AsRef::as_ref).collect::<Vec<_>>().join(", or as if ")
}

/// Formats a number with this number of decimals. Zero has no sign, also after rounding.
pub fn decimal(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let is_zero = text.bytes().all(|byte| matches!(byte, b'-' | b'0' | b'.'));
    if is_zero { text.trim_start_matches('-').to_owned() } else { text }
}

/// Formats a value with four decimals, with an exponent only if necessary.
pub fn figure(value: f64) -> String {
    if (0.01..1e4).contains(&value.abs()) { format!("{value:.4}") } else { format!("{value:.3e}") }
}

/// Formats a number like [`decimal`], with a sign unless it is zero.
pub fn signed(value: f64, decimals: usize) -> String {
    let text = decimal(value, decimals);
    let is_positive = text.bytes().any(|byte| matches!(byte, b'1'..=b'9')) && !text.starts_with('-');
    if is_positive { format!("+{text}") } else { text }
}

/// Formats a duration of at least some seconds: `45 s`, `8 min 40 s`, `9 h 3 min`.
pub fn duration(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match (whole / 3600, whole / 60 % 60, whole % 60) {
        (0, 0, s) => format!("{s} s"),
        (0, min, 0) => format!("{min} min"),
        (0, min, s) => format!("{min} min {s} s"),
        (h, min, _) => format!("{h} h {min} min"),
    }
}

/// Returns `60,5` with a decimal point.
pub fn decimal_point(value: &str) -> Option<String> {
    let (whole, rest) = value.split_once(',')?;
    let are_digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    (are_digits(whole.trim_start_matches(['+', '-'])) && are_digits(rest)).then(|| format!("{whole}.{rest}"))
}

/// Formats bytes as hexadecimal digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Describes the board's clock relative to the computer's. An emulated board may run several times as fast as real time; the
/// computer's load moves its clock then.
pub fn clock(clock: &ClockMeta) -> String {
    let drift = clock.drift_ppm;
    if drift.abs() >= 1e4 {
        return format!("{:.2} times real time", 1.0 + drift * 1e-6);
    }
    let pings = count(clock.pings as usize, "ping");
    format!("{} ppm, residual {:.0} µs, {pings}", signed(drift, 1), clock.residual_us)
}

/// Describes how the robot came to rest before a trial.
pub fn rest(rest: &RestMeta) -> String {
    let state = if rest.still { "still" } else { "not still" };
    format!("{state} after a wait of {:.1} s", rest.waited_s)
}

/// Returns the name of a value in JSON, with spaces instead of underscores.
pub fn word(value: &impl serde::Serialize) -> String {
    serde_json::to_value(value).ok().and_then(|name| Some(name.as_str()?.replace('_', " "))).unwrap_or_default()
}

/// Serialises a path as text. JSON is Unicode, so other bytes become replacement characters. For
/// `#[serde(serialize_with)]`.
pub fn path<S: Serializer>(path: impl AsRef<Path>, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&path.as_ref().to_string_lossy())
}

/// Describes where a trial ran.
pub fn origin(origin: Origin) -> &'static str {
    match origin {
        Origin::Rig => "measured on the rig",
        Origin::VirtualRig => "measured on the emulated board",
        Origin::Model => "computed by the model",
        Origin::Imported => "measured by other instruments",
    }
}

/// Makes foreign text safe to print: names and notes in plans and logs may hold anything. Characters that move the
/// cursor, colour the terminal or change the text's direction are escaped. Line ends and tabs stay.
pub fn printable(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for c in text.replace("\r\n", "\n").chars() {
        if is_unprintable(c) { shown.extend(c.escape_unicode()) } else { shown.push(c) }
    }
    shown
}

/// Returns foreign text on one line.
pub fn line(text: &str) -> String {
    printable(text).replace('\n', " ")
}

/// Formats JSON without these characters and without those that control a terminal. They only occur within strings,
/// where JSON can escape them.
pub fn json_without(value: &serde_json::Value, characters: &[char]) -> String {
    let mut text = String::new();
    for c in value.to_string().chars() {
        let is_unwanted = is_unprintable(c) || characters.contains(&c);
        // Four hexadecimal digits are enough for all of them.
        if is_unwanted { text += &format!("\\u{:04x}", u32::from(c)) } else { text.push(c) }
    }
    text
}

/// Returns whether a character controls a terminal or the direction of text.
fn is_unprintable(c: char) -> bool {
    let is_direction =
        matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    is_direction || c.is_control() && c != '\n' && c != '\t'
}

/// Returns an error and its causes. Libraries often repeat a cause in the message; it is then left out.
pub fn with_causes(error: &dyn Error) -> Vec<String> {
    let mut messages = vec![error.to_string()];
    for cause in std::iter::successors(error.source(), |&cause| cause.source()) {
        let message = cause.to_string();
        if !messages.iter().any(|seen| seen.contains(&message)) {
            messages.push(message);
        }
    }
    messages
}

/// Returns a sentence with a capital at its start.
pub fn capitalised(sentence: &str) -> String {
    let (first, rest) = sentence.split_at(sentence.len().min(1));
    first.to_ascii_uppercase() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_have_two_units_at_most() {
        let texts = [0.4, 45.0, 60.0, 520.0, 3599.6, 32_610.0].map(duration);
        assert_eq!(texts, ["0 s", "45 s", "1 min", "8 min 40 s", "1 h 0 min", "9 h 3 min"]);
    }

    #[test]
    fn foreign_text_cannot_control_a_terminal() {
        assert_eq!(printable("Größe 漢字 °\tü\r\n"), "Größe 漢字 °\tü\n");
        assert_eq!(printable("a\x1b[2J\u{9b}1m\u{202e}\x07\r"), "a\\u{1b}[2J\\u{9b}1m\\u{202e}\\u{7}\\u{d}");
        assert_eq!(line("one\nerror: two"), "one error: two");
    }

    #[test]
    fn numbers_are_formatted() {
        assert_eq!([decimal(-0.001, 2), decimal(-0.006, 2), decimal(2.449, 1)], ["0.00", "-0.01", "2.4"]);
        assert_eq!([signed(0.001, 2), signed(0.5, 2), signed(-0.5, 2)], ["0.00", "+0.50", "-0.50"]);
        assert_eq!([listed(&["a"]), listed(&["a", "b", "c"]), listed(&[""; 0])], ["a", "a, b and c", ""]);
        assert_eq!([count(1, "trial"), count(0, "trial"), count(75, "trial")], ["1 trial", "0 trials", "75 trials"]);
    }
}
