/* The law state_space: any discrete compensator, the same on each axis times a gain. firmware_sim/controllers/state_space.py has
 * the equations; its struct `state_space` {par, state} stands in generated/law_states.h.
 */
#ifndef CORE_STATE_SPACE_H
#define CORE_STATE_SPACE_H

#include "law.h"

extern const law STATE_SPACE_LAW;

#endif
