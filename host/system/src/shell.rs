//! Commands of the shell: run, and shown.

use std::process::Command;

/// Returns the shell that runs a user's command.
pub fn command(line: &str) -> Command {
    let mut shell = Command::new("sh");
    shell.args(["-c", line]);
    shell
}

/// Quotes text for a shell, unless it is a plain word.
pub fn quoted(text: &str) -> String {
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
    let program = program.rsplit_once('/').map_or(program.as_str(), |(_, name)| name).to_owned();
    std::iter::once(program).chain(words).map(|word| quoted(&word)).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
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
