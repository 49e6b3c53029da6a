/* One tick of a configured board, in order; see flight.h. */
#include "flight.h"

#include <string.h>

#include "frames.h"

/* Counters stop at the largest number that their words can say. */
static void count(int32_t *counter) {
    *counter += *counter < INT32_MAX;
}

/* A tick number as an event carries it: modulo 2^31. */
static int32_t tick_word(uint32_t tick) {
    return (int32_t)(tick & INT32_MAX);
}

static void tell(flight *f, uint16_t code, int32_t a, int32_t b) {
    if (f->events_count < EVENTS_MAX) {
        f->events[f->events_count++] = (event){code, a, b};
    }
}

void sample_read(const uint8_t *packet, sample *into) {
    const uint8_t *reading = packet + SAMPLE_SIZE - CRC_SIZE; /* its age, which the laws do not use, then its values */
    into->tick = get_u32(packet + HEADER_TICK_AT);
    get_words(packet + SAMPLE_SETPOINT_AT, into->setpoint, 3);
    get_words(packet + SAMPLE_APPLIED_AT, into->applied, 3);
    get_words(packet + SAMPLE_MOMENTUM_AT, into->momentum, 3);
    into->transit_us = get_u32(packet + SAMPLE_TRANSIT_AT);
    into->present = packet[SAMPLE_PRESENT_AT];
    into->valid = packet[SAMPLE_VALID_AT];
    if (into->present & READING_EULER) {
        get_words(reading + 4, into->euler, READING_EULER_WORDS);
        reading += 4 + 4 * READING_EULER_WORDS;
    }
    if (into->present & READING_QUATERNION) {
        get_words(reading + 4, into->quaternion, READING_QUATERNION_WORDS);
        reading += 4 + 4 * READING_QUATERNION_WORDS;
    }
    if (into->present & READING_RATE) {
        get_words(reading + 4, into->rate, READING_RATE_WORDS);
    }
}

/* -- start and re-start ----------------------------------------------------------------------------------------------- */

/* Fresh law, reference and watchdog. */
static bool begin(flight *f) {
    reference_init(&f->reference, f->common);
    memset(&f->in, 0, sizeof f->in);
    memset(&f->out, 0, sizeof f->out);
    memset(f->sent, 0, sizeof f->sent);
    memset(f->setpoint, 0, sizeof f->setpoint);
    f->next_row = 0;
    f->good_run = f->since_sample = 0;
    f->watchdog = f->arithmetic = f->has_reading = f->reused = false;
    return f->law->init(&f->self, f->common, f->params);
}

bool flight_init(flight *f, const config *c, const config_verdict *checked) {
    const law_table *table = checked->table;
    f->law = checked->law;
    f->table = table;
    f->common = c->words;
    f->params = c->words + COMMON_WORDS;
    f->rows = f->params + table->words;
    f->rows_count = (size_t)f->common[COMMON_GUIDANCE_ROWS];
    f->period_us = f->common[COMMON_PERIOD_US];
    f->sample_timeout_us = f->common[COMMON_SAMPLE_TIMEOUT_US];
    f->lost = f->overruns = f->dropped = f->saturations = 0;
    f->free_at_us = 0;
    f->events_count = 0;
    f->restarted = false;
    return f->law->size <= sizeof f->self && begin(f);
}

void flight_count_dropped(flight *f, uint32_t tick) {
    count(&f->dropped);
    tell(f, EVENT_STALE_SAMPLE, tick_word(tick), f->dropped);
}

void flight_restart(flight *f, uint32_t expected, uint32_t tick) {
    begin(f);
    f->restarted = true;
    f->events_count += f->events_count < EVENTS_MAX;
    for (size_t i = f->events_count - 1; i > 0; i--) {
        f->events[i] = f->events[i - 1];
    }
    f->events[0] = (event){EVENT_RESTARTED, tick_word(expected), tick_word(tick)}; /* first: never one too many */
}

