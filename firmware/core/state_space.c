/* The law state_space, fixed form; firmware_sim/controllers/state_space.py has the same functions and the equations. */
#include "state_space.h"

#include "attitude_error.h"
#include "fixed.h"
#include "generated/frames.h"
#include "generated/law_tables.h"

#define ORDER 8
#define SQUARE 64
#define BITS 28   /* of a coefficient */
#define BELOW 16  /* bits of a state below those that are multiplied */
#define STATE_MAX INT64_C(140737488289792) /* (2^31 - 1) 2^BELOW */
#define SHIFT_MAX 62

/* -- parameters ------------------------------------------------------------------------------------------------------- */

/* The numbers with BITS bits for the largest, and the shift that takes their products with product_bits more bits to the scale
 * of the sum; all zero where they are negligible. False: so large that nothing else would be left of that scale. */
static bool shifted(const int64_t *numbers, int32_t count, int32_t bits, int32_t product_bits, int32_t *values, int32_t *shift) {
    int64_t peak = 0;
    for (int32_t i = 0; i < count; i++) {
        peak = magnitude(numbers[i]) > peak ? magnitude(numbers[i]) : peak;
    }
    int32_t s = norm_shift(peak) + BITS - 31;
    *shift = bits + s + product_bits;
    bool negligible = peak == 0 || *shift > SHIFT_MAX;
    for (int32_t i = 0; i < count; i++) {
        values[i] = negligible ? 0 : (int32_t)shift_round(numbers[i], -s);
    }
    if (negligible) {
        *shift = 1;
    }
    return *shift >= 0;
}

/* The last index that has a number other than zero. */
static int32_t order_of(const int32_t *params) {
    const int32_t *A = params + STATE_SPACE_A_1_1, *B = params + STATE_SPACE_B_1, *C = params + STATE_SPACE_C_1;
    for (int32_t n = ORDER; n > 0; n--) {
        if (B[n - 1] != 0 || C[n - 1] != 0) {
            return n;
        }
        for (int32_t j = 0; j < ORDER; j++) {
            if (A[ORDER * (n - 1) + j] != 0 || A[ORDER * j + n - 1] != 0) {
                return n;
            }
        }
    }
    return 0;
}

/* A - I, zero beyond the order. */
static void identity_less(const int32_t *params, int32_t n, int64_t *numbers) {
    const int64_t one = shift_round(1, -params[STATE_SPACE_A_BITS]);
    for (int32_t j = 0; j < ORDER; j++) {
        for (int32_t m = 0; m < ORDER; m++) {
            int64_t less = params[STATE_SPACE_A_1_1 + ORDER * j + m] - (j == m ? one : 0);
            numbers[ORDER * j + m] = j < n && m < n ? less : 0;
        }
    }
}

/* C and D times the gain of axis i. */
static bool outputs(state_space_par *par, const int32_t *common, const int32_t *params, int i) {
    const int32_t gain = params[STATE_SPACE_GAIN_X + i], more = params[STATE_SPACE_AXIS_GAIN_BITS];
    const int32_t torque = common[COMMON_TORQUE_BITS];
    int64_t row[ORDER], direct = mul_q(params[STATE_SPACE_D], gain, 0);
    for (int32_t j = 0; j < ORDER; j++) {
        row[j] = mul_q(params[STATE_SPACE_C_1 + j], gain, 0);
    }
    return shifted(row, ORDER, params[STATE_SPACE_C_BITS] + more, params[STATE_SPACE_STATE_BITS] - torque, &par->C[ORDER * i],
                   &par->C_shift[i]) &&
           shifted(&direct, 1, params[STATE_SPACE_D_BITS] + more, 29 - torque, &par->D[i], &par->D_shift[i]);
}

