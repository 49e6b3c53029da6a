"""Mistakes of a receiver: what it takes that it should refuse, and what garbage costs it."""

from __future__ import annotations

from wrong_boards import Decoding, Hearing, wrong

from protocol.codec import StreamDecoder
from protocol.frames import NO_TICK, Type


@wrong("reserved fields are not looked at", "receiver: refused")
class Reserved(Hearing):
    def hear(self, packet):
        if packet[1] == Type.SAMPLE:
            packet[55] = 0
        if packet[1] == Type.STOP:
            packet[10:12] = bytes(2)


@wrong("the header's version is not looked at", "receiver: refused")
class AnyVersion(Hearing):
    def hear(self, packet):
        packet[0] = 1


@wrong("the tick of STOP is not looked at", "receiver: refused", "end: left")
class AnyTick(Hearing):
    def hear(self, packet):
        if packet[1] == Type.STOP and packet[4:8] != b"\xff" * 4:
            packet[4:8] = NO_TICK.to_bytes(4, "little")
        elif packet[1] == Type.STOP:
            packet[4:8] = bytes(4)


@wrong("the CRC is not looked at", "receiver: refused", "states: running")
class NoCrc(Decoding):
    class Decoder(StreamDecoder):
        def _close(self, encoded, packets):
            from cobs import cobs

            try:
                raw = cobs.decode(encoded)
            except cobs.DecodeError:
                return
            if 12 <= len(raw) <= 250:
                packets.append(raw)


@wrong("the frame behind garbage is lost", "receiver: garbage")
class LosesTheNext(Decoding):
    class Decoder(StreamDecoder):
        def feed(self, data):
            before = self.counters.discarded_bytes
            packets = super().feed(data)
            return packets[1:] if self.counters.discarded_bytes > before else packets


@wrong("behind a candidate that is too long, it begins anew before the next zero", "receiver: garbage")
class NoDiscarding(Decoding):
    class Decoder(StreamDecoder):
        def feed(self, data):
            packets = []
            for at in range(len(data)):
                packets += super().feed(data[at : at + 1])
                self._discarding = False
            return packets


@wrong("a frame has to come in one read", "receiver: cuts")
class WholeReads(Decoding):
    class Decoder(StreamDecoder):
        def feed(self, data):
            self.reset()
            return super().feed(data)
