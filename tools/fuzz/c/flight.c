/* Target `flight`: each law with any words within their ranges, through any readings: no operation without a meaning, no
 * torque beyond its limit.
 *
 * Input: how many words (u8), the words (i32 each), changes of them (255, index u8, value i32), then ticks: flags (u8) and,
 * where they say READ, a SAMPLE's integers.
 */
#include <string.h>

#include "config.h"
#include "flight.h"
#include "frames.h"
#include "targets.h"

enum { TICKS = 400, WORD = 255, READ = 1, SKIP = 2, RESTART = 4, STALE = 8 };

typedef struct {
    const uint8_t *at, *end;
} input;

static uint8_t byte(input *in) {
    return in->at < in->end ? *in->at++ : 0;
}

static int32_t word(input *in) {
    uint8_t bytes[4];
    for (size_t i = 0; i < sizeof bytes; i++) {
        bytes[i] = byte(in);
    }
    return get_i32(bytes);
}

/* Words and changes apart, so that a change of one byte is enough for another value of one word. */
static size_t words_of(input *in, int32_t *words) {
    size_t count = byte(in);
    count = count < CONFIG_WORDS_MAX ? count : CONFIG_WORDS_MAX;
    for (size_t i = 0; i < count; i++) {
        words[i] = word(in);
    }
    while (in->at < in->end && *in->at == WORD) {
        in->at++;
        size_t index = byte(in);
        int32_t value = word(in);
        if (index < count) {
            words[index] = value;
        }
    }
    return count;
}

static bool configured(config *c, flight *f, const int32_t *words, size_t count) {
    uint8_t packet[PACKET_MAX];
    size_t size = CONFIG_SIZE + 4 * count;
    packet_begin(packet, size, TYPE_CONFIG, 0, NO_TICK);
    put_u16(packet + CONFIG_PARTS_AT, 1);
    put_words(packet + CONFIG_SIZE - CRC_SIZE, words, count);
    packet_finish(packet, size);
    EXPECT(packet_check(packet, size) == PACKET_OK);
    config_clear(c);
    EXPECT(config_add(c, packet, size));
    config_verdict ready = config_check(c);
    return ready.status == READY_OK && flight_init(f, c, &ready);
}

static void read_sample(input *in, sample *s, uint32_t tick) {
    *s = (sample){.tick = tick, .present = 7};
    s->valid = byte(in) & 7;
    s->transit_us = (uint32_t)word(in);
    int32_t *const vectors[] = {s->setpoint, s->applied, s->momentum, s->euler, s->quaternion, s->rate};
    for (size_t i = 0; i < sizeof vectors / sizeof *vectors; i++) {
        for (size_t axis = 0; axis < (i == 4 ? 4u : 3u); axis++) {
            vectors[i][axis] = word(in);
        }
    }
}

static void judge(const flight *f, const answer *a) {
    EXPECT(a->words_count <= TELEMETRY_WORDS_MAX && f->events_count <= EVENTS_MAX);
    EXPECT(a->used >= STEP_USED && a->used <= STEP_REUSED);
    for (size_t axis = 0; axis < 3; axis++) {
        int64_t limit = f->common[COMMON_TORQUE_LIMIT_X + axis];
        limit = limit < 0 ? -limit : limit; /* -1 passes for 0: a range leaves room for rounding */
        EXPECT(a->torque[axis] <= limit && a->torque[axis] >= -limit);
    }
}

void fuzz_flight(const uint8_t *data, size_t size) {
    static config c;
    static flight f;
    input in = {data, data + size};
    int32_t words[CONFIG_WORDS_MAX];
    size_t count = words_of(&in, words);
    if (!configured(&c, &f, words, count)) {
        return;
    }
    sample s = {0};
    uint32_t tick = 0;
    for (int step = 0; step < TICKS && in.at < in.end; step++) {
        uint8_t flags = byte(&in);
        if (flags & READ) {
            read_sample(&in, &s, tick);
        }
        if (flags & STALE) {
            flight_count_dropped(&f, tick);
        }
        if (flags & RESTART) {
            uint32_t to = tick + 5 + (flags >> 4);
            flight_restart(&f, tick, to);
            tick = to;
        }
        s.tick = tick;
        answer a = {0};
        flight_step(&f, tick, flags & SKIP ? NULL : &s, &a);
        judge(&f, &a);
        flight_answered(&f);
        tick++;
    }
}
