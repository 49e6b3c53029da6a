/* One gain by recursive least squares, fixed form; firmware_sim/controllers/gain.py has the same functions. */
#include "gain.h"

#include "fixed.h"

void second_differences(const int32_t y[3], const int32_t y1[3], const int32_t y2[3], int32_t z[3]) {
    for (int i = 0; i < 3; i++) {
        int64_t now = wrap32(wide(y[i]) - y1[i]), before = wrap32(wide(y1[i]) - y2[i]);
        z[i] = sat32(shift_round(now - before, -4));
    }
}

int32_t washed(int32_t states[3], int32_t x) {
    states[0] = sat32(states[0] + mul_q(wide(x) - states[0], 214748365, 30)); /* 0.2 */
    states[1] = sat32(states[1] + mul_q(wide(states[0]) - states[1], 214748365, 30));
    states[2] = sat32(states[2] + mul_q(wide(states[1]) - states[2], 32212255, 30)); /* 0.03 */
    return sat32(mul_q(sub_sat(states[1], states[2]), 843314857, 28));
}

/* P c Q44, denominator Q50, gain Q20. */
void learn(int32_t *g, int32_t *P, int32_t x, int32_t c) {
    if (magnitude(c) <= 3435974) { /* 1e-4 */
        return;
    }
    int64_t p = smaller(wide(*P) + 17180, 1717986918); /* 1e-6, 0.1 */
    int64_t pc = mul_q(p, c, 25);
    int64_t denominator = 112589991 + mul_q(shift_round(pc, 7), c, 22); /* 1e-7 */
    int32_t gain = sat32(div_trunc(shift_round(pc, -26), denominator));
    int32_t error = sat32(x - mul_q(c, *g, 28));
    *g = (int32_t)clip(*g + mul_q(gain, error, 27), 161061274, 456340275); /* 0.6, 1.7 */
    *P = (int32_t)clip(p - mul_q(sat32(mul_q(gain, c, 25)), p, 30), 0, 1717986918);
}
