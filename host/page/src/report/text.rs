//! Formats numbers and texts for the page.

use study::text::{decimal, json_without};

/// Formats degrees with this number of decimals and a proper minus sign.
pub(super) fn degrees(value: f64, decimals: usize) -> String {
    format!("{}°", number(value, decimals))
}

/// Formats a number with this number of decimals and a proper minus sign; a dash for a missing value.
pub(super) fn number(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    decimal(value, decimals).replace('-', "−")
}

/// Formats a pair of speeds.
pub(super) fn speeds([w1, w2]: [f64; 2]) -> String {
    format!("({}, {}) rpm", plain(w1), plain(w2))
}

/// Formats a number with as many decimals as it has, up to four.
pub(super) fn plain(value: f64) -> String {
    let value = (value * 1e4).round() / 1e4;
    if value < 0.0 { format!("−{}", -value) } else { format!("{}", value.abs()) }
}

/// Returns a coordinate rounded to a tenth.
pub(super) fn short(value: f64) -> f64 {
    (value * 10.0).round() / 10.0
}

/// Formats a count with its noun, in the singular or the plural.
pub(super) fn count(n: impl TryInto<u64>, one: &str, more: &str) -> String {
    let n = n.try_into().unwrap_or(u64::MAX);
    format!("{n} {}", if n == 1 { one } else { more })
}

/// Returns at most `most` characters, with an ellipsis if there were more. A log from elsewhere may contain any text.
pub(super) fn clip(text: &str, most: usize) -> String {
    text.char_indices().nth(most).map_or_else(|| text.to_owned(), |(end, _)| format!("{}…", &text[..end]))
}

/// Returns JSON for a `<script>` element, without any character that could end the element or begin another.
pub(super) fn json_for_script(value: &serde_json::Value) -> String {
    json_without(value, &['<', '>', '&', '\''])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_their_signs() {
        assert_eq!(degrees(-12.345, 2), "−12.35°");
        assert_eq!(number(-0.001, 2), "0.00");
        assert_eq!(number(f64::NAN, 2), "–");
        assert_eq!([plain(-0.00001), plain(-0.5), plain(12.345678)], ["0", "−0.5", "12.3457"]);
        assert_eq!([count(1, "trial", "trials"), count(0, "retry", "retries")], ["1 trial", "0 retries"]);
        assert_eq!(speeds([-90.0, 12.5]), "(−90, 12.5) rpm");
        assert_eq!(clip("αβγδ", 3), "αβγ…");
        assert_eq!(clip("αβγ", 3), "αβγ");
    }

    #[test]
    fn json_in_a_script_stays_json_and_ends_no_script() {
        let value = serde_json::json!({ "</script><!--": ["<script>", "a & b", "\u{2028}\u{2029}'\"\\"] });
        let text = json_for_script(&value);
        assert!(!text.contains(['<', '>', '&', '\'', '\u{2028}', '\u{2029}']));
        assert_eq!(serde_json::from_str::<serde_json::Value>(&text).unwrap(), value);
    }
}
