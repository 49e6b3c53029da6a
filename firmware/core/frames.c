/* What a receiver refuses, and the fields of packets; see frames.h. */
#include "frames.h"

#include "codec.h"

static uint32_t crc_start(const uint8_t *packet) {
    return packet_type(packet) == TYPE_HELLO ? 0 : LAYOUT_HASH;
}

bool packet_has_right_crc(const uint8_t *packet, size_t size) {
    return crc32_from(packet, size, crc_start(packet)) == CRC_RESIDUE;
}

packet_verdict packet_check(const uint8_t *packet, size_t size) {
    if (size < PACKET_MIN) {
        return PACKET_TOO_SHORT;
    }
    if (size > PACKET_MAX) {
        return PACKET_TOO_LONG;
    }
    if (!packet_has_right_crc(packet, size)) {
        return PACKET_BAD_CRC;
    }
    return packet_check_rest(packet, size);
}

/* -- length ----------------------------------------------------------------------------------------------------------- */

size_t readings_size(uint8_t present) {
    size_t size = 0;
    size += present & READING_EULER ? 4u + 4u * READING_EULER_WORDS : 0u;
    size += present & READING_QUATERNION ? 4u + 4u * READING_QUATERNION_WORDS : 0u;
    size += present & READING_RATE ? 4u + 4u * READING_RATE_WORDS : 0u;
    return size;
}

static packet_verdict exactly(size_t size, size_t expected) {
    return size == expected ? PACKET_OK : PACKET_BAD_LENGTH;
}

static packet_verdict with_words(size_t size, size_t fixed) {
    return size >= fixed && (size - fixed) % 4u == 0 ? PACKET_OK : PACKET_BAD_LENGTH;
}

/* Which readings are present decides the length of a SAMPLE, so that field is looked at here. */
static packet_verdict sample_length(const uint8_t *packet, size_t size) {
    if (size < SAMPLE_SIZE) {
        return PACKET_BAD_LENGTH;
    }
    uint8_t present = packet[SAMPLE_PRESENT_AT];
    if (present > (READING_EULER | READING_QUATERNION | READING_RATE)) {
        return PACKET_BAD_VALUE;
    }
    return exactly(size, SAMPLE_SIZE + readings_size(present));
}

static packet_verdict length_verdict(const uint8_t *packet, size_t size) {
    switch (packet_type(packet)) {
    case TYPE_CONFIG: return with_words(size, CONFIG_SIZE);
    case TYPE_SAMPLE: return sample_length(packet, size);
    case TYPE_COMMAND: return exactly(size, COMMAND_SIZE);
    case TYPE_TELEMETRY: return with_words(size, TELEMETRY_SIZE);
    case TYPE_EVENT: return exactly(size, EVENT_SIZE);
    case TYPE_HELLO: return exactly(size, HELLO_SIZE);
    case TYPE_READY: return exactly(size, READY_SIZE);
    case TYPE_TICK: return exactly(size, TICK_SIZE);
    case TYPE_TIMING: return exactly(size, TIMING_SIZE);
    case TYPE_STOP: return exactly(size, STOP_SIZE);
    default: return PACKET_UNKNOWN_TYPE;
    }
}

/* -- values ----------------------------------------------------------------------------------------------------------- */

static bool is_ticked(uint8_t type) {
    return type != TYPE_CONFIG && type != TYPE_HELLO && type != TYPE_READY && type != TYPE_STOP;
}

/* Printable ASCII, then NULs to the end. */
static bool is_build(const uint8_t *text) {
    size_t size = HELLO_BUILD_SIZE;
    while (size > 0 && text[size - 1] == 0) {
        size--;
    }
    for (size_t i = 0; i < size; i++) {
        if (text[i] < 0x20 || text[i] > 0x7E) {
            return false;
        }
    }
    return true;
}

