//! When an interrupt that waits is served (section 7.7).

use super::{board, out, run_ms};

/// Two interrupts wait: that of timer 1, then that of the USART's empty data register. Each notes how many instructions have run
/// since `enable`.
fn instructions_before(enable: &str) -> [u8; 2] {
    let mut board = board(&format!(
        "ISR(TIMER1_COMPA_vect, ISR_NAKED) {{ __asm__ volatile(\"sts 0x600, r24\\n reti\"); }}
         ISR(USART_UDRE_vect, ISR_NAKED) {{ __asm__ volatile(\"sts 0x601, r24\\n ldi r25, 0\\n sts 0xC1, r25\\n reti\"); }}
         int main(void) {{
             TIMSK1 = 1 << OCIE1A; OCR1A = 9; TCCR1B = 1 << CS10; _delay_us(10);
             UCSR0B = 1 << UDRIE0;
             __asm__ volatile(
                 \"ldi r24, 0\\n ldi r25, 0x80\\n {enable}\\n inc r24\\n inc r24\\n inc r24\\n inc r24\\n cli\" ::: \"r24\", \"r25\");
             for (;;);
         }}"
    ));
    run_ms(&mut board, 1);
    [out(&board, 0), out(&board, 1)]
}

#[test]
fn one_instruction_runs_after_interrupts_are_turned_on_and_after_each() {
    assert_eq!(instructions_before("sei"), [1, 2]);
    assert_eq!(instructions_before("out 0x3F, r25"), [1, 2]);
}

#[test]
fn a_timer_that_reached_its_compare_value_while_its_interrupt_was_off_interrupts_once_it_is_on() {
    // Once before the interrupt is on at all, and once while an interrupt that waits is turned off and on.
    let mut board = board(
        "ISR(TIMER1_COMPB_vect) { OUT[3]++; }
         int main(void) {
             OUT[3] = 0;
             OCR1B = 100; TCCR1B = 1 << CS10; _delay_us(20);
             sei(); _delay_us(1); OUT[0] = OUT[3];
             TIMSK1 = 1 << OCIE1B; _delay_us(1); OUT[1] = OUT[3];
             cli(); OCR1B = TCNT1 + 100; _delay_us(20);
             TIMSK1 = 0; sei(); _delay_us(1); OUT[2] = OUT[3];
             TIMSK1 = 1 << OCIE1B; _delay_us(1); OUT[4] = OUT[3];
             for (;;);
         }",
    );
    run_ms(&mut board, 1);
    assert_eq!([0, 1, 2, 4].map(|index| out(&board, index)), [0, 1, 1, 2]);
}

#[test]
fn a_one_clears_a_flag_of_a_timer_and_no_other() {
    let mut board = board(
        "int main(void) {
             OCR1A = OCR1B = 100; TCCR1B = 1 << CS10; _delay_us(20);
             OUT[0] = TIFR1; TIFR1 = 1 << OCF1B; OUT[1] = TIFR1;
             for (;;);
         }",
    );
    run_ms(&mut board, 1);
    assert_eq!([out(&board, 0), out(&board, 1)], [0b110, 0b010]);
}
