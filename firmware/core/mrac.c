/* The law mrac, fixed form; firmware_sim/controllers/mrac.py has the same functions and the equations. */
#include "mrac.h"

#include "fixed.h"
#include "generated/frames.h"
#include "generated/law_tables.h"
#include "kinematics.h"
#include "rls.h"

#define STEPS_MAX 1000000
#define TOP_MAX ONE_Q(33) /* rad Q28, so that the quotient by b0 fits 64 bits */

/* -- parameters and initial state -- */

/* b = T_s^2 / (2 I0), Q28, from the drive scale, which counts in turns. */
static int64_t nominal(int32_t mantissa, int32_t shift) {
    return shift_round(mul_q(mantissa, TWO_PI_Q28, 30), shift - 21);
}

static void set_theta(mrac *self, const int32_t *params, int i, int32_t b) {
    int32_t b0 = b, b1 = b, *theta = &self->state.theta[5 * i];
    if (self->par.printed != 0) {
        b0 = (int32_t)shift_round(params[MRAC_PRINTED_B0_X + i], 2);
        b1 = (int32_t)shift_round(params[MRAC_PRINTED_B1_X + i], 2);
    }
    theta[0] = -(int32_t)ONE_Q(29);
    theta[1] = (int32_t)ONE_Q(28);
    theta[2] = b0;
    theta[3] = b1;
}

static bool mrac_init(void *memory, const int32_t *common, const int32_t *params) {
    mrac *self = memory;
    mrac_par *par = &self->par;
    const int64_t one = ONE_Q(30);
    *self = (mrac){0};
    par->printed = params[MRAC_DESIGN] == MRAC_DESIGN_PRINTED;
    par->c1 = (int32_t)-shift_round(params[MRAC_C2_POLE], 1);
    par->c2 = (int32_t)mul_q(params[MRAC_C2_POLE], params[MRAC_C2_POLE], 32);
    par->kappa = params[MRAC_KAPPA];
    par->kappa_inv = (int32_t)div_trunc(ONE_Q(60), one + par->kappa);
    par->forgetting = params[MRAC_FORGETTING];
    par->forgetting_inv = (int32_t)div_trunc(ONE_Q(60), par->forgetting);
    par->trace_max = params[MRAC_TRACE_MAX];
    par->decouple = params[MRAC_DECOUPLE];
    par->identify = params[MRAC_IDENTIFY];
    par->torque_shift = common[COMMON_TORQUE_BITS] - 28;
    torque_limits(common, par->limit);
    torque_scales(common[COMMON_PERIOD_US], &params[MRAC_INERTIA_KGM2_X], par->torque_of, par->drive_of,
                  par->demand_shift, par->drive_shift);
    for (int i = 0; i < 3; i++) {
        int64_t b = nominal(par->drive_of[i], par->drive_shift[i]);
        if (b >= ONE_Q(30)) {
            return false; /* T_s^2 / (2 inertia) is above 4 */
        }
        par->b0_min[i] = par->printed != 0 ? 2684355 : (int32_t)shift_round(b, 1); /* 0.01 */
        par->b0_max[i] = par->printed != 0 ? INT32_MAX : (int32_t)shift_round(b, -1);
        set_theta(self, params, i, (int32_t)b);
        for (int m = 0; m < 5; m++) {
            self->state.F[25 * i + 6 * m] = params[MRAC_F0];
        }
    }
    return true;
}

/* -- one step -- */

/* rad Q28 of an angle in bam, with the whole turns that bring it within half a turn of `centre` (rad Q28). */
static int32_t to_rad(mrac_state *s, int32_t angle, int32_t centre) {
    int64_t turns = mul_q(centre, INV_TWO_PI_Q34, 30); /* unwrapped bam */
    return keep32(mul_q(turns + wrap32(angle - turns), 843314857, 31), &s->arithmetic);
}

/* Acceleration, turn36, of a torque Q28 on the inertia I0. */
static int32_t drive(const mrac_par *par, int i, int32_t torque) {
    return sat32(mul_q(torque, par->drive_of[i], par->drive_shift[i]));
}

/* The torque Q28 that gives the inertia I0 the acceleration, turn36. */
static int32_t torque_for(const mrac_par *par, int i, int32_t acceleration) {
    return sat32(mul_q(acceleration, par->torque_of[i], par->demand_shift[i]));
}

