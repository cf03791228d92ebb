//! Progress on stderr, as a bar on a terminal and as lines elsewhere.
//!
//! A write to stderr may block for ever: after Ctrl-S has stopped the terminal, or while nobody reads the pipe. A
//! recording must go on meanwhile, so only the drawing thread of [`Progress`] writes. The other threads only update the
//! state to show, which never blocks.

use crate::colour;
use crate::lock::lock;
use crate::text::{line, printable};
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use std::collections::VecDeque;
use std::io::{self, IsTerminal, Write};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;
use std::{fmt, thread};

/// Time between two drawings of the bar.
const INTERVAL: Duration = Duration::from_millis(200);

/// Time after which the pace of the work is known well enough to estimate the remaining time.
const PACE_KNOWN_AFTER: Duration = Duration::from_secs(3);

/// Longest wait at the end for a line to be printed: long enough for a busy computer, and short enough for a user who
/// has pressed Ctrl-C.
const PATIENCE: Duration = Duration::from_secs(1);

/// Progress of a command, in seconds of its trials or in another unit. Threads may share it. Only
/// [`finish`](Self::finish) waits for the terminal, and gives up after one second without progress.
#[derive(Debug)]
pub struct Progress {
    /// `None` if nothing is shown.
    shared: Option<Arc<Shared>>,
    plain: bool,
    total_s: f64,
    done_s: f64,
}

/// State shared with the drawing thread. No thread writes to the terminal while holding the lock.
#[derive(Debug, Default)]
struct Shared {
    state: Mutex<State>,
    /// Signals that there is something to draw.
    news: Condvar,
    /// Signals that something was drawn.
    drawn: Condvar,
}

#[derive(Debug, Default)]
struct State {
    bar: Bar,
    /// Lines that are not printed yet.
    lines: VecDeque<String>,
    /// Number of drawings so far.
    drawings: u64,
    ends: bool,
    /// Whether the bell rings at the end.
    rings: bool,
    /// Whether the terminal hangs, and the other threads have stopped waiting for it.
    given_up: bool,
    /// Whether everything was drawn.
    over: bool,
}

/// Contents of the bar. Only the latest contents matter.
#[derive(Clone, Debug, Default)]
struct Bar {
    position_ms: u64,
    message: String,
    figures: String,
}

impl Progress {
    /// Starts the progress of trials of `total_s` seconds in total.
    pub fn new(total_s: f64) -> Self {
        match io::stderr().is_terminal() {
            true => Self::on(terminal(total_s), false, total_s),
            false => Self::on(plain, true, total_s),
        }
    }

    /// Returns a progress that shows nothing.
    pub fn quiet() -> Self {
        Self { shared: None, plain: false, total_s: 0.0, done_s: 0.0 }
    }

    /// Starts a progress on a screen; a `plain` one shows the phases as lines.
    fn on(screen: impl FnMut(Drawing) + Send + 'static, plain: bool, total_s: f64) -> Self {
        let shared = Arc::new(Shared::default());
        let drawing = Arc::clone(&shared);
        thread::spawn(move || draw(&drawing, screen));
        Self { shared: Some(shared), plain, total_s, done_s: 0.0 }
    }

    /// Shows the phase of a trial.
    pub fn phase(&self, trial: &str, phase: &str) {
        let message = line(&format!("{trial}: {phase}"));
        self.change(true, |state| {
            if self.plain {
                let percent = 0.1 * state.bar.position_ms as f64 / self.total_s.max(f64::MIN_POSITIVE);
                let done = if percent > 0.0 { format!("{percent:3.0} % ") } else { String::new() };
                state.lines.push_back(format!("{done}{message}"));
            }
            state.bar.message = message;
        });
    }

    /// Shows figures of the current trial below the bar of a terminal; an empty text removes them.
    pub fn figures(&self, text: &str) {
        let figures = line(text);
        self.change(false, |state| state.bar.figures = figures);
    }

    /// Shows the progress in the current trial. A trial may take longer than planned: until the robot is still.
    pub fn within(&self, trial_s: f64) {
        self.change(false, |state| state.bar.position_ms = milliseconds((self.done_s + trial_s).min(self.total_s)));
    }

