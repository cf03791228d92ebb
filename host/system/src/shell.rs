//! Commands of the shell: run, and shown.

pub use crate::own::shell::{INSTALL, command, quoted};

use std::path::Path;

/// Quotes text for a shell of Unix, on any system, unless it is a plain word.
pub fn quoted_for_sh(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_=+,./:@%".contains(c);
    if !text.is_empty() && text.chars().all(is_plain) {
        return text.to_owned();
    }
    format!("'{}'", text.replace('\'', r"'\''"))
}

/// Returns the command that started this program, for a shell.
pub fn command_line() -> String {
    let mut words = std::env::args_os().map(|word| word.to_string_lossy().into_owned());
    let program = words.next().unwrap_or_default();
    let program = Path::new(&program).file_stem().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    std::iter::once(program).chain(words).map(|word| quoted(&word)).collect::<Vec<_>>().join(" ")
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    /// A shell gets the same text back, whatever it contains.
    #[test]
    fn text_is_quoted_for_a_shell() {
        for text in ["plain", "two words", "it's $HOME `date` \"x\" \\ *", "line\nend"] {
            let output = command(&format!("printf %s {}", quoted(text))).output().unwrap();
            assert_eq!(String::from_utf8_lossy(&output.stdout), text);
        }
    }
}
