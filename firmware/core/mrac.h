/* The law mrac: the unified law with least squares, per axis, as printed or repaired.
 * firmware_sim/controllers/mrac.py has the equations; its struct `mrac` {par, state} stands in generated/law_states.h.
 */
#ifndef CORE_MRAC_H
#define CORE_MRAC_H

#include "law.h"

extern const law MRAC_LAW;

#endif
