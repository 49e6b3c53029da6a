/* CRC-32, COBS and the decoders; see codec.h. */
#include "codec.h"

#include "frames.h"

/* CRC of the sixteen half bytes: a table of 64 bytes and two look-ups per byte. */
static const uint32_t HALF_BYTE[16] = {
    0x00000000u, 0x1DB71064u, 0x3B6E20C8u, 0x26D930ACu, 0x76DC4190u, 0x6B6B51F4u, 0x4DB26158u, 0x5005713Cu,
    0xEDB88320u, 0xF00F9344u, 0xD6D6A3E8u, 0xCB61B38Cu, 0x9B64C2B0u, 0x86D3D2D4u, 0xA00AE278u, 0xBDBDF21Cu,
};

uint32_t crc32_from(const uint8_t *data, size_t size, uint32_t start) {
    uint32_t r = start ^ 0xFFFFFFFFu;
    for (size_t i = 0; i < size; i++) {
        r ^= data[i];
        r = (r >> 4) ^ HALF_BYTE[r & 15u];
        r = (r >> 4) ^ HALF_BYTE[r & 15u];
    }
    return r ^ 0xFFFFFFFFu;
}

size_t cobs_encode(const uint8_t *data, size_t size, uint8_t *into) {
    size_t code = 0, end = 1;
    for (size_t i = 0; i < size; i++) {
        if (data[i] != 0) {
            into[end] = data[i];
        } else {
            into[code] = (uint8_t)(end - code);
            code = end;
        }
        end++;
    }
    into[code] = (uint8_t)(end - code);
    return end;
}

size_t cobs_decode(const uint8_t *data, size_t size, uint8_t *into) {
    size_t at = 0, end = 0;
    while (at < size) {
        size_t code = data[at++];
        if (code == 0 || code - 1 > size - at) {
            return COBS_BAD;
        }
        for (size_t i = 1; i < code; i++) {
            into[end++] = data[at++];
        }
        if (code != 0xFF && at < size) {
            into[end++] = 0;
        }
    }
    return end;
}

void stream_decoder_init(stream_decoder *d) {
    d->counters = (decoder_counters){0};
    d->kept = 0;
    d->discarding = false;
}

/* A candidate is complete: its packet's size, or 0 and a count. */
static size_t close_candidate(stream_decoder *d) {
    decoder_counters *c = &d->counters;
    size_t size = d->kept, decoded = COBS_BAD;
    if (size == 0) {
        c->empty++;
        return 0;
    }
    if (size < ENCODED_MIN) {
        c->too_short++;
    } else if ((decoded = cobs_decode(d->pending, size, d->pending)) == COBS_BAD) {
        c->cobs_errors++;
    } else if (decoded < PACKET_MIN || !packet_has_right_crc(d->pending, decoded)) {
        c->crc_errors++;
    } else {
        c->frames++;
        return decoded;
    }
    c->discarded_bytes += (uint32_t)size;
    return 0;
}

/* One byte that is not zero. */
static void keep(stream_decoder *d, uint8_t byte) {
    if (d->discarding) {
        d->counters.discarded_bytes++;
    } else if (d->kept == ENCODED_MAX) {
        d->counters.too_long++;
        d->counters.discarded_bytes += ENCODED_MAX + 1;
        d->kept = 0;
        d->discarding = true;
    } else {
        d->pending[d->kept++] = byte;
    }
}

size_t stream_decoder_take(stream_decoder *d, const uint8_t *data, size_t size, size_t *packet_size) {
    *packet_size = 0;
    for (size_t i = 0; i < size; i++) {
        if (data[i] != 0) {
            keep(d, data[i]);
            continue;
        }
        if (!d->discarding) {
            *packet_size = close_candidate(d);
        }
        d->kept = 0;
        d->discarding = false;
        if (*packet_size != 0) {
            return i + 1;
        }
    }
    return size;
}

bool datagram_take(decoder_counters *counters, const uint8_t *data, size_t size) {
    if (size == 0) {
        counters->empty++;
        return false;
    }
    if (size < PACKET_MIN) {
        counters->too_short++;
    } else if (size > PACKET_MAX) {
        counters->too_long++;
    } else if (!packet_has_right_crc(data, size)) {
        counters->crc_errors++;
    } else {
        counters->frames++;
        return true;
    }
    counters->discarded_bytes += (uint32_t)size;
    return false;
}
