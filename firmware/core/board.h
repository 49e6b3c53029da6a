/* The board's main loop and its states: one tick is stepped exactly once, by SAMPLE, by TICK or by the board's own timer, and
 * always answered. protocol/SPEC.md, sections 6 and 7; firmware_sim/board.py is the same in Python.
 */
#ifndef CORE_BOARD_H
#define CORE_BOARD_H

#include <stdbool.h>
#include <stdint.h>

#include "config.h"
#include "flight.h"
#include "hal.h"
#include "port.h"

enum {
    AHEAD_LIMIT = 4,  /* a SAMPLE this many ticks ahead is propagated up to; farther ahead is a bumpless re-start */
    TIMING_EVERY = 16 /* stepped ticks */
};

/* All memory of the board. The caller owns it: static, zero or not, never on the stack (it holds all CONFIG words). */
typedef struct board {
    const hal *hal;
    port port;

    /* The session. No nonce: unconfigured; not answered: configuring; flying: ready or running. */
    bool has_nonce, answered, flying, stopped;
    uint64_t nonce;
    uint32_t clock_rate_q16;
    config_verdict ready;
    uint32_t next_tick;
    int64_t timer_ns; /* HAL_FOREVER: does not run */

    uint32_t stepped;          /* ticks of this session */
    uint32_t discarded_before; /* bytes, when it began */

    config config;
    flight flight;
    sample sample;
    answer answer;
} board;

/* Boot: an unconfigured board on this hal. Sends nothing. */
void board_init(board *b, const hal *hal);

/* Sends the one HELLO of a board that has just started. */
void board_announce(board *b);

/* One round of the main loop: kick; then the next frame, or wait for one or for the timer. False when the link is closed. */
bool board_round(board *b);

/* board_announce(), then rounds until the link is closed or, with once, until a session was stopped (b->stopped). */
void board_serve(board *b, bool once);

#endif
