/* One episode of a law for the tests: parameters, then steps on given inputs, with everything recorded after each of them. */
#include "episode.h"

#include <stddef.h>
#include <string.h>

static union {
    pd pd;
    mrac mrac;
    appc appc;
    state_space state_space;
} memory;
static reference ref;

static uint8_t *append(uint8_t *to, const void *from, size_t size) {
    memcpy(to, from, size);
    return to + size;
}

static uint8_t *record(const episode *e, const law *l, const law_output *out, bool started, uint8_t *trace) {
    step_record head = {.flags = out->flags, .started = started};
    for (int i = 0; i < 3; i++) {
        head.torque[i] = out->torque[i];
    }
    head.restarted = l->reference_restarted(&memory);
    e->laws.reference_words(&ref, head.reference_words);
    head.telemetry_words = (int32_t)l->telemetry(&memory, head.telemetry);
    trace = append(trace, &head, sizeof head);
    trace = append(trace, &ref, sizeof ref);
    return append(trace, &memory, l->size);
}

uint32_t run_episode(const episode *e) {
    const law *l = e->laws.law_find((uint16_t)e->id, (uint16_t)e->version);
    uint8_t *end = e->trace;
    memset(&memory, 0xA5, sizeof memory); /* init has to set every byte */
    memset(&ref, 0xA5, sizeof ref);
    if (l == NULL || !l->init(&memory, e->common, e->params)) {
        return 0;
    }
    e->laws.reference_init(&ref, e->common);
    for (uint32_t k = 0; k < e->steps; k++) {
        law_output out = {{-1, -1, -1}, 0xFFFFFFFFu};
        bool started = e->laws.reference_advance(&ref, &e->in[k]);
        l->step(&memory, &e->in[k], &ref, &out);
        end = record(e, l, &out, started, end);
    }
    return (uint32_t)(end - e->trace);
}
