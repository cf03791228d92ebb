//! The result of `biflag sweep`.

use super::super::{Answer, Outcome};
use crate::text::count;
use serde::Serialize;
use std::path::Path;

#[derive(Debug, Serialize)]
pub struct Swept {
    /// The table as Parquet; `null` where it was not written, as by a shard.
    pub table: Option<String>,
    /// The table as CSV.
    pub csv: Option<String>,
    /// Number of points of the plan, or of the shard.
    pub points: u64,
    /// How many of them have a result, failed ones too.
    pub done: u64,
    pub missing: u64,
    pub failed: u64,
    pub warnings: Vec<String>,
}

#[derive(Debug, Serialize)]
pub struct Status {
    #[serde(flatten)]
    pub swept: Swept,
    /// Time that the workers at work need for the missing points; `null` if none is at work.
    pub time_left_s: Option<f64>,
}

impl Swept {
    pub fn answer(&self, folder: &Path) -> miette::Result<Answer> {
        let is_whole = self.missing == 0 && self.failed == 0 && self.warnings.is_empty();
        Answer::new(if is_whole { Outcome::Done } else { Outcome::WithLoss }, self, self.text(folder))
    }

    fn text(&self, folder: &Path) -> String {
        let points = count(self.points as usize, "point");
        let mut text = format!("{}: {} of {points} done", folder.display(), self.done);
        for (number, what) in [(self.missing, "missing"), (self.failed, "failed")] {
            if number > 0 {
                text += &format!(", {number} {what}");
            }
        }
        if let Some(table) = &self.table {
            text += &format!("; table {table}");
        }
        self.warnings.iter().for_each(|warning| text += &format!("\nwarning: {warning}"));
        text
    }
}

impl Status {
    pub fn text(&self, folder: &Path) -> String {
        let left = match self.time_left_s {
            _ if self.swept.missing == 0 => String::new(),
            Some(seconds) => format!("\ntime left: {}", duration(seconds)),
            None => "\ntime left: unknown, no worker is at work".to_owned(),
        };
        self.swept.text(folder) + &left
    }
}

fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 90.0 => format!("{s:.0} s"),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s if s < 172_800.0 => format!("{:.1} h", s / 3600.0),
        s => format!("{:.1} days", s / 86_400.0),
    }
}
