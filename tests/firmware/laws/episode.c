/* One episode of a law for the tests: parameters, then steps on given inputs, with everything recorded after each of them. */
#include "episode.h"

#include <stddef.h>

static union {
    pd pd;
    mrac mrac;
    appc appc;
} memory;
static reference ref;

static uint8_t *append(uint8_t *to, const void *from, size_t size) {
    const uint8_t *bytes = from;
    for (size_t i = 0; i < size; i++) {
        *to++ = bytes[i];
    }
    return to;
}

static uint8_t *record(const law *l, const law_output *out, bool started, uint8_t *trace) {
    step_record head = {.flags = out->flags, .started = started};
    for (int i = 0; i < 3; i++) {
        head.torque[i] = out->torque[i];
    }
    head.restarted = l->reference_restarted(&memory);
    reference_words(&ref, head.reference_words);
    head.telemetry_words = (int32_t)l->telemetry(&memory, head.telemetry);
    trace = append(trace, &head, sizeof head);
    trace = append(trace, &ref, sizeof ref);
    return append(trace, &memory, l->size);
}

size_t run_episode(uint32_t id, uint32_t version, const int32_t *common, const int32_t *params, const law_input *in,
                   size_t steps, uint8_t *trace) {
    const law *l = law_find((uint16_t)id, (uint16_t)version);
    uint8_t *end = trace;
    if (l == NULL) {
        return 0;
    }
    for (size_t i = 0; i < sizeof memory; i++) {
        ((uint8_t *)&memory)[i] = 0xA5; /* init has to set every byte */
    }
    for (size_t i = 0; i < sizeof ref; i++) {
        ((uint8_t *)&ref)[i] = 0xA5;
    }
    if (!l->init(&memory, common, params)) {
        return 0;
    }
    reference_init(&ref, common);
    for (size_t k = 0; k < steps; k++) {
        law_output out = {{-1, -1, -1}, 0xFFFFFFFFu};
        bool started = reference_advance(&ref, &in[k]);
        l->step(&memory, &in[k], &ref, &out);
        end = record(l, &out, started, end);
    }
    return (size_t)(end - trace);
}
