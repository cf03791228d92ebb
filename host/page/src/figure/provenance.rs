//! The provenance of a figure, inside its file: title, command, program, and the logs with their SHA-256.
//!
//! An SVG has it as `<title>` and `<desc>`, a PNG as text of the keywords `Title` and `Description`, a PDF as title and
//! subject of its information dictionary.

use super::Format;
use crate::PageError;
use maud::html;
use sha2::{Digest, Sha256};
use std::path::Path;
use study::program::FULL_VERSION;
use study::text::{hex, printable};
use study::trial::Data;
use system::shell::command_line;

/// Largest number of listed logs; a map may have ten thousand.
const MAX_LOGS: usize = 500;

/// The provenance of a figure.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(super) struct Provenance {
    title: String,
    pub logs: Vec<String>,
}

impl Provenance {
    pub fn new(title: impl Into<String>, logs: impl IntoIterator<Item = String>) -> Self {
        Self { title: title.into(), logs: logs.into_iter().collect() }
    }

    /// Returns a log as a line, with its hash if it was computed.
    pub fn log(data: &Data) -> String {
        line("log", &data.path, data.sha256.as_deref())
    }

    /// Returns another file as a line, after its kind.
    pub fn file(what: &str, path: &Path) -> String {
        let sum = std::fs::read(path).map(|bytes| hex(&Sha256::digest(bytes)));
        line(what, path, sum.ok().as_deref())
    }

    fn text(&self) -> String {
        let mut lines = vec![command_line(), format!("biflag {FULL_VERSION}")];
        lines.extend(self.logs.iter().take(MAX_LOGS).cloned());
        if let Some(more) = self.logs.len().checked_sub(MAX_LOGS).filter(|more| *more > 0) {
            lines.push(format!("and {more} more logs"));
        }
        printable(&lines.join("\n"))
    }

    /// Returns the file with its provenance.
    ///
    /// # Errors
    /// [`PageError::Convert`] if the file has another form than its format.
    pub fn add(&self, file: Vec<u8>, format: Format) -> Result<Vec<u8>, PageError> {
        let title = printable(&self.title);
        let added = match format {
            Format::Svg => svg(&file, &title, &self.text()),
            Format::Png => png(&file, &title, &self.text()),
            Format::Pdf => pdf(&file, &title, &self.text()),
        };
        added.ok_or_else(|| PageError::Convert { reason: "its metadata have no place".to_owned() })
    }
}

fn line(what: &str, path: &Path, sha256: Option<&str>) -> String {
    let sum = sha256.map_or_else(String::new, |sum| format!(", SHA-256 {sum}"));
    format!("{what} {}{sum}", path.display())
}

fn svg(file: &[u8], title: &str, text: &str) -> Option<Vec<u8>> {
    let start = file.iter().position(|byte| *byte == b'>')? + 1;
    let added = html! { title { (title) } desc { (text) } };
    Some([&file[..start], added.0.as_bytes(), &file[start..]].concat())
}

/// Adds two chunks `iTXt` after the header, which is the first chunk (PNG specification, 11.3.3.4).
fn png(file: &[u8], title: &str, text: &str) -> Option<Vec<u8>> {
    let chunk = |keyword: &str, text: &str| {
        // No compression, no language, no translated keyword.
        let data = [keyword.as_bytes(), &[0; 5], text.as_bytes()].concat();
        let body = [b"iTXt", data.as_slice()].concat();
        let length = u32::try_from(data.len()).ok()?;
        Some([&length.to_be_bytes(), body.as_slice(), &crc32fast::hash(&body).to_be_bytes()].concat())
    };
    let (head, rest) = file.split_at_checked(8 + 4 + 4 + 13 + 4)?;
    Some([head, &chunk("Title", title)?, &chunk("Description", text)?, rest].concat())
}

/// Appends an information dictionary as an incremental update (ISO 32000-1, 7.5.6 and 14.3.3).
fn pdf(file: &[u8], title: &str, text: &str) -> Option<Vec<u8>> {
    let end = String::from_utf8_lossy(&file[file.len().saturating_sub(400)..]).into_owned();
    let after = |key: &str| end.rsplit_once(key).map(|(_, rest)| rest.trim_start());
    let number = |text: &str| text.split(|c: char| !c.is_ascii_digit()).next()?.parse::<usize>().ok();
    let (size, root, before) = (number(after("/Size")?)?, number(after("/Root")?)?, number(after("startxref")?)?);
    let string = |text: &str| -> String {
        let units = text.encode_utf16().map(|unit| format!("{unit:04X}"));
        format!("<FEFF{}>", units.collect::<String>())
    };
    let mut file = file.to_vec();
    if file.last() != Some(&b'\n') {
        file.push(b'\n');
    }
    let object = file.len();
    let producer = string(&format!("biflag {FULL_VERSION}"));
    let (title, subject) = (string(title), string(text));
    let information = format!("<< /Title {title} /Subject {subject} /Creator {producer} >>");
    file.extend(format!("{size} 0 obj\n{information}\nendobj\n").into_bytes());
    let (table, next) = (file.len(), size + 1);
    let entries = format!("xref\n0 1\n0000000000 65535 f \n{size} 1\n{object:010} 00000 n \n");
    let trailer = format!("trailer\n<< /Size {next} /Root {root} 0 R /Info {size} 0 R /Prev {before} >>\n");
    file.extend(format!("{entries}{trailer}startxref\n{table}\n%%EOF\n").into_bytes());
    Some(file)
}
