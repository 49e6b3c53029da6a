/* In place of laws.c: a law under every id that shows what it is given, and whose answer asks for every limit and flag. Its
 * counterpart in Python is in test_flight_in_c.py. */
#include <string.h>

#include "generated/frames.h"
#include "law.h"

typedef struct {
    law_input seen;
} probe;

static bool init(void *self, const int32_t *common, const int32_t *params) {
    (void)common;
    (void)params;
    memset(self, 0, sizeof(probe));
    return true;
}

static void step(void *self, const law_input *in, reference *ref, law_output *out) {
    probe *p = self;
    (void)ref;
    p->seen = *in;
    for (int i = 0; i < 3; i++) {
        int32_t wanted = (in->tick & 1u ? -1 : 1) * (1 << (10 + 8 * i));
        out->torque[i] = (int32_t)(in->tick & 7u ? wanted : in->applied[i]);
    }
    out->flags = (in->tick & 4u ? FLAG_ARITHMETIC : 0) | (in->tick & 16u ? FLAG_STARTING : 0);
}

static bool reference_restarted(const void *self) {
    return ((const probe *)self)->seen.tick % 5u == 4u;
}

static size_t telemetry(const void *self, int32_t *words) {
    memcpy(words, self, sizeof(probe));
    return sizeof(probe) / sizeof(int32_t);
}

const law *law_find(uint16_t id, uint16_t version) {
    static law found;
    found = (law){id, version, sizeof(probe), id != 1, init, step, reference_restarted, telemetry};
    return &found;
}
