//! The EEPROM's timing (section 8.6.3).

use super::{MS, board, out, out16, run_ms};

/// Writes with `EECR` prepared by `mode`, and measures the wait for EEPE with timer 1 at 2 MHz.
fn program(mode: &str, byte: u8) -> String {
    format!(
        "int main(void) {{
             OUT16[0] = 0;
             TCCR1B = 1 << CS11;
             EEAR = 5; EEDR = {byte};
             EECR = {mode};
             EECR |= 1 << EEMPE; EECR |= 1 << EEPE;
             uint16_t begin = TCNT1;
             while (EECR & 1 << EEPE);
             OUT16[0] = TCNT1 - begin;
             OUT[2] = 1;
             EECR |= 1 << EERE; OUT[3] = EEDR;
             for (;;);
         }}"
    )
}

#[test]
fn a_write_takes_its_time_and_does_what_its_mode_says() {
    for (mode, before, byte, after, us) in
        [("0", 0x12, 0x34, 0x34, 3400), ("1 << EEPM0", 0x12, 0x34, 0xFF, 1800), ("1 << EEPM1", 0x1F, 0x34, 0x14, 1800)]
    {
        let mut board = board(&program(mode, byte));
        board.mcu.eeprom_mut()[5] = before;
        run_ms(&mut board, 10);
        let taken_us = out16(&board, 0) / 2;
        assert!(taken_us.abs_diff(us) < 5, "{mode}: {taken_us} us");
        assert_eq!((out(&board, 3), board.mcu.eeprom_mut()[5]), (after, after), "{mode}");
    }
}

#[test]
fn a_write_or_a_read_during_a_write_does_nothing() {
    let mut board = board(
        "static void put(uint16_t at, uint8_t byte) { EEAR = at; EEDR = byte; EECR |= 1 << EEMPE; EECR |= 1 << EEPE; }
         int main(void) {
             put(5, 0x55);
             put(6, 0x66);
             EEAR = 7; EEDR = 0x99; EECR |= 1 << EERE; OUT[0] = EEDR;
             while (EECR & 1 << EEPE);
             EECR |= 1 << EERE; OUT[1] = EEDR;
             for (;;);
         }",
    );
    board.mcu.eeprom_mut()[7] = 0x77;
    run_ms(&mut board, 10);
    assert_eq!(board.mcu.eeprom_mut()[5..8], [0x55, 0xFF, 0x77]);
    assert_eq!((out(&board, 0), out(&board, 1)), (0x99, 0x77));
}

#[test]
fn a_late_write_is_none() {
    let mut board = board(
        "int main(void) { EEAR = 5; EEDR = 1; EECR |= 1 << EEMPE; _delay_us(1); EECR |= 1 << EEPE; OUT[0] = EECR; for (;;); }",
    );
    run_ms(&mut board, 10);
    assert_eq!((out(&board, 0), board.mcu.eeprom_mut()[5]), (0, 0xFF));
}

#[test]
fn a_reset_completes_a_write_and_a_brown_out_leaves_some_of_its_bits() {
    let source = "int main(void) { if (MCUSR == 1) { EEAR = 5; EEDR = 0x55; EECR |= 1 << EEMPE; EECR |= 1 << EEPE; } for (;;); }";
    for (brown_out, ms, bytes) in [(false, 1, 0x55..=0x55), (true, 1, 0x13..=0xFE), (true, 2, 0x56..=0xFE)] {
        let mut board = board(source);
        board.mcu.eeprom_mut()[5] = 0x12;
        board.run_for(ms * MS);
        if brown_out {
            board.set_supply_mv(2000)
        } else {
            board.reset()
        }
        run_ms(&mut board, 10);
        let byte = board.mcu.eeprom_mut()[5];
        // Erasing makes ones of what was there, writing makes zeros of what was not asked to stay.
        let from = if ms == 1 && brown_out { 0x12 } else { 0x55 };
        assert!(bytes.contains(&byte) && byte & from == from, "{byte:#04x} after {ms} ms");
    }
}
