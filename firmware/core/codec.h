/* Packets to bytes on a wire and back: CRC-32, COBS between zero bytes, and a decoder that any cut of the bytes leaves in
 * step. protocol/SPEC.md, sections 2 and 4; protocol/codec.py is the same in Python.
 */
#ifndef CORE_CODEC_H
#define CORE_CODEC_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "generated/frames.h"

#define CRC_RESIDUE 0x2144DF1Cu /* CRC of any data followed by its own CRC, whatever the start */
#define COBS_BAD SIZE_MAX

/* CRC-32 as zlib's crc32(data, start). */
uint32_t crc32_from(const uint8_t *data, size_t size, uint32_t start);

/* COBS of size <= 250 bytes; returns size + 1. In place: data == into + 1. */
size_t cobs_encode(const uint8_t *data, size_t size, uint8_t *into);

/* The inverse; returns the bytes written, at most size, or COBS_BAD where the chain does not end where the data ends.
 * In place: data == into. data holds no zero. */
size_t cobs_decode(const uint8_t *data, size_t size, uint8_t *into);

/* What a receiver has seen and thrown away; discarded_bytes is every byte of a candidate that was no frame. */
typedef struct {
    uint32_t frames, empty, too_short, too_long, cobs_errors, crc_errors, discarded_bytes;
} decoder_counters;

/* Decoder of a byte stream: what it keeps of the present candidate, at most ENCODED_MAX bytes. */
typedef struct {
    decoder_counters counters;
    size_t kept;
    bool discarding; /* the present candidate is longer than any frame: its bytes are counted up to the next zero */
    uint8_t pending[ENCODED_MAX];
} stream_decoder;

void stream_decoder_init(stream_decoder *d);

/* Takes bytes up to the first that completes a packet with a right CRC, or all. Returns how many it took; *packet_size is
 * the packet's size, 0 when there is none. The packet lies in d->pending until the next call. */
size_t stream_decoder_take(stream_decoder *d, const uint8_t *data, size_t size, size_t *packet_size);

/* Whether a datagram is a packet with a right CRC; counts it either way. */
bool datagram_take(decoder_counters *counters, const uint8_t *data, size_t size);

#endif
