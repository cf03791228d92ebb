//! A TOML file with its name: reads it into types, and describes every mistake in plain words with its line.

use super::error::PlanError;
use super::shipped::Shipped;
use crate::text::decimal_point;
use biflag_log::similar::suggest;
use serde::Deserialize;
use serde::de::{DeserializeOwned, Deserializer, Error};
use std::fmt::{Display, LowerExp};
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::ops::Range;
use std::path::Path;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Longest file that is read, bytes. Longer files and endless devices are refused as another kind of file.
const LONGEST_FILE: u64 = 4 << 20;

/// The name of each kind of file, with tables that only this kind has.
const KINDS: [(&str, &[&str]); 4] = [
    ("the plan of a sweep", &["vary"]),
    ("a plan", &["speeds", "trial", "session"]),
    ("a robot file", &["flagellum", "fluid", "joint", "base", "tank", "head", "contact", "solver"]),
    ("a sensor file", &["gyro_scale", "gyro_axes"]),
];

/// A kind of file, and the meaning of its keys.
pub(crate) struct FileKind {
    /// The word for the file in messages.
    pub noun: &'static str,
    /// A hint at an example.
    pub example: &'static str,
    /// Keys that are tables. serde itself would take a list of their values too.
    pub tables: &'static [&'static str],
    /// The meaning and range of a key, as an instruction; `None` for a key that explains itself.
    pub help: fn(&str) -> Option<&'static str>,
}

/// A file's text and name.
pub(crate) struct Source<'a> {
    pub kind: &'static FileKind,
    pub text: &'a str,
    /// The name of the file in messages.
    pub name: &'a str,
}

impl FileKind {
    /// Reads the text of a file of this kind: the file at `path`, or else the one of this name inside the program.
    pub fn read(&self, path: &Path) -> Result<String, PlanError> {
        let mut text = String::new();
        let read = File::open(path).and_then(|file| file.take(LONGEST_FILE + 1).read_to_string(&mut text));
        if (read.as_ref().is_err_and(|error| error.kind() == ErrorKind::NotFound) || path.is_dir())
            && let Some(file) = Shipped::find(path)
        {
            return Ok(file.text.to_owned());
        }
        match read {
            Ok(length) if length as u64 <= LONGEST_FILE => Ok(text),
            Err(source) if source.kind() != ErrorKind::InvalidData => {
                Err(PlanError::Read { path: path.to_owned(), noun: self.noun, source })
            }
            _ => Err(self.is_not(&path.display().to_string())),
        }
    }

    /// Returns the error for a file of another kind.
    pub fn is_not(&self, name: &str) -> PlanError {
        PlanError::Invalid { place: name.to_owned(), what: format!("this is not a {}", self.noun), cure: self.format() }
    }

    fn format(&self) -> String {
        format!("a {} is a TOML file in UTF-8; {}", self.noun, self.example)
    }

    /// Returns whether a line opens a table or sets a key of this kind of file.
    fn has(&self, line: &str) -> bool {
        let line = line.trim_start();
        let (is_header, line) = line.strip_prefix('[').map_or((false, line), |rest| (true, rest));
        let end = line.find(|c: char| !c.is_ascii_alphanumeric() && c != '_').unwrap_or(line.len());
        let (word, rest) = line.split_at(end);
        let is_table = self.tables.contains(&word);
        let is_set = rest.trim_start().starts_with(['=', '.']);
        if is_header { is_table } else { is_set && (is_table || (self.help)(word).is_some()) }
    }
}

