/* Frames in and out, their numbers and counters; see port.h. */
#include "port.h"

#include "frames.h"

_Static_assert(COMMAND_SIZE + PACKET_MAX + 16 * EVENT_SIZE + TIMING_SIZE + 19 * 3 <= PORT_OUTPUT, "the longest answer");

enum { WHATEVER_COMES = -1 };

void port_init(port *p, const hal *hal) {
    p->hal = hal;
    stream_decoder_init(&p->decoder);
    p->counters = (port_counters){0};
    p->send_next[0] = p->send_next[1] = 0;
    p->expect[0] = p->expect[1] = WHATEVER_COMES;
    p->input_at = p->input_size = p->output_size = 0;
}

void port_reset(port *p) {
    p->send_next[0] = 0;
    p->expect[0] = 0;
    p->expect[1] = WHATEVER_COMES;
}

static size_t class_of(uint8_t type) {
    return (type & HOUSEKEEPING) != 0;
}

/* -- in --------------------------------------------------------------------------------------------------------------- */

/* A number ahead of the expected one is a gap of so many frames; one behind is a duplicate or out of order. */
static void check_sequence(port *p, const uint8_t *packet) {
    int32_t *expect = &p->expect[class_of(packet_type(packet))];
    uint16_t sequence = get_u16(packet + HEADER_SEQUENCE_AT);
    if (*expect != WHATEVER_COMES) {
        uint16_t ahead = (uint16_t)(sequence - *expect);
        if (ahead >= 0x8000u) {
            p->counters.duplicates++;
            return;
        }
        p->counters.sequence_gaps += ahead;
    }
    *expect = (uint16_t)(sequence + 1);
}

/* One packet with a right CRC: whether it is a frame; counted either way. */
static bool is_frame(port *p, const uint8_t *packet, size_t size) {
    if (packet_check_rest(packet, size) != PACKET_OK) {
        p->counters.unknown++;
        return false;
    }
    check_sequence(p, packet);
    p->counters.received++;
    return true;
}

/* The next packet with a right CRC in what was read, or NULL. */
static const uint8_t *next_packet(port *p, size_t *size) {
    const uint8_t *data = p->input + p->input_at;
    size_t left = p->input_size - p->input_at;
    if (p->hal->datagram) {
        p->input_at = p->input_size;
        *size = left;
        return left != 0 && datagram_take(&p->decoder.counters, data, left) ? data : NULL;
    }
    p->input_at += stream_decoder_take(&p->decoder, data, left, size);
    return *size != 0 ? p->decoder.pending : NULL;
}

const uint8_t *port_next(port *p, size_t *size) {
    const uint8_t *packet;
    while ((packet = next_packet(p, size)) != NULL) {
        if (is_frame(p, packet, *size)) {
            return packet;
        }
    }
    return NULL;
}

const uint8_t *port_receive(port *p, size_t *size) {
    for (int reads = 0; reads < FRUITLESS_READS; reads++) {
        p->input_at = 0;
        p->input_size = p->hal->read(p->hal->self, p->input, sizeof p->input);
        if (p->input_size == 0) {
            break;
        }
        const uint8_t *packet = port_next(p, size);
        if (packet != NULL) {
            return packet;
        }
    }
    return NULL;
}

/* -- out -------------------------------------------------------------------------------------------------------------- */

uint8_t *port_begin(port *p, size_t size, uint8_t type, uint32_t tick) {
    uint8_t *packet = p->output + p->output_size + 2; /* after a zero and the first code byte: it is encoded where it lies */
    packet_begin(packet, size, type, p->send_next[class_of(type)]++, tick);
    return packet;
}

void port_end(port *p, uint8_t *packet, size_t size) {
    packet_finish(packet, size);
    p->counters.sent++;
    if (p->hal->datagram) {
        p->hal->write(p->hal->self, packet, size);
        return;
    }
    packet[-2] = 0;
    packet[cobs_encode(packet, size, packet - 1) - 1] = 0;
    p->output_size += size + 3;
}

void port_flush(port *p) {
    if (p->output_size != 0) {
        p->hal->write(p->hal->self, p->output, p->output_size);
        p->output_size = 0;
    }
}