/* -- one tick, in order ----------------------------------------------------------------------------------------------- */

/* Execution model and validity: start = max(arrival, free_at), free_at = start + answer_delay; a SAMPLE that arrives before
 * free_at finds the one-deep mailbox taken. Where CONFIG says `stale: reuse`, the last reading passes for this tick's. */
static bool admit(flight *f, uint32_t tick, const sample *s, bool *overrun) {
    int64_t start = tick * f->period_us + (s == NULL ? f->sample_timeout_us : (int64_t)s->transit_us);
    *overrun = s != NULL && start < f->free_at_us;
    f->free_at_us = (start > f->free_at_us ? start : f->free_at_us) + f->common[COMMON_ANSWER_DELAY_US];
    int32_t needs = f->common[COMMON_READINGS_MASK];
    bool usable = s != NULL && !*overrun && (s->valid & needs) == needs;
    f->reused = !usable && f->has_reading && f->common[COMMON_STALE] == COMMON_STALE_REUSE;
    if (usable || f->reused) {
        count(&f->good_run);
    } else {
        f->good_run = 0;
    }
    if (usable) {
        f->has_reading = true;
        return true;
    }
    count(&f->lost);
    if (*overrun) {
        count(&f->overruns);
    }
    return false;
}

/* The table's row that holds at this tick; or, when CONFIG says so, SAMPLE's set-point, kept while none comes. */
static void take_setpoint(flight *f, uint32_t tick, const sample *s) {
    if (f->common[COMMON_SETPOINT_SOURCE] == COMMON_SETPOINT_SOURCE_SAMPLE) {
        if (s != NULL) {
            memcpy(f->setpoint, s->setpoint, sizeof f->setpoint);
        }
        return;
    }
    for (; f->next_row < f->rows_count; f->next_row++) {
        const int32_t *row = f->rows + ROW_WORDS * f->next_row;
        if ((uint32_t)row[0] > tick) {
            break;
        }
        memcpy(f->setpoint, row + 1, sizeof f->setpoint);
    }
}

/* The law's inputs; what acts now is the laboratory's word, without it the board's own COMMAND(k - n). Of that the law knows
 * what it computed, but not that the watchdog sent zero instead: then it is told. Readings and momentum stay as they were
 * while no sample comes. */
static void fill(flight *f, uint32_t tick, const sample *s) {
    law_input *in = &f->in;
    int32_t delay = f->common[COMMON_TRANSPORT_DELAY_TICKS];
    in->fresh = s != NULL || f->reused;
    in->applied_known = s != NULL || f->watchdog;
    in->good_run = f->good_run;
    in->tick = tick;
    memcpy(in->setpoint, f->setpoint, sizeof in->setpoint);
    if (s == NULL) {
        memcpy(in->applied, f->sent[delay == 0 ? 0 : delay - 1], sizeof in->applied);
        return;
    }
    memcpy(in->applied, s->applied, sizeof in->applied);
    memcpy(in->momentum, s->momentum, sizeof in->momentum);
    if (s->present & READING_EULER) {
        memcpy(in->euler, s->euler, sizeof in->euler);
    }
    if (s->present & READING_QUATERNION) {
        memcpy(in->quaternion, s->quaternion, sizeof in->quaternion);
    }
    if (s->present & READING_RATE) {
        memcpy(in->rate, s->rate, sizeof in->rate);
    }
}

/* u clipped to [-limit, limit]. */
static int32_t limited(int32_t u, int32_t limit) {
    int32_t low = u < limit ? u : limit;
    return low > -limit ? low : -limit;
}

