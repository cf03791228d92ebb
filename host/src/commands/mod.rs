//! The command line. Each command has a file with a function from its arguments to an [`Answer`].

mod aim;
mod answer;
mod calibrate;
mod compare;
mod doctor;
mod export;
mod flash;
mod info;
mod live;
mod options;
mod record;
mod recover;
mod report;
mod resistance;
mod settings;
mod simulate;
mod virtual_board;

pub use answer::{Answer, Outcome, WRONG_USE};

use crate::signals;
use clap::{Parser, Subcommand};
use std::io::Write;
use std::process::ExitCode;

/// Record trials of the two-flagella robot, simulate them, and compare both.
#[derive(Parser, Debug)]
#[command(name = "biflag", version, arg_required_else_help = true, after_help = AFTER_HELP)]
struct Cli {
    /// Print one JSON object on stdout, and nothing else.
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    command: Command,
}

const AFTER_HELP: &str = "Example: record a plan on the emulated board and compare it with the model
  biflag record host/plans/demo.toml --virtual --out demo
  biflag compare demo

Exit codes:
    0  done
    1  failed
    2  wrong use: an argument, a plan or another named file is wrong, or no board is found
    3  done, with losses, warnings or problems: lost frames, a damaged log, a trial that did not settle
  130  interrupted by the user; the motors are stopped and all files closed";

/// The commands, in the order of a typical workflow.
#[derive(Subcommand, Debug)]
enum Command {
    Doctor(doctor::Args),
    Flash(flash::Args),
    Settings(settings::Args),
    Record(record::Args),
    Live(live::Args),
    Info(info::Args),
    Resistance(resistance::Args),
    Simulate(simulate::Args),
    Compare(compare::Args),
    Calibrate(calibrate::Args),
    Aim(aim::Args),
    Report(report::Args),
    Export(export::Args),
    Recover(recover::Args),
}

/// Runs the program with its command line.
pub fn run() -> ExitCode {
    signals::survive_file_limits();
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return answer::not_parsed(&error, std::env::args_os().any(|argument| argument == "--json")),
    };
    let result = match cli.command {
        Command::Doctor(args) => doctor::run(&args),
        Command::Flash(args) => flash::run(&args),
        Command::Settings(args) => settings::run(&args),
        Command::Record(args) => record::run(&args),
        Command::Resistance(args) => resistance::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Calibrate(args) => calibrate::run(&args),
        Command::Aim(args) => aim::run(&args),
        Command::Live(args) => live::run(&args),
        Command::Info(args) => info::run(&args),
        Command::Recover(args) => recover::run(&args),
        Command::Report(args) => report::run(&args),
        Command::Export(args) => export::run(&args),
    };
    answer::finish(result, cli.json)
}

/// Prints to standard error, whose reader may be gone.
fn say(text: &str) {
    let _ = std::io::stderr().write_all(text.as_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }
}