    /// Counts a trial of `trial_s` seconds as done.
    pub fn end_trial(&mut self, trial_s: f64) {
        self.done_s += trial_s;
        self.within(0.0);
        self.figures("");
    }

    /// Prints a line above the bar.
    pub fn line(&self, text: &str) {
        self.change(true, |state| state.lines.push_back(printable(text)));
    }

    /// Rings the bell of a terminal at the end.
    pub fn ring(&self) {
        self.change(false, |state| state.rings = true);
    }

    /// Prints the remaining lines and removes the bar. Nothing is shown afterwards.
    ///
    /// If the terminal hangs for a second, the remaining lines are left to the drawing thread, so the command can end.
    pub fn finish(&self) {
        let Some(shared) = &self.shared else { return };
        let mut state = lock(&shared.state);
        state.ends = true;
        shared.news.notify_one();
        while !state.over && !state.given_up {
            let drawings = state.drawings;
            let nothing_drawn = |state: &mut State| !state.over && state.drawings == drawings;
            let waited = shared.drawn.wait_timeout_while(state, PATIENCE, nothing_drawn);
            let timeout;
            (state, timeout) = waited.unwrap_or_else(PoisonError::into_inner);
            state.given_up = timeout.timed_out();
        }
    }

    /// Changes the state to show, and draws it `now` or with the next drawing.
    fn change(&self, now: bool, change: impl FnOnce(&mut State)) {
        let Some(shared) = &self.shared else { return };
        change(&mut lock(&shared.state));
        if now {
            shared.news.notify_one();
        }
    }
}

/// Removes the bar from the terminal, also if an error ends the command.
impl Drop for Progress {
    fn drop(&mut self) {
        self.finish();
    }
}

/// Draws until the progress ends: the lines in their order, and the bar once there are no lines.
fn draw(shared: &Shared, mut screen: impl FnMut(Drawing)) {
    let mut state = lock(&shared.state);
    loop {
        let (line, bar) = (state.lines.pop_front(), state.bar.clone());
        let (ends, given_up) = (state.ends, state.given_up);
        drop(state);
        if given_up {
            screen(Drawing::Leave);
        }
        match line {
            Some(line) => screen(Drawing::Line(&line)),
            None if ends => break,
            None => screen(Drawing::Bar(&bar)),
        }
        state = lock(&shared.state);
        state.drawings += 1;
        shared.drawn.notify_all();
        if state.lines.is_empty() && !state.ends {
            (state, _) = shared.news.wait_timeout(state, INTERVAL).unwrap_or_else(PoisonError::into_inner);
        }
    }
    let rings = lock(&shared.state).rings;
    screen(Drawing::End { rings });
    drop(screen);
    lock(&shared.state).over = true;
    shared.drawn.notify_all();
}

/// A request of the drawing thread to its screen.
enum Drawing<'a> {
    /// Print a line above the bar.
    Line(&'a str),
    /// Draw the bar.
    Bar(&'a Bar),
    /// Leave the bar as it is: another drawing would erase any text printed after it.
    Leave,
    /// Remove the bar, and perhaps ring the bell.
    End { rings: bool },
}

/// Draws on a file or a pipe, without a bar.
fn plain(drawing: Drawing) {
    if let Drawing::Line(text) = drawing {
        colour::eprint(&format!("{text}\n"));
    }
}

/// Draws on a terminal with a bar. Every method of the bar may wait for the terminal.
fn terminal(total_s: f64) -> impl FnMut(Drawing) + Send + 'static {
    let bar = ProgressBar::new(milliseconds(total_s));
    let style = ProgressStyle::with_template("{bar:30} {percent:>3} % {msg}{left}{prefix}");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()).with_key("left", left));
    let mut shown = Bar::default();
    move |drawing| match drawing {
        Drawing::Line(_) => bar.suspend(|| plain(drawing)),
        Drawing::Bar(new) => {
            if new.message != shown.message {
                bar.set_message(new.message.clone());
            }
            if new.figures != shown.figures {
                let text = &new.figures;
                bar.set_prefix(if text.is_empty() { String::new() } else { format!("\n{text}") });
            }
            // This draws even if nothing has changed, because the remaining time decreases.
            bar.update(|state| state.set_pos(new.position_ms));
            shown = new.clone();
        }
        Drawing::Leave => bar.set_draw_target(ProgressDrawTarget::hidden()),
        Drawing::End { rings } => {
            bar.finish_and_clear();
            if rings {
                // A closed terminal does not ring.
                let _ = io::stderr().write_all(b"\x07");
            }
        }
    }
}

