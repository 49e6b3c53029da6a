/* What the board needs of its hardware: a clock, a wait for bytes, a way out, a watchdog. Same names as firmware_sim/hal.py.
 *
 * The board never asks which hal it has. Only wait and write may block, none may allocate, and none is called from an
 * interrupt. Times are integer nanoseconds of a clock that never goes backwards.
 */
#ifndef CORE_HAL_H
#define CORE_HAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define HAL_FOREVER INT64_MAX

typedef struct hal {
    void *self; /* handed to every function; may be NULL */

    /* Nanoseconds since an arbitrary start. Range: 0 to INT64_MAX (292 years). Resolution decides how well the board's own
     * timer follows the laboratory: 1 ms is good for T_s of 0.1 s and more. */
    int64_t (*now)(void *self);

    /* Sleeps until bytes can be read or until now() >= until_ns (HAL_FOREVER: until bytes come). May return early for any
     * reason; the board looks again. Must return at least once per watchdog period, so that the board can kick.
     * Returns false when no byte will ever come again (the link is closed), which ends board_serve(). */
    bool (*wait)(void *self, int64_t until_ns);

    /* Moves up to size received bytes to into; never waits. Returns how many, 0 when none are there. With datagram set:
     * one whole datagram per call, at most size bytes of it (an empty one is none). size is at least 256. */
    size_t (*read)(void *self, uint8_t *into, size_t size);

    /* Hands over all size bytes of one answer, or of one datagram. May wait until there is room for them. */
    void (*write)(void *self, const uint8_t *bytes, size_t size);

    /* Hardware watchdog: called once per round of the main loop, so a hang (and only a hang) resets the board. */
    void (*kick)(void *self);

    /* Facts, fixed while the board runs. */
    bool own_timer;    /* now() goes on by itself: the board can step without a SAMPLE in real time (HELLO says so) */
    bool datagram;     /* read and write move whole packets, no COBS */
    const char *build; /* for HELLO, at most 24 printable ASCII characters */

    /* Health, written by the hal at any time, read by the board for TIMING. NULL: the board sends no TIMING. */
    const volatile struct hal_health *health;
} hal;

struct hal_health {
    uint32_t stack_bytes; /* deepest stack so far, 0 unknown */
    uint32_t rx_errors;   /* receiver errors since boot: overrun, framing, noise */
};

#endif
