//! The command line: one file a command, each a function from its arguments to an [`Answer`].

mod answer;
mod calibrate;
mod compare;
mod doctor;
mod export;
mod flash;
mod info;
mod live;
mod record;
mod recover;
mod replay;
mod report;
mod settings;
mod simulate;

pub use answer::{Answer, Outcome, WRONG_USE};

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Record, keep and read trials of the two-flagella robot.
#[derive(Parser, Debug)]
#[command(name = "biflag", version, arg_required_else_help = true)]
struct Cli {
    /// Print one JSON object on stdout and nothing else there.
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    Doctor(doctor::Args),
    Flash(flash::Args),
    Settings(settings::Args),
    Record(record::Args),
    Simulate(simulate::Args),
    Compare(compare::Args),
    Calibrate(calibrate::Args),
    Live(live::Args),
    Info(info::Args),
    Recover(recover::Args),
    Report(report::Args),
    Export(export::Args),
}

/// Runs the program as its command line says.
pub fn run() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            if error.use_stderr() && std::env::args_os().any(|argument| argument == "--json") {
                println!("{}", serde_json::json!({ "error": error.render().to_string().trim(), "help": null }));
            }
            // clap itself exits with 2 on wrong use, and with 0 after --help and --version.
            error.exit()
        }
    };
    let result = match cli.command {
        Command::Doctor(args) => doctor::run(&args),
        Command::Flash(args) => flash::run(&args),
        Command::Settings(args) => settings::run(&args),
        Command::Record(args) => record::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Calibrate(args) => calibrate::run(&args),
        Command::Live(args) => live::run(&args),
        Command::Info(args) => info::run(&args),
        Command::Recover(args) => recover::run(&args),
        Command::Report(args) => report::run(&args),
        Command::Export(args) => export::run(&args),
    };
    answer::finish(result, cli.json)
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
