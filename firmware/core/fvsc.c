/* The laws fvsc, vsc and ifvsc, fixed form; firmware_sim/controllers/fvsc.py has the same functions and the equations. */
#include "fvsc.h"

#include "attitude_error.h"
#include "fixed.h"
#include "fuzzy.h"
#include "generated/frames.h"
#include "generated/law_tables.h"

#define GAP_MAX 1000000
#define HALF_TURN_Q29 INT64_C(1686629713)
#define TURN_Q29 INT64_C(3373259426)

enum { GAIN_CLOSED = 0, GAIN_TABLE = 1, GAIN_LINEAR = 2, ENTRIES = 65 };

/* What all three have; their first words are the same. */
static void init_switching(fvsc *self, const int32_t *common, const int32_t *params) {
    fvsc_par *par = &self->par;
    *self = (fvsc){0};
    for (int i = 0; i < 3; i++) {
        par->ka[i] = params[VSC_KA_X + i];
        par->limit[i] = common[COMMON_TORQUE_LIMIT_X + i];
    }
    par->ka_shift = params[VSC_KA_BITS] + 20 - common[COMMON_TORQUE_BITS];
    par->ks = params[VSC_KS];
    par->kr = params[VSC_KR];
    par->m = params[VSC_M];
    par->integral_limit = 10 << 20;
    par->period_us = common[COMMON_PERIOD_US];
    par->ts = (int32_t)div_trunc(shift_round(par->period_us, -24), 1000000);
    par->rate_bits = common[COMMON_RATE_BITS];
    par->difference = params[VSC_RATE_IN_S];
    par->kind = params[VSC_ERROR];
    par->sequence = common[COMMON_ATTITUDE_SEQUENCE];
    par->gain = GAIN_LINEAR;
}

static bool vsc_init(void *memory, const int32_t *common, const int32_t *params) {
    init_switching(memory, common, params);
    return true;
}

static bool fvsc_init(void *memory, const int32_t *common, const int32_t *params) {
    fvsc *self = memory;
    fvsc_par *par = &self->par;
    init_switching(self, common, params);
    par->ks = (int32_t)mul_q(params[FVSC_KS], params[FVSC_L], 20);
    par->gain = params[FVSC_INFERENCE];
    par->inverse_E = (int32_t)div_trunc(ONE_Q(49), params[FVSC_E]);
    for (int i = 0; i < ENTRIES; i++) {
        par->table[i] = params[FVSC_F_TABLE_1 + i];
    }
    return true;
}

static bool ifvsc_init(void *memory, const int32_t *common, const int32_t *params) {
    fvsc *self = memory;
    fvsc_init(self, common, params);
    self->par.ki = params[IFVSC_KI];
    self->par.integral_limit = params[IFVSC_INTEGRAL_LIMIT];
    return true;
}

/* rad/s Q30 of a change of the error, rad Q29, in so many ticks; zero before the first. */
static int64_t rate_of(const fvsc_par *par, int64_t change, int32_t gap) {
    if (par->kind == ERROR_EULER) { /* the short way round */
        change = change > HALF_TURN_Q29 ? change - TURN_Q29 : change < -HALF_TURN_Q29 ? change + TURN_Q29 : change;
    }
    return gap > 0 ? div_trunc(mul_q(change, 2000000, 0), mul_q(par->period_us, gap, 0)) : 0;
}

/* sgn(e sigma), +1 for zero, from the signs alone: the square of a small error has no bits left. */
static int32_t sign_of(int32_t e, int64_t sigma) {
    return e == 0 || sigma == 0 || (e > 0) == (sigma > 0) ? 1 : -1;
}

/* Ks f(e), V Q20. */
static int64_t gain(const fvsc_par *par, int32_t e) {
    if (par->gain == GAIN_LINEAR) {
        return -mul_q(par->ks, e, 29);
    }
    int64_t a = smaller(mul_q(magnitude(e), par->inverse_E, 35), 32768);
    int64_t f = par->gain == GAIN_CLOSED ? fuzzy_closed(a) : fuzzy_table(par->table, a);
    f = mul_q(par->ks, f, 15);
    return e > 0 ? -f : f;
}

