/* Frames over the hal's link: packets in, numbered packets out, one write per answer. protocol/SPEC.md, section 5;
 * protocol/port.py is the same in Python.
 */
#ifndef CORE_PORT_H
#define CORE_PORT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "codec.h"
#include "hal.h"

enum {
    PORT_INPUT = 256,  /* bytes of one read */
    PORT_OUTPUT = 768, /* the longest answer: COMMAND, TELEMETRY, 16 EVENTs, TIMING, each with its code byte and two zeros */
    FRUITLESS_READS = 64 /* without a packet, in a row; what is behind them is for the next receive */
};

/* Totals since boot. unknown: right CRC, yet no frame we know. */
typedef struct {
    uint32_t sent, received, unknown, sequence_gaps, duplicates;
} port_counters;

typedef struct {
    const hal *hal;
    stream_decoder decoder; /* of a datagram link, its counters only */
    port_counters counters;
    uint16_t send_next[2];    /* deterministic, housekeeping */
    int32_t expect[2];        /* next number of the other end; -1: taken as it comes */
    size_t input_at, input_size, output_size;
    uint8_t input[PORT_INPUT], output[PORT_OUTPUT];
} port;

void port_init(port *p, const hal *hal);

/* A new session: deterministic numbers begin at 0 both ways; the other end's housekeeping number is taken as it comes. */
void port_reset(port *p);

/* The next frame in what was read before, or NULL. It lies in the port until the next call. */
const uint8_t *port_next(port *p, size_t *size);

/* The same, after reading until there is a frame or nothing more to read; never waits. */
const uint8_t *port_receive(port *p, size_t *size);

/* Begins a packet of this type, with its number, and zeros for its body; returns where it lies. */
uint8_t *port_begin(port *p, size_t size, uint8_t type, uint32_t tick);

/* It is complete. On a datagram link it leaves here. */
void port_end(port *p, uint8_t *packet, size_t size);

/* What was ended since leaves, in one write. */
void port_flush(port *p);

#endif
