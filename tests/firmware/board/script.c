/* The board on scripted hardware; see script.h. */
#include "script.h"

#include <string.h>

#include "board.h"
#include "frames.h"

enum { RECORD_HEAD = 5 };

typedef struct {
    uint8_t *bytes;
    size_t used, room;
} output;

typedef struct {
    const uint8_t *next, *end; /* of the script */
    const uint8_t *bytes;      /* that have come */
    size_t bytes_left;
    int64_t now_ns;
    int64_t stepping_ns; /* the clock goes on by so much whenever it is read, where health is asked for */
    output *out;
} script;

static board the_board;
static struct hal_health the_health = {.stack_bytes = 512, .rx_errors = 3};

static void put(output *out, uint8_t kind, const void *payload, size_t size) {
    if (out->used + RECORD_HEAD + size <= out->room) {
        out->bytes[out->used] = kind;
        put_u32(out->bytes + out->used + 1, (uint32_t)size);
        memcpy(out->bytes + out->used + RECORD_HEAD, payload, size);
    }
    out->used += RECORD_HEAD + size;
}

static void put_i64(output *out, uint8_t kind, int64_t number) {
    uint8_t payload[8];
    put_u64(payload, (uint64_t)number);
    put(out, kind, payload, sizeof payload);
}

static int64_t script_now(void *self) {
    script *s = self;
    s->now_ns += s->stepping_ns;
    return s->now_ns;
}

/* The next record happens. */
static bool script_wait(void *self, int64_t until_ns) {
    script *s = self;
    if (s->bytes_left > 0) {
        return true;
    }
    put_i64(s->out, 'U', until_ns);
    if (s->next == s->end) {
        return false;
    }
    size_t size = get_u32(s->next + 1);
    const uint8_t *payload = s->next + RECORD_HEAD;
    if (s->next[0] == 'T') {
        s->now_ns = (int64_t)get_u64(payload);
    } else {
        s->bytes = payload;
        s->bytes_left = size;
    }
    s->next = payload + size;
    return true;
}

static size_t script_read(void *self, uint8_t *into, size_t size) {
    script *s = self;
    size_t take = s->bytes_left < size ? s->bytes_left : size;
    memcpy(into, s->bytes, take);
    s->bytes += take;
    s->bytes_left -= take;
    return take;
}

/* The rest of a datagram that is too long is lost. */
static size_t script_read_datagram(void *self, uint8_t *into, size_t size) {
    script *s = self;
    size_t take = script_read(self, into, size);
    s->bytes_left = 0;
    return take;
}

static void script_write(void *self, const uint8_t *bytes, size_t size) {
    script *s = self;
    put(s->out, 'W', bytes, size);
}

static void script_kick(void *self) {
    (void)self;
}

static void put_counters(output *out, const uint32_t *first, size_t count, const uint32_t *second, size_t more) {
    uint8_t payload[64];
    for (size_t i = 0; i < count; i++) {
        put_u32(payload + 4 * i, first[i]);
    }
    for (size_t i = 0; i < more; i++) {
        put_u32(payload + 4 * (count + i), second[i]);
    }
    put(out, 'C', payload, 4 * (count + more));
}

size_t script_serve(const uint8_t *bytes, size_t size, uint32_t options, const char *build, uint8_t *out, size_t room) {
    output into = {out, 0, room};
    static const uint8_t nothing;
    script s = {bytes, bytes + size, &nothing, 0, 0, options & SCRIPT_HEALTH ? 1000 : 0, &into};
    const hal hardware = {
        .self = &s,
        .now = script_now,
        .wait = script_wait,
        .read = options & SCRIPT_DATAGRAM ? script_read_datagram : script_read,
        .write = script_write,
        .kick = script_kick,
        .own_timer = !(options & SCRIPT_NO_TIMER),
        .datagram = options & SCRIPT_DATAGRAM,
        .build = build,
        .health = options & SCRIPT_HEALTH ? &the_health : NULL,
    };
    board_init(&the_board, &hardware);
    board_serve(&the_board, options & SCRIPT_ONCE);
    const decoder_counters *d = &the_board.port.decoder.counters;
    const port_counters *p = &the_board.port.counters;
    put_counters(&into, (const uint32_t *)d, sizeof *d / 4, (const uint32_t *)p, sizeof *p / 4);
    return into.used;
}

size_t script_decode(const uint8_t *data, size_t size, size_t cut, uint8_t *out, size_t room) {
    output into = {out, 0, room};
    static stream_decoder d;
    stream_decoder_init(&d);
    for (size_t at = 0; at < size; at += cut) {
        size_t left = size - at < cut ? size - at : cut;
        for (const uint8_t *piece = data + at; left > 0;) {
            size_t packet_size, taken = stream_decoder_take(&d, piece, left, &packet_size);
            if (packet_size != 0) {
                put(&into, (uint8_t)packet_check_rest(d.pending, packet_size), d.pending, packet_size);
            }
            piece += taken;
            left -= taken;
        }
    }
    uint32_t kept = (uint32_t)d.kept;
    put_counters(&into, (const uint32_t *)&d.counters, sizeof d.counters / 4, &kept, 1);
    return into.used;
}

size_t script_datagrams(const uint8_t *records, size_t size, uint8_t *out, size_t room) {
    output into = {out, 0, room};
    decoder_counters counters = {0};
    for (const uint8_t *next = records; next < records + size;) {
        size_t bytes = get_u32(next + 1);
        const uint8_t *datagram = next + RECORD_HEAD;
        if (datagram_take(&counters, datagram, bytes)) {
            put(&into, (uint8_t)packet_check_rest(datagram, bytes), datagram, bytes);
        }
        next = datagram + bytes;
    }
    uint32_t kept = 0;
    put_counters(&into, (const uint32_t *)&counters, sizeof counters / 4, &kept, 1);
    return into.used;
}
