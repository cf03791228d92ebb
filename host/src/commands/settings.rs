//! `biflag settings`: reads and writes the settings in the board's EEPROM.

use super::{Answer, Outcome};
use crate::colour;
use crate::link::{self, Link, LinkError};
use crate::plan::board::{self, BoardSettings};
use crate::run::rig::board_copy::BoardCopies;
use miette::{IntoDiagnostic, WrapErr};
use protocol::{Command, Reply, Settings};
use std::path::PathBuf;

/// Print the board's settings as TOML, or save new ones in its EEPROM.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example: biflag settings > board.toml; biflag settings --write board.toml")]
pub struct Args {
    /// The board's serial port; not needed if only one board is plugged in.
    #[arg(long)]
    port: Option<String>,
    /// Save the settings from this file in the board's EEPROM; settings that are not in the file stay unchanged.
    #[arg(long, value_name = "FILE", group = "change")]
    write: Option<PathBuf>,
    /// Restore the settings of the board with this board_id from the copy on this computer.
    #[arg(long, value_name = "ID", group = "change")]
    restore: Option<u16>,
    /// Give a new board an unused board_id, and save its present settings.
    #[arg(long, group = "change")]
    new: bool,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let copies = BoardCopies::of_user();
    let change = match (&args.write, args.restore) {
        (Some(file), _) => Some(board::load(file)?),
        (None, Some(id)) => Some(restored(copies.as_ref(), id)?),
        (None, None) if args.new => Some(BoardSettings { board_id: Some(0), ..BoardSettings::default() }),
        (None, None) => None,
    };
    let link = Link::open(&link::choose_port(args.port.as_deref())?)?;
    let mut settings = read(&link)?;
    let mut notes = Vec::new();
    if let Some(change) = change {
        (settings, notes) = save(&link, change.apply(settings)?, copies.as_ref())?;
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

fn restored(copies: Option<&BoardCopies>, id: u16) -> miette::Result<BoardSettings> {
    match copies {
        Some(copies) => Ok(copies.load(id)?),
        None => Err(miette::miette!(
            help = "set HOME or XDG_CONFIG_HOME",
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
