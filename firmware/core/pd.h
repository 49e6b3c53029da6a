/* The law pd: the paper's proportional-derivative law, per axis. firmware_sim/controllers/pd.py has the equations; its
 * struct `pd` {par, state} stands in generated/law_states.h.
 */
#ifndef CORE_PD_H
#define CORE_PD_H

#include "law.h"

extern const law PD_LAW;

#endif
