// SPDX-License-Identifier: GPL-3.0-or-later
// Callbacks in front of simavr's own.
#include "inner.h"

static void plain_write(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) { avr->data[address] = value; }

void chain(nano_t *nano, uint16_t address, avr_io_write_t write)
{
	avr_io_write_t inner = nano->avr->io[AVR_DATA_TO_IO(address)].w.c;
	struct chained *chained = &nano->chains[nano->chain_count++];
	chained->nano = nano;
	chained->inner = inner ? inner : plain_write;
	chained->param = nano->avr->io[AVR_DATA_TO_IO(address)].w.param;
	nano->avr->io[AVR_DATA_TO_IO(address)].w.c = write;
	nano->avr->io[AVR_DATA_TO_IO(address)].w.param = chained;
}
