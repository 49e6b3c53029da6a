/* The law pd, fixed form; firmware_sim/controllers/pd.py has the same functions and the equations. */
#include "pd.h"

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
    *self = (pd){0};
    for (int i = 0; i < 3; i++) {
        par->kp[i] = params[PD_KP_X + i];
        per_sample(params[PD_KD_X + i], params[PD_KD_BITS], common[COMMON_PERIOD_US], &par->kd[i], &par->kd_shift[i]);
    }
    torque_limits(common, par->limit);
    par->kp_shift = params[PD_KP_BITS] + 1;
    par->torque_shift = common[COMMON_TORQUE_BITS] - 28;
    return true;
}

/* The command of axis i from a reading. */
static void control(pd *self, const law_input *in, const reference *ref, int i, law_output *out) {
    const pd_par *par = &self->par;
    pd_state *s = &self->state;
    if (s->gap > 0) {
        int64_t change = mul_q(wrap32(wide(in->euler[i]) - s->reading[i]), TWO_PI_Q28, 31);
        s->change[i] = (int32_t)div_trunc(change, s->gap);
    }
    s->reading[i] = in->euler[i];
    s->error[i] = wrap32(wide(ref->state.now[i]) - in->euler[i]);
    int64_t error = mul_q(s->error[i], TWO_PI_Q28, 31);
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
    s->arithmetic = 0;
    out->flags = s->gap == 0 && in->fresh == 0 ? FLAG_STARTING : 0;
    for (int i = 0; i < 3; i++) {
        if (in->fresh != 0) {
            control(self, in, ref, i, out);
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
