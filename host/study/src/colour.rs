//! Colours the program's output on a terminal.

use anstyle::{AnsiColor, Style};
use std::io::{self, Write};

/// Labels at the start of a line, after spaces, and their colours on a terminal.
const LABELS: [(&str, AnsiColor); 8] = [
    ("error:", AnsiColor::Red),
    ("because:", AnsiColor::Red),
    ("PROBLEM ", AnsiColor::Red),
    ("warning:", AnsiColor::Yellow),
    ("note:", AnsiColor::Cyan),
    ("help:", AnsiColor::Cyan),
    ("fix:", AnsiColor::Cyan),
    ("ok ", AnsiColor::Green),
];

/// Prints a text on stdout: in colour on a terminal, unless `NO_COLOR` is set.
pub fn print(text: &str) -> io::Result<()> {
    anstream::stdout().write_all(labelled(text).as_bytes())
}

/// Prints a text on stderr in the same way. A closed stderr is not an error.
pub fn eprint(text: &str) {
    let _ = anstream::stderr().write_all(labelled(text).as_bytes());
}

/// Returns the text with its labels in colour.
fn labelled(text: &str) -> String {
    text.split_inclusive('\n').map(labelled_line).collect()
}

fn labelled_line(line: &str) -> String {
    let start = line.len() - line.trim_start().len();
    let (indent, rest) = line.split_at(start);
    match LABELS.iter().find(|(label, _)| rest.starts_with(label)) {
        Some((label, colour)) => {
            let style = Style::new().bold().fg_color(Some((*colour).into()));
            format!("{indent}{style}{label}{style:#}{}", &rest[label.len()..])
        }
        None => line.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_coloured_and_nothing_else() {
        let text = "error: no such plan\n  help: check the path; error: is no label here\nok\n";
        let coloured = labelled(text);
        assert!(coloured.starts_with("\x1b[1m\x1b[31merror:\x1b[0m no such plan\n  \x1b[1m\x1b[36mhelp:\x1b[0m check"));
        assert!(coloured.ends_with("; error: is no label here\nok\n"), "{coloured:?}");
        assert_eq!(anstream::adapter::strip_str(&coloured).to_string(), text);
    }
}
