/* One episode of a law, and what the tests record after each of its steps: this, then the raw bytes of reference and law. */
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

/* What is under test: functions of this program, or those of an image, by address. */
typedef struct {
    const law *(*law_find)(uint16_t id, uint16_t version);
    void (*reference_init)(reference *self, const int32_t *common);
    bool (*reference_advance)(reference *self, const law_input *in);
    void (*reference_words)(const reference *self, int32_t words[6]);
} laws_under_test;

typedef struct {
    laws_under_test laws;
    uint32_t id, version;
    const int32_t *common, *params;
    const law_input *in;
    uint32_t steps;
    uint8_t *trace;
} episode;

/* Bytes written to trace; 0 if the law refused its parameters or is unknown. */
uint32_t run_episode(const episode *e);

#endif
