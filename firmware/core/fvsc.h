/* The laws fvsc, vsc and ifvsc: variable structure with a fuzzy gain, without it, with an integral beside it. One struct
 * `fvsc` {par, state} for all three stands in generated/law_states.h; firmware_sim/controllers/fvsc.py has the equations.
 */
#ifndef CORE_FVSC_H
#define CORE_FVSC_H

#include "law.h"

extern const law FVSC_LAW, VSC_LAW, IFVSC_LAW;

#endif
