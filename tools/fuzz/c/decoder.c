/* Target `decoder`: any bytes as a stream, as datagrams, and as COBS.
 *
 * Input: how the stream is cut (u8), then the stream. However it is cut, packets, counters and what is kept are the same.
 */
#include <string.h>

#include "codec.h"
#include "script.h"
#include "targets.h"

enum { ROOM = 1 << 20 };

static void cobs(const uint8_t *data, size_t size) {
    uint8_t encoded[PACKET_MAX + 1], decoded[PACKET_MAX + 1];
    size_t plain = size < PACKET_MAX ? size : PACKET_MAX;
    EXPECT(cobs_encode(data, plain, encoded) == plain + 1);
    EXPECT(memchr(encoded, 0, plain + 1) == NULL);
    EXPECT(cobs_decode(encoded, plain + 1, decoded) == plain);
    EXPECT(memcmp(decoded, data, plain) == 0);
    size_t candidate = size < sizeof decoded ? size : sizeof decoded;
    size_t took = cobs_decode(data, candidate, decoded);
    EXPECT(took == COBS_BAD || took <= candidate);
}

static void datagram(const uint8_t *data, size_t size) {
    decoder_counters c = {0};
    bool taken = datagram_take(&c, data, size);
    EXPECT(c.frames == taken);
    EXPECT(c.frames + c.empty + c.too_short + c.too_long + c.crc_errors == 1);
    EXPECT(c.discarded_bytes == (taken ? 0 : size));
}

void fuzz_decoder(const uint8_t *data, size_t size) {
    static uint8_t whole[ROOM], in_pieces[ROOM];
    if (size == 0) {
        return;
    }
    size_t cut = data[0] == 0 ? 1 : data[0];
    data++, size--;
    size_t used = script_decode(data, size, size == 0 ? 1 : size, whole, ROOM);
    EXPECT(script_decode(data, size, cut, in_pieces, ROOM) == used);
    EXPECT(used > ROOM || memcmp(whole, in_pieces, used) == 0);
    cobs(data, size);
    datagram(data, size);
}
