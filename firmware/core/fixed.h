/* The named integer operations of the laws, bit for bit those of firmware_sim/fixed.py: int32 in memory, int64 between.
 *
 * All of them are defined for every argument; where a product or sum leaves int64 it wraps, as it does in the compiled
 * Python. The laws use these instead of raw * / % << >> (tools/check_c_operations.py holds them to it).
 *
 *     bam     angle, 2^-32 turn, int32; differences modulo 2^32
 *     turn36  angle, rate per sample or acceleration per sample^2, 2^-36 turn, int32
 *     Qn      value * 2^n
 */
#ifndef CORE_FIXED_H
#define CORE_FIXED_H

#include <stdint.h>

#define ALWAYS_INLINE static inline __attribute__((always_inline))
#define ONE_Q(n) (INT64_C(1) << (n)) /* 1 with n fractional bits */
#define TWO_PI_Q28 INT64_C(1686629713)
#define INV_TWO_PI_Q34 INT64_C(2734261102)

/* x as 64 bits: what comes next to it in a sum or difference cannot overflow. */
static inline int64_t wide(int32_t x) { return x; }

/* a + b, a - b and a * b modulo 2^64. */
static inline int64_t sum64(int64_t a, int64_t b) { return (int64_t)((uint64_t)a + (uint64_t)b); }
static inline int64_t difference64(int64_t a, int64_t b) { return (int64_t)((uint64_t)a - (uint64_t)b); }
static inline int64_t product64(int64_t a, int64_t b) { return (int64_t)((uint64_t)a * (uint64_t)b); }

/* The absolute value of x; -2^63 stays what it is. */
static inline int64_t magnitude(int64_t x) { return x < 0 ? difference64(0, x) : x; }

static inline int64_t smaller(int64_t a, int64_t b) { return a < b ? a : b; }

/* The lowest n bits of x as a signed number: x modulo 2^n in [-2^(n-1), 2^(n-1)); 2 <= n <= 62. */
static inline int64_t wrap_bits(int64_t x, int32_t n) {
    uint64_t half = UINT64_C(1) << (n - 1);
    return (int64_t)((((uint64_t)x + half) & ((half << 1) - 1)) - half);
}

/* x modulo 2^32 as int32: sums and differences of angles in bam. */
static inline int32_t wrap32(int64_t x) { return (int32_t)(uint32_t)(uint64_t)x; }

/* x limited to [low, high]. */
static inline int64_t clip(int64_t x, int64_t low, int64_t high) { return x < low ? low : (x > high ? high : x); }

/* x limited to int32. */
static inline int32_t sat32(int64_t x) { return x < INT32_MIN ? INT32_MIN : (x > INT32_MAX ? INT32_MAX : (int32_t)x); }

/* a + b and a - b limited to int32. */
static inline int32_t add_sat(int64_t a, int64_t b) { return sat32(sum64(a, b)); }
static inline int32_t sub_sat(int64_t a, int64_t b) { return sat32(difference64(a, b)); }

ALWAYS_INLINE int64_t rounded(int64_t x, int32_t n) {
    if (n > 0) {
        return sum64(x, (int64_t)(UINT64_C(1) << (n - 1))) >> n; /* of a negative number: arithmetic, in every compiler */
    }
    return (int64_t)((uint64_t)x << -n);
}

/* rounded(), out of line: for an n that only the running program knows it is long. */
int64_t rounded_by(int64_t x, int32_t n);

/* x / 2^n, rounded to nearest, half up (arithmetic shift of x + 2^(n-1)); n <= 0: x * 2^-n. |n| <= 63. */
ALWAYS_INLINE int64_t shift_round(int64_t x, int32_t n) {
    return __builtin_constant_p(n) ? rounded(x, n) : rounded_by(x, n);
}

/* a b / 2^n, rounded half up; the product must fit int64. */
ALWAYS_INLINE int64_t mul_q(int64_t a, int64_t b, int32_t n) { return shift_round(product64(a, b), n); }

/* a b / 2^n for a 64-bit a and a 32-bit b, 1 <= n <= 62, the product up to 95 bits, the result in int64.
 * Rounded half up for n <= 32; beyond, the product is first cut (floor) at 2^32, then rounded. */
static inline int64_t mul_wide(int64_t a, int32_t b, int32_t n) {
    int64_t high = product64(a >> 32, b);
    int64_t low = product64(a & INT64_C(0xFFFFFFFF), b);
    if (n > 32) {
        return shift_round(sum64(high, low >> 32), n - 32);
    }
    return sum64(shift_round(high, n - 32), shift_round(low, n));
}

/* x limited to int32; *flag becomes 1 if that changed it. For what must never wrap silently. */
static inline int32_t keep32(int64_t x, int32_t *flag) {
    if (x < INT32_MIN || x > INT32_MAX) {
        *flag = 1;
    }
    return sat32(x);
}

/* a / b towards zero; division by zero gives INT32_MAX with the sign of a, and 0 / 0 is 0. */
int64_t div_trunc(int64_t a, int64_t b);

/* s with 2^30 <= x * 2^s < 2^31 for x > 0 (s < 0: a right shift); 0 for x <= 0. */
int32_t norm_shift(int64_t x);

/* sin and cos, Q30, of an angle in bam (any multiple of a turn may be added); error at most 2^-30. */
int32_t sin_q(int64_t angle);
int32_t cos_q(int64_t angle);

/* atan2(y, x) in bam; atan2_q(0, 0) = 0; error at most 2 bam (2^-28 rad). */
int32_t atan2_q(int32_t y, int32_t x);

#endif
