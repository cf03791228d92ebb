//! The TWI with lines that rise slowly (section 22.5.2).

use super::{MS, board, out, out16, run_ms};

/// Writes WHO_AM_I's address to the sensor and reads the register, at 400 kHz; measures with timer 1 at 2 MHz.
const READS: &str = "static uint8_t step(uint8_t control) {
        TWCR = control | 1 << TWINT | 1 << TWEN; while (!(TWCR & 1 << TWINT)); return TWSR & 0xF8; }
    int main(void) {
        TWBR = 12;
        TCCR1B = 1 << CS11;
        for (;;) {
            uint16_t begin = TCNT1;
            step(1 << TWSTA); TWDR = 0xD0; step(0); TWDR = 0x75; step(0);
            step(1 << TWSTA); TWDR = 0xD1; step(0); OUT[2] = step(0); OUT[3] = TWDR;
            OUT16[0] = TCNT1 - begin;
            TWCR = 1 << TWINT | 1 << TWSTO | 1 << TWEN;
            _delay_us(200);
        }
    }";

#[test]
fn a_slow_rise_makes_every_bit_longer() {
    let mut board = board(READS);
    let mut us = [0, 2, 5].map(|rise_us| {
        board.set_bus_rise_us(f64::from(rise_us));
        board.run_for(5 * MS);
        run_ms(&mut board, 5);
        assert_eq!((out(&board, 2), out(&board, 3)), (0x58, 0x68));
        f64::from(out16(&board, 0)) / 2.0
    });
    println!("reading a register at 400 kHz: {us:?} us with rises of 0, 2 and 5 us");
    // Four bytes of nine bits, and two STARTs of two.
    let bits = 40.0;
    assert!((us[0] - 2.5 * bits).abs() < 15.0);
    us[1] -= us[0];
    us[2] -= us[0];
    assert!((us[1] - 2.0 * bits).abs() < 3.0 && (us[2] - 5.0 * bits).abs() < 3.0, "{us:?}");
}
