/* The named operations as functions of a shared library, for the tests to call one by one. */
#include "fixed.h"

#define EXPORT __attribute__((visibility("default")))

int64_t c_wrap_bits(int64_t x, int32_t n);
int64_t c_wrap32(int64_t x);
int64_t c_clip(int64_t x, int64_t low, int64_t high);
int64_t c_sat32(int64_t x);
int64_t c_add_sat(int64_t a, int64_t b);
int64_t c_sub_sat(int64_t a, int64_t b);
int64_t c_shift_round(int64_t x, int32_t n);
int64_t c_mul_q(int64_t a, int64_t b, int32_t n);
int64_t c_mul_wide(int64_t a, int32_t b, int32_t n);
int64_t c_div_trunc(int64_t a, int64_t b);
int64_t c_norm_shift(int64_t x);
int64_t c_sin_q(int64_t angle);
int64_t c_cos_q(int64_t angle);
int64_t c_atan2_q(int32_t y, int32_t x);
int64_t c_keep32(int64_t x, int32_t *flag);

EXPORT int64_t c_wrap_bits(int64_t x, int32_t n) { return wrap_bits(x, n); }
EXPORT int64_t c_wrap32(int64_t x) { return wrap32(x); }
EXPORT int64_t c_clip(int64_t x, int64_t low, int64_t high) { return clip(x, low, high); }
EXPORT int64_t c_sat32(int64_t x) { return sat32(x); }
EXPORT int64_t c_add_sat(int64_t a, int64_t b) { return add_sat(a, b); }
EXPORT int64_t c_sub_sat(int64_t a, int64_t b) { return sub_sat(a, b); }
EXPORT int64_t c_shift_round(int64_t x, int32_t n) { return shift_round(x, n); }
EXPORT int64_t c_mul_q(int64_t a, int64_t b, int32_t n) { return mul_q(a, b, n); }
EXPORT int64_t c_mul_wide(int64_t a, int32_t b, int32_t n) { return mul_wide(a, b, n); }
EXPORT int64_t c_div_trunc(int64_t a, int64_t b) { return div_trunc(a, b); }
EXPORT int64_t c_norm_shift(int64_t x) { return norm_shift(x); }
EXPORT int64_t c_sin_q(int64_t angle) { return sin_q(angle); }
EXPORT int64_t c_cos_q(int64_t angle) { return cos_q(angle); }
EXPORT int64_t c_atan2_q(int32_t y, int32_t x) { return atan2_q(y, x); }
EXPORT int64_t c_keep32(int64_t x, int32_t *flag) { return keep32(x, flag); }
