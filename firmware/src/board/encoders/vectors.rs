//! The hand-written interrupts of the encoders: the reaction to a spike by the PWM, and the jumps to [`edge_of_1`] and
//! [`edge_of_2`].

use core::arch::global_asm;
use core::mem::{offset_of, size_of};

use firmware::encoder::{MAX_PWM_SPIKES, PWM_SPIKE};

use super::{BITS, ENCODERS, Encoder, REST, clock, edge_of_1, edge_of_2};
use crate::board::serial::{SCRATCH, SREG};

/// The interrupts' registers: those below 0x40 in the space of input and output, the others in the memory (section 31).
const PIND: u8 = 0x09;
const EIFR: u8 = 0x1C;
const EIMSK: u8 = 0x1D;
const TCNT0: u8 = 0x26;
const GPIOR1: u8 = 0x2A;
const OCR0A: u8 = 0x27;
const OCR0B: u8 = 0x28;
const TCNT2: u8 = 0xB2;
const OCR2A: u8 = 0xB3;
const OCR2B: u8 = 0xB4;

/// Returns the place of a field of an encoder in [`ENCODERS`].
const fn place(encoder: usize, field: usize) -> usize {
    encoder * size_of::<Encoder>() + field
}

unsafe extern "C" {
    /// Sets the carry if the PWM disturbs, and r24 to the counts since its edge. Changes r25, too.
    ///
    /// A motor's PWM has an edge at the count of 0 and at the count after the compare value. A new compare value comes
    /// into force at 0 only, so the edge may be at the old value, which compare register B has.
    pub fn since_pwm();
}

global_asm!(
    "since_pwm:",
    "in r24, {tcnt0}",
    "cpi r24, {spike}",
    "brcs 1f",
    "in r25, {ocr0a}",
    "sub r24, r25",
    "cpi r24, {spike} + 1",
    "brcs 1f",
    "add r24, r25",
    "in r25, {ocr0b}",
    "sub r24, r25",
    "cpi r24, {spike} + 1",
    "brcs 1f",
    "lds r24, {tcnt2}",
    "cpi r24, {spike}",
    "brcs 1f",
    "lds r25, {ocr2a}",
    "sub r24, r25",
    "cpi r24, {spike} + 1",
    "brcs 1f",
    "add r24, r25",
    "lds r25, {ocr2b}",
    "sub r24, r25",
    "cpi r24, {spike} + 1",
    "1:",
    "ret",
    tcnt0 = const TCNT0,
    ocr0a = const OCR0A,
    ocr0b = const OCR0B,
    tcnt2 = const TCNT2,
    ocr2a = const OCR2A,
    ocr2b = const OCR2B,
    spike = const PWM_SPIKE,
);

/// The interrupt of an encoder. If the PWM does not disturb, it goes on to `edge`, else it notes the change or its end.
macro_rules! interrupt_of {
    ($vector:literal, $encoder:literal, $edge:ident) => {
        global_asm!(
            concat!(".global ", $vector),
            concat!($vector, ":"),
            "out {scratch}, r24",
            "in r24, {sreg}",
            "push r24",
            "push r25",
            // The levels are read before the PWM, so that no disturbance of them is missed.
            "in r24, {pind}",
            "sts {encoders} + {port}, r24",
            "call {since_pwm}",
            "brcs 1f",
            "pop r25",
            "pop r24",
            "out {sreg}, r24",
            "in r24, {scratch}",
            "jmp {edge}",
            // An edge from here on interrupts again.
            "1:",
            "push r30",
            "mov r25, r24",
            "ldi r24, {interrupt}",
            "out {eifr}, r24",
            "in r24, {pind}",
            "lds r30, {encoders} + {level}",
            "eor r24, r30",
            "lds r30, {encoders} + {has_changed}",
            "andi r24, {channel_1}",
            "brne 3f",
            // Unchanged: the spike is over.
            "sts {encoders} + {has_changed}, r24",
            "tst r30",
            "breq 2f",
            "lds r30, {encoders} + {other_has_changed}",
            "tst r30",
            "brne 2f",
            "ldi r30, {without_alarm}",
            "sts {timsk1}, r30",
            "2:",
            "lds r24, {encoders} + {spikes}",
            "inc r24",
            "sts {encoders} + {spikes}, r24",
            "cpi r24, {most} + 1",
            "brcc 4f",
            "5:",
            "pop r30",
            "pop r25",
            "pop r24",
            "out {sreg}, r24",
            "in r24, {scratch}",
            "reti",
            // Changed, for the first time since the last edge: looks again when the lines are at rest, counted from the
            // PWM's edge; r25 has the counts since it.
            "3:",
            "tst r30",
            "brne 5b",
            "ldi r30, 1",
            "sts {encoders} + {has_changed}, r30",
            "lds r24, {tcnt1}",
            "lds r30, {tcnt1} + 1",
            "sts {encoders} + {changed}, r24",
            "sts {encoders} + {changed} + 1, r30",
            "lsl r25",
            "lsl r25",
            "lsl r25",
            "subi r24, lo8(-({rest}))",
            "sbci r30, hi8(-({rest}))",
            "sub r24, r25",
            "sbci r30, 0",
            "sts {ocr1b} + 1, r30",
            "sts {ocr1b}, r24",
            "ldi r24, {alarm_flag}",
            "out {tifr1}, r24",
            "ldi r24, {with_alarm}",
            "sts {timsk1}, r24",
            "rjmp 5b",
            // Too many: off until the next tick.
            "4:",
            "in r24, {eimsk}",
            "andi r24, {without_interrupt}",
            "out {eimsk}, r24",
            "out {counting}, r24",
            "rjmp 5b",
            sreg = const SREG,
            scratch = const SCRATCH,
            since_pwm = sym since_pwm,
            edge = sym $edge,
            interrupt = const BITS[$encoder].interrupt,
            without_interrupt = const !BITS[$encoder].interrupt,
            channel_1 = const BITS[$encoder].channel_1,
            eifr = const EIFR,
            eimsk = const EIMSK,
            counting = const GPIOR1,
            pind = const PIND,
            tcnt1 = const clock::TCNT1L,
            ocr1b = const clock::OCR1BL,
            timsk1 = const clock::TIMSK1,
            tifr1 = const clock::TIFR1,
            alarm_flag = const clock::ALARM_FLAG,
            with_alarm = const clock::WITH_ALARM,
            without_alarm = const clock::WITHOUT_ALARM,
            rest = const REST,
            most = const MAX_PWM_SPIKES,
            encoders = sym ENCODERS,
            level = const place($encoder, offset_of!(Encoder, level)),
            has_changed = const place($encoder, offset_of!(Encoder, has_changed)),
            other_has_changed = const place(1 - $encoder, offset_of!(Encoder, has_changed)),
            changed = const place($encoder, offset_of!(Encoder, changed)),
            spikes = const place($encoder, offset_of!(Encoder, spikes)),
            port = const place($encoder, offset_of!(Encoder, port)),
        );
    };
}

interrupt_of!("__vector_2", 0, edge_of_1);
interrupt_of!("__vector_1", 1, edge_of_2);
