// SPDX-License-Identifier: GPL-3.0-or-later
// The EEPROM (data sheet DS40002061B, section 8.6): a write takes its time, and halts the program only if it waits.
//
// simavr's own writes at once and never sets EEPE.
#include "inner.h"

enum { EERE = 0x01, EEPE = 0x02, EEMPE = 0x04, EERIE = 0x08, EEPM = 0x30, EEPM_ERASE = 0x10, EEPM_WRITE = 0x20 };
enum { ENABLE_CYCLES = 4, READ_HALT = 4, WRITE_HALT = 2 };
// Table 8-1, microseconds.
enum { BOTH_US = 3400, HALF_US = 1800, CYCLES_PER_US = 16 };

static uint16_t address(const nano_t *nano)
{
	const uint8_t *data = nano->avr->data;
	return (data[REG_EEARL] | data[REG_EEARH] << 8) & (nano->eeprom.length - 1);
}

static avr_cycle_count_t enable_ends(avr_t *avr, avr_cycle_count_t when, void *param)
{
	avr->data[REG_EECR] &= ~EEMPE;
	return 0;
}

static avr_cycle_count_t written(avr_t *avr, avr_cycle_count_t when, void *param)
{
	nano_t *nano = param;
	struct eeprom *eeprom = &nano->eeprom;
	eeprom->bytes[eeprom->address] = eeprom->value;
	eeprom->busy = 0;
	avr->data[REG_EECR] &= ~EEPE;
	avr_raise_interrupt(avr, &eeprom->module->ready);
	return 0;
}

static void start_write(nano_t *nano, uint8_t mode)
{
	struct eeprom *eeprom = &nano->eeprom;
	avr_t *avr = nano->avr;
	uint8_t data = avr->data[REG_EEDR];
	eeprom->busy = 1;
	eeprom->since = now(nano);
	eeprom->address = address(nano);
	uint8_t *byte = &eeprom->bytes[eeprom->address];
	eeprom->before = *byte;
	// Erasing makes ones, writing makes zeros.
	eeprom->value = mode == EEPM_ERASE ? 0xFF : mode == EEPM_WRITE ? *byte & data : data;
	if (mode != EEPM_WRITE)
		*byte = 0xFF;
	uint32_t us = mode == EEPM_ERASE || mode == EEPM_WRITE ? HALF_US : BOTH_US;
	avr_cycle_timer_register(avr, us * CYCLES_PER_US, written, nano);
	avr->cycle += WRITE_HALT;
}

static void eecr_write(avr_t *avr, avr_io_addr_t io_address, uint8_t value, void *param)
{
	nano_t *nano = param;
	uint8_t *eecr = &avr->data[REG_EECR];
	uint8_t old = *eecr;
	// The mode cannot be changed during a write.
	uint8_t mode = old & EEPE ? old & EEPM : value & EEPM;
	*eecr = mode | (value & EERIE) | (old & (EEPE | EEMPE));
	if (value & EEPE && old & EEMPE && !(old & EEPE)) {
		*eecr = (*eecr & ~EEMPE) | EEPE;
		avr_cycle_timer_cancel(avr, enable_ends, nano);
		start_write(nano, mode);
	} else if (value & EEMPE) {
		*eecr |= EEMPE;
		avr_cycle_timer_cancel(avr, enable_ends, nano);
		avr_cycle_timer_register(avr, ENABLE_CYCLES + 1, enable_ends, nano);
	}
	// Nothing can be read during a write.
	if (value & EERE && !(*eecr & EEPE)) {
		avr->data[REG_EEDR] = nano->eeprom.bytes[address(nano)];
		avr->cycle += READ_HALT;
	}
	if (value & EERIE && !(old & EERIE) && !(*eecr & EEPE))
		avr_raise_interrupt(avr, &nano->eeprom.module->ready);
}

void eeprom_attach(nano_t *nano)
{
	avr_eeprom_desc_t whole = { .ee = 0, .offset = 0, .size = 0 };
	avr_ioctl(nano->avr, AVR_IOCTL_EEPROM_GET, &whole);
	nano->eeprom.bytes = whole.ee;
	nano->eeprom.length = nano->avr->e2end + 1;
	replace_io(nano, REG_EECR, 0, eecr_write);
	replace_io(nano, REG_EEDR, 0, 0);
	replace_io(nano, REG_EEARL, 0, 0);
	replace_io(nano, REG_EEARH, 0, 0);
}

// What a write leaves that loses its supply in its first half, which erases: ones, here in every other bit. In its second
// half: some of the zeros not yet written.
static uint8_t cut_off(const nano_t *nano)
{
	const struct eeprom *eeprom = &nano->eeprom;
	int is_erasing = now(nano) - eeprom->since < BOTH_US / 2 * CYCLES_PER_US;
	return is_erasing ? eeprom->before | 0xAA : eeprom->value | 0x0F;
}

// A write that a reset interrupts is completed, unless there is no supply.
void eeprom_reset(nano_t *nano)
{
	struct eeprom *eeprom = &nano->eeprom;
	if (eeprom->busy)
		eeprom->bytes[eeprom->address] = nano->supply.off ? cut_off(nano) : eeprom->value;
	eeprom->busy = 0;
}
