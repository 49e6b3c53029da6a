/* The board's hardware on a workstation: poll, read, write, CLOCK_MONOTONIC; see host.h. */
#define _GNU_SOURCE
#include "host.h"

#include <errno.h>
#include <poll.h>
#include <time.h>
#include <unistd.h>

enum { WRITE_TIMEOUT_S = 5 };

static board the_board;
static struct hal_health the_health;

static int64_t now(void *self) {
    (void)self;
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static void kick(void *self) {
    (void)self; /* a process that hangs is its parent's to kill */
}

/* It is over, for the first reason there was. */
static void end(host_link *link, int why, int error) {
    if (link->why < 0) {
        link->why = why;
        link->error = error;
    }
}

/* Whether an errno means that the other end, or the device, is gone: a hung-up tty says EIO. */
static void fail(host_link *link, int error) {
    bool gone = error == EIO || error == ENXIO || error == ENODEV || error == EBADF || error == EPIPE;
    end(link, gone ? HOST_CLOSED : HOST_FAILED, error);
}

/* Waits for events at the link, for stop_fd, or until a time. False: it is over, or the time is up. */
static bool poll_until(host_link *link, short events, int64_t until_ns) {
    struct pollfd fds[2] = {{link->fd, events, 0}, {link->stop_fd, POLLIN, 0}};
    struct timespec left, *timeout = NULL;
    if (until_ns != HAL_FOREVER) {
        int64_t ns = until_ns - now(NULL);
        ns = ns > 0 ? ns : 0;
        left = (struct timespec){.tv_sec = (time_t)(ns / 1000000000), .tv_nsec = (long)(ns % 1000000000)};
        timeout = &left;
    }
    int ready = ppoll(fds, 2, timeout, NULL);
    if (ready < 0 && errno != EINTR) {
        end(link, HOST_FAILED, errno);
    }
    if (ready > 0 && fds[1].revents != 0) {
        end(link, HOST_INTERRUPTED, 0);
    }
    return link->why < 0 && ready > 0;
}

static bool wait(void *self, int64_t until_ns) {
    host_link *link = self;
    if (link->why < 0) {
        link->readable = poll_until(link, POLLIN, until_ns);
    }
    return link->why < 0;
}

static size_t read_link(void *self, uint8_t *into, size_t size) {
    host_link *link = self;
    if (link->read != NULL) {
        size_t got = link->read(link->link_self, into, size);
        if (got == SIZE_MAX) {
            end(link, HOST_CLOSED, 0);
            return 0;
        }
        return got;
    }
    bool readable = link->readable;
    link->readable = false;
    ssize_t got = read(link->fd, into, size);
    if (got > 0) {
        return (size_t)got;
    }
    if (got == 0) { /* a serial port says so, too, when there is nothing to read */
        if (readable) {
            end(link, HOST_CLOSED, 0);
        }
    } else if (errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR) {
        fail(link, errno);
    }
    return 0;
}

static void write_link(void *self, const uint8_t *bytes, size_t size) {
    host_link *link = self;
    if (link->write != NULL) {
        if (link->why < 0 && !link->write(link->link_self, bytes, size)) {
            end(link, HOST_CLOSED, 0);
        }
        return;
    }
    int64_t give_up_ns = HAL_FOREVER;
    while (size > 0 && link->why < 0) {
        ssize_t written = write(link->fd, bytes, size);
        if (written >= 0) {
            bytes += written;
            size -= (size_t)written;
        } else if (errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR) {
            fail(link, errno);
        } else {
            give_up_ns = give_up_ns == HAL_FOREVER ? now(NULL) + WRITE_TIMEOUT_S * INT64_C(1000000000) : give_up_ns;
            if (!poll_until(link, POLLOUT, give_up_ns) && now(NULL) >= give_up_ns) {
                end(link, HOST_STUCK, 0);
            }
        }
    }
}

int host_serve(host_link *link, bool once) {
    const hal host = {
        .self = link,
        .now = now,
        .wait = wait,
        .read = read_link,
        .write = write_link,
        .kick = kick,
        .own_timer = true,
        .datagram = link->datagram,
        .build = link->build,
        .health = &the_health,
    };
    link->why = -1;
    link->error = 0;
    link->readable = false;
    board_init(&the_board, &host);
    board_serve(&the_board, once);
    end(link, HOST_STOPPED, 0);
    link->had_session = the_board.stopped;
    return link->why;
}

size_t host_board_size(void) {
    return sizeof(board);
}
