/* Euler angles 3-2-1 and torque scales, fixed form; firmware_sim/controllers/kinematics.py has the same functions. */
#include "kinematics.h"

#include "fixed.h"
#include "generated/law_tables.h"

int32_t rad(int32_t x) { return sat32(mul_q(x, TWO_PI_Q28, 34)); }

void inverse(const int32_t angles[3], const int32_t v[3], const int32_t a[3], int32_t body[3]) {
    const int32_t sf = sin_q(angles[0]), cf = cos_q(angles[0]), st = sin_q(angles[1]), ct = cos_q(angles[1]);
    const int32_t r1 = rad(v[0]), r2 = rad(v[1]);
    int64_t v3_ct = mul_q(v[2], ct, 30);
    int64_t x = a[0] - mul_q(a[2], st, 30) - mul_q(v3_ct, r2, 30);
    int32_t y = sat32(a[1] + mul_q(v3_ct, r1, 30));
    int32_t z = sat32(mul_q(a[2], ct, 30) - mul_q(v[1], r1, 30) - mul_q(mul_q(v[2], st, 30), r2, 30));
    body[0] = sat32(x);
    body[1] = sat32(mul_q(y, cf, 30) + mul_q(z, sf, 30));
    body[2] = sat32(mul_q(z, cf, 30) - mul_q(y, sf, 30));
}

void forward(const int32_t angles[3], const int32_t v[3], const int32_t b[3], int32_t euler[3]) {
    const int32_t sf = sin_q(angles[0]), cf = cos_q(angles[0]), st = sin_q(angles[1]), ct = cos_q(angles[1]);
    const int32_t r1 = rad(v[0]), r2 = rad(v[1]);
    int64_t v3_ct = mul_q(v[2], ct, 30);
    int64_t y = mul_q(b[1], cf, 30) - mul_q(b[2], sf, 30);
    int64_t z = mul_q(b[1], sf, 30) + mul_q(b[2], cf, 30) + mul_q(v[1], r1, 30) + mul_q(mul_q(v[2], st, 30), r2, 30);
    int32_t a3 = sat32(div_trunc(shift_round(sat32(z), -30), ct > 214748365 ? ct : 214748365)); /* 0.2 */
    euler[0] = sat32(b[0] + mul_q(a3, st, 30) + mul_q(v3_ct, r2, 30));
    euler[1] = sat32(y - mul_q(v3_ct, r1, 30));
    euler[2] = a3;
}

/* 1e-12 / (2 pi): turns of acceleration per sample^2 from torque/inertia and a period in us, as mantissa 2^-73. */
#define TURNS_PER_US2_Q73 1503175938

/* Mantissa and shift with turn36/sample^2 = torque (N m Q28) m 2^-n: T_s^2 2^36 / (2 pi I 2^28). */
static void drive(int32_t period_us, int32_t inertia_q26, int32_t *mantissa, int32_t *shift) {
    int64_t square = mul_q(period_us, period_us, 0);
    int32_t s = norm_shift(square);
    int64_t quotient = div_trunc(mul_q(shift_round(square, -s), TURNS_PER_US2_Q73, 0), inertia_q26);
    int32_t t = norm_shift(quotient);
    *mantissa = (int32_t)clip(shift_round(quotient, -t), 0, INT32_MAX);
    *shift = s + t + 73 - 26 - 8;
}

void torque_scales(int32_t period_us, const int32_t inertia_q26[3], int32_t torque_of[3], int32_t drive_of[3],
                   int32_t demand_shift[3], int32_t drive_shift[3]) {
    for (int i = 0; i < 3; i++) {
        drive(period_us, inertia_q26[i], &drive_of[i], &drive_shift[i]);
        torque_of[i] = (int32_t)clip(div_trunc(ONE_Q(61), drive_of[i]), 0, INT32_MAX); /* the inverse */
        demand_shift[i] = 61 - drive_shift[i];
    }
}

void torque_limits(const int32_t *common, int32_t limits[3]) {
    const int32_t bits = common[COMMON_TORQUE_BITS] - 28;
    for (int i = 0; i < 3; i++) {
        int32_t word = common[COMMON_TORQUE_LIMIT_X + i];
        if (bits > 0) {
            limits[i] = (int32_t)div_trunc(word, shift_round(1, -bits)); /* never above the limit */
        } else {
            limits[i] = (int32_t)clip(shift_round(word, bits), 0, INT32_MAX);
        }
    }
}
