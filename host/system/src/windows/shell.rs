//! The shell of a user's commands.

use std::os::windows::process::CommandExt;
use std::process::Command;

/// The command that installs a program, without its name.
pub const INSTALL: &str = "winget install";

/// Returns the shell that runs a user's command.
pub fn command(line: &str) -> Command {
    let mut shell = Command::new("cmd");
    // With /S the shell removes the outer quotes, and keeps the quotes of the line.
    shell.raw_arg(format!("/D /S /C \"{line}\""));
    shell
}

/// Quotes text for `cmd` and PowerShell, unless it is a plain word.
pub fn quoted(text: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || r"-_=+./:\".contains(c);
    if !text.is_empty() && text.chars().all(is_plain) {
        return text.to_owned();
    }
    // Backslashes in front of a quotation mark are doubled for the program that is started.
    let mut quoted = String::from('"');
    let mut slashes = 0;
    for c in text.chars() {
        if c == '"' {
            quoted.push_str(&"\\".repeat(slashes + 1));
        }
        slashes = if c == '\\' { slashes + 1 } else { 0 };
        quoted.push(c);
    }
    quoted + &"\\".repeat(slashes) + "\""
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Stdio;

    #[test]
    fn a_line_reaches_the_shell_as_it_is() {
        let output = command("echo one&echo \"two words\"").stdin(Stdio::null()).output().unwrap();
        let said = String::from_utf8_lossy(&output.stdout);
        assert_eq!(said.lines().map(str::trim_end).collect::<Vec<_>>(), ["one", "\"two words\""]);
    }

    #[test]
    fn text_is_quoted_for_a_program() {
        let cases =
            [("plain", "plain"), (r"C:\a\b.mcap", r"C:\a\b.mcap"), ("two words", "\"two words\""), ("", "\"\"")];
        for (text, expected) in cases {
            assert_eq!(quoted(text), expected);
        }
        assert_eq!(quoted("a \"b\" c\\"), r#""a \"b\" c\\""#);
    }
}
