//! The viewers of a running recording: Foxglove, and a page in the browser.

use super::row::{RecordedTrial, remarks};
use crate::live::{Browser, Feed, Live};
use crate::plan::{Plan, Trial};
use crate::report::{live_maps, live_page};
use crate::run::rig::Notes;
use biflag_log::Tap;
use serde_json::{Value, json};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// The viewers of a recording.
pub(super) struct Viewers {
    foxglove: Option<Live>,
    browser: Option<(Browser, Feed)>,
    /// Every trial of the session.
    trials: Vec<Trial>,
}

impl Viewers {
    /// Opens a page in the browser if `open`. Its button sets `interrupted`.
    pub fn new(
        foxglove: Option<Live>,
        open: bool,
        plan: &Plan,
        trials: Vec<Trial>,
        notes: &Notes,
        interrupted: &Arc<AtomicBool>,
    ) -> miette::Result<Self> {
        let serve = || -> miette::Result<_> {
            let mut feed = Feed::default();
            feed.notes = Notes::clone(notes);
            let page = live_page(plan, trials.len());
            Ok((Browser::serve(page, feed.clone(), Arc::clone(interrupted))?, feed))
        };
        let browser = open.then(serve).transpose()?;
        Ok(Self { foxglove, browser, trials })
    }

    /// Opens the page. Returns messages for the user.
    pub fn open(&self) -> Vec<String> {
        let foxglove = self.foxglove.iter().map(Live::invitation);
        let browser = self.browser.iter().map(|(browser, _)| {
            let url = browser.url();
            match open::that_detached(&url) {
                Ok(()) => format!("opened in the browser: {url}"),
                Err(_) => format!("open in a browser on this computer: {url}"),
            }
        });
        foxglove.chain(browser).collect()
    }

    /// Returns a tap for the log of a trial that begins.
    pub fn tap(&self, trial: &Trial) -> Option<Tap> {
        let foxglove = self.foxglove.as_ref().map(Live::tap);
        let browser = self.browser.as_ref().map(|(_, feed)| {
            feed.begin(&trial.name, trial.phases.total_s());
            feed.tap()
        });
        match (foxglove, browser) {
            (Some(one), Some(other)) => Some(Box::new(move |channel, time, bytes| {
                one(channel, time, bytes);
                other(channel, time, bytes);
            })),
            (one, other) => one.or(other),
        }
    }

    /// Shows the trials that are done, and the one that runs.
    pub fn session(&self, done: &[RecordedTrial], running: Option<&Trial>) {
        let Some((_, feed)) = &self.browser else { return };
        let of = |trial: &Trial| done.iter().rfind(|row| row.name == trial.name);
        let rows: Vec<Value> = self.trials.iter().map(|trial| row(trial, of(trial), running)).collect();
        let angles = |trial: &Trial| {
            let angles = of(trial).filter(|row| row.complete)?.angles.as_ref()?;
            Some([angles.yaw_deg, angles.pitch_deg, angles.roll_deg])
        };
        let points: Vec<_> =
            self.trials.iter().map(|trial| (trial.speeds.map(|speed| speed.rpm()), angles(trial))).collect();
        feed.session(json!({ "rows": rows, "maps": live_maps(&points) }));
    }

    /// Ends the recording for the page.
    pub fn end(&self, words: &str) {
        if let Some((browser, _)) = &self.browser {
            browser.end(words);
        }
    }
}

/// A trial in the page's table.
fn row(trial: &Trial, done: Option<&RecordedTrial>, running: Option<&Trial>) -> Value {
    let state = match done {
        Some(_) => "done",
        None if running.is_some_and(|running| running.name == trial.name) => "running",
        None => "planned",
    };
    let speeds = trial.speeds.map(|speed| speed.rpm().to_string());
    let angles = done.and_then(|row| row.angles.as_ref()).map_or_else(Default::default, |angles| angles.cells());
    let lost = done.map_or_else(String::new, |row| row.link.lost.to_string());
    let cells: Vec<String> = speeds.into_iter().chain(angles).chain([lost]).collect();
    json!({ "name": trial.name, "state": state, "cells": cells, "notes": done.map_or_else(String::new, remarks) })
}
