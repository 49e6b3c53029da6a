/* One-input fuzzy inference of three sets, |f| / L, Q15, of 0 <= a <= 1 in Q15. firmware_sim/controllers/fuzzy.py has the
 * equations.
 */
#ifndef CORE_FUZZY_H
#define CORE_FUZZY_H

#include <stdint.h>

int64_t fuzzy_closed(int64_t a);

/* table: 65 entries, straight lines between. */
int64_t fuzzy_table(const int32_t *table, int64_t a);

#endif
