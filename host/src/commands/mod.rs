//! The command line. Each command has a file with a function from its arguments to an `Answer`.

mod aim;
mod align;
mod answer;
mod ask;
mod board_sensor;
mod calibrate;
mod compare;
mod completions;
mod doctor;
mod export;
mod figure;
mod film;
mod flash;
mod import;
mod info;
mod live;
mod man;
mod new;
mod options;
mod pack;
mod plan;
mod plans;
mod record;
mod recover;
mod report;
mod resistance;
mod sensor;
mod settings;
mod simulate;
mod steer;
mod sweep;
mod usage;
mod virtual_board;

use crate::program::FULL_VERSION;
use crate::signals;
use clap::{CommandFactory, Parser, Subcommand};
use std::process::ExitCode;

/// Record trials of the two-flagella robot, simulate them, and compare both.
#[derive(Parser, Debug)]
#[command(name = "biflag", version = FULL_VERSION, arg_required_else_help = true, after_help = AFTER_HELP)]
struct Cli {
    /// Print one JSON object on stdout, and nothing else.
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    command: Command,
}

const AFTER_HELP: &str = "Example: record a plan on the emulated board and compare it with the model
  biflag record demo --virtual --out my-demo
  biflag compare my-demo

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
    Align(align::Args),
    Sensor(sensor::Args),
    New(new::Args),
    Plan(plan::Args),
    Plans(plans::Args),
    Record(record::Args),
    Import(import::Args),
    Live(live::Args),
    Info(info::Args),
    Resistance(resistance::Args),
    Simulate(simulate::Args),
    Sweep(sweep::Args),
    Compare(compare::Args),
    Calibrate(calibrate::Args),
    Aim(aim::Args),
    Steer(steer::Args),
    Report(report::Args),
    Figure(figure::Args),
    Film(film::Args),
    Export(export::Args),
    Pack(pack::Args),
    Recover(recover::Args),
    Completions(completions::Args),
    Man(man::Args),
}

/// Runs the program with its command line.
pub fn run() -> ExitCode {
    signals::survive_file_limits();
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return answer::not_parsed(error, std::env::args_os().any(|argument| argument == "--json")),
    };
    let result = match cli.command {
        Command::Doctor(args) => doctor::run(&args),
        Command::Flash(args) => flash::run(&args),
        Command::Settings(args) => settings::run(&args),
        Command::Align(args) => align::run(&args),
        Command::Sensor(args) => sensor::run(&args),
        Command::New(args) => new::run(&args),
        Command::Plan(args) => plan::run(&args),
        Command::Plans(args) => plans::run(&args),
        Command::Record(args) => record::run(&args),
        Command::Resistance(args) => resistance::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Sweep(args) => sweep::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Calibrate(args) => calibrate::run(&args),
        Command::Aim(args) => aim::run(&args),
        Command::Import(args) => import::run(&args),
        Command::Steer(args) => steer::run(&args),
        Command::Live(args) => live::run(&args),
        Command::Info(args) => info::run(&args),
        Command::Pack(args) => pack::run(&args),
        Command::Recover(args) => recover::run(&args),
        Command::Report(args) => report::run(&args),
        Command::Film(args) => film::run(&args),
        Command::Figure(args) => figure::run(&args),
        Command::Export(args) => export::run(&args),
        Command::Completions(args) => completions::run(&args, Cli::command()),
        Command::Man(args) => man::run(&args, Cli::command()),
    };
    answer::finish(result, cli.json)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn common_mistakes_have_a_hint() {
        for (args, hint) in [
            (vec!["plan", "two.toml"], "`biflag plan check two.toml`"),
            (vec!["aim", "--yaw=-67,5", "--pitch", "3"], "write a decimal point: -67.5"),
            (vec!["sensor", "turn", "z", "720,5"], "write a decimal point: 720.5"),
            (vec!["simulate", "--speeds=37,55,-12,25", "--duration", "1"], "a plan has several pairs"),
            (vec!["calibrate", "walk", "--fit", "phase"], "name the file to write, with -o"),
            (vec!["compare", "walk", "-o", "x.pdf"], "the name must end with .html"),
            (vec!["import", "x.csv", "-o", "x.txt"], "the name must end with .mcap"),
            (vec!["new", "new.csv"], "the name must end with .toml"),
            (vec!["simulate", "--speeds", "40,20", "--duration", "-5"], "after `=`, as --speeds=-90,90"),
            (vec!["simulate", "--speeds", "50,10", "--run", "20"], "--duration"),
            (vec!["record", "--speeds", "50,10", "--duration", "20"], "--run"),
        ] {
            let error = Cli::try_parse_from([&["biflag"], args.as_slice()].concat()).unwrap_err();
            let said = usage::with_hint(error).to_string();
            assert!(said.contains(hint), "{said}");
        }
        for (args, wrong) in [
            (vec!["simulate", "--speeds=50,x"], "decimal point"),
            (vec!["record", "--speeds=50,10", "--virtual", "--seed", "1,5"], "decimal point"),
            (vec!["info", "walk", "--bogus"], "'-- --bogus'"),
        ] {
            let error = Cli::try_parse_from([&["biflag"], args.as_slice()].concat()).unwrap_err();
            assert!(!usage::with_hint(error).to_string().contains(wrong));
        }
    }

    #[test]
    fn each_command_has_an_example() {
        for command in Cli::command().get_subcommands() {
            let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
            assert!(help.contains(&format!("biflag {}", command.get_name())), "{}: {help}", command.get_name());
        }
    }
}
