//! The emulated chip against its data sheet (DS40002061B), with small programs that avr-gcc compiles.

mod bus;
mod eeprom;
mod external_interrupts;
mod interrupts;
mod sleep;
mod supply;
mod watchdog;

use std::process::Command;
use virtual_nano::mcu::{FREQUENCY_HZ, RunState};
use virtual_nano::{Board, BoardOptions, Image};

/// Cycles of a millisecond.
const MS: u64 = FREQUENCY_HZ / 1000;

/// Where the programs leave their results: SRAM that neither data nor stack reach, and that no reset clears.
const OUT: u16 = 0x600;

/// What every program begins with.
const PROLOGUE: &str = "#include <avr/io.h>\n#include <avr/interrupt.h>\n#include <avr/wdt.h>\n#include <util/delay.h>\n\
    #define OUT ((volatile uint8_t *)0x600)\n#define OUT16 ((volatile uint16_t *)0x600)\n";

/// Compiles a program in C with further arguments.
fn compile_with(source: &str, further: &[&str]) -> Image {
    let folder = tempfile::tempdir().unwrap();
    let (code, elf) = (folder.path().join("program.c"), folder.path().join("program.elf"));
    std::fs::write(&code, format!("{PROLOGUE}{source}")).unwrap();
    let arguments = ["-mmcu=atmega328p", "-DF_CPU=16000000UL", "-Os", "-std=gnu99", "-Wall", "-Werror", "-o"];
    let output = Command::new("avr-gcc").args(arguments).arg(&elf).args(further).arg(&code).output().expect("avr-gcc");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Image::from_elf(&elf).unwrap()
}

/// A board that has just started a program in C.
fn board(source: &str) -> Board {
    Board::new(&compile_with(source, &[]), BoardOptions::default()).unwrap()
}

fn run_ms(board: &mut Board, ms: u64) {
    assert_eq!(board.run_for(ms * MS), RunState::Running);
}

fn out(board: &Board, index: u16) -> u8 {
    board.mcu.peek(OUT + index)
}

fn out16(board: &Board, index: u16) -> u16 {
    u16::from_le_bytes([out(board, 2 * index), out(board, 2 * index + 1)])
}
