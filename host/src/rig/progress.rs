//! Progress of a session on stderr: a bar on a terminal, plain lines elsewhere.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::cell::Cell;
use std::io::{IsTerminal, Write};
use std::time::Duration;

/// Seconds of trials done, of all that there are to do.
#[derive(Debug)]
pub struct Progress {
    bar: ProgressBar,
    plain: bool,
    total_s: f64,
    done_s: f64,
    within_s: Cell<f64>,
}

impl Progress {
    /// For trials of `total_s` seconds.
    pub fn new(total_s: f64) -> Self {
        let plain = !std::io::stderr().is_terminal();
        let bar = ProgressBar::new(milliseconds(total_s));
        if plain {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        } else {
            let style = ProgressStyle::with_template("{bar:30} {percent:>3} % {msg}, {eta} left");
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar.enable_steady_tick(Duration::from_millis(250));
        }
        Self { bar, plain, total_s, done_s: 0.0, within_s: Cell::new(0.0) }
    }

    /// A trial goes into a phase.
    pub fn phase(&self, trial: &str, phase: &str) {
        let message = format!("{trial}: {phase}");
        if self.plain {
            let percent = 100.0 * (self.done_s + self.within_s.get()) / self.total_s.max(f64::MIN_POSITIVE);
            // A standard error that is closed ends no trial.
            let _ = writeln!(std::io::stderr(), "{percent:3.0} % {message}");
        }
        self.bar.set_message(message);
    }

    /// So much of the trial that runs is done.
    pub fn within(&self, trial_s: f64) {
        self.within_s.set(trial_s);
        self.bar.set_position(milliseconds(self.done_s + trial_s));
    }

    /// A trial of `trial_s` seconds is over.
    pub fn end_trial(&mut self, trial_s: f64) {
        self.done_s += trial_s;
        self.within(0.0);
    }

    /// Prints a line above the bar.
    pub fn line(&self, text: &str) {
        self.bar.suspend(|| drop(writeln!(std::io::stderr(), "{text}")));
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

fn milliseconds(seconds: f64) -> u64 {
    (seconds * 1e3) as u64
}
