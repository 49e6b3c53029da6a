/* Attitude error, fixed form; firmware_sim/controllers/attitude_error.py has the same functions. */
#include "attitude_error.h"

#include "fixed.h"
#include "generated/law_tables.h"

/* q, Q30, of the angles [x, y, z] in bam. */
static void quaternion(int32_t sequence, const int32_t angles[3], int64_t q[4]) {
    const int64_t x = shift_round(angles[0], 1), y = shift_round(angles[1], 1), z = shift_round(angles[2], 1);
    const int32_t sx = sin_q(x), cx = cos_q(x), sy = sin_q(y), cy = cos_q(y), sz = sin_q(z), cz = cos_q(z);
    int64_t cc = mul_q(cy, cz, 30), ss = mul_q(sy, sz, 30), sc = mul_q(sy, cz, 30), cs = mul_q(cy, sz, 30);
    int64_t w2 = mul_q(sx, ss, 30), x2 = -mul_q(cx, ss, 30), y2 = mul_q(sx, cs, 30), z2 = -mul_q(sx, sc, 30);
    if (sequence != COMMON_ATTITUDE_SEQUENCE_321) {
        w2 = -w2;
        x2 = -x2;
        y2 = -y2;
        z2 = -z2;
    }
    q[0] = mul_q(cx, cc, 30) + w2;
    q[1] = mul_q(sx, cc, 30) + x2;
    q[2] = mul_q(cx, sc, 30) + y2;
    q[3] = mul_q(cx, cs, 30) + z2;
}

void attitude_error(int32_t kind, int32_t sequence, const int32_t y[3], const int32_t r[3], int32_t e[3]) {
    if (kind == ERROR_EULER) {
        for (int i = 0; i < 3; i++) {
            e[i] = (int32_t)mul_q(wrap32(wide(y[i]) - r[i]), TWO_PI_Q28, 31);
        }
        return;
    }
    int64_t p[4], q[4];
    quaternion(sequence, y, p);
    quaternion(sequence, r, q);
    int64_t w = mul_q(p[0], q[0], 30) + mul_q(p[1], q[1], 30) + mul_q(p[2], q[2], 30) + mul_q(p[3], q[3], 30);
    int64_t x = mul_q(p[1], q[0], 30) - mul_q(p[0], q[1], 30) + mul_q(p[2], q[3], 30) - mul_q(p[3], q[2], 30);
    int64_t v = mul_q(p[2], q[0], 30) - mul_q(p[0], q[2], 30) + mul_q(p[3], q[1], 30) - mul_q(p[1], q[3], 30);
    int64_t z = mul_q(p[3], q[0], 30) - mul_q(p[0], q[3], 30) + mul_q(p[1], q[2], 30) - mul_q(p[2], q[1], 30);
    e[0] = (int32_t)(w >= 0 ? x : -x);
    e[1] = (int32_t)(w >= 0 ? v : -v);
    e[2] = (int32_t)(w >= 0 ? z : -z);
}
