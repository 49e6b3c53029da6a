/* One configured session: what happens in one tick, from reading to COMMAND, TELEMETRY and EVENTs. protocol/SPEC.md, section
 * 7; firmware_sim/flight.py is the same in Python.
 *
 * Order within a tick: usable or not, set-point, inputs, reference model, law, limits, watchdog, answer. All times are
 * counted in simulated microseconds from tick numbers, so every clock gives the same bytes.
 */
#ifndef CORE_FLIGHT_H
#define CORE_FLIGHT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "config.h"
#include "law.h"

enum {
    EVENTS_MAX = 16, /* of one answer; further ones are only counted */
    DELAY_MAX = 4    /* transport delay, ticks */
};

/* The memory of whichever law flies. */
typedef union {
    pd pd;
    mrac mrac;
    appc appc;
    fvsc fvsc;
    state_space state_space;
} law_memory;

/* A SAMPLE taken apart. */
typedef struct {
    uint32_t tick;
    int32_t setpoint[3];
    int32_t applied[3];
    int32_t momentum[3];
    uint32_t transit_us;
    uint8_t present, valid;
    int32_t euler[3]; /* of a reading that is not present: undefined */
    int32_t quaternion[4];
    int32_t rate[3];
} sample;

/* A SAMPLE packet that is none to refuse. */
void sample_read(const uint8_t *packet, sample *into);

typedef struct {
    uint16_t code;
    int32_t a, b;
} event;

/* What the board sends of one tick. words: TELEMETRY's, words_count 0 when it is not due. */
typedef struct {
    int32_t torque[3];
    uint16_t flags;
    uint8_t used;
    size_t words_count;
    int32_t words[TELEMETRY_WORDS_MAX];
} answer;

typedef struct {
    /* From CONFIG; the words stay where they are. */
    const law *law;
    const law_table *table;
    const int32_t *common, *params, *rows;
    size_t rows_count;
    int64_t period_us, sample_timeout_us;

    /* What a re-start keeps: counters, the model of busy time, events that wait for the next answer. */
    int32_t lost, overruns, dropped, saturations;
    int64_t free_at_us;
    event events[EVENTS_MAX];
    size_t events_count;

    /* What it begins anew. */
    law_memory self;
    reference reference;
    law_input in;
    law_output out;
    int32_t sent[DELAY_MAX + 1][3]; /* commands of the last ticks, newest first */
    int32_t setpoint[3];
    size_t next_row;
    int32_t good_run, since_sample;
    bool watchdog, arithmetic, restarted;
    bool has_reading, reused; /* stale: reuse only: there is one; the last step was given it again */
} flight;

/* Begins with words that config_check() found right. False: the law refuses (READY, status 3). */
bool flight_init(flight *f, const config *c, const config_verdict *checked);

/* A SAMPLE for a tick that was already stepped: counted, and told with the next answer. */
void flight_count_dropped(flight *f, uint32_t tick);

/* Bumpless re-start: the gap is too long to propagate; law and reference begin anew at the next reading. */
void flight_restart(flight *f, uint32_t expected, uint32_t tick);

/* One tick, exactly once; s: its SAMPLE, or NULL. The events of the answer are f->events until flight_answered(). */
void flight_step(flight *f, uint32_t tick, const sample *s, answer *a);

/* The answer has been packed. */
void flight_answered(flight *f);

#endif
