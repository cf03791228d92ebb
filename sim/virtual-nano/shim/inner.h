// SPDX-License-Identifier: GPL-3.0-or-later
// Declarations that the files of the shim share.
#ifndef INNER_H
#define INNER_H

#include <simavr/sim_avr.h>
#include <simavr/sim_core.h>
#include <simavr/avr_adc.h>
#include <simavr/avr_eeprom.h>
#include <simavr/avr_extint.h>
#include <simavr/avr_ioport.h>
#include <simavr/avr_timer.h>
#include <simavr/avr_twi.h>
#include <simavr/avr_uart.h>
#include <simavr/avr_watchdog.h>

#include "nano.h"

// Addresses in data space (ATmega328P data sheet, register summary).
enum {
	REG_DDRB = 0x24, REG_PORTB = 0x25, REG_DDRC = 0x27, REG_PORTC = 0x28, REG_DDRD = 0x2A, REG_PORTD = 0x2B,
	REG_TIFR1 = 0x36, REG_TIMSK1 = 0x6F, REG_EIFR = 0x3C, REG_EIMSK = 0x3D, REG_GPIOR0 = 0x3E, REG_EECR = 0x3F, REG_EEDR = 0x40, REG_EEARL = 0x41, REG_EEARH = 0x42,
	REG_TCCR0A = 0x44, REG_TCCR0B = 0x45, REG_OCR0A = 0x47, REG_SMCR = 0x53, REG_MCUSR = 0x54, REG_WDTCSR = 0x60,
	REG_ADCSRA = 0x7A, REG_ADMUX = 0x7C, REG_TCCR2A = 0xB0, REG_TCCR2B = 0xB1, REG_OCR2A = 0xB3,
	REG_TWBR = 0xB8, REG_TWSR = 0xB9, REG_TWDR = 0xBB, REG_TWCR = 0xBC,
	REG_UCSR0A = 0xC0, REG_UCSR0B = 0xC1, REG_UBRR0L = 0xC4, REG_UBRR0H = 0xC5, REG_UDR0 = 0xC6,
};

enum twi_step { TWI_IDLE, TWI_STOPPING, TWI_STARTING, TWI_BYTE };
enum twi_phase { TWI_OFF_BUS, TWI_ADDRESS, TWI_WRITING, TWI_READING };

struct twi {
	avr_twi_t *module;
	enum twi_step step;
	enum twi_phase phase;
	uint8_t status;      // that the step in hand will end with
	int start_follows;   // START was asked for together with STOP
	uint32_t rise;       // cycles that SCL and SDA take to rise
};

struct uart {
	avr_uart_t *module;
	int sending, queued; // a byte in the shift register; one waiting in UDR0
	uint8_t shifted, waiting_out;
	uint8_t received[2];
	int received_count;
	int held;            // a received byte that waits in the shift register, negative for none
	uint64_t overruns;
};

struct watchdog {
	avr_watchdog_t *module;
	uint64_t change_until; // WDE and the prescaler can be changed up to this cycle
	uint64_t since;        // the last start, WDR instruction or time-out
	int reset;             // a reset is due
};

struct eeprom {
	avr_eeprom_t *module;
	uint8_t *bytes;
	uint32_t length;
	int busy;
	uint64_t since;        // the write's begin
	uint16_t address;      // of the byte that is being written
	uint8_t before, value; // that it had, that it will have
};

struct supply {
	avr_adc_t *adc;
	uint32_t bandgap_mv;
	uint64_t selected; // cycle at which the bandgap was connected to the ADC
	int off;           // the brown-out detector holds the chip in reset
};

// An endless loop that the program is in for a while, in place of its own work.
struct busy {
	uint64_t until; // 0: not busy
	uint32_t loop;  // its address; 0 before it begins
	uint32_t back;  // where the program goes on
};

// A write callback of simavr's with something of ours after it.
struct chained {
	nano_t *nano;
	avr_io_write_t inner;
	void *param;
};

struct nano {
	avr_io_t module; // first: simavr resets it with its own modules
	avr_t *avr;
	struct nano_devices out;
	uint64_t cycle_base; // simavr counts anew from every reset
	struct twi twi;
	struct uart uart;
	struct watchdog watchdog;
	struct eeprom eeprom;
	struct supply supply;
	avr_timer_t *timers[3];
	struct busy busy;
	struct chained chains[16];
	int chain_count;
	uint8_t driven_mask[3], driven_levels[3]; // ports B, C, D
	struct nano_outputs outputs;
	int sda;
	uint32_t start; // where the program starts after a reset
	uint16_t lowest_sp;
};

static inline uint64_t now(const nano_t *nano) { return nano->cycle_base + nano->avr->cycle; }

// Replaces a register's callbacks; null means plain memory.
static inline void replace_io(nano_t *nano, uint16_t address, avr_io_read_t read, avr_io_write_t write)
{
	nano->avr->io[AVR_DATA_TO_IO(address)].r.c = read;
	nano->avr->io[AVR_DATA_TO_IO(address)].r.param = nano;
	nano->avr->io[AVR_DATA_TO_IO(address)].w.c = write;
	nano->avr->io[AVR_DATA_TO_IO(address)].w.param = nano;
}

// Calls `write` in place of the register's callback, which it finds in its `struct chained`.
void chain(nano_t *nano, uint16_t address, avr_io_write_t write);

static inline void write_inner(avr_t *avr, avr_io_addr_t address, uint8_t value, struct chained *chained)
{
	chained->inner(avr, address, value, chained->param);
}

// Applies the levels of driven pins of a port once more.
void drive_pins(nano_t *nano, char port);
// Passes the levels of SDA and SCL to the devices, and theirs to the chip.
void bus_lines_changed(nano_t *nano);

void twi_attach(nano_t *nano);
void twi_reset(nano_t *nano);
void uart_attach(nano_t *nano);
void uart_reset(nano_t *nano);
void watchdog_attach(nano_t *nano);
void watchdog_reset(nano_t *nano);
void watchdog_feed(nano_t *nano);
void eeprom_attach(nano_t *nano);
void eeprom_reset(nano_t *nano);
void supply_attach(nano_t *nano);
void supply_reset(nano_t *nano);
// Returns whether the brown-out detector has begun or ended a reset, which the chip must then be put into.
int supply_set(nano_t *nano, uint32_t vcc_mv, uint32_t bandgap_mv);

#endif
