/* From reset to main(), and back to reset when something is wrong; the millisecond clock; the stack's high water. */
#include "start.h"

#include "registers.h"

#define BOOT_MAGIC 0xB0A2D001u
#define PAINT 0x5AC35AC3u
#define NS_PER_MS 1000000
#define UNPAINTED_BYTES 64u /* of on_reset() itself */

extern int main(void);

extern uint32_t stack_bottom[];
extern uint32_t data_start[], data_end[], data_image[], bss_start[], bss_end[];

__attribute__((section(".noinit"), used)) volatile struct boot_record boot_record;

static volatile int64_t milliseconds;
static uint32_t counts_per_us;

void boot_note(uint32_t exception, uint32_t pc, uint32_t status) {
    boot_record.exception = exception;
    boot_record.pc = pc;
    boot_record.status = status;
}

static void count_boot(void) {
    if (boot_record.magic != BOOT_MAGIC) {
        boot_record.magic = BOOT_MAGIC;
        boot_record.boots = 0u;
        boot_note(0u, 0u, 0u);
    }
    boot_record.boots += 1u;
}

static _Noreturn void reset(void) {
    barrier();
    for (;;) SCB_AIRCR = AIRCR_KEY | AIRCR_SYSTEM_RESET;
}

static void paint_stack(void) {
    uint32_t *top;
    __asm volatile("mov %0, sp" : "=r"(top));
    for (volatile uint32_t *word = stack_bottom; word < top - UNPAINTED_BYTES / 4u; word++) *word = PAINT;
}

/* Order: the FPU before any code that might use it, the record before memory that it must outlive is written. */
_Noreturn void on_reset(void) {
    SCB_CPACR |= CPACR_FPU_FULL;
    SCB_VTOR = (uint32_t)(uintptr_t)vectors;
    barrier();
    paint_stack();
    const uint32_t *image = data_image;
    for (volatile uint32_t *word = data_start; word < data_end; word++) *word = *image++;
    for (volatile uint32_t *word = bss_start; word < bss_end; word++) *word = 0u;
    count_boot();
    (void)main();
    boot_note(1u, 0u, 0u);
    reset();
}

/* frame: what the core pushed, r0-r3 r12 lr pc xpsr; NULL where it may not have got that far. */
__attribute__((used)) static void note(const uint32_t *frame) {
    uint32_t exception;
    __asm volatile("mrs %0, ipsr" : "=r"(exception));
    boot_note(exception, frame ? frame[6] : 0u, SCB_CFSR);
}

__attribute__((used)) static _Noreturn void note_and_reset(const uint32_t *frame) {
    note(frame);
    reset();
}

/* A stack that has overflowed ends below RAM, where there is no frame and no room: begin it anew, nothing returns to it. */
__attribute__((naked)) void on_fault(void) {
    __asm volatile("mov r0, sp\n\t"
                   "ldr r1, =stack_bottom\n\t"
                   "cmp r0, r1\n\t"
                   "it lo\n\t"
                   "movlo r0, #0\n\t"
                   "ldr r1, =stack_top\n\t"
                   "mov sp, r1\n\t"
                   "b %c0\n\t"
                   ".ltorg" ::"i"(note_and_reset));
}

__attribute__((naked)) void on_nmi_note(void) { __asm volatile("mov r0, sp\n\tb %c0" ::"i"(note)); }

void on_systick(void) { milliseconds += 1; }

void clock_start(uint32_t core_hz) {
    counts_per_us = core_hz / 1000000u;
    SYSTICK_RELOAD = core_hz / 1000u - 1u;
    SYSTICK_VALUE = 0u;
    SYSTICK_CONTROL = SYSTICK_ENABLE | SYSTICK_INTERRUPT | SYSTICK_CORE_CLOCK;
}

int64_t clock_now(void *self) {
    (void)self;
    int64_t ms;
    uint32_t left;
    do {
        ms = milliseconds;
        left = SYSTICK_VALUE;
    } while (ms != milliseconds || (SCB_ICSR & ICSR_SYSTICK_PENDING) != 0u);
    uint32_t passed = SYSTICK_RELOAD - left;
    return ms * NS_PER_MS + (int64_t)(passed * 1000u / counts_per_us);
}

uint32_t stack_high_water(void) {
    const volatile uint32_t *word = stack_bottom;
    while (*word == PAINT) word++;
    return (uint32_t)(stack_top - (const volatile uint8_t *)word);
}
