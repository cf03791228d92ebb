// SPDX-License-Identifier: GPL-3.0-or-later
// Supply voltage: the brown-out detector, and the bandgap reference at the ADC (data sheet DS40002061B).
#include <math.h>

#include "inner.h"

// Extended fuse of an Arduino Nano: brown-out at 2.7 V, with a hysteresis of 50 mV (section 29.5).
enum { BROWN_OUT_MV = 2700, HYSTERESIS_MV = 50 };
// The bandgap as an input of the ADC (table 24-4).
enum { MUX = 0x0F, MUX_BANDGAP = 0x0E, ADSC = 0x40 };
// Once connected, the input takes 70 us to follow the reference (start-up time in section 29.5), here to half a count.
static const double SETTLING_CYCLES = 70.0 * 16.0 / 7.6;

static void admux_write(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
	struct chained *chained = param;
	nano_t *nano = chained->nano;
	if ((value & MUX) == MUX_BANDGAP && (avr->data[REG_ADMUX] & MUX) != MUX_BANDGAP)
		nano->supply.selected = now(nano);
	write_inner(avr, address, value, chained);
}

static void adcsra_write(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
	struct chained *chained = param;
	nano_t *nano = chained->nano;
	if (value & ADSC && !(avr->data[REG_ADCSRA] & ADSC)) {
		double settled = 1.0 - exp(-(double)(now(nano) - nano->supply.selected) / SETTLING_CYCLES);
		nano->supply.adc->muxmode[MUX_BANDGAP].src = (unsigned)(nano->supply.bandgap_mv * settled + 0.5);
	}
	write_inner(avr, address, value, chained);
}

void supply_attach(nano_t *nano)
{
	chain(nano, REG_ADMUX, admux_write);
	chain(nano, REG_ADCSRA, adcsra_write);
	supply_set(nano, 5000, 1100);
}

void supply_reset(nano_t *nano) { nano->supply.selected = now(nano); }

int supply_set(nano_t *nano, uint32_t vcc_mv, uint32_t bandgap_mv)
{
	avr_t *avr = nano->avr;
	avr->vcc = avr->avcc = avr->aref = vcc_mv;
	nano->supply.bandgap_mv = bandgap_mv;
	int was_off = nano->supply.off;
	nano->supply.off = vcc_mv < BROWN_OUT_MV || (was_off && vcc_mv <= BROWN_OUT_MV + HYSTERESIS_MV);
	return nano->supply.off != was_off;
}
