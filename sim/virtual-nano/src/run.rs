//! The program's loop: the board runs in slices, and between them bytes pass to and from the port, commands are carried
//! out, and time is kept.

use crate::board::Board;
use crate::control;
use crate::mcu::RunState;
use crate::pace::Pace;
use crate::port::{DRIVER_BUFFER, Port, PortCount};
use std::io::{self, Write};
use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::Duration;

/// Cycles between two looks at the port: a millisecond.
const SLICE: u64 = 16_000;

/// Largest difference of the speeds of two ends without misread bytes: half a bit in ten.
const BAUD_TOLERANCE: f64 = 0.05;

/// A board at its port.
pub struct Runner {
    /// The board.
    pub board: Board,
    /// Its port.
    pub port: Port,
    /// The pace of its time.
    pub pace: Pace,
    /// Whether opening the port resets the board, as DTR does on a Nano.
    pub reset_on_open: bool,
    /// Bytes that the port has not taken yet.
    pub pending: Vec<u8>,
    /// Bytes that no host got.
    pub count: PortCount,
}

impl Runner {
    /// Runs until `quit` or the end of the commands.
    pub fn run(&mut self, commands: &Receiver<String>, answers: &mut impl Write) -> io::Result<()> {
        loop {
            // A board whose time stands still waits for its host.
            let stands_still = self.pace.stands_still();
            let next = if stands_still {
                commands.recv().map_err(|_| TryRecvError::Disconnected)
            } else {
                commands.try_recv()
            };
            match next {
                Ok(line) => {
                    let answer = control::follow(&line, &mut self.board, &self.count)
                        .unwrap_or_else(|problem| control::error(&line, &problem));
                    writeln!(answers, "{answer}")?;
                    answers.flush()?;
                    if line.trim() == "quit" {
                        return Ok(());
                    }
                    continue;
                }
                Err(TryRecvError::Disconnected) => return Ok(()),
                Err(TryRecvError::Empty) => {}
            }
            if self.board.plant().is_some_and(|plant| plant.failure.is_some()) {
                // The sensor's readings are wrong from here on: the board stops, so that nobody takes them for
                // measurements.
                std::thread::sleep(Duration::from_millis(1));
                continue;
            }
            self.exchange()?;
            if self.pace.is_ahead_of_host(self.board.seconds()) {
                self.port.wait_for_host(Duration::from_millis(1))?;
                continue;
            }
            if self.pace.waits_for_host() && !self.pending.is_empty() {
                // Time stands still for the board until the host has read.
                self.port.wait_for_room(Duration::from_millis(5))?;
                continue;
            }
            let next = self.board.cycle() + SLICE;
            if self.board.run_until(next) != RunState::Running {
                std::thread::sleep(Duration::from_millis(1));
                continue;
            }
            self.pace.wait_for(self.board.seconds());
        }
    }

    /// Passes bytes between board and port.
    fn exchange(&mut self) -> io::Result<()> {
        if self.port.was_opened()? && self.reset_on_open {
            self.board.reset();
        }
        let from_board = self.board.take_serial();
        if !self.port.is_open {
            self.count.unheard += (self.pending.len() + from_board.len()) as u64;
            self.pending.clear();
            self.pace.lose_host();
            return Ok(());
        }
        let ratio = f64::from(self.port.baud()?) / self.board.baud();
        self.board.rig_mut().serial.garbled = (ratio - 1.0).abs() > BAUD_TOLERANCE;
        let from_host = self.port.read()?;
        if !from_host.is_empty() {
            self.pace.hear_host(self.board.seconds());
            self.board.send(&from_host);
        }
        self.pending.extend(from_board);
        while !self.pending.is_empty() {
            match self.port.write(&self.pending)? {
                0 => break,
                taken => drop(self.pending.drain(..taken)),
            }
        }
        if !self.pace.waits_for_host() {
            self.count.lost += self.pending.len().saturating_sub(DRIVER_BUFFER) as u64;
            self.pending.truncate(DRIVER_BUFFER);
        }
        Ok(())
    }
}
