/* What the tests record of a law after each step: this, then the raw bytes of reference and law. */
#ifndef TESTS_EPISODE_H
#define TESTS_EPISODE_H

#include "law.h"

typedef struct {
    int32_t torque[3];
    uint32_t flags;
    int32_t started, restarted;
    int32_t reference_words[6];
    int32_t telemetry[19];
    int32_t telemetry_words;
} step_record;

/* Bytes written to trace; 0 if the law refused its parameters or is unknown. */
size_t run_episode(uint32_t id, uint32_t version, const int32_t *common, const int32_t *params, const law_input *in,
                   size_t steps, uint8_t *trace);

#endif
