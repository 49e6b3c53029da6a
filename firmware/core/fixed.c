/* The larger of the named operations, out of line: division, normalising, sine, cosine and arc tangent. */
#include "fixed.h"

#include <stdbool.h>

int64_t rounded_by(int64_t x, int32_t n) { return rounded(x, n); }

int64_t div_trunc(int64_t a, int64_t b) {
    uint64_t n = (uint64_t)magnitude(a), d = (uint64_t)magnitude(b), quotient;
    if (b == 0) {
        return a == 0 ? 0 : (a > 0 ? INT32_MAX : -INT32_MAX);
    }
    if ((n | d) >> 32 == 0) { /* the same quotient, by the processor's own division */
        quotient = (uint32_t)n / (uint32_t)d;
    } else {
        quotient = n / d;
    }
    return (a < 0) == (b < 0) ? (int64_t)quotient : difference64(0, (int64_t)quotient);
}

int32_t norm_shift(int64_t x) {
    int32_t s = 0;
    if (x <= 0) {
        return 0;
    }
    for (; x >= ONE_Q(31); x >>= 1) {
        s -= 1;
    }
    for (; x < ONE_Q(30); x <<= 1) {
        s += 1;
    }
    return s;
}

/* sin, Q32, of r in bam, |r| <= 1/8 turn; Taylor polynomial of degree 11. */
static int64_t sin_eighth(int64_t r) {
    int64_t t = mul_q(r, TWO_PI_Q28, 29); /* rad Q31 */
    int64_t z = mul_q(t, t, 30);          /* t^2, Q32 */
    int64_t p = 11836 - mul_q(z, 108, 32);
    p = mul_q(z, p, 32) - 852176;
    p = mul_q(z, p, 32) + 35791394;
    p = mul_q(z, p, 32) - 715827883;
    return shift_round(t, -1) + mul_q(mul_q(z, p, 32), t, 31);
}

/* cos, Q32, of r in bam, |r| <= 1/8 turn; Taylor polynomial of degree 12. */
static int64_t cos_eighth(int64_t r) {
    int64_t t = mul_q(r, TWO_PI_Q28, 29);
    int64_t z = mul_q(t, t, 30);
    int64_t p = mul_q(z, 9, 32) - 1184;
    p = mul_q(z, p, 32) + 106522;
    p = mul_q(z, p, 32) - 5965232;
    p = mul_q(z, p, 32) + 178956971;
    p = mul_q(z, p, 32) - ONE_Q(31);
    return ONE_Q(32) + mul_q(z, p, 32);
}

int32_t sin_q(int64_t angle) {
    int64_t quarter = (wrap32(angle) + ONE_Q(29)) >> 30; /* nearest quarter turn, -2 .. 2 */
    int64_t r = wrap32(angle) - shift_round(quarter, -30);
    int64_t s = (quarter & 1) == 1 ? cos_eighth(r) : sin_eighth(r);
    return (int32_t)shift_round((quarter & 3) < 2 ? s : -s, 2);
}

int32_t cos_q(int64_t angle) { return sin_q(sum64(angle, ONE_Q(30))); }

/* atan(num / den) on [0, 1]; above tan(1/16 turn) as 1/8 turn - atan((den - num) / (den + num)). */
int32_t atan2_q(int32_t y, int32_t x) {
    int64_t ay = magnitude(y), ax = magnitude(x);
    int64_t num = smaller(ay, ax), den = ay <= ax ? ax : ay;
    bool upper = mul_q(den, 1779033704, 32) < num; /* tan(1/16 turn) in Q32 */
    if (upper) {
        int64_t difference = den - num;
        den += num;
        num = difference;
    }
    int64_t q = den > 0 ? div_trunc(shift_round(num, -31), den) : 0;
    int64_t z = mul_q(q, q, 30);
    int64_t p = 190766450 - mul_q(z, 103080864, 32);
    p = mul_q(z, p, 32) - 245897367;
    p = mul_q(z, p, 32) + 303599564;
    p = mul_q(z, p, 32) - 390599893;
    p = mul_q(z, p, 32) + 546852034;
    p = mul_q(z, p, 32) - 911420366;
    p = mul_q(z, p, 32) + INV_TWO_PI_Q34;
    int64_t a = mul_q(p, q, 33);
    a = upper ? ONE_Q(29) - a : a;
    a = ay > ax ? ONE_Q(30) - a : a;
    a = x < 0 ? ONE_Q(31) - a : a;
    return wrap32(y >= 0 ? a : -a);
}
