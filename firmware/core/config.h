/* CONFIG in transit and checked: parts in any order, put together, every word within its range. protocol/SPEC.md, sections
 * 6.1 and 6.3; protocol/config.py and protocol/law_tables.py are the same in Python.
 */
#ifndef CORE_CONFIG_H
#define CORE_CONFIG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "generated/frames.h"
#include "generated/law_tables.h"
#include "law.h"

/* Room for CONFIG words. A board with less memory may have less: a CONFIG with more is refused (READY, status 3). */
#ifndef BOARD_MAX_WORDS
#define BOARD_MAX_WORDS CONFIG_TOTAL_MAX
#endif

/* What CONFIG says of one part. */
typedef struct {
    uint16_t offset; /* index of its first word */
    uint8_t count;   /* of its words */
    bool present;
} config_part;

/* The words: while parts come, part p's from words[p * CONFIG_WORDS_MAX] on; once joined, all from words[0] on. */
typedef struct {
    uint16_t parts, present; /* of one cut: how many there are, how many have come */
    size_t count, held;      /* words of all parts, once joined, and how many of them, from the first on, had room */
    config_part part[CONFIG_PARTS_MAX];
    int32_t words[BOARD_MAX_WORDS];
} config;

/* What READY says; table and law where status is READY_OK. */
typedef struct {
    uint16_t status, index;
    uint32_t table_hash;
    const law_table *table;
    const law *law;
} config_verdict;

void config_clear(config *c);

/* Keeps one part, a CONFIG packet of that size; true when all have come. A part of another cut begins a new collection. */
bool config_add(config *c, const uint8_t *packet, size_t size);

/* All parts have come: joins and checks them, in the order of section 6.3. What only the law can say is not in it. */
config_verdict config_check(config *c);

#endif
