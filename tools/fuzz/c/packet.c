/* Target `packet`: any bytes as a packet, as they are and with a right CRC; and as CONFIG parts that come one by one.
 *
 * Input: records of a length (u8) and so many bytes, each header and body of a packet.
 */
#include <string.h>

#include "config.h"
#include "flight.h"
#include "frames.h"
#include "targets.h"

/* A packet of its own size in memory, so that a read beyond it is seen. */
static uint8_t *copied(const uint8_t *body, size_t size) {
    uint8_t *packet = malloc(size + CRC_SIZE);
    EXPECT(packet != NULL);
    memcpy(packet, body, size);
    packet_finish(packet, size + CRC_SIZE);
    return packet;
}

static void judge(config *c, const uint8_t *packet, size_t size) {
    packet_verdict verdict = packet_check(packet, size);
    EXPECT(verdict != PACKET_BAD_CRC);
    EXPECT(size < PACKET_MIN ? verdict == PACKET_TOO_SHORT : size > PACKET_MAX ? verdict == PACKET_TOO_LONG : true);
    if (verdict != PACKET_OK) {
        return;
    }
    EXPECT(packet_check_rest(packet, size) == PACKET_OK);
    if (packet_type(packet) == TYPE_SAMPLE) {
        sample s;
        sample_read(packet, &s);
        EXPECT(SAMPLE_SIZE + readings_size(s.present) == size && (s.valid & ~s.present) == 0);
    } else if (packet_type(packet) == TYPE_CONFIG && config_add(c, packet, size)) {
        config_verdict ready = config_check(c);
        EXPECT((ready.status == READY_OK) == (ready.law != NULL && ready.table != NULL && ready.table_hash != 0));
        config_clear(c);
    }
}

void fuzz_packet(const uint8_t *data, size_t size) {
    static config c;
    config_clear(&c);
    while (size > 0) {
        size_t body = data[0] < size ? data[0] : size - 1;
        (void)packet_check(data + 1, body);
        if (body >= PACKET_MIN - CRC_SIZE) {
            uint8_t *packet = copied(data + 1, body);
            judge(&c, packet, body + CRC_SIZE);
            free(packet);
        }
        data += 1 + body;
        size -= 1 + body;
    }
}
