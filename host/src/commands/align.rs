//! `biflag align`: makes the angles of the flagella known to the board.

use super::answer::{Answer, Outcome};
use super::ask::ask;
use super::{settings, virtual_board};
use crate::colour;
use crate::link::Link;
use crate::run::rig::{RecordError, park};
use crate::signals::interruption;
use protocol::Command;
use protocol::units::{CentiRpm, EncoderCounts};
use serde_json::json;
use std::sync::atomic::AtomicBool;

/// Speed of a flagellum between two keys.
const SPEED: CentiRpm = CentiRpm(200);

/// A coarse step, degrees.
const COARSE_DEG: f64 = 10.0;

/// A fine step, counts: the board turns a motor to within two counts of a position.
const FINE_COUNTS: f64 = 3.0;

const KEYS: &str = "\
1, 2   the motor that the next keys turn
f, b   10 degrees forwards (counter-clockwise seen from above), backwards
+, -   about a degree forwards, backwards
ok     both flagella are at their marks: these are their 0 degrees
q      quit, and leave the angles as they were";

/// Bring both flagella to their marks, so that the board knows their angles: `phase_deg` and `phases` of a plan need them.
///
/// Turn them with the keys below, one motor at a time, at 2 rpm, or by hand: the motors are off while the program waits. Come
/// to each mark in the direction in which the motor will run, so that the backlash of its gear is on the same side. Keys are
/// read from standard input: lines with one or more of them.
#[derive(clap::Args, Debug)]
#[command(after_help = format!("Keys, each line ended by Enter:\n{KEYS}\n\nExamples:\n  biflag align\n  \
    printf 'ff+\\n2b\\nok\\n' | biflag align --virtual"))]
pub struct Args {
    /// The board's serial port; not needed if only one board is plugged in.
    #[arg(long, conflicts_with = "virtual")]
    port: Option<String>,
    /// Align the emulated board.
    #[arg(long = "virtual")]
    r#virtual: bool,
}

/// The action of a key.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Key {
    Motor(usize),
    /// Degrees.
    Coarse(f64),
    /// Counts.
    Fine(f64),
    Done,
    Quit,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let interrupted = interruption()?;
    let nano = args.r#virtual.then(|| virtual_board::start(vec!["--speed".into(), "max".into()], &[])).transpose()?;
    let port = virtual_board::port(nano.as_ref(), args.port.as_deref())?;
    let link = Link::open_unless(&port, &interrupted)?;
    let settings = settings::read(&link)?;
    settings::need_encoders(&settings)?;
    let per_turn = f64::from(settings.counts_per_turn);
    let begin = park::info(&link)?.encoder;
    colour::eprint(&format!("{KEYS}\n"));
    let outcome = align(&link, begin, per_turn, &interrupted);
    let info = park::info(&link)?;
    let (outcome, aligned, turned_deg) = match outcome {
        Ok((aligned, turned_deg)) => (if aligned { Outcome::Done } else { Outcome::Interrupted }, aligned, turned_deg),
        Err(RecordError::Interrupted) => (Outcome::Interrupted, false, degrees(begin, info.encoder, per_turn)),
        Err(error) => return Err(error.into()),
    };
    let text = match (aligned, info.angles_known) {
        (true, _) => "aligned: the board knows the angles of both flagella from their marks",
        (false, true) => "not aligned; the board knows its angles from before",
        (false, false) => "not aligned; the board does not know the angles of its flagella",
    };
    let body = json!({ "port": port, "aligned": aligned, "angles_known": info.angles_known, "turned_deg": turned_deg });
    Answer::new(outcome, &body, text)
}

/// Follows the keys. Returns whether the angles were marked, and how far each flagellum turned before, degrees.
fn align(
    link: &Link,
    begin: [EncoderCounts; 2],
    per_turn: f64,
    interrupted: &AtomicBool,
) -> Result<(bool, [f64; 2]), RecordError> {
    let mut motor = 0;
    loop {
        let turned_deg = degrees(begin, park::info(link)?.encoder, per_turn);
        let [one, two] = turned_deg;
        let line = ask(&format!("turned {one:+.1}° and {two:+.1}°; motor {}", motor + 1), interrupted)?;
        let Some(keys) = keys(&line) else {
            colour::eprint(&format!("{line:?} has other keys than these:\n{KEYS}\n"));
            continue;
        };
        for key in keys {
            let counts = match key {
                Key::Motor(number) => {
                    motor = number;
                    continue;
                }
                Key::Coarse(degrees) => degrees / 360.0 * per_turn,
                Key::Fine(counts) => counts,
                Key::Done => {
                    let turned_deg = degrees(begin, park::info(link)?.encoder, per_turn);
                    link.command(Command::Align)?;
                    return Ok((true, turned_deg));
                }
                Key::Quit => return Ok((false, turned_deg)),
            };
            let mut position = park::info(link)?.encoder.map(|position| f64::from(position.0));
            position[motor] += counts;
            park::turn(link, position, SPEED, interrupted)?;
        }
    }
}

fn degrees(from: [EncoderCounts; 2], to: [EncoderCounts; 2], per_turn: f64) -> [f64; 2] {
    [0, 1].map(|k| f64::from(to[k].0.wrapping_sub(from[k].0)) / per_turn * 360.0)
}

/// Returns the keys of a line; `None` if a character is not a key.
fn keys(line: &str) -> Option<Vec<Key>> {
    let (steps, last) = match line.strip_suffix("ok") {
        Some(steps) => (steps, Some(Key::Done)),
        None => (line, None),
    };
    let step = |key: char| {
        Some(match key {
            '1' => Key::Motor(0),
            '2' => Key::Motor(1),
            'f' => Key::Coarse(COARSE_DEG),
            'b' => Key::Coarse(-COARSE_DEG),
            '+' => Key::Fine(FINE_COUNTS),
            '-' => Key::Fine(-FINE_COUNTS),
            'q' => Key::Quit,
            _ => return None,
        })
    };
    let mut keys = steps.chars().filter(|key| !key.is_whitespace()).map(step).collect::<Option<Vec<_>>>()?;
    keys.extend(last);
    Some(keys)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_its_keys() {
        assert_eq!(keys(""), Some(vec![]));
        assert_eq!(keys("2 f+"), Some(vec![Key::Motor(1), Key::Coarse(10.0), Key::Fine(3.0)]));
        assert_eq!(keys("b-ok"), Some(vec![Key::Coarse(-10.0), Key::Fine(-3.0), Key::Done]));
        assert_eq!([keys("okay"), keys("3"), keys("o")], [None, None, None]);
    }
}
