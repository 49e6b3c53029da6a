"""The named integer operations of the fixed forms: int32 values, int64 intermediates, nothing else.

The C firmware reproduces each of them bit for bit, so all of them are plain functions over integers whose every
intermediate fits int64. Numba compiles them; un-jitted, with Python integers, the same source runs in checked mode
(firmware_sim/checked.py), where check32 and check64 raise and record instead of passing their argument on.

    bam     angle, 2^-32 turn, int32; differences modulo 2^32
    turn36  angle, rate per sample or acceleration per sample^2, 2^-36 turn, int32
    Qn      value * 2^n
"""

from __future__ import annotations

import numpy as np

from firmware_sim.jit import callee

INT32_MIN, INT32_MAX = -(2**31), 2**31 - 1
MASK32 = 0xFFFFFFFF
TWO_PI_Q28 = 1686629713
INV_TWO_PI_Q34 = 2734261102


@callee
def check64(x: int) -> int:
    """x, which must fit int64."""
    return x


@callee
def check32(x: int) -> int:
    """x, which must fit int32."""
    return x


@callee
def wrap_bits(x: int, n: int) -> int:
    """The lowest n bits of x as a signed number: x modulo 2^n in [-2^(n-1), 2^(n-1)); 2 <= n <= 62."""
    return ((x + (1 << (n - 1))) & ((1 << n) - 1)) - (1 << (n - 1))


@callee
def wrap32(x: int) -> int:
    """x modulo 2^32 as int32: sums and differences of angles in bam."""
    return ((x + 0x80000000) & 0xFFFFFFFF) - 0x80000000


@callee
def clip(x: int, low: int, high: int) -> int:
    """x limited to [low, high]."""
    return low if x < low else (high if x > high else x)


@callee
def sat32(x: int) -> int:
    """x limited to int32."""
    return -2147483648 if x < -2147483648 else (2147483647 if x > 2147483647 else x)


@callee
def add_sat(a: int, b: int) -> int:
    """a + b limited to int32."""
    return sat32(check64(a + b))


@callee
def sub_sat(a: int, b: int) -> int:
    """a - b limited to int32."""
    return sat32(check64(a - b))


@callee
def shift_round(x: int, n: int) -> int:
    """x / 2^n, rounded to nearest, half up (arithmetic shift of x + 2^(n-1)); n <= 0: x * 2^-n."""
    if n > 0:
        return check64(x + (1 << (n - 1))) >> n
    return check64(x << -n)


@callee
def mul_q(a: int, b: int, n: int) -> int:
    """a b / 2^n, rounded half up; the product must fit int64."""
    return shift_round(check64(a * b), n)


@callee
def mul_wide(a: int, b: int, n: int) -> int:
    """a b / 2^n for a 64-bit a and a 32-bit b, 1 <= n <= 62, the product up to 95 bits, the result in int64.

    Rounded half up for n <= 32; beyond, the product is first cut (floor) at 2^32, then rounded.
    """
    high = check64((a >> 32) * check32(b))
    low = check64((a & 0xFFFFFFFF) * b)
    if n > 32:
        return shift_round(check64(high + (low >> 32)), n - 32)
    return check64(check64(high << (32 - n)) + shift_round(low, n))


@callee
def div_trunc(a: int, b: int) -> int:
    """a / b towards zero, as in C; division by zero gives INT32_MAX with the sign of a, and 0 / 0 is 0."""
    if b == 0:
        return 0 if a == 0 else (2147483647 if a > 0 else -2147483647)
    quotient = abs(a) // abs(b)
    return check64(quotient if (a < 0) == (b < 0) else -quotient)


@callee
def norm_shift(x: int) -> int:
    """s with 2^30 <= x * 2^s < 2^31 for x > 0 (s < 0: a right shift); 0 for x <= 0."""
    if x <= 0:
        return 0
    s = 0
    while x >= 2147483648:
        x = x >> 1
        s -= 1
    while x < 1073741824:
        x = x << 1
        s += 1
    return s


@callee
def sin_eighth(r: int) -> int:
    """sin, Q32, of r in bam, |r| <= 1/8 turn; Taylor polynomial of degree 11."""
    t = mul_q(r, 1686629713, 29)  # rad Q31
    z = mul_q(t, t, 30)  # t^2, Q32
    p = 11836 - mul_q(z, 108, 32)
    p = mul_q(z, p, 32) - 852176
    p = mul_q(z, p, 32) + 35791394
    p = mul_q(z, p, 32) - 715827883
    return shift_round(t, -1) + mul_q(mul_q(z, p, 32), t, 31)


@callee
def cos_eighth(r: int) -> int:
    """cos, Q32, of r in bam, |r| <= 1/8 turn; Taylor polynomial of degree 12."""
    t = mul_q(r, 1686629713, 29)
    z = mul_q(t, t, 30)
    p = mul_q(z, 9, 32) - 1184
    p = mul_q(z, p, 32) + 106522
    p = mul_q(z, p, 32) - 5965232
    p = mul_q(z, p, 32) + 178956971
    p = mul_q(z, p, 32) - 2147483648
    return 4294967296 + mul_q(z, p, 32)


@callee
def sin_q(angle: int) -> int:
    """sin, Q30, of an angle in bam (any multiple of a turn may be added); error at most 2^-30."""
    quarter = (wrap32(angle) + 536870912) >> 30  # nearest quarter turn, -2 .. 2
    r = wrap32(angle) - (quarter << 30)
    q = quarter & 3
    s = cos_eighth(r) if (q & 1) == 1 else sin_eighth(r)
    return shift_round(s if q < 2 else -s, 2)


@callee
def cos_q(angle: int) -> int:
    """cos, Q30, of an angle in bam; error at most 2^-30."""
    return sin_q(angle + 1073741824)


@callee
def atan2_q(y: int, x: int) -> int:
    """atan2(y, x) in bam for int32 y and x; atan2_q(0, 0) = 0; error at most 2 bam (2^-28 rad).

    atan(num / den) on [0, 1]; above tan(1/16 turn) as 1/8 turn - atan((den - num) / (den + num)).
    """
    ay, ax = abs(y), abs(x)
    num, den = (ay, ax) if ay <= ax else (ax, ay)
    upper = mul_q(den, 1779033704, 32) < num  # tan(1/16 turn) in Q32
    if upper:
        num, den = den - num, den + num
    q = div_trunc(num << 31, den) if den > 0 else 0
    z = mul_q(q, q, 30)
    p = 190766450 - mul_q(z, 103080864, 32)
    p = mul_q(z, p, 32) - 245897367
    p = mul_q(z, p, 32) + 303599564
    p = mul_q(z, p, 32) - 390599893
    p = mul_q(z, p, 32) + 546852034
    p = mul_q(z, p, 32) - 911420366
    p = mul_q(z, p, 32) + 2734261102
    a = mul_q(p, q, 33)
    if upper:
        a = 536870912 - a
    if ay > ax:
        a = 1073741824 - a
    if x < 0:
        a = 2147483648 - a
    return wrap32(a if y >= 0 else -a)


@callee
def keep32(x: int, state: np.ndarray, flag: int) -> int:
    """x limited to int32; state[flag] becomes 1 if that changed it. For what must never wrap silently."""
    if x < -2147483648 or x > 2147483647:
        state[flag] = 1
    return sat32(x)
