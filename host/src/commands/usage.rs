//! Errors of the command line: the hints of common mistakes, and their form as JSON.

use crate::text::decimal_point;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use std::error::Error;
use std::num::ParseIntError;
use system::shell::quoted;

/// Options of the same meaning in other commands.
const ALIKE: [(&str, &str); 2] = [("--run", "--duration"), ("--duration", "--run")];

/// Adds the hint of a common mistake, such as a decimal comma, and removes one that misleads.
pub(super) fn with_hint(mut error: clap::Error) -> clap::Error {
    match hint(&error) {
        Some(hint) => {
            error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![hint.into()]));
        }
        // The advice to write the unknown option after `--` makes a value of it.
        None if error.kind() == ErrorKind::UnknownArgument && error.get(ContextKind::SuggestedArg).is_none() => {
            error.remove(ContextKind::Suggested);
        }
        None => {}
    }
    error
}

fn hint(error: &clap::Error) -> Option<String> {
    let text = |kind| error.get(kind).map(ToString::to_string).unwrap_or_default();
    let (command, argument, value) =
        (text(ContextKind::InvalidSubcommand), text(ContextKind::InvalidArg), text(ContextKind::InvalidValue));
    let is_whole = error.source().is_some_and(|source| source.is::<ParseIntError>());
    // A comma also separates two values: `--speeds <W1,W2>`.
    if let Some(number) = decimal_point(&value).filter(|_| !argument.contains(',') && !is_whole) {
        return Some(format!("write a decimal point: {number}"));
    }
    if command.ends_with(".toml") {
        return Some(format!("`biflag plan check {}` checks a plan", quoted(&command)));
    }
    match error.kind() {
        ErrorKind::MissingRequiredArgument if argument.contains("--out") => {
            Some("name the file to write, with -o; nothing was done without it".to_owned())
        }
        ErrorKind::UnknownArgument if argument.parse::<f64>().is_ok() || decimal_point(&argument).is_some() => {
            Some("write a negative value after `=`, as --speeds=-90,90".to_owned())
        }
        ErrorKind::UnknownArgument => {
            let (_, other) = ALIKE.into_iter().find(|(option, _)| argument == *option)?;
            Some(format!("did you mean {other}?"))
        }
        _ => None,
    }
}

/// Returns an error as JSON from what it prints: the message, and its tips as the help.
pub(super) fn json(printed: &str) -> serde_json::Value {
    let one_line = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let mut parts = printed.split("\n\n");
    let error = one_line(parts.next().unwrap_or_default().trim_start_matches("error: "));
    let tips: Vec<_> = parts
        .flat_map(str::lines)
        .filter_map(|line| line.trim().strip_prefix("tip: ").or_else(|| line.strip_prefix("Usage: ")))
        .collect();
    serde_json::json!({ "error": error, "help": tips.first().map(|tip| one_line(tip)) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_has_a_message_and_its_help() {
        let printed = "error: unexpected argument '--seeds' found\n\n  tip: a similar argument exists: '--seed'\n\nUsage: biflag record [OPTIONS] <PLAN>\n       biflag record [OPTIONS] --speeds <W1,W2> [--run <S>]\n\nFor more information, try '--help'.\n";
        let expected = serde_json::json!({ "error": "unexpected argument '--seeds' found", "help": "a similar argument exists: '--seed'" });
        assert_eq!(json(printed), expected);
        let missing = "error: the following required arguments were not provided:\n  --pitch <DEG>\n\nUsage: biflag aim --yaw <DEG> --pitch <DEG>\n";
        let expected = serde_json::json!({
            "error": "the following required arguments were not provided: --pitch <DEG>",
            "help": "biflag aim --yaw <DEG> --pitch <DEG>",
        });
        assert_eq!(json(missing), expected);
    }
}
