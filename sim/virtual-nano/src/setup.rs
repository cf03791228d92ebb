//! Sets up a board for its rig: its EEPROM then has the settings that a user would have sent and saved.
//!
//! A separate board receives and saves them, so this code does not depend on how the program stores its settings.

use crate::board::{Board, BoardOptions};
use crate::bridge::Model;
use crate::image::Image;
use crate::mcu::FREQUENCY_HZ;
use crate::rig::RigKind;
use protocol::frame::{Accumulator, MAX_FRAME, encode};
use protocol::{Bridge, Command, Message, Reply, Request, Settings, SpeedFrom};

/// Why a board could not be set up.
const REFUSED: &str =
    "the program does not take the settings of this rig; is it the firmware of this version? Try --rig encoders";

/// Longest wait for a reply, ms: saving takes 3.4 ms a byte.
const WAIT_MS: u64 = 1000;

impl RigKind {
    /// Returns the default settings, adapted to this rig except for the directions of its motors, which the user has to find.
    pub fn settings(&self) -> Settings {
        Settings {
            bridge: if self.bridge == Model::Drv8833 { Bridge::InIn } else { Bridge::Enable },
            speed_from: if self.has_encoders { SpeedFrom::Encoders } else { SpeedFrom::Duty },
            ..Settings::DEFAULT
        }
    }

    /// Returns the EEPROM of a board with this program that was set up for this rig.
    ///
    /// # Errors
    /// A program that does not take the settings.
    pub fn eeprom(&self, image: &Image) -> Result<Vec<u8>, &'static str> {
        let mut board = Board::new(image, BoardOptions { rig: *self, ..BoardOptions::default() })?;
        // The program may still be starting.
        (1..4).find_map(|seq| ask(&mut board, seq, Command::Ping)).ok_or(REFUSED)?;
        for (seq, command) in [(4, Command::WriteSettings(self.settings())), (5, Command::SaveSettings)] {
            ask(&mut board, seq, command).filter(|reply| *reply == Reply::Done).ok_or(REFUSED)?;
        }
        Ok(board.mcu.eeprom_mut().to_vec())
    }
}

fn ask(board: &mut Board, seq: u8, command: Command) -> Option<Reply> {
    let (mut buffer, mut accumulator) = ([0; MAX_FRAME], Accumulator::new());
    board.send(encode(&Request { seq, command }, &mut buffer).ok()?);
    for _ in 0..WAIT_MS {
        board.run_for(FREQUENCY_HZ / 1000);
        for byte in board.take_serial() {
            match accumulator.push::<Message>(byte) {
                Some(Ok(Message::Reply { to, reply })) if to == seq => return Some(reply),
                _ => {}
            }
        }
    }
    None
}
