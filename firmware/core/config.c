/* The CONFIG words: collected, joined, checked; see config.h. */
#include "config.h"

#include "codec.h"
#include "frames.h"

_Static_assert(BOARD_MAX_WORDS >= CONFIG_WORDS_MAX, "BOARD_MAX_WORDS: at least one part, 57 words");

void config_clear(config *c) {
    c->parts = c->present = 0;
    c->count = 0;
    for (size_t p = 0; p < CONFIG_PARTS_MAX; p++) {
        c->part[p].present = false;
    }
}

/* -- collecting ------------------------------------------------------------------------------------------------------- */

/* Where part p's words lie until they are joined. */
static size_t place_of(size_t part) {
    return part * CONFIG_WORDS_MAX;
}

static bool has_room(size_t from, size_t count) {
    return from + count <= BOARD_MAX_WORDS;
}

bool config_add(config *c, const uint8_t *packet, size_t size) {
    uint16_t part = get_u16(packet + CONFIG_PART_AT), parts = get_u16(packet + CONFIG_PARTS_AT);
    if (parts != c->parts) {
        config_clear(c);
    }
    if (parts > CONFIG_PARTS_MAX) {
        return false;
    }
    config_part *known = &c->part[part];
    c->parts = parts;
    c->present = (uint16_t)(c->present + !known->present);
    known->present = true;
    known->offset = get_u16(packet + CONFIG_OFFSET_AT);
    known->count = (uint8_t)words_count(size, CONFIG_SIZE);
    if (has_room(place_of(part), known->count)) {
        get_words(packet + CONFIG_SIZE - CRC_SIZE, c->words + place_of(part), known->count);
    }
    return c->present == parts;
}

/* -- joining ---------------------------------------------------------------------------------------------------------- */

/* Moves the words together, down to the first part that had no room. False where the parts leave a gap or overlap. */
static bool join(config *c) {
    c->count = c->held = 0;
    for (size_t p = 0; p < c->parts; p++) {
        const config_part *part = &c->part[p];
        if (part->offset != c->count) {
            return false;
        }
        if (c->held == c->count && has_room(place_of(p), part->count)) {
            for (size_t i = 0; i < part->count; i++) { /* never to a higher place than they have */
                c->words[c->held++] = c->words[place_of(p) + i];
            }
        }
        c->count += part->count;
    }
    return true;
}

/* -- checking --------------------------------------------------------------------------------------------------------- */

static const law_table *table_of(int32_t id, int32_t version) {
    for (size_t i = 0; i < LAW_TABLES_COUNT; i++) {
        if (LAW_TABLES[i].id == id && LAW_TABLES[i].version == version) {
            return &LAW_TABLES[i];
        }
    }
    return NULL;
}

/* floor(mantissa 2^exponent), limited to what an int32 can be compared with. */
static int64_t scaled(int64_t mantissa, int32_t exponent) {
    if (exponent >= 0) {
        return mantissa < 0 ? INT64_MIN : mantissa > 0 ? INT64_MAX : 0;
    }
    int32_t shift = exponent < -63 ? 63 : -exponent;
    int64_t divided = (int64_t)((uint64_t)(mantissa < 0 ? ~mantissa : mantissa) >> shift);
    return mantissa < 0 ? ~divided : divided;
}

static bool in_range(int32_t count, const word_range *range, const int32_t *words) {
    if (range->scale == NO_WORD) {
        return count >= range->low && count <= range->high;
    }
    const range_scale *scale = &RANGE_SCALES[range->scale];
    int32_t more = words[scale->bits_word] + 1;
    int64_t twice = 2 * (int64_t)count;
    return twice - 1 <= scaled(scale->high, scale->high_exponent + more) &&
           -twice - 1 <= scaled(scale->minus_low, scale->low_exponent + more);
}

