/* What the flight knows of a control law: its inputs at a tick, its answer, and five calls. firmware_sim/controllers/inputs.py
 * has the same fields.
 *
 * A law is one struct {par, state} without padding and without pointers, so its bytes can be compared, copied and set back.
 * It uses the named operations of fixed.h only, int32 in memory and int64 between them.
 */
#ifndef CORE_LAW_H
#define CORE_LAW_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "reference.h"

typedef struct law_input {
    int32_t fresh;         /* 1: this tick's reading is there and used (or, by `stale: reuse`, an old one passed for it) */
    int32_t good_run;      /* readings used in a row, this one included */
    int32_t applied_known; /* 1: applied is the laboratory's word for what acts from t_k on, or the watchdog's zero */
    int32_t euler[3];      /* 2^-32 turn */
    int32_t quaternion[4]; /* 2^-30, scalar first */
    int32_t rate[3];       /* 2^-rate_bits rad/s, body axes */
    int32_t applied[3];    /* 2^-torque_bits N m */
    int32_t momentum[3];   /* 2^-momentum_bits N m s */
    int32_t setpoint[3];   /* 2^-32 turn */
    uint32_t tick;
} law_input;

typedef struct {
    int32_t torque[3]; /* on the body, 2^-torque_bits N m, within the law's limits */
    uint32_t flags;    /* the law's bits of COMMAND's flags */
} law_output;

typedef struct law {
    uint16_t id, version; /* of its table in protocol/law_tables.py */
    size_t size;          /* bytes of its struct */
    bool has_model;       /* without a reading it propagates its model; else it repeats its last command */

    /* Parameters and initial state from CONFIG: common words and the law's own, both already within their tables' ranges.
     * False: the law refuses what no table can say (READY status 3). Sets every byte of self. */
    bool (*init)(void *self, const int32_t *common, const int32_t *params);

    /* One tick. ref is the reference after its advance; a law may begin it anew. */
    void (*step)(void *self, const law_input *in, reference *ref, law_output *out);

    /* True if the last step began the reference anew. */
    bool (*reference_restarted)(const void *self);

    /* The law's TELEMETRY words, after the common ones; returns how many. */
    size_t (*telemetry)(const void *self, int32_t *words);
} law;

/* The law with this id and version, NULL if this board has none. */
const law *law_find(uint16_t id, uint16_t version);

#endif
