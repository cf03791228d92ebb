//! `biflag doctor`: checks the tools, ports and boards that a trial needs.

use super::{Answer, Outcome};
use crate::link::{self, Link, LinkError};
use crate::run::rig::{VirtualNano, commit_text, source_folder};
use miette::Diagnostic;
use serde::Serialize;
use std::fmt::Write;
use std::process::Command;

/// Check toolchain, avrdude, ports, permissions and boards, with fixes.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example: biflag doctor")]
pub struct Args {
    /// Check only this port instead of all ports.
    #[arg(long)]
    port: Option<String>,
}

#[derive(Debug, Serialize)]
struct Check {
    name: String,
    ok: bool,
    detail: String,
    cure: String,
}

#[derive(Debug, Serialize)]
struct Report {
    checks: Vec<Check>,
}

/// What was found, or the problem and its fix.
type Finding = Result<String, (String, String)>;

pub fn run(args: &Args) -> miette::Result<Answer> {
    // A wrong port name is wrong use, not a finding.
    if let Some(port) = &args.port
        && let Err(error @ (LinkError::NotFound { .. } | LinkError::NotSerial { .. })) = link::probe_port(port)
    {
        return Err(error.into());
    }
    let tools = [
        ("biflag", Ok(format!("{}, protocol {}", env!("CARGO_PKG_VERSION"), protocol::VERSION))),
        ("AVR toolchain", toolchain()),
        ("avrdude", avrdude()),
        ("emulated board", emulated_board()),
    ];
    let mut checks: Vec<Check> = tools.into_iter().map(|(name, finding)| check(name.into(), finding)).collect();
    let broken_tool = checks.iter().any(|check| !check.ok);
    let ports = args.port.clone().map_or_else(link::robot_ports, |port| vec![port]);
    if ports.is_empty() {
        let cure = "plug in the board's USB cable; charge-only cables do not work";
        checks.push(check("board".into(), Err(("no board is plugged in".into(), cure.into()))));
    }
    checks.extend(ports.iter().map(|port| check(format!("board on {port}"), board(port))));

    let mut text = String::new();
    for Check { name, ok, detail, cure } in &checks {
        let mark = if *ok { "ok     " } else { "PROBLEM" };
        let _ = writeln!(text, "{mark} {name}: {detail}");
        if !ok {
            let _ = writeln!(text, "        fix: {cure}");
        }
    }
    let outcome = match checks.iter().all(|check| check.ok) {
        true => Outcome::Done,
        false if broken_tool => Outcome::Failed,
        false => Outcome::WithLoss,
    };
    Answer::new(outcome, &Report { checks }, text)
}

fn check(name: String, finding: Finding) -> Check {
    match finding {
        Ok(detail) => Check { name, ok: true, detail, cure: String::new() },
        Err((detail, cure)) => Check { name, ok: false, detail, cure },
    }
}

fn toolchain() -> Finding {
    let output = Command::new("sh").arg(source_folder().join("build.sh")).arg("--check").output();
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

fn emulated_board() -> Finding {
    VirtualNano::program().map(|path| path.display().to_string()).map_err(problem)
}

fn board(port: &str) -> Finding {
    let link = Link::open(port).map_err(problem)?;
    let info = link.info();
    let [major, minor, patch] = info.firmware;
    let detail = format!(
        "firmware {major}.{minor}.{patch} ({}), protocol {}, board {}, start {} ({:?})",
        commit_text(info.git_hash, info.git_dirty),
        info.protocol,
        info.board_id,
        info.boot_count,
        info.reset_cause,
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

fn problem(error: impl Diagnostic) -> (String, String) {
    let cure = error.help().map_or_else(|| "unplug and replug the board".to_owned(), |help| help.to_string());
    (error.to_string(), cure)
}

fn last_line(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).lines().last().unwrap_or_default().trim().to_owned()
}
