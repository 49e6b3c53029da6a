/* Recursive least squares, fixed form; firmware_sim/controllers/rls.py has the same function. */
#include "rls.h"

#include <stdbool.h>

#include "fixed.h"

/* F phi into F_phi; returns least + phi' F phi, Q28. */
static int64_t denominator_of(const rls *self, int64_t least) {
    int64_t denominator = least;
    for (int m = 0; m < 5; m++) {
        int64_t sum = 0;
        for (int n = 0; n < 5; n++) {
            sum += mul_q(self->F[5 * m + n], self->phi[n], 8);
        }
        self->F_phi[m] = sum;
        denominator += mul_wide(sum, self->phi[m], 40);
    }
    return denominator;
}

void identify(const rls *self, const rls_par *par, int32_t e, int32_t *flag) {
    int32_t *F = self->F;
    const int64_t trace = wide(F[0]) + F[6] + F[12] + F[18] + F[24];
    const bool forget = trace < par->trace_max;
    const int64_t least = forget ? shift_round(par->forgetting, 2) : ONE_Q(28);
    const int32_t scale = forget ? par->forgetting_inv : (int32_t)ONE_Q(30);
    const int64_t denominator = denominator_of(self, least);
    if (denominator < least) {
        *flag = 1;
        return;
    }
    const int32_t inverse = (int32_t)div_trunc(ONE_Q(58), denominator); /* Q30 */
    for (int m = 0; m < 5; m++) {
        int32_t gain = keep32(mul_wide(self->F_phi[m], inverse, 42), flag);
        self->gain[m] = gain;
        self->theta[m] = keep32(self->theta[m] + mul_q(gain, e, 28), flag);
        for (int n = m; n < 5; n++) {
            int64_t rest = shift_round(F[5 * m + n], -10) - mul_wide(self->F_phi[n], gain, 38);
            F[5 * m + n] = F[5 * n + m] = keep32(mul_wide(rest, scale, 40), flag);
        }
    }
}
