//! `biflag settings`: reads and writes the settings in the board's EEPROM.

use super::{Answer, Outcome};
use crate::link::{self, Link};
use crate::plan::board::{self, BoardSettings};
use miette::{IntoDiagnostic, WrapErr};
use protocol::{Command, Reply, Settings};
use std::path::PathBuf;

/// Print the board's settings as TOML, or write a settings file to its EEPROM.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example: biflag settings > board.toml; biflag settings --write board.toml")]
pub struct Args {
    /// The board's serial port; not needed if only one board is plugged in.
    #[arg(long)]
    port: Option<String>,
    /// Write the settings in this file; settings that are not in the file are unchanged.
    #[arg(long, value_name = "FILE")]
    write: Option<PathBuf>,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let file = args.write.as_deref().map(board::load).transpose()?;
    let link = Link::open(&link::choose_port(args.port.as_deref())?)?;
    let mut settings = read(&link)?;
    if let Some(file) = file {
        settings = file.apply(settings)?;
        link.command(Command::WriteSettings(settings))?;
        link.command(Command::SaveSettings)?;
        settings = read(&link)?;
    }
    let file = BoardSettings::all(&settings);
    let text = toml::to_string(&file).into_diagnostic().wrap_err("settings of the board")?;
    Answer::new(Outcome::Done, &file, text)
}

/// Reads the current settings.
pub(crate) fn read(link: &Link) -> miette::Result<Settings> {
    match link.ask(Command::ReadSettings)? {
        Reply::Settings(settings) => Ok(settings),
        other => Err(link.wrong_answer(&Command::ReadSettings, &other).into()),
    }
}
