//! `biflag doctor`: checks the tools, ports and boards that a trial needs, the wiring of the motors, or a session.

mod motors;
mod session;

use super::{Answer, Outcome, settings};
use crate::image;
use crate::link::{self, Link, LinkError};
use crate::plan::board;
use crate::program::FULL_VERSION;
use crate::run::rig::board_copy::BoardCopies;
use crate::run::rig::{ImageError, VirtualNano, commit_text, fault_log, preflight, repository};
use miette::Diagnostic;
use serde::Serialize;
use serde_json::json;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

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
    /// Ask nothing: take the motors' directions for correct, and save the settings that the test found.
    #[arg(long, requires = "motors")]
    yes: bool,
    /// Test the motors of the emulated board.
    #[arg(long = "virtual", requires = "motors", conflicts_with = "port")]
    r#virtual: bool,
    /// Simulate a fault of the emulated board, such as `encoder-swapped=2`; may be repeated. `help` lists the faults.
    #[arg(long = "fault", value_name = "NAME[=VALUE][@SECONDS]", requires = "virtual")]
    faults: Vec<String>,
}

#[derive(Debug, Serialize)]
struct Check {
    name: String,
    ok: bool,
    detail: String,
    cure: String,
}

/// What was found, or the problem and its fix.
type Finding = Result<String, (String, String)>;

pub fn run(args: &Args) -> miette::Result<Answer> {
    if let Some(folder) = &args.session {
        let (checks, findings) = session::checks(folder)?;
        let mut answer = answer(checks, Outcome::WithLoss)?;
        answer.json["findings"] = json!(findings);
        return Ok(answer);
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
        ("avrdude", avrdude()),
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
            Ok(link) => checks.extend(checks_of_board(&link, BoardCopies::of_user().as_ref())),
            Err(error) => checks.push(check(format!("board on {port}"), Err(problem(error)))),
        }
    }
    answer(checks, on_problem)
}

/// Returns the checks as text and JSON.
fn answer(checks: Vec<Check>, on_problem: Outcome) -> miette::Result<Answer> {
    let mut text = String::new();
    for Check { name, ok, detail, cure } in &checks {
        let mark = if *ok { "ok     " } else { "PROBLEM" };
        let _ = writeln!(text, "{mark} {name}: {}", detail.replace('\n', "\n          "));
        if !ok {
            let _ = writeln!(text, "        fix: {cure}");
        }
    }
    let outcome = if checks.iter().all(|check| check.ok) { Outcome::Done } else { on_problem };
    Answer::new(outcome, &json!({ "checks": checks }), text)
}

fn check(name: String, finding: Finding) -> Check {
    match finding {
        Ok(detail) => Check { name, ok: true, detail, cure: String::new() },
        Err((detail, cure)) => Check { name, ok: false, detail, cure },
    }
}

/// Returns the check of where the board's firmware comes from: a toolchain in the repository, otherwise this program.
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

fn avrdude() -> Finding {
    let output = Command::new("avrdude")
        .arg("-?")
        .output()
        .map_err(|_| ("not installed".to_owned(), "sudo apt install avrdude".to_owned()))?;
    let said = String::from_utf8_lossy(&output.stderr);
    let version = said.lines().find_map(|line| line.split_once("avrdude version ")?.1.split(',').next());
    Ok(version.map_or_else(|| "installed".to_owned(), |version| format!("version {version}")))
}

/// Returns a finding for each program that takes serial ports away, or writes to them.
fn other_programs() -> Vec<Finding> {
    let found = system::meddlers::running();
    let none = found.is_empty().then(|| Ok("none that takes serial ports".into()));
    found.into_iter().map(|(detail, cure)| Err((detail.into(), cure.into()))).chain(none).collect()
}

fn emulated_board() -> Finding {
    VirtualNano::program().map(|path| path.display().to_string()).map_err(problem)
}

/// Checks a board: firmware and sensor, settings, angles of the flagella, fault log.
fn checks_of_board(link: &Link, copies: Option<&BoardCopies>) -> [Check; 4] {
    let port = link.path();
    [
        check(format!("board on {port}"), firmware(link)),
        check(format!("settings on {port}"), stored_settings(link, copies)),
        check(format!("angles on {port}"), angles(link)),
        check(format!("fault log on {port}"), faults(link)),
    ]
}

fn firmware(link: &Link) -> Finding {
    let info = link.info();
    let [major, minor, patch] = info.firmware;
    let detail = format!(
        "firmware {major}.{minor}.{patch} ({}), protocol {}, board {}, start {} ({:?}), {} bytes of RAM left",
        commit_text(info.git_hash, info.git_dirty),
        info.protocol,
        info.board_id,
        info.boot_count,
        info.reset_cause,
        info.ram_left,
    );
    match info.imu_id {
        protocol::GENUINE_IMU_ID => Ok(format!("{detail}, MPU6050")),
        0 => Err((
            format!("{detail}, but its IMU does not respond"),
            "check the four wires of the MPU6050: VCC, GND, SCL on A5, SDA on A4".to_owned(),
        )),
        id => Ok(format!("{detail}, a clone of the MPU6050 (WHO_AM_I {id:#04x})")),
    }
}

/// Checks that the board's settings are in its EEPROM, and keeps a copy of them.
fn stored_settings(link: &Link, copies: Option<&BoardCopies>) -> Finding {
    preflight::settings(link, copies).map_err(problem)?;
    let settings = settings::read(link).map_err(problem)?;
    match (settings.board_id, settings::keep(copies, &settings)) {
        (_, Some(note)) => Ok(format!("in its EEPROM; {note}")),
        (0, None) => Err((
            "in its EEPROM, without a board_id, so that this computer cannot keep a copy".to_owned(),
            format!("`biflag settings --new --port {}` gives the board an unused id", link.path()),
        )),
        (id, None) => Ok(match copies {
            Some(copies) => format!("in its EEPROM; copy in {}", copies.path(id).display()),
            None => "in its EEPROM".to_owned(),
        }),
    }
}

/// Says whether the board knows the angles of its flagella, which only plans with phases need.
fn angles(link: &Link) -> Finding {
    let settings = settings::read(link).map_err(problem)?;
    Ok(match board::angles_deg(link.info(), &settings) {
        Some([one, two]) => format!("flagella at {one:.1}° and {two:.1}° from their marks"),
        None => format!("not known; `biflag align --port {}` makes them known, for plans with phases", link.path()),
    })
}

fn faults(link: &Link) -> Finding {
    let records = fault_log::read(link).map_err(problem)?;
    if records.is_empty() {
        return Ok("empty".to_owned());
    }
    Ok(records.iter().map(|record| format!("\n{}", fault_log::line(record))).collect())
}

fn problem(error: impl Diagnostic) -> (String, String) {
    let cure = error.help().map_or_else(|| "unplug and replug the board".to_owned(), |help| help.to_string());
    (error.to_string(), cure)
}

fn last_line(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).lines().last().unwrap_or_default().trim().to_owned()
}
