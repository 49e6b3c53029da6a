/* The law appc: adaptive pole placement with an observer.
 * firmware_sim/controllers/appc.py has the equations; its struct `appc` {par, state} stands in generated/law_states.h.
 */
#ifndef CORE_APPC_H
#define CORE_APPC_H

#include "law.h"

extern const law APPC_LAW;

#endif
