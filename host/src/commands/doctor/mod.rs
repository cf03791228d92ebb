//! `biflag doctor`: checks the tools, ports and boards that a trial needs, the wiring of the motors, or a session.

mod board;
mod check;
mod motors;
mod session;

use super::answer::{Answer, Outcome};
use crate::image;
use crate::link::{self, Link, LinkError};
use crate::program::FULL_VERSION;
use crate::run::rig::board_copy::BoardCopies;
use crate::run::rig::{ImageError, VirtualError, VirtualNano, repository};
use check::{Check, Finding, answer, check, problem};
use std::path::{Path, PathBuf};
use std::process::Command;
use system::shell::INSTALL;
use system::{avrdude, meddlers};

/// Check toolchain, avrdude, ports, permissions and boards, the wiring of the motors, or a session; suggest fixes.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  biflag doctor\n  biflag doctor --motors\n  biflag doctor glycerin\n\n\
    --motors turns each motor in both directions, at up to full duty: keep the flagella clear. It finds swapped and\n\
    cut wires, says what to change, and saves settings that correct the error where possible.")]
pub struct Args {
    /// Check that the logs of this session are intact, instead of tools and boards.
    #[arg(value_name = "SESSION", conflicts_with_all = ["port", "motors"])]
    session: Option<PathBuf>,
    /// Check only this port instead of all ports.
    #[arg(long)]
    port: Option<String>,
    /// Turn the motors to test them, the encoders and their wiring.
    #[arg(long)]
    motors: bool,
    /// Ask nothing: assume that the motors' directions are correct, and save the settings that the test found.
    #[arg(long, requires = "motors")]
    yes: bool,
    /// Test the motors of the emulated board.
    #[arg(long = "virtual", requires = "motors", conflicts_with = "port")]
    r#virtual: bool,
    /// The emulated rig: `encoders`, `duty`, `in-in` or `duty-in-in`.
    #[arg(long, value_name = "RIG", requires = "virtual", conflicts_with = "port", default_value = "encoders")]
    rig: String,
    /// Simulate a fault of the emulated board, such as `encoder-swapped=2`; may be repeated. `help` lists the faults.
    #[arg(long = "fault", value_name = "NAME[=VALUE][@SECONDS]", requires = "virtual")]
    faults: Vec<String>,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    if let Some(folder) = &args.session {
        let (checks, findings) = session::checks(folder)?;
        return Ok(answer(checks, Outcome::WithLoss)?.with("findings", findings));
    }
    if args.motors {
        return motors::run(args);
    }
    // A wrong port name is wrong use, not a finding.
    if let Some(port) = &args.port
        && let Err(error @ (LinkError::NotFound { .. } | LinkError::NotSerial { .. })) = link::probe_port(port)
    {
        return Err(error.into());
    }
    let tools = [
        ("biflag", Ok(format!("{FULL_VERSION}, protocol {}", protocol::VERSION))),
        firmware_source(),
        ("avrdude", installed_avrdude()),
        ("emulated board", emulated_board()),
    ];
    let mut checks: Vec<Check> = tools.into_iter().map(|(name, finding)| check(name.into(), finding)).collect();
    let on_problem = if checks.iter().all(|check| check.ok) { Outcome::WithLoss } else { Outcome::Failed };
    checks.extend(other_programs().into_iter().map(|finding| check("other programs".into(), finding)));
    let ports = args.port.clone().map_or_else(link::robot_ports, |port| vec![port]);
    if ports.is_empty() {
        let cure = "plug in the board's USB cable; charge-only cables do not work";
        checks.push(check("board".into(), Err(("no board is plugged in".into(), cure.into()))));
    }
    for port in &ports {
        match Link::open(port) {
            Ok(link) => checks.extend(board::checks(&link, BoardCopies::of_user().as_ref())),
            Err(error) => checks.push(check(format!("board on {port}"), Err(problem(error)))),
        }
    }
    answer(checks, on_problem)
}

/// Returns the check of the firmware's source: a toolchain in the repository, otherwise this program.
fn firmware_source() -> (&'static str, Finding) {
    match (repository(), image::embedded_commit()) {
        (Some(root), _) => ("AVR toolchain", toolchain(&root)),
        (None, Some(commit)) => ("firmware", Ok(format!("{commit}, inside biflag"))),
        (None, None) => ("firmware", Err(problem(ImageError::NoSource))),
    }
}

fn toolchain(repository: &Path) -> Finding {
    let output = Command::new("sh").arg(repository.join("firmware/build.sh")).arg("--check").output();
    let missing = |detail| (detail, "run `make setup` in the repository".to_owned());
    match output {
        Ok(output) if output.status.success() => Ok(last_line(&output.stdout)),
        Ok(output) => Err(missing(last_line(&output.stderr))),
        Err(error) => Err(missing(error.to_string())),
    }
}

fn installed_avrdude() -> Finding {
    let output = avrdude::command()
        .arg("-?")
        .output()
        .map_err(|_| ("not installed".to_owned(), format!("{INSTALL} {}", avrdude::PACKAGE)))?;
    let said = String::from_utf8_lossy(&output.stderr);
    let version = said.lines().find_map(|line| line.split_once("avrdude version ")?.1.split(',').next());
    Ok(version.map_or_else(|| "installed".to_owned(), |version| format!("version {version}")))
}

/// Returns a finding for each program that takes serial ports away, or writes to them; none on systems where they are not looked
/// for.
fn other_programs() -> Vec<Finding> {
    let found = meddlers::running();
    let none = (meddlers::ARE_LOOKED_FOR && found.is_empty()).then(|| Ok("none that takes serial ports".into()));
    found.into_iter().map(|(detail, cure)| Err((detail.into(), cure.into()))).chain(none).collect()
}

fn emulated_board() -> Finding {
    match VirtualNano::program() {
        Err(error @ VirtualError::NotHere) => Ok(error.to_string()),
        found => found.map(|path| path.display().to_string()).map_err(problem),
    }
}

fn last_line(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).lines().last().unwrap_or_default().trim().to_owned()
}
