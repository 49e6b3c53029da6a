/* What is fuzzed in C: one function per target; each ends the process (abort, or a sanitizer) on a finding. */
#ifndef TARGETS_H
#define TARGETS_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

/* Not assert: a finding is one whatever NDEBUG says, and says what was wrong. */
#define EXPECT(condition)                                                                                              \
    do {                                                                                                               \
        if (!(condition)) {                                                                                            \
            fprintf(stderr, "%s:%d: expected %s\n", __FILE__, __LINE__, #condition);                                   \
            abort();                                                                                                   \
        }                                                                                                              \
    } while (0)

void fuzz_decoder(const uint8_t *data, size_t size);
void fuzz_packet(const uint8_t *data, size_t size);
void fuzz_board(const uint8_t *data, size_t size);
void fuzz_flight(const uint8_t *data, size_t size);

#endif
