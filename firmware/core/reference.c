/* Reference model, fixed form; firmware_sim/guidance/reference.py has the same functions and the equations. */
#include "reference.h"

#include "fixed.h"
#include "generated/law_tables.h"
#include "law.h"

#define RATE_LIMIT_48 ONE_Q(46) /* a quarter turn per sample: the largest rate the integers carry */
#define HALF_TURN_48 ONE_Q(47)  /* limits no step of an angle */

void reference_init(reference *self, const int32_t *common) {
    const int64_t p = common[COMMON_REFERENCE_POLE], one_minus = ONE_Q(30) - p, one_plus = ONE_Q(30) + p;
    const int32_t kind = common[COMMON_REFERENCE_KIND];
    const int32_t accel = common[COMMON_ACCEL_LIMIT], rate = common[COMMON_RATE_LIMIT];
    const bool zoh = kind == COMMON_REFERENCE_KIND_ZOH;
    reference_par *par = &self->par;
    *self = (reference){0};
    par->kind = kind;
    par->k1 = mul_q(one_minus, one_minus, 14);
    par->k2 = (int32_t)(zoh ? mul_q(one_minus, one_plus + ONE_Q(31), 31) : mul_q(one_minus, one_plus, 30));
    if (zoh) {
        int64_t ratio = div_trunc(shift_round(one_minus, -31), one_plus);
        par->start = mul_q(ratio, ratio, 15);
    }
    par->accel_max = shift_round(accel != 0 ? accel : INT32_MAX, -16);
    par->rate_max = clip(shift_round(rate != 0 ? rate : INT32_MAX, -16), 0, RATE_LIMIT_48);
    if (kind == COMMON_REFERENCE_KIND_NONE) {
        par->rate_max = rate != 0 ? shift_round(rate, -16) : HALF_TURN_48;
    }
    self->state.lead = common[COMMON_REFERENCE_LEAD];
}

void reference_restart(reference *self, int i, int32_t position, int32_t rate) {
    reference_state *s = &self->state;
    s->past[i] = s->now[i] = s->next[i] = s->ahead[i] = position;
    s->rate_now[i] = s->rate_next[i] = s->accel[i] = 0;
    s->head[i] = shift_round(position, -16);
    s->head_rate[i] = shift_round(rate, -12);
}

/* `position` turned towards `goal`, the short way, by no more than `most`; all 2^-48 turn. */
static int64_t turned(int64_t position, int64_t goal, int64_t most) {
    return wrap_bits(position + clip(wrap_bits(goal - position, 48), -most, most), 48);
}

/* The set-point itself, turned by no more than the rate limit per sample. */
static void follow_axis(reference *self, const law_input *in, int i) {
    const int64_t most = self->par.rate_max, goal = shift_round(in->setpoint[i], -16);
    reference_state *s = &self->state;
    int64_t now = turned(s->head[i], goal, most);
    int64_t later = turned(now, goal, most);
    int64_t last = turned(later, goal, most);
    s->past[i] = s->now[i];
    s->head[i] = now;
    s->head_rate[i] = 0;
    s->now[i] = wrap32(shift_round(now, 16));
    s->next[i] = wrap32(shift_round(later, 16));
    s->ahead[i] = wrap32(shift_round(last, 16));
    s->rate_now[i] = sat32(shift_round(wrap_bits(later - now, 48), 12));
    s->rate_next[i] = sat32(shift_round(wrap_bits(last - later, 48), 12));
    s->accel[i] = 0;
}

static void advance_axis(reference *self, const law_input *in, int i) {
    const reference_par *par = &self->par;
    reference_state *s = &self->state;
    int64_t position = s->head[i], rate = s->head_rate[i];
    int32_t error = wrap32(in->setpoint[i] - shift_round(position, 16));
    int64_t wanted = mul_wide(par->k1, error, 30) - mul_wide(rate, par->k2, 30);
    int64_t accel = clip(wanted, -par->accel_max, par->accel_max);
    int64_t rate_new = clip(rate + accel, -par->rate_max, par->rate_max);
    if (rate_new == RATE_LIMIT_48 || rate_new == -RATE_LIMIT_48) {
        s->saturated = 1;
    }
    accel = rate_new - rate;
    position += rate + (par->kind == COMMON_REFERENCE_KIND_PAPER ? accel : shift_round(accel, 1));
    position = wrap_bits(position, 48);
    s->head[i] = position;
    s->head_rate[i] = rate_new;
    int32_t head = wrap32(shift_round(position, 16));
    s->accel[i] = sat32(shift_round(accel, 12));
    s->past[i] = s->now[i];
    if (s->lead == 2) {
        s->now[i] = s->next[i];
        s->next[i] = s->ahead[i];
        s->ahead[i] = head;
        s->rate_now[i] = s->rate_next[i];
        s->rate_next[i] = sat32(shift_round(rate, 12));
    } else {
        s->now[i] = s->next[i];
        s->next[i] = head;
        s->ahead[i] = wrap32(shift_round(position + rate_new, 16));
        s->rate_now[i] = sat32(shift_round(rate, 12));
        s->rate_next[i] = sat32(shift_round(rate_new, 12));
    }
}

bool reference_advance(reference *self, const law_input *in) {
    const reference_par *par = &self->par;
    reference_state *s = &self->state;
    bool started = false;
    if (s->started == 0) {
        if (in->fresh == 0) {
            return false;
        }
        for (int i = 0; i < 3; i++) {
            reference_restart(self, i, in->euler[i], 0);
            int64_t rate = mul_wide(par->start, wrap32(wide(in->setpoint[i]) - in->euler[i]), 30);
            s->head_rate[i] = clip(rate, -par->rate_max, par->rate_max);
        }
        s->started = 1;
        started = true;
    }
    for (int i = 0; i < 3; i++) {
        if (par->kind == COMMON_REFERENCE_KIND_NONE) {
            follow_axis(self, in, i);
        } else {
            advance_axis(self, in, i);
        }
    }
    return started;
}

void reference_words(const reference *self, int32_t words[6]) {
    for (int i = 0; i < 3; i++) {
        words[i] = self->state.now[i];
        words[3 + i] = sat32(shift_round(self->state.rate_now[i], 4));
    }
}
