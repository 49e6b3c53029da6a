/* Runs episodes from standard input, writes what they record to standard output: the host's side of the comparison. */
#include <stdio.h>
#include <stdlib.h>

#include "episode.h"

#define STEPS_MAX 100000

static void *need(size_t size) {
    void *memory = malloc(size);
    if (memory == NULL) {
        exit(2);
    }
    return memory;
}

int main(void) {
    uint32_t head[5]; /* law id, version, common words, law's words, steps */
    while (fread(head, sizeof head, 1, stdin) == 1) {
        size_t words = (size_t)head[2] + head[3], steps = head[4];
        if (steps > STEPS_MAX) {
            return 2;
        }
        int32_t *config = need(words * sizeof *config);
        law_input *in = need(steps * sizeof *in);
        uint8_t *trace = need(steps * 2048);
        if (fread(config, sizeof *config, words, stdin) != words || fread(in, sizeof *in, steps, stdin) != steps) {
            return 2;
        }
        episode e = {{law_find, reference_init, reference_advance, reference_words}, head[0], head[1],
                     config, config + head[2], in, head[4], trace};
        uint32_t size = run_episode(&e);
        fwrite(&size, sizeof size, 1, stdout);
        fwrite(trace, 1, size, stdout);
        free(config);
        free(in);
        free(trace);
    }
    return 0;
}
