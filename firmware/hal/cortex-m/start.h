/* From reset to main(), and back to reset when something is wrong; the millisecond clock; the stack's high water. */
#ifndef CORTEX_M_START_H
#define CORTEX_M_START_H

#include <stdint.h>

#include "../../core/hal.h"

#define STACK_BYTES 2048u

/* Why the board started, kept over a reset in memory that start-up leaves alone: five words just above the stack, for a
 * debugger, and for QEMU. boots counts from power-on. The other fields are those of the last incident, 0 before any:
 * exception is its number (2 NMI: the watchdog is about to bite, or has bitten where pc is 0, or the crystal failed; 3 fault;
 * others: an interrupt that nobody expects; 1: main() returned), pc where it happened, status the CFSR (which says what kind
 * of fault).
 */
struct boot_record {
    uint32_t magic;
    uint32_t boots;
    uint32_t exception;
    uint32_t pc;
    uint32_t status;
};
extern volatile struct boot_record boot_record;
#define BOOT_WATCHDOG 2u

/* An incident that a chip has noticed by itself, into the record. */
void boot_note(uint32_t exception, uint32_t pc, uint32_t status);

typedef void (*vector)(void);
extern const vector vectors[]; /* the chip's table; its first word is stack_top */
extern uint8_t stack_top[];

_Noreturn void on_reset(void);
void on_fault(void);    /* every vector that has no better handler: records and resets */
void on_nmi_note(void); /* records and goes on, where the NMI is a warning */
void on_systick(void);

/* Sets SysTick to 1 ms. core_hz: a multiple of 1 MHz. */
void clock_start(uint32_t core_hz);

/* Nanoseconds since clock_start(), in steps of the core clock. Not with interrupts off: it waits for a tick that is due. */
int64_t clock_now(void *self);

/* Deepest stack since boot in bytes, from what is left of the paint. Interrupt handlers use the same stack. */
uint32_t stack_high_water(void);

#endif
