/* The law appc, fixed form; controllers/appc.py and appc_observer.py have the same functions and the equations. */
#include "appc.h"

#include "fixed.h"
#include "gain.h"
#include "generated/frames.h"
#include "generated/law_tables.h"
#include "gyroscopic.h"
#include "kinematics.h"

#define START_STEPS 4
#define LEARN_FROM 25
#define STEPS_MAX 1000000 /* and of the ticks of a gap */

/* -- parameters and initial state -- */

static bool appc_init(void *memory, const int32_t *common, const int32_t *params) {
    appc *self = memory;
    appc_par *par = &self->par;
    appc_state *s = &self->state;
    const int32_t period_us = common[COMMON_PERIOD_US];
    const int64_t one = ONE_Q(30), pc = params[APPC_CONTROLLER_POLE], po = params[APPC_OBSERVER_POLE];
    const int64_t qc = one - pc, qo = one - po, qo2 = mul_q(qo, qo, 30);
    *self = (appc){0};
    par->ts = (int32_t)div_trunc(shift_round(period_us, -30), 1000000);
    par->ts_inv = (int32_t)div_trunc(shift_round(1000000, -28), period_us);
    par->k1 = (int32_t)mul_q(qc, qc, 30);
    par->k2 = (int32_t)mul_q(qc, pc + shift_round(3, -30), 31);
    par->l1 = (int32_t)(one - mul_q(mul_q(po, po, 30), po, 30));
    par->l2 = (int32_t)mul_q(mul_q(qo2, one + po, 30), 3, 1);
    par->l3 = (int32_t)mul_q(qo2, qo, 30);
    par->adapt = params[APPC_ADAPT];
    par->gyro = params[APPC_GYRO];
    par->recover = params[APPC_RECOVER_TORQUE];
    par->orbit = (int32_t)mul_q(mul_q(params[APPC_ORBIT_RATE_RADPS], par->ts, 32), INV_TWO_PI_Q34, 34);
    par->torque_shift = common[COMMON_TORQUE_BITS] - 28;
    par->momentum_shift = common[COMMON_MOMENTUM_BITS] - 28;
    par->momentum_max = sat32(shift_round(INT32_MAX, par->momentum_shift));
    torque_limits(common, par->limit);
    torque_scales(period_us, &params[APPC_INERTIA_KGM2_X], par->torque_of, par->drive_of, par->demand_shift,
                  par->drive_shift);
    for (int i = 0; i < 3; i++) {
        s->g[i] = s->g_inverse[i] = (int32_t)ONE_Q(28);
        s->P[i] = 1717986918; /* 0.1 */
    }
    return true;
}

/* -- one step -- */

/* Acceleration, turn36, of a torque Q28 on the inertia I0. */
static int32_t drive(const appc_par *par, int i, int32_t torque) {
    return sat32(mul_q(torque, par->drive_of[i], par->drive_shift[i]));
}

/* Torque Q28 of the inertia I0 / g = acceleration (turn36) times this 2^-demand_shift. */
static int64_t scale(const appc_state *s, const appc_par *par, int i) {
    return mul_q(par->torque_of[i], s->g_inverse[i], 28);
}

/* Gamma at these angles, rates and momentum; zero without `gyro`. */
static void gyro_torque(const appc_state *s, const appc_par *par, const int32_t angles[3], const int32_t rates[3],
                        const int32_t momentum[3], int32_t torque[3]) {
    const int64_t scales[3] = {scale(s, par, 0), scale(s, par, 1), scale(s, par, 2)};
    const gyro_par body = {scales, par->demand_shift, par->ts, par->ts_inv, par->orbit};
    torque[0] = torque[1] = torque[2] = 0;
    if (par->gyro != 0) {
        gyro(&body, angles, rates, momentum, torque);
    }
}

/* alpha at (y^, v^) with the torque that acts now, turn36. */
static void acceleration(const appc_state *s, const appc_par *par, int32_t alpha[3]) {
    int32_t gamma[3];
    gyro_torque(s, par, s->y, s->v, s->momentum, gamma);
    for (int i = 0; i < 3; i++) {
        alpha[i] = sat32(mul_q(drive(par, i, sub_sat(s->applied[i], gamma[i])), s->g[i], 28));
    }
    forward(s->y, s->v, alpha, alpha);
    for (int i = 0; i < 3; i++) {
        alpha[i] = add_sat(alpha[i], s->w[i]);
    }
}

/* y + v + alpha / 2: bam and turn36 to bam. */
static int32_t moved(int32_t y, int32_t v, int32_t alpha) {
    return wrap32(y + shift_round(shift_round(v, -1) + alpha, 5));
}

