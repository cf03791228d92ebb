//! Supply voltage as the ADC sees it, and the brown-out detector (sections 24.8 and 11.5).

use super::{board, out, out16, run_ms};

/// Measures the bandgap against AVCC: once as soon as it is connected, and once after 100 µs.
const MEASURES: &str = "static uint16_t measure(void) { ADCSRA |= 1 << ADSC; while (ADCSRA & 1 << ADSC); return ADC; }
    int main(void) {
        ADMUX = 1 << REFS0 | 0x0F;
        ADCSRA = 1 << ADEN | 7;
        measure();
        TCCR1B = 1 << CS11;
        uint16_t begin = TCNT1;
        measure();
        OUT16[2] = TCNT1 - begin;
        ADMUX = 1 << REFS0 | 0x0E;
        OUT16[0] = measure();
        _delay_us(100);
        for (;;) OUT16[1] = measure();
    }";

#[test]
fn the_bandgap_shows_the_supply_once_it_has_settled() {
    let mut board = board(MEASURES);
    for (vcc_mv, bandgap_mv) in [(5000, 1100), (4300, 1100), (5000, 1200), (3300, 1000)] {
        board.set_supply_mv(vcc_mv);
        board.set_bandgap_mv(bandgap_mv);
        run_ms(&mut board, 2);
        let counts = f64::from(out16(&board, 1));
        let expected = 1024.0 * f64::from(bandgap_mv) / f64::from(vcc_mv);
        assert!((counts - expected).abs() <= 1.0, "{vcc_mv} mV: {counts} counts, not {expected}");
    }
    let first = out16(&board, 0);
    assert!(first < 200, "{first} counts at once");
    // 13 cycles of 125 kHz.
    let conversion_us = out16(&board, 2) / 2;
    assert!(conversion_us.abs_diff(104) < 12, "{conversion_us} us");
}

#[test]
fn a_brown_out_resets_and_lasts_until_the_supply_is_back() {
    let mut board = board(
        "int main(void) { if (MCUSR == 1) OUT[0] = 0; OUT[1 + OUT[0]++] = MCUSR; DDRB = 2; PORTB = 2; for (;;) OUT[10]++; }",
    );
    run_ms(&mut board, 5);
    board.set_supply_mv(2750);
    run_ms(&mut board, 5);
    assert_eq!([0, 1].map(|i| out(&board, i)), [1, 1]);
    board.set_supply_mv(2650);
    run_ms(&mut board, 1);
    let (count, cycle) = (out(&board, 10), board.cycle());
    assert_eq!(board.mcu.peek(0x24), 0, "pins are inputs");
    board.set_supply_mv(2740);
    run_ms(&mut board, 50);
    assert_eq!((out(&board, 0), out(&board, 10)), (1, count), "runs below the level");
    assert!(board.cycle() >= cycle + 50 * super::MS, "time stands still");
    board.set_supply_mv(5000);
    run_ms(&mut board, 5);
    assert_eq!([0, 1, 2].map(|i| out(&board, i)), [2, 1, 1 | 4]);
    assert_ne!(out(&board, 10), count);
}
