/* The laws of this board: one line each. */
#include "appc.h"
#include "fvsc.h"
#include "generated/law_tables.h"
#include "mrac.h"
#include "pd.h"
#include "state_space.h"

static const law *const LAWS[LAW_TABLES_COUNT] = {&PD_LAW,  &MRAC_LAW,  &APPC_LAW,       &FVSC_LAW,
                                                   &VSC_LAW, &IFVSC_LAW, &STATE_SPACE_LAW};

const law *law_find(uint16_t id, uint16_t version) {
    for (size_t i = 0; i < LAW_TABLES_COUNT; i++) {
        if (LAWS[i]->id == id && LAWS[i]->version == version) {
            return LAWS[i];
        }
    }
    return NULL;
}