/// Writes the remaining time, once the pace is known.
fn left(state: &ProgressState, text: &mut dyn fmt::Write) {
    if state.pos() > 0 && state.elapsed() > PACE_KNOWN_AFTER {
        // Writing to a string cannot fail.
        let _ = write!(text, ", {} left", HumanDuration(state.eta()));
    }
}

fn milliseconds(seconds: f64) -> u64 {
    (seconds * 1e3) as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::{Receiver, channel};
    use std::time::Instant;

    /// Returns a screen that reports every drawing, after a wait for each line.
    fn told(mut wait: impl FnMut() + Send + 'static) -> (impl FnMut(Drawing) + Send + 'static, Receiver<String>) {
        let (told, tells) = channel();
        let screen = move |drawing: Drawing| {
            let text = match drawing {
                Drawing::Line(text) => {
                    wait();
                    text.to_owned()
                }
                Drawing::Bar(bar) => format!("bar {} {} {}", bar.position_ms, bar.message, bar.figures),
                Drawing::Leave => "leave".to_owned(),
                Drawing::End { .. } => "clear".to_owned(),
            };
            // The test may have ended.
            let _ = told.send(text);
        };
        (screen, tells)
    }

    #[test]
    fn slow_terminal_shows_all_lines_in_order_before_the_end() {
        let (screen, tells) = told(|| thread::sleep(PATIENCE * 6 / 10));
        let mut progress = Progress::on(screen, true, 20.0);
        progress.line("note: first");
        progress.phase("001", "rest");
        progress.within(5.0);
        progress.phase("001", "run");
        progress.end_trial(10.0);
        progress.line("001: result");
        progress.finish();
        let shown: Vec<_> = tells.try_iter().filter(|text| !text.starts_with("bar")).collect();
        assert_eq!(shown, ["note: first", "001: rest", " 25 % 001: run", "001: result", "clear"]);
    }

    #[test]
    fn bar_shows_the_latest() {
        let (screen, tells) = told(|| {});
        let progress = Progress::on(screen, false, 20.0);
        for tenth in 0..=50 {
            progress.within(f64::from(tenth) / 10.0);
            progress.figures(&format!("figure {tenth}"));
        }
        progress.phase("001", "run");
        // Earlier drawings may have only a part of this, even between the figures and the phase.
        let shown = tells.iter().take(100).find(|text| text.contains("run"));
        assert_eq!(shown.unwrap(), "bar 5000 001: run figure 50");
    }

    #[test]
    fn stopped_terminal_delays_nobody() {
        let (go_on, stopped) = channel::<()>();
        let (screen, tells) = told(move || {
            let _ = stopped.recv();
        });
        let progress = Progress::on(screen, false, 20.0);
        let begun = Instant::now();
        for count in 0..1000 {
            progress.line(&count.to_string());
            progress.figures("figures");
            progress.within(1.0);
            progress.phase("001", "run");
        }
        assert!(begun.elapsed() < PATIENCE, "{:?}", begun.elapsed());
        progress.finish();
        drop(progress);
        assert!(begun.elapsed() < PATIENCE * 3, "{:?}", begun.elapsed());
        assert!(tells.try_iter().all(|text| text.starts_with("bar")), "no line can have been printed");
        // A terminal that continues before the program has ended shows the lines, and neither draws nor removes a bar
        // among them.
        drop(go_on);
        let shown: Vec<_> = tells.iter().collect();
        let left = (1..1000).flat_map(|count| ["leave".to_owned(), count.to_string()]);
        let end = ["leave", "clear"].map(str::to_owned);
        assert_eq!(shown, ["0".to_owned()].into_iter().chain(left).chain(end).collect::<Vec<_>>());
    }
}