/* Index of the first word outside its range, or NO_INDEX. */
static uint16_t bad_word(const int32_t *words, const law_table *table) {
    for (uint16_t i = 0; i < COMMON_WORDS + table->words; i++) {
        const word_range *range = i < COMMON_WORDS ? &COMMON_RANGES[i] : &table->ranges[i - COMMON_WORDS];
        if (!in_range(words[i], range, words)) {
            return i;
        }
    }
    return NO_INDEX;
}

/* Index of the first guidance tick that is negative or not after the one before, or NO_INDEX. */
static uint16_t bad_row(const int32_t *words, size_t from, size_t to) {
    int32_t before = -1;
    for (size_t i = from; i < to; i += ROW_WORDS) {
        if (words[i] <= before) {
            return (uint16_t)i;
        }
        before = words[i];
    }
    return NO_INDEX;
}

/* What the law's table says of period, delay, lead, arithmetic, readings and angles. */
static bool table_allows(const int32_t *words, const law_table *table) {
    const int32_t *params = words + COMMON_WORDS;
    const law_variant *v = &table->variants[table->variant_word == NO_WORD ? 0 : params[table->variant_word]];
    int32_t period = words[COMMON_PERIOD_US];
    return words[COMMON_FORM] == COMMON_FORM_FIXED && period >= table->period_us_min && period <= table->period_us_max &&
           (v->delays >> words[COMMON_TRANSPORT_DELAY_TICKS] & 1) != 0 &&
           (v->leads >> words[COMMON_REFERENCE_LEAD] & 1) != 0 &&
           (table->finite_word == NO_WORD || params[table->finite_word] != INT32_MAX) &&
           (v->needs & ~words[COMMON_READINGS_MASK]) == 0 &&
           (table->only_321 == NO_WORD || words[table->only_321] == 0 ||
            words[COMMON_ATTITUDE_SEQUENCE] == COMMON_ATTITUDE_SEQUENCE_321);
}

/* crc32(W, crc32(T)) of section 8.3. */
static uint32_t table_hash(const law_table *table, const int32_t *words, size_t count) {
    uint32_t crc = table->text_crc;
    for (size_t i = 0; i < count; i++) {
        uint8_t bytes[4];
        put_i32(bytes, words[i]);
        crc = crc32_from(bytes, sizeof bytes, crc);
    }
    return crc;
}

static config_verdict refused(uint16_t status, uint16_t index) {
    return (config_verdict){.status = status, .index = index, .table_hash = 0, .table = NULL, .law = NULL};
}

config_verdict config_check(config *c) {
    const int32_t *words = c->words;
    if (!join(c) || c->count < COMMON_WORDS) {
        return refused(READY_MISSING_PARTS, NO_INDEX);
    }
    if (c->held < COMMON_WORDS) {
        return refused(READY_LAW_REFUSES, NO_INDEX);
    }
    const law_table *table = table_of(words[COMMON_LAW_ID], words[COMMON_LAW_VERSION]);
    const law *law = table == NULL ? NULL : law_find(table->id, table->version);
    if (law == NULL) {
        return refused(READY_UNKNOWN_LAW, 0);
    }
    size_t law_end = (size_t)COMMON_WORDS + table->words;
    int64_t expected = (int64_t)law_end + (int64_t)ROW_WORDS * words[COMMON_GUIDANCE_ROWS];
    if (c->count < law_end || (int64_t)c->count != expected) {
        return refused(READY_MISSING_PARTS, NO_INDEX);
    }
    if (c->held < law_end) {
        return refused(READY_LAW_REFUSES, NO_INDEX);
    }
    uint16_t bad = bad_word(words, table);
    if (bad == NO_INDEX) {
        bad = bad_row(words, law_end, c->held);
    }
    if (bad != NO_INDEX) {
        return refused(READY_BAD_WORD, bad);
    }
    if (c->held < c->count || !table_allows(words, table)) {
        return refused(READY_LAW_REFUSES, NO_INDEX);
    }
    uint32_t hash = table_hash(table, words, c->count);
    return (config_verdict){.status = READY_OK, .index = NO_INDEX, .table_hash = hash, .table = table, .law = law};
}