impl Source<'_> {
    /// Reads the file into `T`.
    pub fn read<T: DeserializeOwned>(&self) -> Result<T, PlanError> {
        let table = DeTable::parse(self.text).map_err(|error| self.wrong_syntax(&error))?;
        self.check_tables(table.get_ref())?;
        toml::from_str(self.text).map_err(|error| match self.other_kind(table.get_ref()) {
            Some(other) => PlanError::Invalid {
                place: self.name.to_owned(),
                what: format!("this is {other}, not a {}", self.kind.noun),
                cure: self.kind.format(),
            },
            None => self.wrong_value(table.get_ref(), &error),
        })
    }

    /// Returns the actual kind of a file that has a table of another kind, and none of the expected kind.
    fn other_kind(&self, table: &DeTable) -> Option<&'static str> {
        let has = |names: &[&str]| table.iter().any(|(key, _)| names.contains(&key.get_ref().as_ref()));
        let (other, _) = KINDS.iter().find(|(_, names)| has(names))?;
        let is_own = other.ends_with(self.kind.noun) || has(self.kind.tables);
        (!is_own).then_some(other)
    }

    /// Refuses other values where a table belongs.
    fn check_tables(&self, table: &DeTable) -> Result<(), PlanError> {
        table.iter().try_for_each(|(key, value)| match value.get_ref() {
            DeValue::Table(inner) => self.check_tables(inner),
            _ if !self.kind.tables.contains(&key.get_ref().as_ref()) => Ok(()),
            _ => {
                let key = key.get_ref();
                let written = shorten(self.text.get(value.span()).unwrap_or_default());
                let cure = (self.kind.help)(key).map_or_else(|| format!("write it as a table: [{key}]"), str::to_owned);
                Err(self.error(value.span(), format!("{key} cannot be {written}"), cure))
            }
        })
    }

    /// Returns the name of a session or sweep, without surrounding space.
    pub fn session_name(&self, name: Option<Spanned<String>>, default: &str) -> Result<String, PlanError> {
        match name {
            None => Ok(default.to_owned()),
            Some(name) if name.get_ref().trim().is_empty() => {
                let cure = "give it a name, or leave the key out";
                Err(self.error(name.span(), "the name of the session is empty", cure))
            }
            Some(name) => Ok(name.get_ref().trim().to_owned()),
        }
    }

    /// Returns an error at `span`.
    pub fn error(&self, span: Range<usize>, what: impl Into<String>, cure: impl Into<String>) -> PlanError {
        let before = &self.text[..self.text.floor_char_boundary(span.start)];
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
        PlanError::Invalid { place: format!("{}:{line}:{column}", self.name), what: what.into(), cure: cure.into() }
    }

    /// Returns the error for a value that `key` cannot have.
    pub fn out_of_range(&self, span: Range<usize>, key: &str, value: impl Display) -> PlanError {
        self.error(span, format!("{key} cannot be {value}"), (self.kind.help)(key).unwrap_or_default())
    }

    /// Converts the value of a key that may be missing. The value is out of range if `convert` returns `None`.
    pub fn checked<T: Display, U>(
        &self,
        value: &Option<Spanned<T>>,
        key: &str,
        convert: impl FnOnce(&T) -> Option<U>,
    ) -> Result<Option<U>, PlanError> {
        let Some(value) = value else { return Ok(None) };
        let converted = convert(value.get_ref()).map(Some);
        converted.ok_or_else(|| self.out_of_range(value.span(), key, value.get_ref()))
    }

    /// Returns an error at the value of the key at `path`, or at no line if the file does not set the key.
    pub fn error_at<'k>(
        &self,
        path: impl IntoIterator<Item = &'k str>,
        what: impl Into<String>,
        cure: impl Into<String>,
    ) -> PlanError {
        let found = DeTable::parse(self.text).ok().and_then(|table| span_of(table.get_ref(), path));
        match found {
            Some(span) => self.error(span, what, cure),
            None => PlanError::Invalid { place: self.name.to_owned(), what: what.into(), cure: cure.into() },
        }
    }

    /// Returns the error for text that is not TOML.
    fn wrong_syntax(&self, error: &toml::de::Error) -> PlanError {
        if !self.text.lines().any(|line| self.kind.has(line)) {
            return self.kind.is_not(self.name);
        }
        let span = error.span().unwrap_or(0..0);
        if let Some((key, value)) = self.setting(span.start) {
            let written = shorten(format!("{key} = {value}").trim_end());
            if let Some(point) = decimal_point(value) {
                let what = format!("{written}: TOML has no decimal comma");
                return self.error(span, what, format!("write {key} = {point}"));
            }
            if let Some(number) = without_unit(value) {
                let cure = (self.kind.help)(key).map_or_else(|| format!("write {key} = {number}"), str::to_owned);
                return self.error(span, format!("{written}: give the number without a unit"), cure);
            }
            let cure = (self.kind.help)(key).map_or_else(|| format!("write {key} = {value:?}"), str::to_owned);
            if value.starts_with(|c: char| c.is_alphabetic()) {
                return self.error(span, format!("{written}: text needs quotes"), cure);
            }
            if value.starts_with('"') && value.contains('\\') {
                let cure = "write / in a path, or put it in single quotes";
                return self.error(span, format!("{written}: \\ begins an escape here"), cure.to_owned());
            }
            if error.message().starts_with("string values must be quoted") {
                return self.error(span, format!("{written}: this is not a value"), cure);
            }
        }
        let what = error.message().trim().replace('\n', "; ");
        let cure = match what.as_str() {
            "duplicate key" => "leave one of them out".to_owned(),
            _ => self.kind.format(),
        };
        self.error(span, what, cure)
    }

    /// Returns the key and the value, as written, of the line at `offset`.
    fn setting(&self, offset: usize) -> Option<(&str, &str)> {
        let at = self.text.floor_char_boundary(offset);
        let start = self.text[..at].rfind('\n').map_or(0, |end| end + 1);
        let line = self.text[start..].lines().next()?;
        let (key, value) = line.split('#').next()?.split_once('=')?;
        Some((key.trim(), value.trim()))
    }

    /// Returns the error for TOML that does not fit the types.
    fn wrong_value(&self, table: &DeTable, error: &toml::de::Error) -> PlanError {
        let message = error.message().trim();
        let span = error.span().unwrap_or(0..0);
        let quoted = message.split('`').nth(1).unwrap_or_default();
        let expected = message.split_once("expected ").map(|(_, expected)| expected);
        if message.starts_with("unknown field") {
            let cure = expected.map_or("leave it out".to_owned(), |keys| format!("write {keys}, or leave it out"));
            let keys = expected.unwrap_or_default().split('`').skip(1).step_by(2);
            return self.error(span, format!("unknown key `{quoted}`"), suggest(quoted, keys, &cure));
        }
        if message.starts_with("missing field") {
            let cure = (self.kind.help)(quoted).map_or_else(|| self.kind.example.to_owned(), str::to_owned);
            return self.error(span, format!("the key `{quoted}` is missing"), cure);
        }
        let Some((key, whole)) = key_at(table, span.start) else {
            return self.error(span, message.replace('\n', "; "), self.kind.example);
        };
        let verb = if span == whole { "cannot be" } else { "cannot hold" };
        let written = shorten(self.text.get(span.clone()).unwrap_or_default());
        let of_type = || type_help(expected.unwrap_or(message));
        let cure = (self.kind.help)(key).map_or_else(of_type, str::to_owned);
        self.error(span, format!("{key} {verb} {written}"), cure)
    }
}

