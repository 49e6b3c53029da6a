/* 64-bit division and shifts, which a Cortex-M4 has no instruction for: the calls that compilers make for them, named and
 * with the registers of Arm's run-time ABI (IHI 0043). So an image holds nothing that does not come from this folder, and
 * counts the same instructions here whichever compiler built the rest.
 *
 * Quotients of unsigned numbers, rounded down; 32-bit digits, from the processor's own division of 32 by 32 bits.
 */
#include <stdint.h>

/* {high, low} / by. high < by, by >= 2^31. Two digits of 16 bits; each estimate, by the divisor's upper half alone, is at
 * most two too large (Knuth, The Art of Computer Programming 2, 4.3.1, theorem B). */
static uint32_t divide_wide(uint32_t high, uint32_t low, uint32_t by) {
    uint32_t upper = by >> 16, lower = by & 0xFFFFu, quotient = 0;
    for (int digits = 0; digits < 2; digits++, low <<= 16) {
        uint32_t digit = high / upper, rest = high % upper;
        while (digit > 0xFFFFu || digit * lower > (rest << 16 | low >> 16)) {
            digit -= 1u;
            rest += upper;
            if (rest > 0xFFFFu) break;
        }
        quotient = quotient << 16 | digit;
        high = (high << 16 | low >> 16) - digit * by;
    }
    return quotient;
}

/* A divisor of 32 bits at most, moved up to its highest bit, and the dividend with it. */
static uint64_t divide_by_word(uint64_t dividend, uint32_t by) {
    uint32_t high = (uint32_t)(dividend >> 32), low = (uint32_t)dividend;
    uint32_t upper = high / by, shift = (uint32_t)__builtin_clz(by);
    high %= by;
    if (shift != 0u) {
        high = high << shift | low >> (32u - shift);
        low <<= shift;
    }
    return (uint64_t)upper << 32 | divide_wide(high, low, by << shift);
}

/* A divisor of 2^32 or more: by its upper 32 bits, which is right or one too large; halved, so that divide_wide() fits. */
static uint64_t divide_by_more(uint64_t dividend, uint64_t by) {
    uint32_t shift = (uint32_t)__builtin_clz((uint32_t)(by >> 32));
    uint32_t upper = (uint32_t)(by >> 32), lower = (uint32_t)by;
    if (shift != 0u) upper = upper << shift | lower >> (32u - shift);
    uint64_t half = dividend >> 1;
    uint32_t quotient = divide_wide((uint32_t)(half >> 32), (uint32_t)half, upper) >> (31u - shift);
    if (quotient != 0u) quotient -= 1u;
    return dividend - quotient * by >= by ? quotient + 1u : quotient;
}

/* By zero: zero, as the processor's own division. */
__attribute__((used)) static uint64_t divide(uint64_t dividend, uint64_t by, uint64_t *rest) {
    uint64_t quotient = 0;
    if (by >> 32 != 0u) quotient = divide_by_more(dividend, by);
    else if (by != 0u) quotient = divide_by_word(dividend, (uint32_t)by);
    *rest = dividend - quotient * by;
    return quotient;
}

/* Towards zero; the rest has the sign of the dividend. */
__attribute__((used)) static int64_t divide_signed(int64_t dividend, int64_t by, int64_t *rest) {
    uint64_t n = dividend < 0 ? 0u - (uint64_t)dividend : (uint64_t)dividend;
    uint64_t quotient = divide(n, by < 0 ? 0u - (uint64_t)by : (uint64_t)by, (uint64_t *)rest);
    if (dividend < 0) *rest = (int64_t)(0u - (uint64_t)*rest);
    return (int64_t)((dividend ^ by) < 0 ? 0u - quotient : quotient);
}

/* In: dividend r0 r1, divisor r2 r3. Out: quotient r0 r1, rest r2 r3. */
#define DIVIDES_BY(function) \
    __asm volatile("push {r4, lr}\n\t" \
                   "sub sp, #16\n\t" \
                   "add r4, sp, #8\n\t" \
                   "str r4, [sp]\n\t" \
                   "bl %c0\n\t" \
                   "ldrd r2, r3, [sp, #8]\n\t" \
                   "add sp, #16\n\t" \
                   "pop {r4, pc}" ::"i"(function))

void __aeabi_uldivmod(void);
__attribute__((naked)) void __aeabi_uldivmod(void) { DIVIDES_BY(divide); }

void __aeabi_ldivmod(void);
__attribute__((naked)) void __aeabi_ldivmod(void) { DIVIDES_BY(divide_signed); }

/* Shifts of r0 r1 by r2 in 0..63. The processor shifts by the lowest byte of a register, 32 and more giving zero: so what
 * crosses from one word to the other is shifted by 32 - n for n < 32, by n - 32 beyond, and the other of the two is zero. */
void __aeabi_llsl(void);
__attribute__((naked)) void __aeabi_llsl(void) {
    __asm volatile("lsls r1, r2\n\t"
                   "rsb r3, r2, #32\n\t"
                   "lsr r12, r0, r3\n\t"
                   "orr r1, r1, r12\n\t"
                   "sub r3, r2, #32\n\t"
                   "lsl r12, r0, r3\n\t"
                   "orr r1, r1, r12\n\t"
                   "lsls r0, r2\n\t"
                   "bx lr");
}

void __aeabi_llsr(void);
__attribute__((naked)) void __aeabi_llsr(void) {
    __asm volatile("lsrs r0, r2\n\t"
                   "rsb r3, r2, #32\n\t"
                   "lsl r12, r1, r3\n\t"
                   "orr r0, r0, r12\n\t"
                   "sub r3, r2, #32\n\t"
                   "lsr r12, r1, r3\n\t"
                   "orr r0, r0, r12\n\t"
                   "lsrs r1, r2\n\t"
                   "bx lr");
}

/* The sign fills from above, so the upper word may cross only where n is 32 or more. */
void __aeabi_lasr(void);
__attribute__((naked)) void __aeabi_lasr(void) {
    __asm volatile("lsrs r0, r2\n\t"
                   "rsb r3, r2, #32\n\t"
                   "lsl r12, r1, r3\n\t"
                   "orr r0, r0, r12\n\t"
                   "subs r3, r2, #32\n\t"
                   "it pl\n\t"
                   "asrpl r0, r1, r3\n\t"
                   "asrs r1, r2\n\t"
                   "bx lr");
}