/* Reference model, then law, then the wire's own limits. */
static void control(flight *f, uint32_t tick, answer *a) {
    bool started = reference_advance(&f->reference, &f->in);
    f->law->step(&f->self, &f->in, &f->reference, &f->out);
    if (started || f->law->reference_restarted(&f->self)) {
        tell(f, EVENT_REFERENCE_RESTART, 7, started);
    }
    bool arithmetic = (f->out.flags & FLAG_ARITHMETIC) != 0;
    if (arithmetic && !f->arithmetic) {
        tell(f, EVENT_ARITHMETIC_SATURATION, tick_word(tick), 0);
    }
    f->arithmetic = arithmetic;
    a->flags = (uint16_t)f->out.flags;
    for (int i = 0; i < 3; i++) {
        a->torque[i] = limited(f->out.torque[i], f->common[COMMON_TORQUE_LIMIT_X + i]);
        if (a->torque[i] != f->out.torque[i]) {
            a->flags |= FLAG_SATURATED;
        }
    }
    if (a->flags & FLAG_SATURATED) {
        count(&f->saturations);
    }
}

/* Link watchdog: after link_limit ticks without a SAMPLE the command is zero, until the next SAMPLE. */
static void watch(flight *f, uint32_t tick, bool heard, answer *a) {
    if (heard) {
        f->since_sample = 0;
    } else {
        count(&f->since_sample);
    }
    bool tripped = f->since_sample >= f->common[COMMON_LINK_LIMIT];
    if (tripped != f->watchdog) {
        tell(f, tripped ? EVENT_WATCHDOG_ON : EVENT_WATCHDOG_OFF, tick_word(tick), f->since_sample);
        f->watchdog = tripped;
    }
    if (tripped) {
        a->flags |= FLAG_WATCHDOG;
        memset(a->torque, 0, sizeof a->torque);
    }
}

/* Why the SAMPLE, if there was one, was not used. */
static void tell_lost(flight *f, uint32_t tick, const sample *s, bool overrun, answer *a) {
    if (overrun) {
        a->flags |= FLAG_OVERRUN;
        tell(f, EVENT_OVERRUN, tick_word(tick), f->overruns);
    } else if (s != NULL) {
        tell(f, EVENT_READING_INVALID, f->common[COMMON_READINGS_MASK], s->valid);
    }
    tell(f, EVENT_SAMPLE_LOST, tick_word(tick), f->lost);
}

static void write_telemetry(flight *f, int32_t *words, size_t *words_count) {
    reference_words(&f->reference, words + TELEMETRY_REFERENCE_X);
    memcpy(words + TELEMETRY_SETPOINT_X, f->setpoint, sizeof f->setpoint);
    words[TELEMETRY_SAMPLES_LOST] = f->lost;
    words[TELEMETRY_OVERRUNS] = f->overruns;
    words[TELEMETRY_DROPPED] = f->dropped;
    words[TELEMETRY_SATURATIONS] = f->saturations;
    *words_count = TELEMETRY_WORDS + f->law->telemetry(&f->self, words + TELEMETRY_WORDS);
}

void flight_step(flight *f, uint32_t tick, const sample *s, answer *a) {
    bool overrun;
    bool usable = admit(f, tick, s, &overrun);
    take_setpoint(f, tick, s);
    fill(f, tick, usable ? s : NULL);
    control(f, tick, a);
    watch(f, tick, s != NULL, a);
    if (!usable) {
        tell_lost(f, tick, s, overrun, a);
    }
    for (int i = DELAY_MAX; i > 0; i--) {
        memcpy(f->sent[i], f->sent[i - 1], sizeof f->sent[i]);
    }
    memcpy(f->sent[0], a->torque, sizeof f->sent[0]);
    a->used = usable ? STEP_USED : f->reused ? STEP_REUSED : f->law->has_model ? STEP_PROPAGATED : STEP_REPEATED;
    if (f->restarted) {
        a->used = STEP_RESTARTED;
        f->restarted = false;
    }
    uint32_t every = (uint32_t)f->common[COMMON_TELEMETRY_EVERY];
    a->words_count = 0;
    if (every > 0 && tick % every == 0) {
        write_telemetry(f, a->words, &a->words_count);
    }
}

void flight_answered(flight *f) {
    f->events_count = 0;
}
