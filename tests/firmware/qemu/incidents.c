/* A firmware with accidents: the board as it ships, and what goes wrong in it when the bytes "!?!" and a letter come. Built by
 * tests in place of hal/cortex-m/main.c; the product has no such thing.
 */
#include "../../../firmware/core/board.h"
#include "registers.h"
#include "start.h"

const hal *hal_start(void);
void hang(void);
void hang_deaf(void);
void pause(void);
void dawdle(void);
void undefined(void);
void wild_read(void);
void overflow(void);
void stray_interrupt(void);
void use_fpu(void);
void use_fpu_switched_off(void);

static board the_board;
static hal here;
static const hal *chip;
static volatile bool leave;

__attribute__((noinline)) void hang(void) {
    for (;;) __asm volatile("nop");
}

/* With interrupts off nothing but an NMI gets through. */
__attribute__((noinline)) void hang_deaf(void) {
    interrupts_off();
    for (;;) __asm volatile("nop");
}

/* Until the watchdog warns. Touches no register: QEMU serves those and the line in turn. */
void pause(void) {
    while (boot_record.exception != 2u) {}
}

/* A while, where QEMU has no watchdog. */
void dawdle(void) {
    for (volatile uint32_t n = 0; n < 50000000u; n++) {}
}

__attribute__((noinline)) void undefined(void) { __asm volatile("udf #0"); }

__attribute__((noinline)) void wild_read(void) { (void)REGISTER(0x90000000u); }

__attribute__((noinline)) void overflow(void) {
    volatile uint8_t eats[64];
    eats[0] = 1;
    if (!leave) overflow();
    eats[1] = eats[0];
}

/* Interrupt 5 is nobody's. */
__attribute__((noinline)) void stray_interrupt(void) {
    irq_enable(5);
    REGISTER(0xE000E200u) = 1u << 5;
    barrier();
}

/* vadd.f32 s0, s0, s0; by its number, for the firmware is compiled without floating point. */
__attribute__((noinline)) void use_fpu(void) { __asm volatile(".inst.w 0xEE300A00"); }

__attribute__((noinline)) void use_fpu_switched_off(void) {
    SCB_CPACR = 0u;
    barrier();
    use_fpu();
}

static void happen(uint8_t what) {
    if (what == 'h') hang();
    if (what == 'd') hang_deaf();
    if (what == 'p') pause();
    if (what == 'q') dawdle();
    if (what == 'u') undefined();
    if (what == 'w') wild_read();
    if (what == 'o') overflow();
    if (what == 's') stray_interrupt();
    if (what == 'f') use_fpu();
    if (what == 'n') use_fpu_switched_off();
    if (what == 'l') leave = true;
}

static size_t read_and_obey(void *self, uint8_t *into, size_t size) {
    static uint32_t last;
    size_t count = chip->read(self, into, size);
    for (size_t i = 0; i < count; i++) {
        if ((last & 0xFFFFFFu) == ('!' << 16 | '?' << 8 | '!')) happen(into[i]);
        last = last << 8 | into[i];
    }
    return count;
}

static bool wait_or_leave(void *self, int64_t until_ns) { return !leave && chip->wait(self, until_ns); }

int main(void) {
    chip = hal_start();
    here = *chip;
    here.read = read_and_obey;
    here.wait = wait_or_leave;
    board_init(&the_board, &here);
    board_serve(&the_board, false);
    return 0;
}
