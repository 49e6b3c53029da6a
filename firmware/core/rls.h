/* Recursive least squares of five parameters with forgetting and a bounded trace. firmware_sim/controllers/rls.py has the
 * equations.
 */
#ifndef CORE_RLS_H
#define CORE_RLS_H

#include <stdint.h>

/* One estimator: its memory, which the caller owns. */
typedef struct {
    int32_t *theta; /* [5] Q28 */
    int32_t *F;     /* [25] Q20, row by row, symmetric */
    int32_t *phi;   /* [5] Q28 */
    int64_t *F_phi; /* [5] Q40 */
    int32_t *gain;  /* [5] Q28 */
} rls;

typedef struct {
    int32_t forgetting, forgetting_inv; /* Q30 */
    int32_t trace_max;                  /* Q20 */
} rls_par;

/* One measurement with error e = y - phi theta, Q28; *flag becomes 1 if a number had to be limited.
 * If rounding brought the denominator below its least value, F and theta stay as they are. */
void identify(const rls *self, const rls_par *par, int32_t e, int32_t *flag);

#endif
