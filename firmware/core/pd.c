/* The law pd, fixed form; firmware_sim/controllers/pd.py has the same functions and the equations. */
#include "pd.h"

#include "attitude_error.h"
#include "fixed.h"
#include "generated/frames.h"
#include "generated/law_tables.h"
#include "kinematics.h"

#define GAP_MAX 1000000

/* gain 2^-bits / T_s times a change in rad Q29 is a torque Q28, change m 2^-n; (0, 1) if negligible. */
static void per_sample(int32_t gain, int32_t bits, int32_t period_us, int32_t *m, int32_t *n) {
    int64_t size = div_trunc(mul_q(magnitude(gain), 1024000000, 0), period_us);
    int32_t s = norm_shift(size);
    *m = 0;
    *n = bits + 10 + 1 + s;
    if (size == 0 || *n > 62) {
        *n = 1;
        return;
    }
    *m = (int32_t)clip(shift_round(size, -s), 0, INT32_MAX);
    if (gain <= 0) {
        *m = -*m;
    }
}

static bool pd_init(void *memory, const int32_t *common, const int32_t *params) {
    pd *self = memory;
    pd_par *par = &self->par;
    const int32_t bits = params[PD_KD_BITS] + common[COMMON_RATE_BITS] - 28; /* of kd times a sensed rate beyond Q28 */
    *self = (pd){0};
    for (int i = 0; i < 3; i++) {
        par->kp[i] = params[PD_KP_X + i];
        if (params[PD_RATE] == PD_RATE_SENSED) {
            par->kd[i] = params[PD_KD_X + i];
            par->kd_shift[i] = bits > 0 ? bits : 0;
        } else {
            per_sample(params[PD_KD_X + i], params[PD_KD_BITS], common[COMMON_PERIOD_US], &par->kd[i],
                       &par->kd_shift[i]);
        }
    }
    torque_limits(common, par->limit);
    par->kp_shift = params[PD_KP_BITS] + 1;
    par->torque_shift = common[COMMON_TORQUE_BITS] - 28;
    par->rate_shift = bits < 0 ? bits : 0;
    par->sensed = params[PD_RATE];
    par->kind = params[PD_ERROR];
    par->sequence = common[COMMON_ATTITUDE_SEQUENCE];
    return true;
}

/* Error, rad Q29; for TELEMETRY in bam; and rate. */
static void take_reading(pd *self, const law_input *in, const reference *ref, int32_t error[3]) {
    const pd_par *par = &self->par;
    pd_state *s = &self->state;
    int32_t change[3];
    attitude_error(par->kind, par->sequence, ref->state.now, in->euler, error);
    attitude_error(par->kind, par->sequence, in->euler, s->reading, change);
    for (int i = 0; i < 3; i++) {
        if (par->sensed != 0) {
            s->change[i] = sat32(shift_round(in->rate[i], par->rate_shift));
        } else if (s->gap > 0) {
            s->change[i] = (int32_t)div_trunc(change[i], s->gap);
        }
        s->reading[i] = in->euler[i];
        s->error[i] = wrap32(par->kind == ERROR_EULER ? wide(ref->state.now[i]) - in->euler[i]
                                                      : mul_q(error[i], INV_TWO_PI_Q34, 31));
    }
}

/* The command of axis i. */
static void control(pd *self, int i, int32_t error, law_output *out) {
    const pd_par *par = &self->par;
    pd_state *s = &self->state;
    int64_t wanted = mul_q(par->kp[i], error, par->kp_shift) - mul_q(par->kd[i], s->change[i], par->kd_shift[i]);
    int32_t u = keep32(wanted, &s->arithmetic);
    s->command[i] = (int32_t)clip(u, -par->limit[i], par->limit[i]);
    if (s->command[i] != u) {
        out->flags = FLAG_SATURATED;
    }
}

static void pd_step(void *memory, const law_input *in, reference *ref, law_output *out) {
    pd *self = memory;
    pd_state *s = &self->state;
    int32_t error[3];
    s->arithmetic = 0;
    out->flags = s->gap == 0 && in->fresh == 0 ? FLAG_STARTING : 0;
    if (in->fresh != 0) {
        take_reading(self, in, ref, error);
    }
    for (int i = 0; i < 3; i++) {
        if (in->fresh != 0) {
            control(self, i, error[i], out);
        }
        out->torque[i] = sat32(shift_round(s->command[i], -self->par.torque_shift));
    }
    if (s->arithmetic != 0) {
        out->flags += FLAG_ARITHMETIC;
    }
    if (in->fresh != 0) {
        s->gap = 1;
    } else if (s->gap > 0) {
        s->gap = (int32_t)smaller(s->gap + 1, GAP_MAX);
    }
}

static bool pd_reference_restarted(const void *memory) {
    (void)memory;
    return false;
}

static size_t pd_telemetry(const void *memory, int32_t *words) {
    const pd *self = memory;
    for (int i = 0; i < 3; i++) {
        words[PD_TELEMETRY_ERROR_X + i] = self->state.error[i];
    }
    return PD_TELEMETRY_WORDS;
}

const law PD_LAW = {
    .id = PD_LAW_ID,
    .version = PD_LAW_VERSION,
    .size = sizeof(pd),
    .has_model = false,
    .init = pd_init,
    .step = pd_step,
    .reference_restarted = pd_reference_restarted,
    .telemetry = pd_telemetry,
};