/* Momentum after one period of the torque that acts now. */
static int64_t momentum_after(const appc_state *s, const appc_par *par, int i) {
    return s->momentum[i] - mul_q(s->applied[i], par->ts, 30);
}

static void propagate(appc_state *s, const appc_par *par) {
    int32_t alpha[3];
    acceleration(s, par, alpha);
    for (int i = 0; i < 3; i++) {
        s->y[i] = moved(s->y[i], s->v[i], alpha[i]);
        s->v[i] = keep32(wide(s->v[i]) + alpha[i], &s->arithmetic);
        s->momentum[i] = keep32(momentum_after(s, par, i), &s->arithmetic);
        s->innovation[i] = 0;
    }
    s->gap = (int32_t)smaller(s->gap + 1, STEPS_MAX);
}

/* dU of axis i: what the torque of a gap was more than guessed, summed up; from the momentum of the wheels. */
static int32_t missed(const appc_state *s, const appc_par *par, const law_input *in, int i) {
    int32_t h = sat32(shift_round(in->momentum[i], par->momentum_shift));
    if (h >= par->momentum_max || h <= -par->momentum_max) {
        return 0;
    }
    return sat32(mul_q(sub_sat(s->momentum[i], h), par->ts_inv, 28));
}

/* The prediction for t_k as it would be had the torque of the gap been known. */
static void recover(appc_state *s, const appc_par *par, const law_input *in) {
    static const int32_t AT_REST[3] = {0, 0, 0};
    const int32_t lost = s->gap - 1; /* gap: ticks since a reading */
    int32_t torque[3], dv[3];
    s->gap = 0;
    if (lost <= 0 || par->recover == 0 || in->applied_known == 0) {
        return;
    }
    for (int i = 0; i < 3; i++) {
        torque[i] = missed(s, par, in, i);
        dv[i] = sat32(mul_q(drive(par, i, torque[i]), s->g[i], 28));
    }
    forward(s->y, AT_REST, dv, dv);
    for (int i = 0; i < 3; i++) {
        int64_t share = div_trunc(torque[i], lost);
        s->y[i] = wrap32(s->y[i] + mul_q(dv[i], lost, 5));
        s->v[i] = keep32(wide(s->v[i]) + dv[i], &s->arithmetic);
        s->applied[i] = add_sat(s->applied[i], share);
        if (lost > 1) {
            s->applied_before[i] = add_sat(s->applied_before[i], share);
        }
    }
}

static void correct(appc_state *s, const appc_par *par, const law_input *in) {
    for (int i = 0; i < 3; i++) {
        if (s->steps == 0) {
            s->y[i] = s->reading[i] = s->reading_before[i] = in->euler[i];
        }
        int32_t e = wrap32(wide(in->euler[i]) - s->y[i]);
        s->innovation[i] = e;
        s->y[i] = wrap32(s->y[i] + mul_q(par->l1, e, 30));
        s->v[i] = keep32(s->v[i] + mul_q(par->l2, e, 26), &s->arithmetic);
        s->w[i] = keep32(s->w[i] + mul_q(par->l3, e, 26), &s->arithmetic);
        s->momentum[i] = keep32(shift_round(in->momentum[i], par->momentum_shift), &s->arithmetic);
    }
}

/* seen: the reading, or the prediction that stands in for it; angles and rates: the estimate before this tick. */
static void adapt(appc_state *s, const appc_par *par, const int32_t seen[3], const int32_t angles[3],
                  const int32_t rates[3], bool may_learn) {
    int32_t response[3];
    second_differences(seen, s->reading, s->reading_before, response);
    inverse(angles, rates, response, response);
    for (int i = 0; i < 3; i++) {
        int64_t both = wide(drive(par, i, s->applied[i])) + drive(par, i, s->applied_before[i]);
        int32_t x = washed(&s->response[3 * i], response[i]);
        int32_t c = washed(&s->drive[3 * i], (int32_t)shift_round(both, 1));
        if (may_learn && s->steps >= LEARN_FROM) {
            learn(&s->g[i], &s->P[i], x, c);
            s->g_inverse[i] = (int32_t)div_trunc(ONE_Q(56), s->g[i]);
        }
    }
}

/* The readings and the torque that acts from now on move up. */
static void take_inputs(appc_state *s, const appc_par *par, const law_input *in, const int32_t seen[3]) {
    for (int i = 0; i < 3; i++) {
        bool known = in->applied_known != 0;
        s->applied_before[i] = s->applied[i];
        s->applied[i] = known ? sat32(shift_round(in->applied[i], par->torque_shift)) : s->command[i];
        s->reading_before[i] = s->reading[i];
        s->reading[i] = seen[i];
    }
}

