/* The one entry that fuzzing engines know; FUZZ_TARGET in the environment says which target it is. */
#include <string.h>

#include "targets.h"

typedef void target(const uint8_t *data, size_t size);

static target *chosen;

static target *choose(const char *name) {
    static const struct {
        const char *name;
        target *run;
    } targets[] = {
        {"decoder", fuzz_decoder},
        {"packet", fuzz_packet},
        {"board", fuzz_board},
        {"flight", fuzz_flight},
    };
    for (size_t i = 0; name != NULL && i < sizeof targets / sizeof *targets; i++) {
        if (strcmp(name, targets[i].name) == 0) {
            return targets[i].run;
        }
    }
    fprintf(stderr, "FUZZ_TARGET: expected decoder, packet, board or flight, got %s\n", name == NULL ? "nothing" : name);
    exit(2);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (chosen == NULL) {
        chosen = choose(getenv("FUZZ_TARGET"));
    }
    chosen(data, size);
    return 0;
}
