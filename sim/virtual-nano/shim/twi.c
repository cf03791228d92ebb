// SPDX-License-Identifier: GPL-3.0-or-later
// The two-wire interface as the only master of its bus, with bit times from TWBR and TWSR.
//
// simavr's own cannot serve a program that polls: TWINT never clears, the status after SLA+W is wrong, and the bit time
// is fixed.
#include "inner.h"

enum { TWINT = 0x80, TWEA = 0x40, TWSTA = 0x20, TWSTO = 0x10, TWEN = 0x04, PRESCALER = 0x03 };
enum {
	STARTED = 0x08, RESTARTED = 0x10,
	SLA_W_ACK = 0x18, SLA_W_NACK = 0x20, WRITTEN_ACK = 0x28, WRITTEN_NACK = 0x30,
	LOST = 0x38, // arbitration: a one was sent and a zero seen
	SLA_R_ACK = 0x40, SLA_R_NACK = 0x48, READ_ACK = 0x50, READ_NACK = 0x58,
	NOTHING = 0xF8,
};

static void set_status(nano_t *nano, uint8_t status)
{
	uint8_t *twsr = &nano->avr->data[REG_TWSR];
	*twsr = (*twsr & PRESCALER) | status;
}

// The clock's high time begins only when SCL is seen high (section 22.5.2), so a slow rise makes every bit longer.
static uint32_t bit_cycles(const nano_t *nano)
{
	const uint8_t *data = nano->avr->data;
	return 16 + (2u * data[REG_TWBR] << (2 * (data[REG_TWSR] & PRESCALER))) + nano->twi.rise;
}

static avr_cycle_count_t step_done(avr_t *avr, avr_cycle_count_t when, void *param)
{
	nano_t *nano = param;
	struct twi *twi = &nano->twi;
	// Neither START nor STOP can be made while a device keeps SDA low: the hardware waits for as long as it lasts.
	if ((twi->step == TWI_STOPPING || twi->step == TWI_STARTING) && !nano->sda)
		return when + bit_cycles(nano);
	if (twi->step == TWI_STOPPING) {
		nano->out.bus_stop(nano->out.context, now(nano));
		twi->phase = TWI_OFF_BUS;
		avr->data[REG_TWCR] &= ~TWSTO;
		set_status(nano, NOTHING);
		if (!twi->start_follows) {
			twi->step = TWI_IDLE;
			return 0;
		}
		twi->start_follows = 0;
		twi->step = TWI_STARTING;
		twi->status = STARTED;
		return when + 2 * bit_cycles(nano);
	}
	if (twi->step == TWI_STARTING)
		twi->phase = TWI_ADDRESS;
	twi->step = TWI_IDLE;
	set_status(nano, twi->status);
	avr_raise_interrupt(avr, &twi->module->twi);
	return 0;
}

static void begin(nano_t *nano, enum twi_step step, uint32_t bits, uint8_t status)
{
	nano->twi.step = step;
	nano->twi.status = status;
	avr_cycle_timer_register(nano->avr, bits * bit_cycles(nano), step_done, nano);
}

static void note_sda(nano_t *nano, uint32_t answer)
{
	if (!!(answer & NANO_BUS_HELD) == nano->sda)
		bus_lines_changed(nano);
}

// Sends a byte; the device's reply decides how it ends.
static void transmit(nano_t *nano, uint8_t byte, uint32_t answer, uint8_t acked, uint8_t nacked)
{
	note_sda(nano, answer);
	uint8_t status = answer & NANO_BUS_ACK ? acked : nacked;
	if (answer & NANO_BUS_HELD)
		status = byte ? LOST : acked;
	if (status == LOST)
		nano->twi.phase = TWI_OFF_BUS;
	begin(nano, TWI_BYTE, 9, status);
}

static void receive(nano_t *nano, int ack)
{
	uint32_t answer = nano->out.bus_read(nano->out.context, now(nano));
	note_sda(nano, answer);
	nano->avr->data[REG_TWDR] = answer & NANO_BUS_HELD ? 0 : answer;
	if (ack)
		begin(nano, TWI_BYTE, 9, READ_ACK);
	else
		begin(nano, TWI_BYTE, 9, answer & NANO_BUS_HELD ? LOST : READ_NACK);
}

static void twcr_write(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
	nano_t *nano = param;
	struct twi *twi = &nano->twi;
	uint8_t *twcr = &avr->data[REG_TWCR];
	if (!(value & TWEN)) {
		*twcr = value & ~(TWINT | TWSTO);
		avr_cycle_timer_cancel(avr, step_done, nano);
		avr_clear_interrupt(avr, &twi->module->twi);
		if (twi->phase != TWI_OFF_BUS)
			nano->out.bus_stop(nano->out.context, now(nano));
		twi->step = TWI_IDLE;
		twi->phase = TWI_OFF_BUS;
		set_status(nano, NOTHING);
		bus_lines_changed(nano);
		return;
	}
	if (!(value & TWINT)) {
		*twcr = (value & ~TWINT) | (*twcr & TWINT);
		return;
	}
	// Writing a one clears the flag, and the next step begins.
	*twcr = value & ~TWINT;
	twi->module->twi.pending = 0;
	if (value & TWSTO) {
		twi->start_follows = !!(value & TWSTA);
		begin(nano, TWI_STOPPING, 1, NOTHING);
	} else if (value & TWSTA) {
		if (twi->step == TWI_STOPPING)
			twi->start_follows = 1;
		else
			begin(nano, TWI_STARTING, 2, twi->phase == TWI_OFF_BUS ? STARTED : RESTARTED);
	} else if (twi->step == TWI_IDLE) {
		uint8_t byte = avr->data[REG_TWDR];
		uint32_t answer;
		switch (twi->phase) {
		case TWI_ADDRESS:
			answer = nano->out.bus_address(nano->out.context, now(nano), byte);
			twi->phase = byte & 1 ? TWI_READING : TWI_WRITING;
			transmit(nano, byte, answer, byte & 1 ? SLA_R_ACK : SLA_W_ACK, byte & 1 ? SLA_R_NACK : SLA_W_NACK);
			break;
		case TWI_WRITING:
			answer = nano->out.bus_write(nano->out.context, now(nano), byte);
			transmit(nano, byte, answer, WRITTEN_ACK, WRITTEN_NACK);
			break;
		case TWI_READING:
			receive(nano, value & TWEA);
			break;
		case TWI_OFF_BUS:
			break;
		}
	}
}

static void twsr_write(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
	avr->data[REG_TWSR] = (avr->data[REG_TWSR] & ~PRESCALER) | (value & PRESCALER);
}

void twi_attach(nano_t *nano)
{
	replace_io(nano, REG_TWCR, 0, twcr_write);
	replace_io(nano, REG_TWSR, 0, twsr_write);
	replace_io(nano, REG_TWDR, 0, 0);
	replace_io(nano, REG_TWBR, 0, 0);
}

void nano_set_bus_rise(nano_t *nano, uint32_t cycles) { nano->twi.rise = cycles; }

void twi_reset(nano_t *nano)
{
	if (nano->twi.phase != TWI_OFF_BUS)
		nano->out.bus_stop(nano->out.context, now(nano));
	nano->twi.step = TWI_IDLE;
	nano->twi.phase = TWI_OFF_BUS;
	nano->twi.start_follows = 0;
	set_status(nano, NOTHING);
	nano->avr->data[REG_TWDR] = 0xFF;
}
