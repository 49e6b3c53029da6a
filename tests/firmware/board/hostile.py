"""What a board may have to hear: legal frames in any order, illegal ones, damaged ones, and noise between them."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Sequence
from random import Random

from c_board import Step

from protocol import frames
from protocol.codec import encode
from protocol.frames import LAYOUT_HASH, NO_TICK, Hello, Reading, Sample, Stop, Tick, Type
from protocol.law_tables import C_LAWS, COMMON, FORM_FLOAT, config_words
from protocol.words import INT32_MAX

INT32 = (-(2**31), INT32_MAX)
RATES = (0, 0, 65536, 20 * 65536, 1, 2**32 - 1, 65537)
READING_WORDS = (3, 4, 3)
FORM = [word.name for word in COMMON].index("form")


# -- packets ----------------------------------------------------------------------------------------------------------


def with_crc(body: bytes) -> bytes:
    """Header and body with the CRC that their type asks for."""
    start = 0 if body[1] == Type.HELLO else LAYOUT_HASH
    return body + zlib.crc32(body, start).to_bytes(4, "little")


def any_packet(random: Random) -> bytes:
    """Right CRC, and anything else: about half are frames, the rest are refused for one reason or another."""
    types = [int(type_) for type_ in Type]
    type_ = random.choice(types) if random.random() < 0.95 else random.randrange(256)
    body = bytearray(random.randbytes(_length(random, type_)))
    body[0] = 1 if random.random() < 0.97 else random.randrange(256)
    body[1] = type_
    ticked = type_ not in (Type.CONFIG, Type.HELLO, Type.READY, Type.STOP)
    if random.random() < 0.97:
        body[4:8] = struct.pack("<I", random.randrange(NO_TICK) if ticked else NO_TICK)
    if random.random() < 0.9:
        _make_values_right(random, body)
    return with_crc(bytes(body))


def _length(random: Random, type_: int) -> int:
    """Header and body of a frame of this type; one in twenty is wrong."""
    fixed = {0x02: 56, 0x03: 24, 0x05: 20, 0x81: 52, 0x82: 16, 0x83: 8, 0x84: 24, 0x85: 12}.get(type_)
    if fixed is None or random.random() < 0.05:
        return random.randrange(8, 247) if random.random() < 0.5 else 16 + 4 * random.randrange(57)
    return fixed


def _make_values_right(random: Random, body: bytearray) -> None:
    type_ = body[1]
    if type_ == Type.CONFIG and len(body) >= 16:
        parts = random.randrange(1, 400)
        body[8:16] = struct.pack("<HHHH", random.randrange(parts), parts, random.randrange(65536), 0)
    elif type_ == Type.SAMPLE and len(body) == 56:
        present = random.randrange(8)
        body[52:56] = bytes((random.randrange(3), present, present & random.randrange(8), 0))
        for bit, words in enumerate(READING_WORDS):
            if present >> bit & 1:
                body += random.randbytes(4 + 4 * words)
    elif type_ == Type.COMMAND and len(body) == 24:
        body[23] = random.randrange(1, 6)
    elif type_ in (Type.EVENT, Type.STOP) and len(body) >= 12:
        body[10:12] = b"\0\0"
    elif type_ == Type.HELLO and len(body) == 52:
        body[10] = random.randrange(2)
        build = [random.randrange(0x20, 0x7F) for _ in range(random.randrange(25))]
        if build and random.random() < 0.2:
            build[random.randrange(len(build))] = random.choice((0, 0x1F, 0x7F, 0x80))
        body[28:52] = bytes(build).ljust(24, b"\0")


def any_bytes(random: Random, packet: bytes) -> bytes:
    """A packet on the stream, as it is or after an accident; or no packet at all."""
    wire = bytearray(encode(packet))
    kind = random.randrange(12)
    if kind < 4:
        return bytes(wire)
    if kind == 4:
        wire[random.randrange(len(wire))] ^= 1 << random.randrange(8)
    elif kind == 5:
        del wire[random.randrange(len(wire)) :]
    elif kind == 6:
        del wire[random.randrange(len(wire))]
    elif kind == 7:
        wire.insert(random.randrange(len(wire)), random.randrange(256))
    elif kind == 8:
        return random.randbytes(random.randrange(40))
    elif kind == 9:
        return (
            bytes(random.randrange(1, 256) for _ in range(random.choice((11, 12, 13, 250, 251, 252, 253, 600)))) + b"\0"
        )
    elif kind == 10:
        return b"\0" * random.randrange(4)
    else:
        at = random.randrange(len(wire))
        wire[at:at] = wire[random.randrange(len(wire)) :]
    return bytes(wire)


def hostile_pieces(seed: int, count: int) -> list[bytes]:
    """So many pieces of a hostile byte stream, each a frame, a damaged one, or noise."""
    random = Random(seed)
    packets = [any_packet(random) for _ in range(2000)]
    return [any_bytes(random, packets[random.randrange(2000)]) for _ in range(count)]


# -- sessions ---------------------------------------------------------------------------------------------------------


def any_words(random: Random) -> tuple[int, ...]:
    """CONFIG words of a law; mostly such as it flies with, and never the float form, which a C board does not have."""
    table = random.choice(C_LAWS)
    rows, tick, size = [], 0, 2 ** random.choice((20, 22, 24, 29))
    for _ in range(random.choice((0, 1, 3, 40))):
        tick += random.randrange(1, 30)
        rows.append((tick - 1, *(random.randrange(-size, size) for _ in range(3))))
    values = {
        "period_us": random.choice((200_000, 500_000, 1_000_000)),
        "answer_delay_us": random.choice((0, 0, 150_000, 345_000, 700_000)),
        "sample_timeout_us": random.choice((0, 100_000)),
        "telemetry_every": random.choice((0, 1, 1, 3)),
        "link_limit": random.choice((1, 3, 20)),
        "setpoint_source": random.randrange(2),
        "torque_limit": random.choice((0.0, 0.001, 0.1, math.inf, math.inf)),
        "transport_delay_ticks": random.randrange(5) if table.name == "pd" or random.random() < 0.1 else 1,
        "reference_kind": random.randrange(3),
        "stale": random.randrange(2),
    }
    words = list(config_words(table, values, rows))
    for _ in range(random.choice((0, 0, 0, 0, 0, 0, 0, 0, 1, 2))):
        words[random.randrange(len(words))] = any_count(random)
    words[FORM] = 0 if words[FORM] == FORM_FLOAT else words[FORM]
    return tuple(words)


def any_count(random: Random) -> int:
    """A word: small, near a power of two, or anything."""
    kind = random.randrange(4)
    if kind == 0:
        return random.randrange(-3, 50)
    if kind == 1:
        return max(
            min(random.choice((-1, 1)) * 2 ** random.randrange(32) + random.randrange(-2, 3), INT32[1]), INT32[0]
        )
    return random.choice(INT32) if kind == 2 else random.randrange(INT32[0], INT32[1] + 1)


def any_parts(random: Random, words: Sequence[int]) -> list[frames.Config]:
    """The words cut as a laboratory may cut them; now and then a part is missing, twice there, or wrong."""
    size = random.choice((57, 57, 57, 20, 5))
    starts = range(0, max(len(words), 1), size)
    parts = [
        frames.Config(part, len(starts), start, tuple(words[start : start + size])) for part, start in enumerate(starts)
    ]
    if random.random() < 0.3:
        random.shuffle(parts)
    if random.random() < 0.1:
        parts.insert(random.randrange(len(parts) + 1), random.choice(parts))
    if random.random() < 0.05:
        parts.pop(random.randrange(len(parts)))
    if random.random() < 0.05 and parts:
        at = random.randrange(len(parts))
        parts[at] = parts[at]._replace(offset=random.randrange(300))
    return parts


def any_sample(random: Random, tick: int, angles: tuple[int, int, int]) -> Sample:
    """A SAMPLE with these angles; readings may be missing, invalid, late."""
    small = tuple(random.randrange(-(2**22), 2**22) for _ in range(6))
    present = 7 if random.random() < 0.8 else random.randrange(8)
    values = (angles, (2**30, 0, 0, 0), small[:3])
    readings = tuple(Reading(0, value) if present >> bit & 1 else None for bit, value in enumerate(values))
    valid = present if random.random() < 0.9 else present & random.randrange(8)
    transit = random.choice((0, 0, 7000, 90_000, 400_000, 2**32 - 1 if random.random() < 0.02 else 1))
    ack = tick - 1 if tick else NO_TICK
    return Sample(tick, angles, small[:3], small[3:], ack, transit, random.randrange(3), valid, readings)  # type: ignore[arg-type]


class Laboratory:
    """Draws what a board hears, one step after the other. It knows roughly which tick the board expects."""

    def __init__(self, random: Random) -> None:
        self._random = random
        self._tick, self._nonce, self._time_ns = 0, 1, 0
        self._words = any_words(random)
        self._numbers = [0, 0]
        self._angles, self._rates = [0, 0, 0], [0, 0, 0]

    def steps(self, count: int) -> list[Step]:
        """From a HELLO on; so many draws, each one step or a few."""
        drawn = self._open()
        while len(drawn) < count:
            drawn += self._next()
        return drawn

    def _next(self) -> list[Step]:
        random, kind = self._random, self._random.randrange(1000)
        if kind < 500:
            return [self._sample(0)]
        if kind < 560:
            return [self._tick_frame(0)]
        if kind < 640:
            return [self._sample(random.choice((-3, -1, -1, 1, 2, 4, 5, 9)))]
        if kind < 660:
            return [self._tick_frame(random.choice((-1, 1, 3, 4, 5, 30)))]
        if kind < 740:
            return [Step(any_bytes(random, self._harmless()))]
        if kind < 900:
            return [self._clock()]
        if kind < 906:
            return self._open()
        if kind < 920:
            return self._config(any_parts(random, self._words)[-1:])
        return [self._rare(kind)]

    def _rare(self, kind: int) -> Step:
        random = self._random
        if kind < 935:
            return self._frame(Hello(1, 0, 0, LAYOUT_HASH, self._nonce, 0, "again"))
        if kind < 940:
            return self._frame(Hello(1, 1, 7, LAYOUT_HASH, self._nonce + 1, 0, "a board"))
        if kind < 941:
            return self._frame(Stop(0))
        if kind < 942:
            self._tick = random.choice((NO_TICK - 3, 2**31 - 2, random.randrange(2**32 - 8)))
            return self._sample(0)
        return Step(encode(any_packet(random) if kind < 946 else self._harmless()))

    def _harmless(self) -> bytes:
        """A packet that opens and ends no session, and seldom one that carries the board off to another tick."""
        while True:
            packet = any_packet(self._random)
            far = packet[1] in (Type.SAMPLE, Type.TICK) and self._random.random() < 0.97
            if not far and packet[1] not in (Type.HELLO, Type.STOP):
                return packet

    def _open(self) -> list[Step]:
        """A new session, with a configuration of its own."""
        self._nonce += 1
        self._words, self._tick = any_words(self._random), 0
        self._angles = [self._random.randrange(-(2**22), 2**22) for _ in range(3)]
        hello = self._frame(Hello(1, 0, 0, LAYOUT_HASH, self._nonce, self._random.choice(RATES), "lab"))
        self._numbers[0] = 0
        return [hello, *self._config(any_parts(self._random, self._words))]

    def _config(self, parts: Sequence[frames.Config]) -> list[Step]:
        return [self._frame(part) for part in parts]

    def _sample(self, ahead: int) -> Step:
        tick = self._expected(ahead)
        return self._frame(any_sample(self._random, tick, self._move()))

    def _move(self) -> tuple[int, int, int]:
        """Attitude a tick later: a tumble slow enough that most torques stay within their limits."""
        for axis in range(3):
            self._rates[axis] = self._rates[axis] * 15 // 16 + self._random.randrange(-(2**14), 2**14)
            self._angles[axis] += self._rates[axis]
        x, y, z = ((angle + 2**31) % 2**32 - 2**31 for angle in self._angles)
        return x, y, z

    def _tick_frame(self, ahead: int) -> Step:
        return self._frame(Tick(self._expected(ahead)))

    def _expected(self, ahead: int) -> int:
        tick = min(max(self._tick + ahead, 0), NO_TICK - 1)
        self._tick = max(self._tick, min(tick + 1, NO_TICK - 1))
        return tick

    def _clock(self) -> Step:
        self._time_ns += self._random.choice((1_000, 30_000_000, 100_000_000, 600_000_000, 2_000_000_000))
        return Step(time_ns=self._time_ns)

    def _frame(self, frame: frames.Frame) -> Step:
        which = int(isinstance(frame, Hello | Stop | Tick))
        if self._random.random() < 0.01:
            self._numbers[which] += self._random.choice((-2, 1, 5))
        number = self._numbers[which] & 0xFFFF
        self._numbers[which] += 1
        return Step(encode(frames.pack(frame, number)))
