// SPDX-License-Identifier: GPL-3.0-or-later
// The chip's life: made, loaded, reset and run; its outputs and memories.
#include <stdlib.h>
#include <string.h>

#include "inner.h"

enum { FREQUENCY = 16000000, SRAM_START = 0x100, RAMEND = 0x8FF, PAINT = 0xA5 };
enum { SLEEP_ENABLE = 1, RJMP_TO_ITSELF = 0xCFFF };
// Instructions run in batches of at most this many cycles; an event or an interrupt ends a batch early.
enum { BATCH_CYCLES = 2000 };

// simavr's messages would mix with the program's own output.
static void no_log(avr_t *avr, const int level, const char *format, va_list arguments) {}

// Ends a batch at the cycle that `nano_run_until` was asked for.
static avr_cycle_count_t stop(avr_t *avr, avr_cycle_count_t when, void *param) { return 0; }

static void report_outputs(nano_t *nano)
{
	const uint8_t *data = nano->avr->data;
	struct nano_outputs outputs = {
		.port_b = data[REG_PORTB], .ddr_b = data[REG_DDRB], .port_d = data[REG_PORTD], .ddr_d = data[REG_DDRD],
		.tccr0a = data[REG_TCCR0A], .tccr0b = data[REG_TCCR0B], .ocr0a = data[REG_OCR0A],
		.tccr2a = data[REG_TCCR2A], .tccr2b = data[REG_TCCR2B], .ocr2a = data[REG_OCR2A],
	};
	if (memcmp(&outputs, &nano->outputs, sizeof outputs) == 0)
		return;
	nano->outputs = outputs;
	nano->out.outputs(nano->out.context, now(nano), &outputs);
}

static void write_then_outputs(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
	struct chained *chained = param;
	write_inner(avr, address, value, chained);
	report_outputs(chained->nano);
}

static void write_then_bus(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
	struct chained *chained = param;
	write_inner(avr, address, value, chained);
	bus_lines_changed(chained->nano);
}

static void mark_write(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
	nano_t *nano = param;
	avr->data[address] = value;
	nano->out.mark(nano->out.context, now(nano), value);
}

// A one clears the flag of an interrupt (sections 13.2.3 and 16.11.9). To simavr the register is plain memory, or any write clears
// all flags of the timer.
static void flags_write(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
	for (int i = 0; i < avr->interrupts.vector_count; i++) {
		avr_int_vector_t *vector = avr->interrupts.vector[i];
		if (vector->raised.reg == address && value >> vector->raised.bit & 1)
			avr_clear_interrupt(avr, vector);
	}
}

// What has raised its flag while its interrupt was off interrupts when it is on again (sections 13.2.2 and 16.11.8). To simavr it
// is over.
static void mask_write(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
	avr->data[address] = value;
	for (int i = 0; i < avr->interrupts.vector_count; i++) {
		avr_int_vector_t *vector = avr->interrupts.vector[i];
		if (vector->enable.reg == address && avr_regbit_get(avr, vector->enable) && avr_regbit_get(avr, vector->raised))
			avr_raise_interrupt(avr, vector);
	}
}

// A function that makes room on the stack writes SPH, then SPL. What it does not use of that room keeps its paint.
// Calls, pushes and pops come here too, before their SPH is written: where they cross a page the pair is not the stack
// pointer. What they reach loses its paint, so only an OUT counts.
static void spl_write(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
	nano_t *nano = param;
	avr->data[address] = value;
	uint16_t opcode = avr->flash[avr->pc] | avr->flash[avr->pc + 1] << 8;
	if ((opcode & 0xF800) != 0xB800)
		return;
	uint16_t sp = value | avr->data[R_SPH] << 8;
	if (sp >= SRAM_START && sp < nano->lowest_sp)
		nano->lowest_sp = sp;
}

static avr_cycle_count_t wake(avr_t *avr, avr_cycle_count_t when, void *param)
{
	nano_t *nano = param;
	uint64_t cycle = now(nano);
	uint64_t next = nano->out.wake(nano->out.context, nano, cycle);
	return (next > cycle ? next : cycle + 1) - nano->cycle_base;
}

// Once all of simavr's modules are reset.
static avr_cycle_count_t after_reset(avr_t *avr, avr_cycle_count_t when, void *param)
{
	nano_t *nano = param;
	// simavr goes on polling a pin that was low while its interrupt was level-triggered, as all are after reset, even
	// when the program has made it edge-triggered since: interrupts without end.
	avr_extint_set_strict_lvl_trig(avr, EXTINT_IRQ_OUT_INT0, 0);
	avr_extint_set_strict_lvl_trig(avr, EXTINT_IRQ_OUT_INT1, 0);
	for (int index = 0; index < 3; index++)
		drive_pins(nano, 'B' + index);
	bus_lines_changed(nano);
	avr_cycle_timer_register(avr, 1, wake, nano);
	return 0;
}

