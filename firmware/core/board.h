/* The board's main loop and its states: one tick is stepped exactly once, by SAMPLE, by TICK or by the board's own timer, and
 * always answered. protocol/SPEC.md, sections 6 and 7; firmware_sim/board.py is the same in Python.
 */
#ifndef CORE_BOARD_H
#define CORE_BOARD_H

#include "codec.h"
#include "config.h"
#include "flight.h"
#include "hal.h"

/* All memory of the board. The caller owns it: static, zero or not, never on the stack (it holds all CONFIG words). */
typedef struct board board;

/* Boot: an unconfigured board on this hal. Sends nothing. */
void board_init(board *b, const hal *hal);

/* Sends the one HELLO of a board that has just started. */
void board_announce(board *b);

/* One round of the main loop: kick, wait for bytes or the timer, handle what came. False when the link is closed. */
bool board_round(board *b);

/* board_announce(), then rounds until the link is closed or, with once, until a session was stopped. */
void board_serve(board *b, bool once);

#endif
