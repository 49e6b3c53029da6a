/* Frames: what a receiver refuses and why, the fields it reads, and the packets a board sends. protocol/SPEC.md, sections
 * 2 and 3; protocol/frames.py is the same in Python.
 */
#ifndef CORE_FRAMES_H
#define CORE_FRAMES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "generated/frames.h"

enum { CRC_SIZE = 4, HELLO_BUILD_SIZE = HELLO_SIZE - CRC_SIZE - HELLO_BUILD_AT };

/* Why a packet is refused, in the order of checking. */
typedef enum {
    PACKET_OK,
    PACKET_TOO_SHORT,
    PACKET_TOO_LONG,
    PACKET_BAD_CRC,
    PACKET_BAD_VERSION,
    PACKET_UNKNOWN_TYPE,
    PACKET_BAD_LENGTH,
    PACKET_BAD_VALUE
} packet_verdict;

/* Whether the last four bytes are the CRC of the rest. size >= PACKET_MIN. */
bool packet_has_right_crc(const uint8_t *packet, size_t size);

/* All checks of section 2. */
packet_verdict packet_check(const uint8_t *packet, size_t size);

/* The same for a packet whose length and CRC are known to be right, as a decoder's are. */
packet_verdict packet_check_rest(const uint8_t *packet, size_t size);

/* -- reading ------------------------------------------------------------------------------------------------------- */

uint16_t get_u16(const uint8_t *at);
uint32_t get_u32(const uint8_t *at);
uint64_t get_u64(const uint8_t *at);
int32_t get_i32(const uint8_t *at);
void get_words(const uint8_t *at, int32_t *into, size_t count);

static inline uint8_t packet_type(const uint8_t *packet) {
    return packet[HEADER_TYPE_AT];
}

/* Bytes of SAMPLE's readings. present <= 7. */
size_t readings_size(uint8_t present);

/* How many words follow a CONFIG or TELEMETRY packet's fixed fields. fixed: CONFIG_SIZE or TELEMETRY_SIZE. */
static inline size_t words_count(size_t size, size_t fixed) {
    return (size - fixed) / 4u;
}

/* -- writing: header and body at packet, the CRC by packet_finish() ------------------------------------------------- */

void put_u16(uint8_t *at, uint16_t value);
void put_u32(uint8_t *at, uint32_t value);
void put_u64(uint8_t *at, uint64_t value);
void put_i32(uint8_t *at, int32_t value);
void put_words(uint8_t *at, const int32_t *words, size_t count);

/* The header, and zeros where the fixed fields go. size: the packet's, CRC included. */
void packet_begin(uint8_t *packet, size_t size, uint8_t type, uint16_t sequence, uint32_t tick);

/* The CRC in the last four bytes. */
void packet_finish(uint8_t *packet, size_t size);

#endif
