/* Received bytes between an interrupt that puts and a main loop that takes; neither waits for the other. */
#ifndef CORTEX_M_RING_H
#define CORTEX_M_RING_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define RING_BYTES 2048u /* a power of two; 178 ms at 115200 baud */

typedef struct {
    volatile uint32_t put; /* bytes ever put, modulo 2^32; written by the interrupt */
    volatile uint32_t taken;
    volatile uint8_t bytes[RING_BYTES];
} ring;

static inline bool ring_empty(const ring *r) { return r->put == r->taken; }
static inline bool ring_full(const ring *r) { return r->put - r->taken == RING_BYTES; }

static inline void ring_put(ring *r, uint8_t byte) {
    uint32_t put = r->put;
    r->bytes[put % RING_BYTES] = byte;
    r->put = put + 1u;
}

static inline size_t ring_take(ring *r, uint8_t *into, size_t size) {
    uint32_t taken = r->taken;
    uint32_t there = r->put - taken;
    size_t count = there < size ? there : size;
    for (size_t i = 0; i < count; i++) into[i] = r->bytes[taken++ % RING_BYTES];
    r->taken = taken;
    return count;
}

#endif
