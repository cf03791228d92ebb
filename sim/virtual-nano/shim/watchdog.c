// SPDX-License-Identifier: GPL-3.0-or-later
// The watchdog timer (data sheet DS40002061B, sections 11.8 and 11.9.2).
//
// simavr's own resets the chip in interrupt-and-reset mode only if its interrupt ran, and forgets the start address of a
// bootloader.
#include "inner.h"

enum { WDIF = 0x80, WDIE = 0x40, WDP3 = 0x20, WDCE = 0x10, WDE = 0x08, WDP = 0x27 };
enum { WDRF = 0x08 }; // in MCUSR
// Cycles of the chip for one of the watchdog's 128 kHz.
enum { SLOWER = 125, CHANGE_CYCLES = 4 };

static uint64_t period(uint8_t wdtcsr)
{
	uint8_t prescaler = (wdtcsr & 7) | (wdtcsr & WDP3 ? 8 : 0);
	// Table 11-2; higher values are reserved.
	return (2048ull << (prescaler < 9 ? prescaler : 9)) * SLOWER;
}

static avr_cycle_count_t timed_out(avr_t *avr, avr_cycle_count_t when, void *param)
{
	nano_t *nano = param;
	uint8_t wdtcsr = avr->data[REG_WDTCSR];
	nano->watchdog.since = now(nano);
	// In interrupt-and-reset mode an interrupt that was not executed before the next time-out makes it a reset.
	if (wdtcsr & WDE && (!(wdtcsr & WDIE) || wdtcsr & WDIF)) {
		nano->watchdog.reset = 1;
		return 0;
	}
	avr->data[REG_WDTCSR] |= WDIF;
	avr_raise_interrupt(avr, &nano->watchdog.module->watchdog);
	return when + period(wdtcsr);
}

static void schedule(nano_t *nano)
{
	avr_t *avr = nano->avr;
	uint8_t wdtcsr = avr->data[REG_WDTCSR];
	avr_cycle_timer_cancel(avr, timed_out, nano);
	if (!(wdtcsr & (WDE | WDIE)))
		return;
	uint64_t due = nano->watchdog.since + period(wdtcsr);
	avr_cycle_timer_register(avr, due > now(nano) ? due - now(nano) : 1, timed_out, nano);
}

void watchdog_feed(nano_t *nano)
{
	nano->watchdog.since = now(nano);
	schedule(nano);
}

static void wdtcsr_write(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
	nano_t *nano = param;
	struct watchdog *watchdog = &nano->watchdog;
	uint8_t old = avr->data[REG_WDTCSR];
	uint8_t new = (value & WDIE) | (old & WDIF);
	if (value & WDIF) {
		new &= ~WDIF;
		watchdog->module->watchdog.pending = 0;
	}
	if (now(nano) <= watchdog->change_until && !(value & WDCE)) {
		new |= value & (WDE | WDP);
		watchdog->change_until = 0;
	} else {
		// Outside of the timed sequence WDE can be set, and nothing else changed.
		new |= (old & (WDE | WDP)) | (value & WDE);
		if (value & WDCE && value & WDE)
			watchdog->change_until = now(nano) + CHANGE_CYCLES;
	}
	if (avr->data[REG_MCUSR] & WDRF)
		new |= WDE;
	avr->data[REG_WDTCSR] = new;
	if (!(old & (WDE | WDIE)))
		watchdog->since = now(nano);
	schedule(nano);
}

// The interrupt runs: the flag is cleared, and the next time-out resets.
static void interrupt_runs(struct avr_irq_t *irq, uint32_t runs, void *param)
{
	nano_t *nano = param;
	uint8_t *wdtcsr = &nano->avr->data[REG_WDTCSR];
	if (!runs)
		return;
	*wdtcsr &= ~WDIF;
	if (*wdtcsr & WDE)
		*wdtcsr &= ~WDIE;
}

void watchdog_attach(nano_t *nano)
{
	replace_io(nano, REG_WDTCSR, 0, wdtcsr_write);
	avr_irq_t *irq = avr_get_interrupt_irq(nano->avr, nano->watchdog.module->watchdog.vector);
	avr_irq_register_notify(irq + AVR_INT_IRQ_RUNNING, interrupt_runs, nano);
}

// After the flags in MCUSR are set: the watchdog goes on after its own reset, with its shortest time.
void watchdog_reset(nano_t *nano)
{
	nano->watchdog.reset = 0;
	nano->watchdog.change_until = 0;
	nano->watchdog.since = now(nano);
	nano->avr->data[REG_WDTCSR] = nano->avr->data[REG_MCUSR] & WDRF ? WDE : 0;
	schedule(nano);
}
