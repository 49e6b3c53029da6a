/* Reference model: set-point r(k) in, reference ym(k) .. ym(k+2) out, per axis. firmware_sim/guidance/reference.py has the
 * equations; this is its fixed form. `reference` {par, state} stands in generated/law_states.h.
 */
#ifndef CORE_REFERENCE_H
#define CORE_REFERENCE_H

#include <stdbool.h>
#include <stdint.h>

#include "generated/law_states.h"

/* An input of a law, law.h. */
struct law_input;

/* Parameters from the common words of CONFIG; nothing has started. Sets every byte of self. */
void reference_init(reference *self, const int32_t *common);

/* One tick, before the law's step; uses fresh, euler and setpoint. True if the reference started at this reading. */
bool reference_advance(reference *self, const struct law_input *in);

/* Axis i begins anew: it stays at `position` (bam) up to t_(k+lead) and goes on from there at `rate` (turn36). */
void reference_restart(reference *self, int i, int32_t position, int32_t rate);

/* For TELEMETRY: reference[3] in bam, reference_rate[3] in bam/sample. */
void reference_words(const reference *self, int32_t words[6]);

#endif
