//! `biflag settings`: reads and writes the settings in the board's EEPROM.

use super::answer::{Answer, Outcome, WRONG_USE, wrong_use};
use super::ask::ask;
use super::options::volts;
use super::virtual_board;
use crate::colour;
use crate::link::{Link, LinkError};
use crate::plan::board::{self, BoardSettings};
use crate::run::rig::board_copy::BoardCopies;
use crate::run::rig::preflight;
use crate::signals::interruption;
use miette::{IntoDiagnostic, WrapErr};
use protocol::units::Millivolts;
use protocol::{Command, Reply, Settings, SpeedFrom};
use std::io::IsTerminal;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

/// Print the board's settings as TOML, or save new ones in its EEPROM.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example: biflag settings > board.toml; biflag settings --write board.toml")]
pub struct Args {
    /// The board's serial port; not needed if only one board is plugged in.
    #[arg(long, conflicts_with = "virtual")]
    port: Option<String>,
    /// Use an emulated board, as practice: this computer keeps no copy of its settings.
    #[arg(long = "virtual", conflicts_with = "restore")]
    r#virtual: bool,
    /// Save the settings from this file in the board's EEPROM; settings that are not in the file stay unchanged.
    #[arg(long, value_name = "FILE", group = "change")]
    write: Option<PathBuf>,
    /// Restore the settings of the board with this board_id from the copy on this computer.
    #[arg(long, value_name = "ID", group = "change")]
    restore: Option<u16>,
    /// Give a new board an unused board_id, and save its present settings. On a terminal it asks once for --supply.
    #[arg(long, group = "change")]
    new: bool,
    /// A meter's reading between the board's pins 5V and GND: saves the reference with which the board measures its supply.
    #[arg(long, value_name = "VOLTS", value_parser = volts)]
    supply: Option<f64>,
}

/// What to do about an id that another board has, and about lines of motors that came with an id.
const TWICE: &str = "leave board_id out of the file, or give the board an unused id with `biflag settings --new`; if it is that board \
                     and has lost its settings, `biflag settings --restore ID` gives them back";
const SAME_MOTORS: &str = "the lines of its motors are those that were measured on that board: if its motors, bridge or supply are \
                           others now, measure them again with `biflag doctor --motors`";

pub fn run(args: &Args) -> miette::Result<Answer> {
    let copies = if args.r#virtual { None } else { BoardCopies::of_user() };
    let change = match (&args.write, args.restore) {
        (Some(file), _) => Some(board::load(file)?),
        (None, Some(id)) => Some(restored(copies.as_ref(), id)?),
        (None, None) if args.new => Some(BoardSettings { board_id: Some(0), ..BoardSettings::default() }),
        (None, None) if args.supply.is_some() => Some(BoardSettings::default()),
        (None, None) => None,
    };
    let interrupted = interruption()?;
    let nano = args.r#virtual.then(|| virtual_board::start(Vec::new(), &[])).transpose()?;
    let link = Link::open(&virtual_board::port(nano.as_ref(), args.port.as_deref())?)?;
    let mut settings = read(&link)?;
    let mut notes = Vec::new();
    if let Some(change) = change {
        let mut wanted = change.apply(settings)?;
        if let Some(volts) = meter(args, &interrupted)? {
            wanted.bandgap = reference(&link, settings.bandgap, volts, &interrupted)?;
        }
        let is_other = wanted.board_id != settings.board_id;
        // The lines of another board would be taken for this one's, unless this board has lost its settings and may be that
        // board.
        let takes_lines = is_other && copies.as_ref().is_some_and(|copies| copies.lines(wanted.board_id).is_some());
        if takes_lines && (args.restore.is_none() || link.info().settings_stored) {
            return Err(wrong_use(
                format!("board_id = {} is that of another board, with the lines of its motors", wanted.board_id),
                TWICE,
            ));
        }
        (settings, notes) = save(&link, wanted, copies.as_ref())?;
        notes.extend(takes_lines.then(|| SAME_MOTORS.to_owned()));
    } else if link.info().settings_stored {
        notes.extend(keep(copies.as_ref(), &settings));
    } else {
        notes.push("these are not in the board's EEPROM: it forgets them at the next reset".to_owned());
    }
    notes.iter().for_each(|note| colour::eprint(&format!("note: {note}\n")));
    let file = BoardSettings::all(&settings);
    let text = toml::to_string(&file).into_diagnostic().wrap_err("settings of the board")?;
    Answer::new(Outcome::Done, &file, text)
}