/* No torque while the observer settles; the reference waits at y^ and leaves at last with rate v^. */
static void start(appc_state *s, reference *ref) {
    const bool last = s->steps == START_STEPS - 1;
    for (int i = 0; i < 3; i++) {
        int32_t rate = last ? s->v[i] : 0;
        reference_restart(ref, i, wrap32(s->y[i] + shift_round(rate, 4)), rate);
        s->command[i] = 0;
    }
    s->restarted = 1;
}

/* nu of axis i, the wanted Euler acceleration at t_(k+1), for the predicted angle and rate. */
static int32_t wanted(appc_state *s, const appc_par *par, const reference_state *ref, int i, int32_t angle,
                      int32_t rate) {
    int64_t e = mul_q(par->k1, wrap32(wide(angle) - ref->next[i]), 26);
    int64_t f = mul_q(par->k2, sub_sat(rate, ref->rate_next[i]), 30);
    return keep32(ref->accel[i] - e - f - s->w[i], &s->arithmetic);
}

/* The command; true if it is at a limit. */
static bool place(appc_state *s, const appc_par *par, const reference_state *ref, int32_t torque[3]) {
    int32_t alpha[3], angles[3], rates[3], momentum[3], nu[3], gamma[3];
    bool saturated = false;
    acceleration(s, par, alpha);
    for (int i = 0; i < 3; i++) {
        angles[i] = moved(s->y[i], s->v[i], alpha[i]);
        rates[i] = add_sat(s->v[i], alpha[i]);
        momentum[i] = sat32(momentum_after(s, par, i));
        nu[i] = wanted(s, par, ref, i, angles[i], rates[i]);
    }
    inverse(angles, rates, nu, nu);
    gyro_torque(s, par, angles, rates, momentum, gamma);
    for (int i = 0; i < 3; i++) {
        int64_t u = keep32(mul_q(nu[i], scale(s, par, i), par->demand_shift[i]) + gamma[i], &s->arithmetic);
        s->command[i] = (int32_t)clip(u, -par->limit[i], par->limit[i]);
        saturated = saturated || s->command[i] != u;
        torque[i] = sat32(shift_round(s->command[i], -par->torque_shift));
    }
    return saturated;
}

static void appc_step(void *memory, const law_input *in, reference *ref, law_output *out) {
    appc *self = memory;
    const appc_par *par = &self->par;
    appc_state *s = &self->state;
    const int32_t angles[3] = {s->y[0], s->y[1], s->y[2]}, rates[3] = {s->v[0], s->v[1], s->v[2]};
    *out = (law_output){0};
    s->restarted = s->arithmetic = 0;
    if (s->steps == 0 && in->fresh == 0) {
        out->flags = FLAG_STARTING;
        return;
    }
    if (s->steps > 0) {
        propagate(s, par);
    }
    if (in->fresh != 0) {
        recover(s, par, in);
        correct(s, par, in);
    }
    int32_t seen[3];
    for (int i = 0; i < 3; i++) {
        seen[i] = in->fresh != 0 ? in->euler[i] : s->y[i];
    }
    if (par->adapt != 0) {
        bool may_learn = in->fresh != 0 && in->good_run >= smaller(3, s->steps + 1);
        adapt(s, par, seen, angles, rates, may_learn);
        out->flags = may_learn ? 0 : FLAG_IDENTIFICATION_PAUSED;
    }
    take_inputs(s, par, in, seen);
    if (s->steps < START_STEPS) {
        start(s, ref);
        out->flags += FLAG_STARTING;
    } else if (place(s, par, &ref->state, out->torque)) {
        out->flags += FLAG_SATURATED;
    }
    out->flags += s->arithmetic != 0 ? FLAG_ARITHMETIC : 0;
    s->steps = (int32_t)smaller(s->steps + 1, STEPS_MAX);
}

static bool appc_reference_restarted(const void *memory) {
    const appc *self = memory;
    return self->state.restarted != 0;
}

/* g, P, innovation, disturbance; all of them within their ranges by construction. */
static size_t appc_telemetry(const void *memory, int32_t *words) {
    const appc *self = memory;
    const appc_state *s = &self->state;
    for (int i = 0; i < 3; i++) {
        words[APPC_TELEMETRY_G_X + i] = s->g[i];
        words[APPC_TELEMETRY_P_X + i] = s->P[i];
        words[APPC_TELEMETRY_INNOVATION_X + i] = s->innovation[i];
        words[APPC_TELEMETRY_DISTURBANCE_X + i] = s->w[i];
    }
    return APPC_TELEMETRY_WORDS;
}

const law APPC_LAW = {
    .id = APPC_LAW_ID,
    .version = APPC_LAW_VERSION,
    .size = sizeof(appc),
    .has_model = true,
    .init = appc_init,
    .step = appc_step,
    .reference_restarted = appc_reference_restarted,
    .telemetry = appc_telemetry,
};
