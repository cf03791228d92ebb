// SPDX-License-Identifier: GPL-3.0-or-later
// An ATmega328P at 16 MHz on simavr, with a flat interface.
//
// What simavr 1.6 does not do well enough is done here: the TWI as a bus master (twi.c), the USART (uart.c), the watchdog
// (watchdog.c), the EEPROM's write time (eeprom.c), supply and bandgap (supply.c), sleep, and pins that something outside
// drives (pins.c). Everything outside of the chip is behind `struct nano_devices`.
#ifndef NANO_H
#define NANO_H

#include <stdint.h>

typedef struct nano nano_t;

// Registers that determine the chip's outputs to the motors' bridge.
struct nano_outputs {
	uint8_t port_b, ddr_b, port_d, ddr_d;
	uint8_t tccr0a, tccr0b, ocr0a, tccr2a, tccr2b, ocr2a;
};

// A device's reply on the bus.
enum {
	NANO_BUS_ACK = 0x100,  // the device pulls SDA low in the acknowledge bit
	NANO_BUS_HELD = 0x200, // the device keeps SDA low for good
};

// The devices outside of the chip. Every call has the cycle at which it happens. None of them may call back into this
// interface except `nano_set_pins` and `nano_timer_phase`.
struct nano_devices {
	void *context;
	// Bus: a START with an address byte, a byte written, a byte read (returned in the low 8 bits), a STOP.
	uint32_t (*bus_address)(void *context, uint64_t cycle, uint8_t address);
	uint32_t (*bus_write)(void *context, uint64_t cycle, uint8_t byte);
	uint32_t (*bus_read)(void *context, uint64_t cycle);
	void (*bus_stop)(void *context, uint64_t cycle);
	// The board releases or pulls SDA and SCL; returns whether the devices release SDA.
	int (*bus_lines)(void *context, uint64_t cycle, int sda, int scl);
	// A byte has left the USART; the byte that has just arrived, negative for none.
	void (*serial_out)(void *context, uint64_t cycle, uint8_t byte);
	int32_t (*serial_in)(void *context, uint64_t cycle);
	void (*outputs)(void *context, uint64_t cycle, const struct nano_outputs *outputs);
	// The chip was reset, whatever caused it.
	void (*reset)(void *context, uint64_t cycle);
	// The program wrote GPIOR0.
	void (*mark)(void *context, uint64_t cycle, uint8_t value);
	// Called at the cycle that its last call returned.
	uint64_t (*wake)(void *context, nano_t *nano, uint64_t cycle);
};

enum nano_state { NANO_RUNS, NANO_CRASHED };
// Bits of MCUSR.
enum { NANO_RESET_POWER = 1, NANO_RESET_PIN = 2, NANO_RESET_BROWN_OUT = 4, NANO_RESET_WATCHDOG = 8 };

// Flash of so many bytes is blank, SRAM painted; `nano_reset` starts it. Null when simavr does not know the chip.
nano_t *nano_new(const struct nano_devices *devices, uint32_t flash_bytes);
void nano_free(nano_t *nano);
// Copies into flash. Zero when it does not fit.
int nano_flash(nano_t *nano, uint32_t address, const uint8_t *bytes, uint32_t length);
uint8_t *nano_eeprom(nano_t *nano, uint32_t *length);
// Resets the chip; this reset and those to come start the program at the byte address `start`.
void nano_reset(nano_t *nano, uint32_t start, uint8_t cause);
// Supply and bandgap reference, mV. Below the brown-out level the chip is in reset.
void nano_set_supply(nano_t *nano, uint32_t vcc_mv, uint32_t bandgap_mv);
// Cycles that a line of the bus takes to rise.
void nano_set_bus_rise(nano_t *nano, uint32_t cycles);
// Sends the program into an endless loop, with interrupts on or off. Zero when flash has no room for the loop.
int nano_hang(nano_t *nano, int interrupts);
// Keeps the program in such a loop until `cycle`, from the next moment on at which interrupts are on. Zero as above.
int nano_busy(nano_t *nano, uint64_t cycle);
enum nano_state nano_run_until(nano_t *nano, uint64_t cycle);
uint64_t nano_cycle(const nano_t *nano);
// Levels of pins that something outside drives, from now on.
void nano_set_pins(nano_t *nano, char port, uint8_t mask, uint8_t levels);
// Cycles since the counter of timer 0 or 2 was last zero.
uint64_t nano_timer_phase(const nano_t *nano, int timer);
// Asks `bus_lines` again: a device changed its mind.
void nano_bus_changed(nano_t *nano);
// `serial_in` has bytes.
void nano_serial_wake(nano_t *nano);
// Cycles that a byte takes on the line, both ways.
uint32_t nano_serial_byte_cycles(const nano_t *nano);
// Bytes that the program was too slow to read.
uint64_t nano_serial_overruns(const nano_t *nano);
uint8_t nano_peek(const nano_t *nano, uint16_t address);
// Bytes of stack used at most since `nano_new`, where static data end before `bottom`.
uint16_t nano_deepest_stack(const nano_t *nano, uint16_t bottom);
uint32_t nano_pc(const nano_t *nano);

#endif
