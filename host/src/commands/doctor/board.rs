//! Checks of a board: its firmware and sensor, its settings, the angles of its flagella, its fault log.

use super::check::{Check, Finding, check, problem};
use crate::commands::settings;
use crate::link::{Link, arduino};
use crate::plan::board;
use crate::run::rig::board_copy::BoardCopies;
use crate::run::rig::{commit_text, fault_log, preflight};
use protocol::units::imu_part;
use protocol::{Info, SpeedFrom};

/// Checks a board: firmware and sensor, settings, angles of the flagella, fault log.
pub fn checks(link: &Link, copies: Option<&BoardCopies>) -> [Check; 4] {
    let port = link.path();
    [
        check(format!("board on {port}"), firmware(link)),
        check(format!("settings on {port}"), stored_settings(link, copies)),
        check(format!("angles on {port}"), angles(link)),
        check(format!("fault log on {port}"), faults(link)),
    ]
}

fn firmware(link: &Link) -> Finding {
    let info @ Info { protocol, board_id, boot_count, reset_cause, ram_left, .. } = link.info();
    let ([major, minor, patch], commit) = (info.firmware, commit_text(info.git_hash, info.git_dirty));
    let board = format!("board {board_id}, start {boot_count} ({reset_cause:?}), {ram_left} bytes of RAM left");
    let name = arduino(link.path()).map_or_else(String::new, |(name, _)| format!("Arduino {name}, "));
    let detail = format!("{name}firmware {major}.{minor}.{patch} ({commit}), protocol {protocol}, {board}");
    match (info.imu_id, imu_part(info.imu_id)) {
        (0, _) => Err((
            format!("{detail}, but its IMU does not respond"),
            "check the four wires of the MPU6050: VCC, GND, SCL on A5, SDA on A4".to_owned(),
        )),
        (protocol::GENUINE_IMU_ID, Some(part)) => Ok(format!("{detail}, {part}")),
        (id, Some(part)) => Ok(format!("{detail}, an {part} (WHO_AM_I {id:#04x}) in place of an MPU6050")),
        (id, None) => {
            Ok(format!("{detail}, a clone of the MPU6050 (WHO_AM_I {id:#04x}) whose temperature is not known"))
        }
    }
}

/// Checks that the board's settings are in its EEPROM, and keeps a copy of them.
fn stored_settings(link: &Link, copies: Option<&BoardCopies>) -> Finding {
    preflight::settings(link, copies).map_err(problem)?;
    let settings = settings::read(link).map_err(problem)?;
    match (settings.board_id, settings::keep(copies, &settings)) {
        (_, Some(note)) => Ok(format!("in its EEPROM; {note}")),
        (0, None) if copies.is_some() => Err((
            "in its EEPROM, without a board_id, so that this computer cannot keep a copy".to_owned(),
            format!("`biflag settings --new --port {}` gives the board an unused id", link.path()),
        )),
        (id, None) => Ok(match copies {
            Some(copies) => format!("in its EEPROM; copy in {}", copies.path(id).display()),
            None => "in its EEPROM".to_owned(),
        }),
    }
}

/// Reports whether the board knows the angles of its flagella, which only plans with phases need.
fn angles(link: &Link) -> Finding {
    let settings = settings::read(link).map_err(problem)?;
    Ok(match board::angles_deg(link.info(), &settings) {
        _ if settings.speed_from == SpeedFrom::Duty => "none, without encoders".to_owned(),
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
