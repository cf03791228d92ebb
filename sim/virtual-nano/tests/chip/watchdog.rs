//! The watchdog's three modes (sections 11.8 and 11.9.2).

use super::{MS, board, compile_with, out, run_ms};
use virtual_nano::{Board, BoardOptions};

/// MCUSR of every start into OUT\[1..\], the number of starts in OUT\[0\] (SRAM survives a reset), the number of watchdog
/// interrupts in OUT\[15\]. `mode` are bits of WDTCSR beside a time of 32 ms.
fn program(mode: &str, with: &str) -> String {
    format!(
        "ISR(WDT_vect) {{ OUT[15]++; }}
         int main(void) {{
             uint8_t flags = MCUSR;
             MCUSR = 0;
             wdt_reset();
             WDTCSR = 1 << WDCE | 1 << WDE;
             WDTCSR = 0;
             if (flags & 1 << PORF) OUT[0] = OUT[15] = 0;
             if (OUT[0] < 10) OUT[1 + OUT[0]] = flags;
             OUT[0]++;
             WDTCSR = 1 << WDCE | 1 << WDE;
             WDTCSR = {mode} | 1 << WDP0;
             {with}
             for (;;);
         }}"
    )
}

const PORF: u8 = 1;
const WDRF: u8 = 8;

#[test]
fn interrupt_mode_interrupts_for_ever() {
    let mut board = board(&program("1 << WDIE", "sei();"));
    run_ms(&mut board, 335);
    assert_eq!((out(&board, 0), out(&board, 15)), (1, 10));
}

#[test]
fn reset_mode_resets_at_the_first_time_out() {
    let mut board = board(&program("1 << WDE", "sei();"));
    run_ms(&mut board, 31);
    assert_eq!(out(&board, 0), 1);
    run_ms(&mut board, 2);
    assert_eq!([0, 1, 2].map(|i| out(&board, i)), [2, PORF, WDRF]);
    assert_eq!(out(&board, 15), 0);
}

#[test]
fn interrupt_and_reset_mode_interrupts_once_and_then_resets() {
    let mut board = board(&program("1 << WDIE | 1 << WDE", "sei();"));
    run_ms(&mut board, 63);
    assert_eq!((out(&board, 0), out(&board, 15)), (1, 1));
    run_ms(&mut board, 2);
    assert_eq!([0, 1, 2, 15].map(|i| out(&board, i)), [2, PORF, WDRF, 1]);
}

#[test]
fn with_interrupts_off_the_second_time_out_resets_all_the_same() {
    let mut board = board(&program("1 << WDIE | 1 << WDE", "cli();"));
    run_ms(&mut board, 63);
    assert_eq!(out(&board, 0), 1);
    run_ms(&mut board, 2);
    assert_eq!([0, 1, 2, 15].map(|i| out(&board, i)), [2, PORF, WDRF, 0]);
}

#[test]
fn a_program_that_feeds_it_lives() {
    let mut board = board(&program("1 << WDE", "for (;;) { wdt_reset(); _delay_ms(25); }"));
    run_ms(&mut board, 500);
    assert_eq!(out(&board, 0), 1);
}

#[test]
fn it_is_changed_only_within_four_cycles_and_stays_on_after_its_reset() {
    // WDE cannot be cleared without the timed sequence, nor while WDRF is set.
    let mut board = board(
        "int main(void) {
             uint8_t flags = MCUSR;
             if (flags & 1 << PORF) OUT[0] = 0;
             MCUSR &= ~(1 << PORF);
             OUT[1 + OUT[0]++] = WDTCSR;
             if (OUT[0] == 3) { MCUSR = 0; WDTCSR = 1 << WDCE | 1 << WDE; WDTCSR = 0; OUT[10] = WDTCSR; for (;;); }
             WDTCSR = 1 << WDCE | 1 << WDE; WDTCSR = 1 << WDE;
             WDTCSR = 0;
             WDTCSR = 1 << WDCE | 1 << WDE; _delay_us(1); WDTCSR = 0;
             for (;;);
         }",
    );
    run_ms(&mut board, 200);
    assert_eq!([0, 1, 2, 3, 10].map(|i| out(&board, i)), [3, 0, 8, 8, 0]);
}

#[test]
fn its_reset_starts_the_bootloader() {
    let program = compile_with(&program("1 << WDE", ""), &["-Wl,--section-start=.text=0x7E00"]);
    assert_eq!(program.start(), 0x7E00);
    let mut board = Board::with_bootloader(&program, BoardOptions::default()).unwrap();
    // At address 0 blank flash would run for a millisecond.
    for _ in 0..1000 {
        board.run_for(MS / 10);
        assert!(board.mcu.pc() >= 0x7E00, "at {:#x}", board.mcu.pc());
    }
    assert_eq!([0, 1, 2, 3].map(|i| out(&board, i)), [4, PORF, WDRF, WDRF]);
}