// Called by `avr_reset`.
static void on_reset(avr_io_t *module)
{
	nano_t *nano = (nano_t *)module;
	avr_t *avr = nano->avr;
	nano->cycle_base += avr->cycle;
	avr->cycle = 0;
	avr->run_cycle_limit = BATCH_CYCLES;
	twi_reset(nano);
	uart_reset(nano);
	eeprom_reset(nano);
	supply_reset(nano);
	nano->out.reset(nano->out.context, now(nano));
	report_outputs(nano);
	avr_cycle_timer_register(avr, 1, after_reset, nano);
}

static int on_ioctl(avr_io_t *module, uint32_t call, void *param)
{
	if (call != AVR_IOCTL_WATCHDOG_RESET)
		return -1;
	watchdog_feed((nano_t *)module);
	return 0;
}

nano_t *nano_new(const struct nano_devices *devices, uint32_t flash_bytes)
{
	avr_global_logger_set(no_log);
	avr_t *avr = avr_make_mcu_by_name("atmega328p");
	if (!avr)
		return 0;
	avr->flashend = flash_bytes - 1;
	avr_init(avr);
	avr->frequency = FREQUENCY;
	avr->log = LOG_NONE;

	nano_t *nano = calloc(1, sizeof *nano);
	nano->avr = avr;
	nano->out = *devices;
	nano->sda = 1;
	nano->lowest_sp = RAMEND;
	memset(avr->flash, 0xFF, avr->flashend + 1);
	memset(avr->data + SRAM_START, PAINT, RAMEND + 1 - SRAM_START);

	for (avr_io_t *io = avr->io_port; io; io = io->next) {
		if (!strcmp(io->kind, "twi"))
			nano->twi.module = (avr_twi_t *)io;
		if (!strcmp(io->kind, "uart"))
			nano->uart.module = (avr_uart_t *)io;
		if (!strcmp(io->kind, "watchdog"))
			nano->watchdog.module = (avr_watchdog_t *)io;
		if (!strcmp(io->kind, "eeprom"))
			nano->eeprom.module = (avr_eeprom_t *)io;
		if (!strcmp(io->kind, "adc"))
			nano->supply.adc = (avr_adc_t *)io;
		if (!strcmp(io->kind, "timer"))
			nano->timers[((avr_timer_t *)io)->name - '0'] = (avr_timer_t *)io;
	}
	twi_attach(nano);
	uart_attach(nano);
	watchdog_attach(nano);
	eeprom_attach(nano);
	supply_attach(nano);
	static const uint16_t output_registers[] = {
		REG_PORTB, REG_DDRB, REG_PORTD, REG_DDRD,
		REG_TCCR0A, REG_TCCR0B, REG_OCR0A, REG_TCCR2A, REG_TCCR2B, REG_OCR2A,
	};
	for (unsigned i = 0; i < sizeof output_registers / sizeof *output_registers; i++)
		chain(nano, output_registers[i], write_then_outputs);
	chain(nano, REG_DDRC, write_then_bus);
	chain(nano, REG_PORTC, write_then_bus);
	avr_register_io_write(avr, REG_GPIOR0, mark_write, nano);
	avr_register_io_write(avr, R_SPL, spl_write, nano);
	avr_register_io_write(avr, REG_EIFR, flags_write, nano);
	replace_io(nano, REG_TIFR1, 0, flags_write);
	avr_register_io_write(avr, REG_EIMSK, mask_write, nano);
	avr_register_io_write(avr, REG_TIMSK1, mask_write, nano);
	nano->module = (avr_io_t){ .kind = "nano", .reset = on_reset, .ioctl = on_ioctl };
	avr_register_io(avr, &nano->module);
	return nano;
}

void nano_free(nano_t *nano)
{
	avr_terminate(nano->avr);
	free(nano->avr);
	free(nano);
}

int nano_flash(nano_t *nano, uint32_t address, const uint8_t *bytes, uint32_t length)
{
	uint32_t size = nano->avr->flashend + 1;
	if (address > size || length > size - address)
		return 0;
	memcpy(nano->avr->flash + address, bytes, length);
	return 1;
}

uint8_t *nano_eeprom(nano_t *nano, uint32_t *length)
{
	*length = nano->eeprom.length;
	return nano->eeprom.bytes;
}

void nano_reset(nano_t *nano, uint32_t start, uint8_t cause)
{
	avr_t *avr = nano->avr;
	// Each cause keeps its flag until the program clears it; power-on clears the others (section 11.9.1).
	uint8_t flags = cause == NANO_RESET_POWER ? cause : avr->data[REG_MCUSR] | cause;
	nano->start = start;
	nano->busy.until = 0;
	avr->reset_pc = start;
	avr->codeend = avr->flashend;
	avr_reset(avr);
	avr->pc = start;
	avr->data[REG_MCUSR] = flags;
	watchdog_reset(nano);
}

