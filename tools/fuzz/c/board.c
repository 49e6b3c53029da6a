/* Target `board`: a whole board on scripted hardware hears frames, noise and time in any order; all it sends has to be right.
 *
 * Input: options (u8, as script.h has them), then records. The first byte of a record, modulo 4, says what it is:
 *     0, 1   length (u8) and header and body of a packet, which gets its CRC and goes over the link as it should
 *     2      length (u8) and bytes that come as they are
 *     3      m (u8), e (u8): the clock goes on by m * 2^(e mod 56) ns
 */
#include <string.h>

#include "codec.h"
#include "frames.h"
#include "script.h"
#include "targets.h"

enum { SCRIPT_ROOM = 1 << 18, OUT_ROOM = 1 << 25, LONGEST_BODY = PACKET_MAX - CRC_SIZE, KINDS = 4, CLOCK = 3, RAW = 2 };

/* -- what comes ------------------------------------------------------------------------------------------------------- */

typedef struct {
    uint8_t bytes[SCRIPT_ROOM];
    size_t used;
    int64_t now_ns;
} made_script;

static void put_record(made_script *s, uint8_t kind, const uint8_t *payload, size_t size) {
    if (s->used + 5 + size <= SCRIPT_ROOM) {
        s->bytes[s->used] = kind;
        put_u32(s->bytes + s->used + 1, (uint32_t)size);
        memcpy(s->bytes + s->used + 5, payload, size);
        s->used += 5 + size;
    }
}

static void put_packet(made_script *s, const uint8_t *body, size_t size, bool datagram) {
    uint8_t packet[PACKET_MAX], wire[PACKET_MAX + 3] = {0};
    memcpy(packet, body, size);
    packet_finish(packet, size + CRC_SIZE);
    if (datagram) {
        put_record(s, 'B', packet, size + CRC_SIZE);
    } else {
        size_t encoded = cobs_encode(packet, size + CRC_SIZE, wire + 1);
        put_record(s, 'B', wire, encoded + 2);
    }
}

static void put_clock(made_script *s, uint8_t m, uint8_t e) {
    uint8_t now[8];
    int64_t by_ns = (int64_t)m << (e % 56);
    s->now_ns = by_ns < INT64_MAX - s->now_ns ? s->now_ns + by_ns : INT64_MAX;
    put_u64(now, (uint64_t)s->now_ns);
    put_record(s, 'T', now, sizeof now);
}

static void translate(made_script *s, const uint8_t *data, size_t size, bool datagram) {
    s->used = 0;
    s->now_ns = 0;
    while (size >= 2) {
        uint8_t kind = data[0] % KINDS;
        if (kind == CLOCK) {
            put_clock(s, data[1], size > 2 ? data[2] : 0);
            size_t taken = size < 3 ? size : 3;
            data += taken, size -= taken;
            continue;
        }
        size_t length = data[1] < size - 2 ? data[1] : size - 2;
        size_t body = length < LONGEST_BODY ? length : LONGEST_BODY;
        if (kind == RAW) {
            put_record(s, 'B', data + 2, length);
        } else if (body >= 2) {
            put_packet(s, data + 2, body, datagram);
        }
        data += 2 + length, size -= 2 + length;
    }
}

/* -- what goes -------------------------------------------------------------------------------------------------------- */

typedef struct {
    int64_t next_tick;         /* of COMMAND; -1: any, a session has begun */
    uint32_t answered;         /* the tick whose answer goes on */
    unsigned follows;          /* frames that COMMAND announced and that are still to come */
    int32_t number[2];         /* of the last frame of each class; -1: none */
} heard;

static void number_is_next(heard *h, const uint8_t *packet) {
    size_t class = (packet_type(packet) & HOUSEKEEPING) != 0;
    uint16_t number = get_u16(packet + HEADER_SEQUENCE_AT);
    EXPECT(number == (uint16_t)(h->number[class] + 1) || (class == 0 && number == 0));
    h->number[class] = number;
}

static void hear(heard *h, const uint8_t *packet, size_t size) {
    EXPECT(packet_check(packet, size) == PACKET_OK);
    number_is_next(h, packet);
    uint32_t tick = get_u32(packet + HEADER_TICK_AT);
    switch (packet_type(packet)) {
    case TYPE_HELLO:
        EXPECT(packet[HELLO_ROLE_AT] == ROLE_BOARD && h->follows == 0);
        break;
    case TYPE_READY:
        h->next_tick = -1;
        EXPECT(h->follows == 0);
        break;
    case TYPE_COMMAND:
        EXPECT(h->follows == 0);
        EXPECT(h->next_tick < 0 || tick == h->next_tick || packet[COMMAND_USED_AT] == STEP_RESTARTED);
        h->next_tick = (int64_t)tick + 1;
        h->answered = tick;
        h->follows = packet[COMMAND_FOLLOWS_AT];
        EXPECT(h->follows <= 17);
        break;
    case TYPE_TELEMETRY:
    case TYPE_EVENT:
        EXPECT(h->follows > 0 && tick == h->answered);
        h->follows--;
        break;
    case TYPE_TIMING: EXPECT(h->follows == 0); break;
    default: EXPECT(false); /* only a laboratory sends it */
    }
}

static void hear_write(heard *h, const uint8_t *bytes, size_t size, bool datagram) {
    if (datagram) {
        hear(h, bytes, size);
        return;
    }
    static stream_decoder d;
    stream_decoder_init(&d);
    while (size > 0) {
        size_t packet_size, taken = stream_decoder_take(&d, bytes, size, &packet_size);
        if (packet_size != 0) {
            hear(h, d.pending, packet_size);
        }
        bytes += taken, size -= taken;
    }
    EXPECT(d.counters.discarded_bytes == 0 && d.kept == 0 && d.counters.frames > 0);
}

void fuzz_board(const uint8_t *data, size_t size) {
    static made_script script;
    static uint8_t out[OUT_ROOM];
    if (size == 0) {
        return;
    }
    uint32_t options = data[0] & 15u;
    bool datagram = options & SCRIPT_DATAGRAM;
    translate(&script, data + 1, size - 1, datagram);
    size_t used = script_serve(script.bytes, script.used, options, "fuzzed", out, OUT_ROOM);
    EXPECT(used <= OUT_ROOM);
    heard h = {.next_tick = -1, .number = {-1, -1}};
    for (size_t at = 0; at < used;) {
        size_t payload = get_u32(out + at + 1);
        if (out[at] == 'W') {
            hear_write(&h, out + at + 5, payload, datagram);
        }
        at += 5 + payload;
    }
    EXPECT(h.follows == 0);
}
