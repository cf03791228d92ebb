// SPDX-License-Identifier: GPL-3.0-or-later
// Pins that something outside of the chip drives, the lines of the bus among them.
#include "inner.h"

enum { SDA_PIN = 0x10, SCL_PIN = 0x20 };

void drive_pins(nano_t *nano, char port)
{
	int index = port - 'B';
	avr_ioport_external_t external = {
		.name = port, .mask = nano->driven_mask[index], .value = nano->driven_levels[index],
	};
	// Otherwise simavr sets inputs with a pull-up to one at every write to the port.
	avr_ioctl(nano->avr, AVR_IOCTL_IOPORT_SET_EXTERNAL(port), &external);
	uint8_t ddr = nano->avr->data[REG_DDRB + 3 * index];
	uint8_t driven = external.mask & ~ddr;
	// A reset clears this register, and simavr sets it again only where a level changes.
	uint8_t *pin = &nano->avr->data[REG_DDRB - 1 + 3 * index];
	*pin = (*pin & ~driven) | (external.value & driven);
	avr_irq_t *pins = avr_io_getirq(nano->avr, AVR_IOCTL_IOPORT_GETIRQ(port), 0);
	for (int bit = 0; bit < 8; bit++)
		if (driven & 1 << bit)
			avr_raise_irq(&pins[bit], external.value >> bit & 1);
}

void nano_set_pins(nano_t *nano, char port, uint8_t mask, uint8_t levels)
{
	int index = port - 'B';
	nano->driven_mask[index] |= mask;
	nano->driven_levels[index] = (nano->driven_levels[index] & ~mask) | (levels & mask);
	drive_pins(nano, port);
}

void bus_lines_changed(nano_t *nano)
{
	const uint8_t *data = nano->avr->data;
	uint8_t low = data[REG_DDRC] & ~data[REG_PORTC];
	nano->sda = nano->out.bus_lines(nano->out.context, now(nano), !(low & SDA_PIN), !(low & SCL_PIN));
	nano_set_pins(nano, 'C', SDA_PIN | SCL_PIN, SCL_PIN | (nano->sda ? SDA_PIN : 0));
}

void nano_bus_changed(nano_t *nano) { bus_lines_changed(nano); }