/// Returns the reading of a meter at the board's 5V pin, if the user has one.
fn meter(args: &Args, interrupted: &AtomicBool) -> miette::Result<Option<f64>> {
    if args.supply.is_some() || !args.new || !std::io::stdin().is_terminal() {
        return Ok(args.supply);
    }
    let question = "volts that a meter reads between the board's pins 5V and GND, or Enter without a meter";
    match ask(question, interrupted)?.trim_end_matches(['v', ' ']) {
        "" => Ok(None),
        answer => volts(answer).map(Some).map_err(|error| miette::miette!(code = WRONG_USE, "{error}")),
    }
}

/// Returns the voltage of the chip's reference with which the board's reading of its supply agrees with a meter.
fn reference(link: &Link, present: Millivolts, volts: f64, interrupted: &AtomicBool) -> miette::Result<Millivolts> {
    let told = preflight::measured_supply(link, interrupted)?.volts();
    let reference = f64::from(present.0) * volts / told;
    // The limits of its data sheet, which the settings have too.
    if !(1000.0..=1200.0).contains(&reference) {
        return Err(miette::miette!(
            help = "measure at the board's pins 5V and GND while it is connected as in a trial",
            "the board tells {told:.2} V and the meter {volts:.2} V, which is more than the board's reference may be off"
        ));
    }
    Ok(Millivolts(reference.round() as u16))
}

fn restored(copies: Option<&BoardCopies>, id: u16) -> miette::Result<BoardSettings> {
    match copies {
        Some(copies) => Ok(copies.load(id)?),
        None => Err(miette::miette!(
            help = system::folders::CURE,
            "this computer has no folder for the copies of the boards' settings"
        )),
    }
}

/// Reads the current settings.
pub(super) fn read(link: &Link) -> Result<Settings, LinkError> {
    match link.ask(Command::ReadSettings)? {
        Reply::Settings(settings) => Ok(settings),
        other => Err(link.wrong_answer(&Command::ReadSettings, &other)),
    }
}

/// Refuses a board whose motors have no encoders.
pub(super) fn need_encoders(settings: &Settings) -> miette::Result<()> {
    match settings.speed_from {
        SpeedFrom::Encoders => Ok(()),
        SpeedFrom::Duty => Err(miette::miette!(
            help = "without them only constant speeds can be recorded, from any angles; if they have encoders, write speed_from = \
                    \"encoders\" with `biflag settings --write`",
            "the motors of this board have no encoders (speed_from = \"duty\")"
        )),
    }
}

/// Saves settings to the board's EEPROM and keeps a copy of them. A board without an id gets an unused one. Returns the
/// settings in force, and notes for the user.
pub(super) fn save(
    link: &Link,
    mut settings: Settings,
    copies: Option<&BoardCopies>,
) -> Result<(Settings, Vec<String>), LinkError> {
    let mut notes = Vec::new();
    if let Some(copies) = copies.filter(|_| settings.board_id == 0) {
        settings.board_id = copies.unused_id();
        notes.push(format!("this is board {} from here on (board_id)", settings.board_id));
    }
    link.command(Command::WriteSettings(settings))?;
    link.command(Command::SaveSettings)?;
    let saved = read(link)?;
    notes.extend(keep(copies, &saved));
    Ok((saved, notes))
}

/// Keeps a copy of settings that are in a board's EEPROM. A failure is a note for the user: the board has them.
pub(super) fn keep(copies: Option<&BoardCopies>, settings: &Settings) -> Option<String> {
    let error = copies?.keep(settings).err()?;
    let path = copies?.path(settings.board_id);
    Some(format!("this computer could not keep a copy of the board's settings: {}: {error}", path.display()))
}
