//! The flags of INT0 and INT1 (sections 13.2.2 and 13.2.3).

use super::{board, out, run_ms};

#[test]
fn a_one_clears_a_flag_and_a_cleared_flag_does_not_interrupt() {
    // The pin of INT0 is an output, which triggers it all the same.
    let mut board = board(
        "ISR(INT0_vect) { OUT[3]++; }
         int main(void) {
             OUT[3] = 0;
             DDRD = 4; EICRA = 1;
             PORTD = 4; __asm__ volatile(\"nop\\nnop\\nnop\\nnop\");
             OUT[0] = EIFR;
             EIFR = 2; OUT[1] = EIFR;
             EIFR = 1; OUT[2] = EIFR;
             EIMSK = 1; sei(); _delay_us(10); OUT[4] = OUT[3];
             PORTD = 0; _delay_us(10); OUT[5] = OUT[3];
             for (;;);
         }",
    );
    run_ms(&mut board, 1);
    assert_eq!([0, 1, 2].map(|index| out(&board, index)), [1, 1, 0]);
    assert_eq!([4, 5].map(|index| out(&board, index)), [0, 1]);
}

#[test]
fn an_edge_while_the_interrupt_is_off_interrupts_once_it_is_on() {
    let mut board = board(
        "ISR(INT0_vect) { OUT[3]++; }
         int main(void) {
             OUT[3] = 0;
             DDRD = 4; EICRA = 1; sei();
             PORTD = 4; _delay_us(10); PORTD = 0; _delay_us(10); OUT[0] = OUT[3];
             EIMSK = 1; _delay_us(10); OUT[1] = OUT[3];
             EIMSK = 0; EIMSK = 1; _delay_us(10); OUT[2] = OUT[3];
             for (;;);
         }",
    );
    run_ms(&mut board, 1);
    assert_eq!([0, 1, 2].map(|index| out(&board, index)), [0, 1, 1]);
}