// Returns the address of an endless loop in a blank place of flash, or zero.
static uint32_t endless_loop(nano_t *nano)
{
	avr_t *avr = nano->avr;
	uint32_t place = avr->flashend - 1;
	while (place && (avr->flash[place] & avr->flash[place + 1]) != 0xFF)
		place -= 2;
	if (place) {
		avr->flash[place] = RJMP_TO_ITSELF & 0xFF;
		avr->flash[place + 1] = RJMP_TO_ITSELF >> 8;
	}
	return place;
}

int nano_hang(nano_t *nano, int interrupts)
{
	avr_t *avr = nano->avr;
	uint32_t loop = endless_loop(nano);
	if (!loop)
		return 0;
	avr->pc = loop;
	avr->sreg[S_I] = interrupts;
	avr->state = cpu_Running;
	return 1;
}

int nano_busy(nano_t *nano, uint64_t cycle)
{
	uint32_t loop = endless_loop(nano);
	nano->busy = (struct busy){ .until = loop ? cycle : 0, .loop = loop };
	return !!loop;
}

// Between two instructions: enters or leaves the loop of `nano_busy`.
static void be_busy(nano_t *nano)
{
	avr_t *avr = nano->avr;
	struct busy *busy = &nano->busy;
	if (!busy->back && avr->sreg[S_I] && avr->state == cpu_Running) {
		busy->back = avr->pc;
		avr->pc = busy->loop;
	} else if (busy->back && avr->pc == busy->loop && now(nano) >= busy->until) {
		avr->pc = busy->back;
		busy->until = 0;
	}
}

// One batch of instructions, or of sleep; then what is due at its end.
static void step(nano_t *nano)
{
	avr_t *avr = nano->avr;
	avr_flashaddr_t pc = avr->pc;
	if (avr->state == cpu_Running && !nano->supply.off) {
		pc = avr_run_one(avr);
		// One more instruction runs once interrupts are on (sections 7.7 and 7.7.1), where simavr has two.
		if (avr->interrupt_state == -2)
			avr->interrupt_state = -1;
		// Without its enable bit SLEEP does nothing (section 10.11.1).
		if (avr->state == cpu_Sleeping && !(avr->data[REG_SMCR] & SLEEP_ENABLE))
			avr->state = cpu_Running;
	}
	int deaf = avr->state == cpu_Sleeping && !avr->sreg[S_I];
	avr_cycle_count_t idle = avr_cycle_timer_process(avr);
	avr->pc = pc;
	// simavr wakes the chip for interrupts that are off, too.
	if (deaf)
		avr->state = cpu_Sleeping;
	if (avr->state == cpu_Sleeping || nano->supply.off)
		avr->cycle += 1 + idle;
	if (nano->busy.until)
		be_busy(nano);
	if (avr->interrupt_state && !nano->supply.off)
		avr_service_interrupts(avr);
}

enum nano_state nano_run_until(nano_t *nano, uint64_t cycle)
{
	avr_t *avr = nano->avr;
	if (cycle <= now(nano))
		return NANO_RUNS;
	avr_cycle_timer_register(avr, cycle - now(nano), stop, nano);
	while (now(nano) < cycle) {
		step(nano);
		if (nano->watchdog.reset) {
			nano_reset(nano, nano->start, NANO_RESET_WATCHDOG);
			avr_cycle_timer_register(avr, cycle - now(nano), stop, nano);
		}
		if (avr->state == cpu_Crashed)
			return NANO_CRASHED;
	}
	return NANO_RUNS;
}

void nano_set_supply(nano_t *nano, uint32_t vcc_mv, uint32_t bandgap_mv)
{
	if (supply_set(nano, vcc_mv, bandgap_mv))
		nano_reset(nano, nano->start, NANO_RESET_BROWN_OUT);
}

uint64_t nano_timer_phase(const nano_t *nano, int timer)
{
	const avr_timer_t *module = nano->timers[timer];
	return module->tov_cycles ? (nano->avr->cycle - module->tov_base) % module->tov_cycles : 0;
}

uint64_t nano_cycle(const nano_t *nano) { return now(nano); }

uint8_t nano_peek(const nano_t *nano, uint16_t address) { return address <= RAMEND ? nano->avr->data[address] : 0; }

uint16_t nano_deepest_stack(const nano_t *nano, uint16_t bottom)
{
	uint16_t address = bottom < SRAM_START ? SRAM_START : bottom;
	// PAINT, or what a program paints its free memory with.
	uint8_t paint = nano->avr->data[address];
	while (address <= RAMEND && nano->avr->data[address] == paint)
		address++;
	uint16_t touched = RAMEND + 1 - address;
	uint16_t pointed = RAMEND - nano->lowest_sp;
	return touched > pointed ? touched : pointed;
}

uint32_t nano_pc(const nano_t *nano) { return nano->avr->pc; }
