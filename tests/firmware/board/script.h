/* A board whose hardware is a script: what comes, and when; and what it sends, as a list. For the tests, as a library or, with
 * scripted.c, as a program.
 *
 * Script and output are records: kind (one byte), size (u32, little endian), payload.
 *     script   'B' bytes that come next (on a datagram link: one datagram), 'T' i64: the clock's time from here on, ns
 *     output   'W' one write of the board, 'U' i64: until when it waited before the next record of the script, 'C' the
 *              counters at the end, u32 each: decoder_counters, then port_counters
 */
#ifndef SCRIPT_H
#define SCRIPT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { SCRIPT_DATAGRAM = 1, SCRIPT_NO_TIMER = 2, SCRIPT_HEALTH = 4, SCRIPT_ONCE = 8 };

/* Serves the script from boot to its end; returns the bytes of output, at most room. */
size_t script_serve(const uint8_t *script, size_t size, uint32_t options, const char *build, uint8_t *out, size_t room);

/* Decodes a byte stream, `cut` bytes at a time: per packet with a right CRC a record, kind the packet_verdict and payload the
 * packet; then 'C' with the decoder_counters and the bytes that are kept. */
size_t script_decode(const uint8_t *data, size_t size, size_t cut, uint8_t *out, size_t room);

/* The same for datagrams: data is records, each a datagram. */
size_t script_datagrams(const uint8_t *records, size_t size, uint8_t *out, size_t room);

#endif
