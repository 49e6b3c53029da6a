/* The board on a workstation: a hal over a file descriptor, whose main loop runs in C until the link is closed, a session was
 * stopped, or somebody writes to a second descriptor. sil/pil/library.py calls it through ctypes.
 */
#ifndef HAL_HOST_H
#define HAL_HOST_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "../../core/board.h"

/* What the library gives away, also where it is compiled to keep everything else to itself. */
#define EXPORTED __attribute__((visibility("default")))

/* Why host_serve() returned. */
enum {
    HOST_STOPPED = 0,     /* once, and a session was stopped */
    HOST_INTERRUPTED = 1, /* somebody wrote to stop_fd */
    HOST_CLOSED = 2,      /* the other end is gone; error: the errno that said so, 0 at the end of the file */
    HOST_STUCK = 3,       /* the other end does not read: no room for an answer within 5 s */
    HOST_FAILED = 4       /* error: errno */
};

/* One link. Bytes go through fd, unless read and write are given: then fd only says when there is something to read. These
 * two are the hal's, with link_self; read returns SIZE_MAX where the link is closed, write returns false where it is. */
typedef struct {
    int fd;
    int stop_fd; /* a byte to read here ends the main loop */
    bool datagram;
    const char *build;
    void *link_self;
    size_t (*read)(void *link_self, uint8_t *into, size_t size);
    bool (*write)(void *link_self, const uint8_t *bytes, size_t size);

    /* Out. */
    int why, error;
    bool had_session; /* a session was stopped: what became of the link afterwards is no failure */

    bool readable; /* its own: poll said so, and nothing was read since */
} host_link;

/* Serves the link; `once`: until a session was stopped. Returns link->why. One at a time in a process. */
EXPORTED int host_serve(host_link *link, bool once);

/* Bytes of a board, for a hal that somebody else makes (the tests do). */
EXPORTED size_t host_board_size(void);

#endif