/* v(k), v(k-1), v(k-2); printed: u(k-1), u(k-2), u(k-3). */
static void take_inputs(mrac_state *s, const mrac_par *par, const law_input *in) {
    const bool known = par->printed == 0 && in->applied_known != 0;
    int32_t v[3];
    for (int i = 0; i < 3; i++) {
        v[i] = known ? sat32(shift_round(in->applied[i], par->torque_shift)) : s->command[i];
        v[i] = par->decouple != 0 ? drive(par, i, v[i]) : v[i];
    }
    if (par->decouple != 0) {
        forward(s->eta, s->rate, v, v);
    }
    for (int i = 0; i < 3; i++) {
        s->input_old[i] = s->input_before[i];
        s->input_before[i] = s->input[i];
        s->input[i] = par->decouple != 0 ? torque_for(par, i, v[i]) : v[i];
    }
}

/* phi, and phi theta. */
static int32_t predict(mrac_state *s, const mrac_par *par, int i) {
    const bool late = par->printed == 0;
    int64_t model = 0;
    s->phi[0] = sat32(-wide(s->y[i]));
    s->phi[1] = sat32(-wide(s->y_before[i]));
    s->phi[2] = late ? s->input_before[i] : s->input[i];
    s->phi[3] = late ? s->input_old[i] : s->input_before[i];
    s->phi[4] = (int32_t)ONE_Q(28);
    for (int m = 0; m < 5; m++) {
        model += mul_q(s->phi[m], s->theta[5 * i + m], 28);
    }
    return keep32(model, &s->arithmetic);
}

static void identify_axis(mrac_state *s, const mrac_par *par, int i, int32_t e) {
    int32_t *theta = &s->theta[5 * i];
    const rls estimator = {theta, &s->F[25 * i], s->phi, s->F_phi, s->gain};
    const rls_par bounds = {par->forgetting, par->forgetting_inv, par->trace_max};
    identify(&estimator, &bounds, e, &s->arithmetic);
    theta[2] = (int32_t)clip(theta[2], par->b0_min[i], par->b0_max[i]);
}

static int32_t control(mrac_state *s, const mrac_par *par, const reference_state *ref, int i) {
    const int64_t a1 = s->theta[5 * i], a2 = s->theta[5 * i + 1], d = s->theta[5 * i + 4];
    const int64_t c1 = par->c1, c2 = par->c2;
    const int32_t y = s->y[i];
    int64_t b0 = s->theta[5 * i + 2], b1 = s->theta[5 * i + 3];
    int32_t w0 = ref->next[i], w1 = ref->now[i], w2 = ref->past[i];
    int32_t s1 = 0, t0 = sat32(c1 - a1), t1 = sat32(c2 - a2);
    if (par->printed == 0) {
        w0 = ref->ahead[i];
        w1 = ref->next[i];
        w2 = ref->now[i];
        s1 = sat32(c1 - a1);
        t0 = sat32(c2 - a2 - mul_q(a1, s1, 28));
        t1 = sat32(-mul_q(a2, s1, 28));
        b0 = sat32(mul_q(b0 + b1, par->kappa_inv, 30));
        b1 = mul_q(par->kappa, b0, 30);
    }
    int64_t top = to_rad(s, w0, y) + mul_q(c1, to_rad(s, w1, y), 28) + mul_q(c2, to_rad(s, w2, y), 28);
    top -= mul_q(t0, y, 28) + mul_q(t1, s->y_before[i], 28) + d + mul_q(s1, d, 28);
    top -= mul_q(sat32(b1 + mul_q(b0, s1, 28)), s->input[i], 28);
    top -= mul_q(sat32(mul_q(b1, s1, 28)), s->input_before[i], 28);
    return keep32(div_trunc(shift_round(clip(top, -TOP_MAX, TOP_MAX), -28), b0), &s->arithmetic);
}

