//! `biflag settings`: what the board keeps in its EEPROM, as a file.

use super::{Answer, Outcome, WRONG_USE};
use crate::board_settings::BoardSettings;
use crate::link::{self, Link};
use miette::{IntoDiagnostic, WrapErr, miette};
use protocol::{Command, Reply, Settings};
use std::path::{Path, PathBuf};

/// Print the board's settings as TOML, or write such a file into its EEPROM.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example: biflag settings > board.toml; biflag settings --write board.toml")]
pub struct Args {
    /// The board's serial port; may be left out where there is only one.
    #[arg(long)]
    port: Option<String>,
    /// Write the settings in this file; those that it leaves out stay as they are.
    #[arg(long, value_name = "FILE")]
    write: Option<PathBuf>,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let file = args.write.as_deref().map(read_file).transpose()?;
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

fn read_file(path: &Path) -> miette::Result<BoardSettings> {
    let wrong = |what: String| {
        miette!(code = WRONG_USE, help = "`biflag settings` prints such a file", "{}: {what}", path.display())
    };
    let text = std::fs::read_to_string(path).map_err(|error| wrong(format!("cannot be read: {error}")))?;
    toml::from_str(&text).map_err(|error| wrong(error.to_string()))
}

/// The settings in force.
pub(crate) fn read(link: &Link) -> miette::Result<Settings> {
    match link.ask(Command::ReadSettings)? {
        Reply::Settings(settings) => Ok(settings),
        other => Err(link.wrong_answer(&Command::ReadSettings, &other).into()),
    }
}
