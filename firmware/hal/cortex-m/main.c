/* The firmware: this chip's hal, and the board on it, for ever. */
#include "../../core/board.h"
#include "start.h"

/* The chip: starts clocks, UART and watchdog, and says what the board may use. */
const hal *hal_start(void);

static board the_board; /* holds all CONFIG words: static, never on the stack */

int main(void) {
    board_init(&the_board, hal_start());
    board_serve(&the_board, false);
    return 0;
}
