// SPDX-License-Identifier: GPL-3.0-or-later
// The USART at 8N1: a byte lasts ten bits, the transmitter holds two bytes and the receiver three, as in the chip.
//
// simavr's own counts eleven bits, sends a byte only after the one before, and receives into 64 bytes, which would hide
// a program that reads too late.
#include "inner.h"

enum { RXC = 0x80, TXC = 0x40, UDRE = 0x20, DOR = 0x08, U2X = 0x02, MPCM = 0x01 };
enum { RXCIE = 0x80, TXCIE = 0x40, UDRIE = 0x20, RXEN = 0x10, TXEN = 0x08 };

uint32_t nano_serial_byte_cycles(const nano_t *nano)
{
	const uint8_t *data = nano->avr->data;
	uint32_t divider = (data[REG_UBRR0L] | (data[REG_UBRR0H] & 0x0Fu) << 8) + 1;
	return 10 * divider * (data[REG_UCSR0A] & U2X ? 8 : 16);
}

uint64_t nano_serial_overruns(const nano_t *nano) { return nano->uart.overruns; }

static avr_cycle_count_t sent(avr_t *avr, avr_cycle_count_t when, void *param)
{
	nano_t *nano = param;
	struct uart *uart = &nano->uart;
	nano->out.serial_out(nano->out.context, now(nano), uart->shifted);
	if (!uart->queued) {
		uart->sending = 0;
		avr_raise_interrupt(avr, &uart->module->txc);
		return 0;
	}
	uart->shifted = uart->waiting_out;
	uart->queued = 0;
	avr_raise_interrupt(avr, &uart->module->udrc);
	return when + nano_serial_byte_cycles(nano);
}

static void udr_write(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
	nano_t *nano = param;
	struct uart *uart = &nano->uart;
	if (!(avr->data[REG_UCSR0B] & TXEN))
		return;
	if (uart->sending) {
		uart->waiting_out = value;
		uart->queued = 1;
		avr->data[REG_UCSR0A] &= ~UDRE;
		return;
	}
	uart->sending = 1;
	uart->shifted = value;
	avr_cycle_timer_register(avr, nano_serial_byte_cycles(nano), sent, nano);
	// The byte went straight into the shift register: there is room for the next.
	avr_raise_interrupt(avr, &uart->module->udrc);
}

static uint8_t udr_read(avr_t *avr, avr_io_addr_t address, void *param)
{
	nano_t *nano = param;
	struct uart *uart = &nano->uart;
	uint8_t value = uart->received[0];
	avr->data[REG_UCSR0A] &= ~DOR;
	if (uart->received_count) {
		uart->received[0] = uart->received[1];
		uart->received_count--;
	}
	if (uart->held >= 0) {
		uart->received[uart->received_count++] = uart->held;
		uart->held = -1;
	}
	avr->data[REG_UCSR0A] &= ~RXC;
	uart->module->rxc.pending = 0;
	if (uart->received_count)
		avr_raise_interrupt(avr, &uart->module->rxc);
	return value;
}

static void receive(nano_t *nano, uint8_t byte)
{
	struct uart *uart = &nano->uart;
	avr_t *avr = nano->avr;
	if (!(avr->data[REG_UCSR0B] & RXEN))
		return;
	if (uart->received_count < 2) {
		uart->received[uart->received_count++] = byte;
	} else {
		if (uart->held >= 0) {
			avr->data[REG_UCSR0A] |= DOR;
			uart->overruns++;
		}
		uart->held = byte;
	}
	avr_raise_interrupt(avr, &uart->module->rxc);
}

static avr_cycle_count_t arrived(avr_t *avr, avr_cycle_count_t when, void *param)
{
	nano_t *nano = param;
	int32_t byte = nano->out.serial_in(nano->out.context, now(nano));
	if (byte < 0)
		return 0;
	receive(nano, byte);
	return when + nano_serial_byte_cycles(nano);
}

void nano_serial_wake(nano_t *nano)
{
	if (!avr_cycle_timer_status(nano->avr, arrived, nano))
		avr_cycle_timer_register(nano->avr, nano_serial_byte_cycles(nano), arrived, nano);
}

static void ucsra_write(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
	nano_t *nano = param;
	uint8_t *ucsra = &avr->data[REG_UCSR0A];
	*ucsra = (*ucsra & ~(U2X | MPCM)) | (value & (U2X | MPCM));
	if (value & TXC) {
		*ucsra &= ~TXC;
		nano->uart.module->txc.pending = 0;
	}
}

static void ucsrb_write(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
	nano_t *nano = param;
	struct uart *uart = &nano->uart;
	uint8_t enabled = value & ~avr->data[REG_UCSR0B];
	avr->data[REG_UCSR0B] = value;
	if (!(value & RXEN)) {
		uart->received_count = 0;
		uart->held = -1;
		avr->data[REG_UCSR0A] &= ~(RXC | DOR);
	}
	// The requests are levels: enabling one whose flag is up serves it at once.
	uint8_t flags = avr->data[REG_UCSR0A];
	if (enabled & UDRIE && flags & UDRE)
		avr_raise_interrupt(avr, &uart->module->udrc);
	if (enabled & RXCIE && flags & RXC)
		avr_raise_interrupt(avr, &uart->module->rxc);
	if (enabled & TXCIE && flags & TXC)
		avr_raise_interrupt(avr, &uart->module->txc);
}

void uart_attach(nano_t *nano)
{
	replace_io(nano, REG_UDR0, udr_read, udr_write);
	replace_io(nano, REG_UCSR0A, 0, ucsra_write);
	replace_io(nano, REG_UCSR0B, 0, ucsrb_write);
	replace_io(nano, REG_UBRR0L, 0, 0);
	replace_io(nano, REG_UBRR0H, 0, 0);
}

void uart_reset(nano_t *nano)
{
	struct uart *uart = &nano->uart;
	uart->sending = uart->queued = uart->received_count = 0;
	uart->held = -1;
	nano->avr->data[REG_UCSR0A] = UDRE;
}
