//! The result of `biflag sweep`.

use super::super::answer::{Answer, Outcome};
use crate::sweep::{Reason, ShardCounts, Sweep};
use crate::text::count;
use serde::Serialize;
use serde_json::json;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

#[derive(Debug, Default, Serialize)]
pub struct Swept {
    /// The table as Parquet; `null` if it was not written, for instance by a shard.
    pub table: Option<String>,
    /// The table as CSV.
    pub csv: Option<String>,
    /// The cost of each point, as CSV.
    pub cost: Option<String>,
    /// Number of points of the plan, or of the shard.
    pub points: u64,
    /// Number of points with a result, including failed ones.
    pub done: u64,
    pub missing: u64,
    pub failed: u64,
    pub warnings: Vec<String>,
    pub notes: Vec<String>,
}

pub struct Status {
    pub swept: Swept,
    /// Time that the active workers need for the missing points; `null` if none is active.
    pub time_left_s: Option<f64>,
    /// The reasons for failed points, if requested.
    pub reasons: Option<Vec<Failed>>,
    /// The progress of each shard, if requested.
    pub shards: Option<Vec<ShardCounts>>,
}

/// Why points failed, with one of them.
#[derive(Debug, Serialize)]
pub struct Failed {
    pub points: u64,
    pub reason: String,
    pub w1_rpm: f64,
    pub w2_rpm: f64,
    /// The keys that vary.
    pub values: BTreeMap<String, f64>,
}

impl Failed {
    pub fn new(reason: Reason, sweep: &Sweep) -> Self {
        let point = sweep.point(reason.index);
        let keys = sweep.plan.axes.iter().map(|axis| axis.key.name().to_owned());
        let [w1_rpm, w2_rpm] = point.speeds_rpm;
        let values = keys.zip(point.values).collect();
        Self { points: reason.points, reason: reason.text, w1_rpm, w2_rpm, values }
    }
}

impl Swept {
    pub fn answer(&self, folder: &Path) -> miette::Result<Answer> {
        let is_whole = self.missing == 0 && self.failed == 0 && self.warnings.is_empty();
        Answer::new(Outcome::of(is_whole), self, self.text(folder))
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
        self.notes.iter().for_each(|note| text += &format!("\nnote: {note}"));
        text
    }
}

impl Status {
    pub fn answer(&self, folder: &Path) -> miette::Result<Answer> {
        let mut answer =
            Answer::new(Outcome::Done, &self.swept, self.text(folder))?.with("time_left_s", self.time_left_s);
        if let Some(reasons) = &self.reasons {
            answer = answer.with("reasons", reasons);
        }
        if let Some(shards) = &self.shards {
            let one = |(number, one): (u64, &ShardCounts)| {
                let ShardCounts { points, done, failed } = one;
                json!({ "shard": number, "points": points, "done": done, "missing": points - done, "failed": failed })
            };
            // From 1, as in `--shard`.
            answer = answer.with("shards", (1..).zip(shards).map(one).collect::<Vec<_>>());
        }
        Ok(answer)
    }

    fn text(&self, folder: &Path) -> String {
        let left = match self.time_left_s {
            _ if self.swept.missing == 0 => String::new(),
            Some(seconds) => format!("\ntime left: {}", duration(seconds)),
            None => "\ntime left: unknown, no worker is at work".to_owned(),
        };
        let mut text = self.swept.text(folder) + &left;
        // Writing to a string cannot fail.
        for Failed { points, reason, w1_rpm, w2_rpm, values } in self.reasons.iter().flatten() {
            let _ = write!(text, "\n{}: {reason}\n    as at {w1_rpm}, {w2_rpm} rpm", count(*points as usize, "point"));
            values.iter().for_each(|(key, value)| text += &format!(", {key} {value}"));
        }
        if let Some(shards) = &self.shards {
            let whole = shards.iter().filter(|shard| shard.done == shard.points).count();
            let _ = write!(text, "\n{whole} of {} done", count(shards.len(), "shard"));
            for (number, ShardCounts { points, done, failed }) in
                (1..).zip(shards).filter(|(_, one)| one.done < one.points)
            {
                let points = count(*points as usize, "point");
                let _ = write!(text, "\nshard {number}/{}: {done} of {points}, {failed} failed", shards.len());
            }
        }
        text
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