/* u: from I0 times an Euler acceleration to torque; true if it had to be scaled down. */
static bool decouple(mrac_state *s, const mrac_par *par, const reference_state *ref, int32_t u[3]) {
    int64_t scale = ONE_Q(30);
    for (int i = 0; i < 3; i++) {
        int32_t turn = wrap32(wide(ref->ahead[i]) - ref->next[i]);
        u[i] = drive(par, i, u[i]);
        s->rate[i] = keep32(shift_round(turn, -4), &s->arithmetic);
        s->eta[i] = wrap32(ref->next[i] + shift_round(turn, 1));
    }
    inverse(s->eta, s->rate, u, u);
    for (int i = 0; i < 3; i++) {
        u[i] = torque_for(par, i, u[i]);
        int64_t size = magnitude(u[i]);
        if (size > par->limit[i]) {
            scale = smaller(scale, div_trunc(shift_round(par->limit[i], -30), size));
        }
    }
    if (scale < ONE_Q(30)) {
        for (int i = 0; i < 3; i++) {
            u[i] = (int32_t)mul_q(u[i], scale, 30);
        }
    }
    return scale < ONE_Q(30);
}

/* Model, identification and wanted command of axis i. */
static int32_t step_axis(mrac *self, const law_input *in, const reference *ref, int i, bool learn) {
    const mrac_par *par = &self->par;
    mrac_state *s = &self->state;
    if (s->steps == 0) {
        s->y[i] = to_rad(s, in->euler[i], 0);
        s->y_before[i] = s->y[i];
    }
    int32_t model = predict(s, par, i);
    int32_t y = in->fresh != 0 ? to_rad(s, in->euler[i], s->y[i]) : model;
    if (par->identify != 0 && learn) {
        identify_axis(s, par, i, sub_sat(y, model));
    }
    s->y_before[i] = s->y[i];
    s->y[i] = y;
    return control(s, par, &ref->state, i);
}

static void mrac_step(void *memory, const law_input *in, reference *ref, law_output *out) {
    mrac *self = memory;
    const mrac_par *par = &self->par;
    mrac_state *s = &self->state;
    int32_t *u = out->torque;
    *out = (law_output){0};
    s->arithmetic = 0;
    if (s->steps == 0 && in->fresh == 0) {
        out->flags = FLAG_STARTING;
        return;
    }
    take_inputs(s, par, in);
    const bool learn = in->fresh != 0 && in->good_run >= 3 && s->steps >= 3;
    for (int i = 0; i < 3; i++) {
        u[i] = step_axis(self, in, ref, i, learn);
    }
    bool saturated = par->decouple != 0 && decouple(s, par, &ref->state, u);
    for (int i = 0; i < 3; i++) {
        s->command[i] = (int32_t)clip(u[i], -par->limit[i], par->limit[i]);
        saturated = saturated || s->command[i] != u[i];
        u[i] = sat32(shift_round(s->command[i], -par->torque_shift));
    }
    out->flags = par->identify != 0 && !learn ? FLAG_IDENTIFICATION_PAUSED : 0;
    out->flags += saturated ? FLAG_SATURATED : 0;
    out->flags += s->arithmetic != 0 ? FLAG_ARITHMETIC : 0;
    s->steps = (int32_t)smaller(s->steps + 1, STEPS_MAX);
}

static bool mrac_reference_restarted(const void *memory) {
    (void)memory;
    return false;
}

/* theta of the three axes, then the trace of each axis' covariance, Q16. */
static size_t mrac_telemetry(const void *memory, int32_t *words) {
    const mrac *self = memory;
    for (int i = 0; i < 15; i++) {
        words[MRAC_TELEMETRY_A1_X + i] = self->state.theta[i];
    }
    for (int i = 0; i < 3; i++) {
        const int32_t *F = &self->state.F[25 * i];
        int64_t trace = wide(F[0]) + F[6] + F[12] + F[18] + F[24];
        words[MRAC_TELEMETRY_TRACE_X + i] = (int32_t)clip(shift_round(trace, 4), 0, INT32_MAX);
    }
    return MRAC_TELEMETRY_WORDS;
}

const law MRAC_LAW = {
    .id = MRAC_LAW_ID,
    .version = MRAC_LAW_VERSION,
    .size = sizeof(mrac),
    .has_model = true,
    .init = mrac_init,
    .step = mrac_step,
    .reference_restarted = mrac_reference_restarted,
    .telemetry = mrac_telemetry,
};