static bool state_space_init(void *memory, const int32_t *common, const int32_t *params) {
    state_space *self = memory;
    state_space_par *par = &self->par;
    int64_t numbers[SQUARE];
    *self = (state_space){0};
    par->order = order_of(params);
    par->anti_windup = params[STATE_SPACE_ANTI_WINDUP];
    par->error_kind = params[STATE_SPACE_ERROR];
    par->sequence = common[COMMON_ATTITUDE_SEQUENCE];
    identity_less(params, par->order, numbers);
    bool fits = shifted(numbers, SQUARE, params[STATE_SPACE_A_BITS], -BELOW, par->A, &par->A_shift);
    for (int32_t j = 0; j < ORDER; j++) {
        numbers[j] = params[STATE_SPACE_B_1 + j];
    }
    int32_t scale = 29 - BELOW - params[STATE_SPACE_STATE_BITS];
    fits = shifted(numbers, ORDER, params[STATE_SPACE_B_BITS], scale, par->B, &par->B_shift) && fits;
    for (int i = 0; i < 3; i++) {
        par->limit[i] = (int32_t)clip(common[COMMON_TORQUE_LIMIT_X + i], 0, INT32_MAX);
        fits = outputs(par, common, params, i) && fits;
    }
    return fits;
}

/* -- one tick --------------------------------------------------------------------------------------------------------- */

/* A state within its range; what is beyond is said. */
static int64_t kept(state_space_state *s, int64_t x) {
    if (x < -STATE_MAX || x > STATE_MAX) {
        s->arithmetic = 1;
    }
    return clip(x, -STATE_MAX, STATE_MAX);
}

/* Output of axis i, then its next states; true at the limit. */
static bool step_axis(state_space *self, int i) {
    const state_space_par *par = &self->par;
    state_space_state *s = &self->state;
    const int32_t n = par->order, e = s->error[i], *C = &par->C[ORDER * i];
    int64_t *x = &s->x[ORDER * i], now = 0, later = 0;
    for (int32_t j = 0; j < n; j++) {
        s->high[j] = (int32_t)shift_round(x[j], BELOW);
        now = sum64(now, mul_q(C[j], s->high[j], 0));
    }
    int64_t u = sum64(shift_round(now, par->C_shift[i]), mul_q(par->D[i], e, par->D_shift[i]));
    s->command[i] = (int32_t)clip(u, -par->limit[i], par->limit[i]);
    for (int32_t j = 0; j < n; j++) {
        const int32_t *A = &par->A[ORDER * j];
        int64_t row = 0;
        for (int32_t m = 0; m < n; m++) {
            row = sum64(row, mul_q(A[m], s->high[m], 0));
        }
        int64_t change = sum64(shift_round(row, par->A_shift), mul_q(par->B[j], e, par->B_shift));
        s->next[j] = kept(s, sum64(x[j], change));
        later = sum64(later, mul_q(C[j], shift_round(s->next[j], BELOW), 0));
    }
    bool limited = s->command[i] != u;
    bool outwards = u > 0 ? later > now : later < now;
    if (!(par->anti_windup != 0 && limited && outwards)) {
        for (int32_t j = 0; j < n; j++) {
            x[j] = s->next[j];
        }
    }
    return limited;
}

static void state_space_step(void *memory, const law_input *in, reference *ref, law_output *out) {
    state_space *self = memory;
    state_space_state *s = &self->state;
    s->arithmetic = 0;
    out->flags = s->started == 0 && in->fresh == 0 ? FLAG_STARTING : 0;
    if (in->fresh != 0) {
        s->started = 1;
        attitude_error(self->par.error_kind, self->par.sequence, ref->state.now, in->euler, s->error);
        for (int i = 0; i < 3; i++) {
            if (step_axis(self, i)) {
                out->flags = FLAG_SATURATED;
            }
        }
    }
    for (int i = 0; i < 3; i++) {
        out->torque[i] = s->command[i];
    }
    if (s->arithmetic != 0) {
        out->flags += FLAG_ARITHMETIC;
    }
}

static bool state_space_reference_restarted(const void *memory) {
    (void)memory;
    return false;
}

static size_t state_space_telemetry(const void *memory, int32_t *words) {
    const state_space *self = memory;
    for (int i = 0; i < 3; i++) {
        words[STATE_SPACE_TELEMETRY_ERROR_X + i] = self->state.error[i];
    }
    return STATE_SPACE_TELEMETRY_WORDS;
}

const law STATE_SPACE_LAW = {
    .id = STATE_SPACE_LAW_ID,
    .version = STATE_SPACE_LAW_VERSION,
    .size = sizeof(state_space),
    .has_model = false,
    .init = state_space_init,
    .step = state_space_step,
    .reference_restarted = state_space_reference_restarted,
    .telemetry = state_space_telemetry,
};
