/* A firmware that does what it is told, byte by byte: on the real start-up and hal, so their faults are the real ones.
 * Digits and capital letters are echoed.
 */
#include <stdbool.h>

#include "start.h"

#define WORD(address) (*(volatile uint32_t *)(uintptr_t)(address))

const hal *hal_start(void);

static void __attribute__((noinline)) dig(volatile uint32_t depth) {
    volatile uint8_t hole[64];
    for (uint32_t i = 0; i < sizeof hole; i++) hole[i] = 1;
    if (depth) dig(depth + hole[7]);
    hole[0] = 2;
}

static void obey(const hal *h, uint8_t byte) {
    switch (byte) {
    case 'r': (void)WORD(0x90000000u); break;
    case 'w': WORD(0x00000100u) = 1u; break;
    case 'u': __asm volatile("udf #7"); break;
    case 't': __asm volatile(".inst.w 0xe840f000"); break; /* TT r0, r0: a Cortex-M33 has it, an M4 does not */
    case 'b': __asm volatile("bkpt #0xab"); break;
    case 'j': ((void (*)(void))(uintptr_t)0x30000001u)(); break;
    case 'o': dig(1); break;
    case 'h': for (;;) {}
    case 'q': for (uint32_t i = 0; i < 2000000u; i++) h->kick(h->self); break; /* long, but it kicks */
    case 's': WORD(0xE000ED0Cu) = 0x05FA0004u; break;
    case 'n': h->write(h->self, (const uint8_t *)&boot_record.boots, 1); break;
    default: h->write(h->self, &byte, 1);
    }
}

int main(void) {
    static uint8_t bytes[256];
    const hal *h = hal_start();
    h->write(h->self, (const uint8_t *)"boot", 4);
    for (;;) {
        h->kick(h->self);
        size_t count = h->read(h->self, bytes, sizeof bytes);
        for (size_t i = 0; i < count; i++) obey(h, bytes[i]);
        if (count == 0) h->wait(h->self, HAL_FOREVER);
    }
}
