/* Fuzzy inference, fixed form; firmware_sim/controllers/fuzzy.py has the same functions. */
#include "fuzzy.h"

#include "fixed.h"

int64_t fuzzy_closed(int64_t a) {
    int64_t square = div_trunc(mul_q(a, a, 0), 32768);
    return div_trunc(mul_q(square, 98304 - a, 0), mul_q(3, 65536 - square, 0));
}

int64_t fuzzy_table(const int32_t *table, int64_t a) {
    int64_t i = smaller(div_trunc(a, 512), 63);
    int64_t low = table[i];
    return low + mul_q(table[i + 1] - low, a - mul_q(i, 512, 0), 9);
}