static bool values_are_right(const uint8_t *packet) {
    switch (packet_type(packet)) {
    case TYPE_CONFIG:
        return get_u16(packet + CONFIG_PART_AT) < get_u16(packet + CONFIG_PARTS_AT) &&
               get_u16(packet + CONFIG_RESERVED_AT) == 0;
    case TYPE_SAMPLE:
        return packet[SAMPLE_SOURCE_AT] <= SOURCE_HELD && packet[SAMPLE_RESERVED_AT] == 0 &&
               (packet[SAMPLE_VALID_AT] & ~packet[SAMPLE_PRESENT_AT]) == 0;
    case TYPE_COMMAND: return packet[COMMAND_USED_AT] >= STEP_USED && packet[COMMAND_USED_AT] <= STEP_REUSED;
    case TYPE_EVENT: return get_u16(packet + EVENT_RESERVED_AT) == 0;
    case TYPE_HELLO: return packet[HELLO_ROLE_AT] <= ROLE_BOARD && is_build(packet + HELLO_BUILD_AT);
    case TYPE_STOP: return get_u16(packet + STOP_RESERVED_AT) == 0;
    default: return true;
    }
}

packet_verdict packet_check_rest(const uint8_t *packet, size_t size) {
    if (packet[HEADER_VERSION_AT] != PROTOCOL_VERSION) {
        return PACKET_BAD_VERSION;
    }
    packet_verdict length = length_verdict(packet, size);
    if (length != PACKET_OK) {
        return length;
    }
    bool has_tick = get_u32(packet + HEADER_TICK_AT) != NO_TICK;
    return has_tick == is_ticked(packet_type(packet)) && values_are_right(packet) ? PACKET_OK : PACKET_BAD_VALUE;
}

/* -- fields ----------------------------------------------------------------------------------------------------------- */

uint16_t get_u16(const uint8_t *at) {
    return (uint16_t)(at[0] | at[1] << 8);
}

uint32_t get_u32(const uint8_t *at) {
    return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

uint64_t get_u64(const uint8_t *at) {
    return (uint64_t)get_u32(at) | (uint64_t)get_u32(at + 4) << 32;
}

int32_t get_i32(const uint8_t *at) {
    return (int32_t)get_u32(at);
}

void get_words(const uint8_t *at, int32_t *into, size_t count) {
    for (size_t i = 0; i < count; i++) {
        into[i] = get_i32(at + 4 * i);
    }
}

void put_u16(uint8_t *at, uint16_t value) {
    at[0] = (uint8_t)(value & 0xFFu);
    at[1] = (uint8_t)(value >> 8);
}

void put_u32(uint8_t *at, uint32_t value) {
    put_u16(at, (uint16_t)(value & 0xFFFFu));
    put_u16(at + 2, (uint16_t)(value >> 16));
}

void put_u64(uint8_t *at, uint64_t value) {
    put_u32(at, (uint32_t)(value & 0xFFFFFFFFu));
    put_u32(at + 4, (uint32_t)(value >> 32));
}

void put_i32(uint8_t *at, int32_t value) {
    put_u32(at, (uint32_t)value);
}

void put_words(uint8_t *at, const int32_t *words, size_t count) {
    for (size_t i = 0; i < count; i++) {
        put_i32(at + 4 * i, words[i]);
    }
}

void packet_begin(uint8_t *packet, size_t size, uint8_t type, uint16_t sequence, uint32_t tick) {
    for (size_t i = 0; i < size; i++) {
        packet[i] = 0;
    }
    packet[HEADER_VERSION_AT] = PROTOCOL_VERSION;
    packet[HEADER_TYPE_AT] = type;
    put_u16(packet + HEADER_SEQUENCE_AT, sequence);
    put_u32(packet + HEADER_TICK_AT, tick);
}

void packet_finish(uint8_t *packet, size_t size) {
    put_u32(packet + size - CRC_SIZE, crc32_from(packet, size - CRC_SIZE, crc_start(packet)));
}