/* The command of axis i. */
static void control(fvsc *self, int i, int32_t e, int32_t rate, law_output *out) {
    const fvsc_par *par = &self->par;
    fvsc_state *s = &self->state;
    int64_t w = shift_round(rate, par->rate_bits - 30);
    if (par->difference != 0) {
        w = rate_of(par, wide(e) - s->error[i], s->gap);
    }
    s->sign[i] = sign_of(e, mul_q(par->m, e, 23) + w);
    s->error[i] = e;
    int64_t f = gain(par, e);
    s->switching[i] = keep32(s->sign[i] > 0 ? f : -f, &s->arithmetic);
    int64_t v = s->switching[i] - mul_q(par->kr, rate, par->rate_bits) - mul_q(par->ki, s->integral[i], 20);
    int64_t u = mul_q(par->ka[i], keep32(v, &s->arithmetic), par->ka_shift);
    s->command[i] = (int32_t)clip(u, -par->limit[i], par->limit[i]);
    if (s->command[i] != u) {
        out->flags = FLAG_SATURATED;
    }
    if (s->command[i] == u || (u > 0) == (e > 0)) {
        int64_t limit = shift_round(par->integral_limit, -20);
        s->sum[i] = clip(s->sum[i] + mul_q(par->ts, e, 13), -limit, limit);
        s->integral[i] = sat32(shift_round(s->sum[i], 20));
    }
}

static void fvsc_step(void *memory, const law_input *in, reference *ref, law_output *out) {
    fvsc *self = memory;
    fvsc_state *s = &self->state;
    s->arithmetic = 0;
    out->flags = s->gap == 0 && in->fresh == 0 ? FLAG_STARTING : 0;
    if (in->fresh != 0) {
        int32_t error[3];
        attitude_error(self->par.kind, self->par.sequence, in->euler, ref->state.now, error);
        for (int i = 0; i < 3; i++) {
            control(self, i, error[i], in->rate[i], out);
        }
        s->gap = 1;
    } else if (s->gap > 0) {
        s->gap = (int32_t)smaller(s->gap + 1, GAP_MAX);
    }
    for (int i = 0; i < 3; i++) {
        out->torque[i] = s->command[i];
    }
    if (s->arithmetic != 0) {
        out->flags += FLAG_ARITHMETIC;
    }
}

static bool fvsc_reference_restarted(const void *memory) {
    (void)memory;
    return false;
}

static size_t fvsc_telemetry(const void *memory, int32_t *words) {
    const fvsc_state *s = &((const fvsc *)memory)->state;
    for (int i = 0; i < 3; i++) {
        words[FVSC_TELEMETRY_ERROR_X + i] = s->error[i];
        words[FVSC_TELEMETRY_SWITCHING_X + i] = s->switching[i];
        words[FVSC_TELEMETRY_SIGN_X + i] = s->sign[i];
    }
    return FVSC_TELEMETRY_WORDS;
}

static size_t ifvsc_telemetry(const void *memory, int32_t *words) {
    fvsc_telemetry(memory, words);
    for (int i = 0; i < 3; i++) {
        words[IFVSC_TELEMETRY_INTEGRAL_X + i] = ((const fvsc *)memory)->state.integral[i];
    }
    return IFVSC_TELEMETRY_WORDS;
}

#define LAW(ID, VERSION, INIT, TELEMETRY)                                                                              \
    {                                                                                                                  \
        .id = ID, .version = VERSION, .size = sizeof(fvsc), .has_model = false, .init = INIT, .step = fvsc_step,       \
        .reference_restarted = fvsc_reference_restarted, .telemetry = TELEMETRY,                                       \
    }

const law FVSC_LAW = LAW(FVSC_LAW_ID, FVSC_LAW_VERSION, fvsc_init, fvsc_telemetry);
const law VSC_LAW = LAW(VSC_LAW_ID, VSC_LAW_VERSION, vsc_init, fvsc_telemetry);
const law IFVSC_LAW = LAW(IFVSC_LAW_ID, IFVSC_LAW_VERSION, ifvsc_init, ifvsc_telemetry);
