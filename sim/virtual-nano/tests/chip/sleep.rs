//! SLEEP and its enable bit (section 10.11.1).

use super::{board, out16, run_ms};

/// Timer 1 interrupts every 5 ms; the loop counts how often it went round, and the interrupt how often it came.
fn program(smcr: u8) -> String {
    format!(
        "ISR(TIMER1_COMPA_vect) {{ OUT16[1]++; }}
         int main(void) {{
             OUT16[0] = OUT16[1] = 0;
             OCR1A = 9999; TCCR1B = 1 << WGM12 | 1 << CS11; TIMSK1 = 1 << OCIE1A;
             SMCR = {smcr};
             sei();
             for (;;) {{ OUT16[0]++; __asm__ volatile(\"sleep\"); }}
         }}"
    )
}

#[test]
fn sleep_waits_for_an_interrupt_only_when_it_is_enabled() {
    let mut asleep = board(&program(1));
    run_ms(&mut asleep, 101);
    assert_eq!((out16(&asleep, 1), out16(&asleep, 0)), (20, 21));
    let mut awake = board(&program(0));
    run_ms(&mut awake, 12);
    assert_eq!(out16(&awake, 1), 2);
    assert!(out16(&awake, 0) > 5000, "{} rounds without SE", out16(&awake, 0));
}

#[test]
fn a_chip_that_sleeps_with_interrupts_off_stays_so_and_time_passes() {
    let mut board = board(
        "int main(void) { OCR1A = 9999; TCCR1B = 1 << WGM12 | 1 << CS11; TIMSK1 = 1 << OCIE1A;
                          SMCR = 1; OUT[0] = 1; __asm__ volatile(\"sleep\"); OUT[0] = 2; for (;;); }",
    );
    run_ms(&mut board, 100);
    assert_eq!(super::out(&board, 0), 1);
    assert!(board.cycle() >= 100 * super::MS);
}
