//! Golden files in `tests/golden`: public names and values as text. `BIFLAG_WRITE_GOLDEN=1` writes them again.

use crate::repository;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{self, Display, Formatter};
use std::fs;

/// Largest relative difference of equal numbers: another order of a sum changes the last bits.
const SAME: f64 = 1e-12;

/// Returns whether two texts are equal, except for the last digits of numbers.
fn is_same(one: &str, other: &str) -> bool {
    let words = |text: &str| -> Vec<String> {
        text.split_inclusive(|c: char| c.is_whitespace() || ",:[](){}".contains(c))
            .flat_map(|part| {
                let word = part.trim_end_matches(|c: char| c.is_whitespace() || ",:[](){}".contains(c));
                [word.to_owned(), part[word.len()..].to_owned()]
            })
            .collect()
    };
    let number = |word: &str| word.parse::<f64>().ok().filter(|number| number.is_finite());
    let is_same_word = |(a, b): (&String, &String)| {
        a == b || number(a).zip(number(b)).is_some_and(|(a, b)| (a - b).abs() <= SAME * a.abs().max(b.abs()))
    };
    let (one, other) = (words(one), words(other));
    one.len() == other.len() && one.iter().zip(&other).all(is_same_word)
}

/// Compares a text with a golden file, or writes the file if `BIFLAG_WRITE_GOLDEN` is set.
#[track_caller]
pub fn hold(name: &str, now: &str) {
    let path = repository().join("tests/golden").join(format!("{name}.txt"));
    if std::env::var_os("BIFLAG_WRITE_GOLDEN").is_some() {
        fs::create_dir_all(path.parent().expect("a folder")).expect("the folder of the golden files");
        fs::write(&path, now).expect("a golden file");
        return;
    }
    let before = fs::read_to_string(&path).unwrap_or_default();
    let (mut gone, mut new): (Vec<&str>, Vec<&str>) = (before.lines().collect(), now.lines().collect());
    let same = |a: &[&str], b: &[&str]| a.iter().zip(b).take_while(|(a, b)| is_same(a, b)).count();
    let head = same(&gone, &new);
    (gone, new) = (gone.split_off(head), new.split_off(head));
    gone.reverse();
    new.reverse();
    let tail = same(&gone, &new);
    let lines = |of: &[&str], mark: &str| {
        of.iter().skip(tail).rev().take(60).map(|line| format!("{mark} {line}\n")).collect::<String>()
    };
    assert!(
        is_same(&before, now),
        "tests/golden/{name}.txt, from line {}; if the change is wanted, BIFLAG_WRITE_GOLDEN=1 writes it:\n{}{}",
        head + 1,
        lines(&gone, "-"),
        lines(&new, "+")
    );
}

/// Compares the keys of a command's JSON with a golden file, like [`hold`].
#[track_caller]
pub fn hold_keys(command: &str, json: &Value) {
    hold(&format!("json/{command}"), &Keys::of(json).to_string());
}

/// The keys of JSON values, recursively, with the types that their values have.
#[derive(Debug, Default)]
pub struct Keys {
    types: BTreeSet<&'static str>,
    members: BTreeMap<String, Keys>,
    items: Option<Box<Keys>>,
}

impl Keys {
    /// Returns the keys of a value.
    pub fn of(value: &Value) -> Self {
        let mut keys = Self::default();
        keys.add(value);
        keys
    }

    /// Adds the keys of a value.
    pub fn add(&mut self, value: &Value) {
        match value {
            Value::Object(members) => {
                if members.is_empty() {
                    self.types.insert("{}");
                }
                members.iter().for_each(|(key, value)| self.members.entry(key.clone()).or_default().add(value));
            }
            Value::Array(items) => {
                let keys = self.items.get_or_insert_default();
                items.iter().for_each(|item| keys.add(item));
            }
            Value::Null => _ = self.types.insert("null"),
            Value::Bool(_) => _ = self.types.insert("bool"),
            Value::String(_) => _ = self.types.insert("text"),
            Value::Number(number) => _ = self.types.insert(if number.is_f64() { "real" } else { "integer" }),
        }
    }

    /// Returns the type in one line; `None` if it needs more.
    fn line(&self) -> Option<String> {
        let mut types: Vec<String> = self.types.iter().map(|&name| name.to_owned()).collect();
        match &self.items {
            Some(items) => types.push(format!("[{}]", items.line()?)),
            None if !self.members.is_empty() => return None,
            None => {}
        }
        Some(types.join(" or "))
    }

    fn write(&self, path: &str, f: &mut Formatter<'_>) -> fmt::Result {
        if let Some(line) = self.line() {
            return writeln!(f, "{path}: {line}");
        }
        let members: Option<Vec<_>> =
            self.members.iter().map(|(key, keys)| Some(format!("{key}: {}", keys.line()?))).collect();
        if let Some(members) = members.filter(|members| members.len() <= 3 && self.items.is_none()) {
            let types: String = self.types.iter().map(|name| format!(" or {name}")).collect();
            return writeln!(f, "{path}: {{{}}}{types}", members.join(", "));
        }
        if !self.types.is_empty() {
            let types: Vec<_> = self.types.iter().copied().collect();
            writeln!(f, "{path}: {}", types.join(" or "))?;
        }
        let dot = if path.is_empty() { "" } else { "." };
        self.members.iter().try_for_each(|(key, keys)| keys.write(&format!("{path}{dot}{key}"), f))?;
        self.items.iter().try_for_each(|items| items.write(&format!("{path}[]"), f))
    }
}

/// A line for each key.
impl Display for Keys {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.write("", f)
    }
}

/// Returns the values in JSON, a line each; real numbers to fourteen digits.
pub fn values(value: &Value) -> String {
    fn write(path: &str, value: &Value, text: &mut String) {
        match value {
            Value::Object(members) => {
                let dot = if path.is_empty() { "" } else { "." };
                members.iter().for_each(|(key, value)| write(&format!("{path}{dot}{key}"), value, text));
            }
            Value::Array(items) if items.iter().any(|item| item.is_object() || item.is_array()) => {
                items.iter().enumerate().for_each(|(i, item)| write(&format!("{path}[{i}]"), item, text));
            }
            Value::Array(items) => {
                let items: Vec<_> = items.iter().map(number).collect();
                *text += &format!("{path}: [{}]\n", items.join(", "));
            }
            value => *text += &format!("{path}: {}\n", number(value)),
        }
    }
    let mut text = String::new();
    write("", value, &mut text);
    text
}

/// Returns a value as text; a real number to fourteen digits.
pub fn number(value: &Value) -> String {
    match value {
        Value::Number(number) if number.is_f64() => {
            let rounded = format!("{:.13e}", number.as_f64().expect("a real number"));
            let rounded: f64 = rounded.parse().expect("a number");
            if rounded == 0.0 || rounded.abs() >= 1e-4 { rounded.to_string() } else { format!("{rounded:e}") }
        }
        Value::String(text) => text.clone(),
        value => value.to_string(),
    }
}