/// Returns the first line of a text, shortened to fit a message.
fn shorten(text: &str) -> String {
    let line = text.lines().next().unwrap_or_default();
    let end = line.char_indices().nth(40).map_or(line.len(), |(end, _)| end);
    if end < text.trim_end().len() { format!("{}...", &line[..end]) } else { line.to_owned() }
}

/// Returns the help text for the type that serde expects.
fn type_help(expected: &str) -> String {
    match expected {
        "f64" | "f32" => "give a number".to_owned(),
        "bool" | "a boolean" => "give true or false".to_owned(),
        "a string" => "give text in quotes".to_owned(),
        "i64" | "usize" | "u8" | "u16" | "u32" | "u64" => "give a whole number".to_owned(),
        expected if expected.starts_with("struct") => "write it as a table".to_owned(),
        expected if expected.starts_with("an array of length") => {
            expected.replace("an array of length", "give a list of")
        }
        expected => format!("give {expected}"),
    }
}

/// Returns the key whose value contains `offset`, and the span of the value.
fn key_at<'t>(table: &'t DeTable, offset: usize) -> Option<(&'t str, Range<usize>)> {
    table.iter().find_map(|(key, value)| {
        let inner = value.get_ref().as_table().and_then(|inner| key_at(inner, offset));
        inner.or_else(|| value.span().contains(&offset).then(|| (key.get_ref().as_ref(), value.span())))
    })
}

/// Returns the span of the value at `path`.
fn span_of<'k>(table: &DeTable, path: impl IntoIterator<Item = &'k str>) -> Option<Range<usize>> {
    let mut path = path.into_iter();
    let name = path.next()?;
    let (_, value) = table.iter().find(|(key, _)| key.get_ref() == name)?;
    if let DeValue::Table(inner) = value.get_ref() { span_of(inner, path) } else { Some(value.span()) }
}

/// Returns the number in `60 s`.
fn without_unit(value: &str) -> Option<&str> {
    let end = value.rfind(|c: char| c.is_ascii_digit())? + 1;
    let (number, unit) = value.split_at(end);
    (number.parse::<f64>().is_ok()
        && unit.trim_start().starts_with(|c: char| c.is_alphabetic() || c == '°' || c == '%'))
    .then_some(number)
}

/// Returns a numeric value.
pub(crate) fn real(value: &toml::Value) -> Option<f64> {
    value.as_float().or_else(|| Some(value.as_integer()? as f64))
}

/// Formats a number for a message; very large and very small numbers get scientific notation.
pub(crate) fn number<T: Into<f64> + Copy + Display + LowerExp>(value: T) -> String {
    let size = value.into().abs();
    if size.is_finite() && size != 0.0 && !(1e-4..1e7).contains(&size) {
        format!("{value:e}")
    } else {
        value.to_string()
    }
}

/// A list of `N` values; serde itself ignores surplus values of an array.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Exactly<T, const N: usize>(pub [T; N]);

impl<'de, T: Deserialize<'de>, const N: usize> Deserialize<'de> for Exactly<T, N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let list = Vec::deserialize(deserializer)?;
        list.try_into().map(Self).map_err(|_| D::Error::custom(format!("expected {N} values")))
    }
}

/// Deserialises an optional array, for `#[serde(deserialize_with)]`.
pub(crate) fn optional_array<'de, D: Deserializer<'de>, T: Deserialize<'de>, const N: usize>(
    deserializer: D,
) -> Result<Option<[T; N]>, D::Error> {
    Ok(Option::<Exactly<T, N>>::deserialize(deserializer)?.map(|list| list.0))
}
