//! Progress on stderr, as a bar on a terminal and as lines elsewhere.

use crate::colour;
use crate::text::{line, printable};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::time::Duration;

/// Progress of a command, in seconds of its trials or in another unit. Threads may share it.
#[derive(Debug)]
pub struct Progress {
    bar: ProgressBar,
    plain: bool,
    quiet: bool,
    total_s: f64,
    done_s: f64,
}

impl Progress {
    /// Starts the progress of trials of `total_s` seconds in total.
    pub fn new(total_s: f64) -> Self {
        let plain = !std::io::stderr().is_terminal();
        let bar = ProgressBar::new(milliseconds(total_s));
        if plain {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        } else {
            let style = ProgressStyle::with_template("{bar:30} {percent:>3} % {msg}, {eta} left{prefix}");
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar.enable_steady_tick(Duration::from_millis(250));
        }
        Self { bar, plain, quiet: false, total_s, done_s: 0.0 }
    }

    /// Returns a progress that nobody sees.
    pub fn quiet() -> Self {
        Self { bar: ProgressBar::hidden(), plain: false, quiet: true, total_s: 0.0, done_s: 0.0 }
    }

    /// Shows the phase of a trial.
    pub fn phase(&self, trial: &str, phase: &str) {
        let message = line(&format!("{trial}: {phase}"));
        if self.plain {
            let percent = 0.1 * self.bar.position() as f64 / self.total_s.max(f64::MIN_POSITIVE);
            // A closed standard error must not end a trial.
            let _ = writeln!(std::io::stderr(), "{percent:3.0} % {message}");
        }
        self.bar.set_message(message);
    }

    /// Shows figures of the current trial below the bar of a terminal; an empty text removes them.
    pub fn figures(&self, text: &str) {
        let text = line(text);
        self.bar.set_prefix(if text.is_empty() { text } else { format!("\n{text}") });
    }

    /// Shows the progress in the current trial.
    pub fn within(&self, trial_s: f64) {
        self.bar.set_position(milliseconds(self.done_s + trial_s));
    }

    /// Counts a trial of `trial_s` seconds as done.
    pub fn end_trial(&mut self, trial_s: f64) {
        self.done_s += trial_s;
        self.within(0.0);
        self.figures("");
    }

    /// Prints a line above the bar.
    pub fn line(&self, text: &str) {
        if !self.quiet {
            self.bar.suspend(|| colour::eprint(&format!("{}\n", printable(text))));
        }
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

fn milliseconds(seconds: f64) -> u64 {
    (seconds * 1e3) as u64
}
