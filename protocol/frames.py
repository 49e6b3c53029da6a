"""Packets: `pack` a frame into header, body and CRC-32, and `unpack` it again. All frames are importable from here.

Layouts, units and the layout hash L come from `layouts.py`; SPEC.md says what every field means.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterable
from typing import Any

from protocol import messages
from protocol.layouts import HEADER, HEADER_SIZE, LAYOUT_BY_TYPE, READINGS, struct_format
from protocol.messages import *  # noqa: F403  (everything that has a name on the wire is also frames.NAME)
from protocol.messages import (
    EULER,
    HELD,
    LAYOUT_HASH,
    MAX_PACKET,
    MAX_TELEMETRY_WORDS,
    MIN_PACKET,
    NO_TICK,
    PROTOCOL_VERSION,
    QUATERNION,
    RATE,
    REUSED,
    ROLE_BOARD,
    USED,
    ZERO,
    Command,
    Config,
    Event,
    Frame,
    Hello,
    Packet,
    Reading,
    Ready,
    Sample,
    Stop,
    Telemetry,
    Tick,
    Timing,
    Type,
)
from protocol.refusals import BadCrc, BadLength, BadValue, BadVersion, CannotPack, TooLong, TooShort, UnknownType
from protocol.refusals import BadPacket as BadPacket

__all__ = ["BadPacket", "has_right_crc", "in_sequence", "pack", "unpack", "unpack_checked"]
__all__ += messages.__all__


def has_right_crc(packet: bytes) -> bool:
    """Whether the last four bytes are the CRC of the rest; HELLO's starts from 0, every other from L.

    The CRC over data and its own CRC is a constant, whatever the start: no slice is needed.
    """
    return zlib.crc32(packet, 0 if packet[1] == Type.HELLO else LAYOUT_HASH) == _RESIDUE


def pack(frame: Frame, sequence: int) -> bytes:
    """The packet of `frame`. Raises CannotPack when a number does not fit its field."""
    try:
        body = _PACKERS[type(frame)](frame, sequence)
    except (struct.error, TypeError, AttributeError, ValueError) as error:
        raise CannotPack(frame, error) from None
    if len(body) > MAX_PACKET - 4:
        raise CannotPack(frame, f"{len(body) + 4} bytes, at most {MAX_PACKET}")
    start = 0 if body[1] == Type.HELLO else LAYOUT_HASH
    return body + zlib.crc32(body, start).to_bytes(4, "little")


def unpack(packet: bytes) -> Packet:
    """Take a packet apart. Raises one of the BadPacket classes of `protocol.refusals`, in their order there."""
    if len(packet) < MIN_PACKET:
        raise TooShort(len(packet))
    if len(packet) > MAX_PACKET:
        raise TooLong(len(packet))
    if not has_right_crc(packet):
        raise BadCrc(packet)
    return unpack_checked(packet)


def unpack_checked(packet: bytes) -> Packet:
    """The same for a packet whose length and CRC are known to be right, as every decoder's are."""
    version, type_, sequence, tick = _HEADER.unpack_from(packet)
    if version != PROTOCOL_VERSION:
        raise BadVersion(version, PROTOCOL_VERSION)
    reader = _READERS.get(type_)
    if reader is None:
        raise UnknownType(type_)
    return Packet(version, type_, sequence, tick, reader(packet, tick), packet)


_HEADER = struct.Struct("<" + struct_format(HEADER))
_HALF = 0x8000  # of the numbers there are
_RESIDUE = 0x2144DF1C  # CRC-32 of any data followed by its own CRC, as zlib gives it


def _fixed(type_: Type) -> struct.Struct:
    """Header and fixed fields of one frame type in one format."""
    return struct.Struct("<" + struct_format(HEADER) + struct_format(LAYOUT_BY_TYPE[type_].fields))


def _with_readings(present: int) -> struct.Struct:
    fields = LAYOUT_BY_TYPE[Type.SAMPLE].fields
    for reading in READINGS:
        if present >> reading.bit & 1:
            fields += reading.fields
    return struct.Struct("<" + struct_format(HEADER) + struct_format(fields))


_CONFIG, _TELEMETRY = _fixed(Type.CONFIG), _fixed(Type.TELEMETRY)
_COMMAND, _EVENT, _HELLO, _READY = (_fixed(t) for t in (Type.COMMAND, Type.EVENT, Type.HELLO, Type.READY))
_TICK, _TIMING, _STOP = (_fixed(t) for t in (Type.TICK, Type.TIMING, Type.STOP))
_SAMPLES = tuple(_with_readings(present) for present in range(8))
_WORDS = tuple(struct.Struct(f"<{n}i") for n in range(MAX_TELEMETRY_WORDS + 1))
_PRESENT_AT = HEADER_SIZE + 3 * 12 + 4 + 4 + 1  # offset of `present` in a SAMPLE packet


def in_sequence(packets: Iterable[bytes]) -> list[bytes]:
    """Packets of one answer, in any order, by their numbers, which may pass from 65535 to 0 among them."""
    numbered = [(int.from_bytes(packet[2:4], "little"), packet) for packet in packets]
    numbers = [number for number, _ in numbered]
    shift = _HALF if numbers and max(numbers) - min(numbers) >= _HALF else 0
    return [packet for _, packet in sorted(numbered, key=lambda each: (each[0] + shift) % (2 * _HALF))]


# -- pack: (frame, sequence) -> header and body ----------------------------------------------------------------------


def _words(words: tuple[int, ...]) -> bytes:
    if len(words) >= len(_WORDS):
        raise ValueError(f"{len(words)} words, at most {MAX_TELEMETRY_WORDS}")
    return _WORDS[len(words)].pack(*words)


def _pack_config(f: Config, sequence: int) -> bytes:
    return _CONFIG.pack(1, Type.CONFIG, sequence, NO_TICK, f.part, f.parts, f.offset, 0) + _words(f.words)


def _pack_sample(f: Sample, sequence: int) -> bytes:
    tick, setpoint, applied, momentum, ack, transit, source, valid, (euler, quaternion, rate) = f
    present, tail = 0, ()  # type: tuple[int, tuple[int, ...]]
    if euler is not None:
        present, tail = EULER, (euler[0], *euler[1])
    if quaternion is not None:
        present, tail = present | QUATERNION, (*tail, quaternion[0], *quaternion[1])
    if rate is not None:
        present, tail = present | RATE, (*tail, rate[0], *rate[1])
    if valid & ~present or not ZERO <= source <= HELD:
        raise ValueError(f"source {source} is none of 0, 1, 2, or valid {valid:#x} names an absent reading")
    head = (1, Type.SAMPLE, sequence, tick, *setpoint, *applied, *momentum)
    return _SAMPLES[present].pack(*head, ack, transit, source, present, valid, 0, *tail)


def _pack_command(f: Command, sequence: int) -> bytes:
    if not USED <= f.used <= REUSED:
        raise ValueError(f"used {f.used} is none of 1, 2, 3, 4, 5")
    return _COMMAND.pack(1, Type.COMMAND, sequence, f.tick, *f.torque, f.flags, f.follows, f.used)


def _pack_telemetry(f: Telemetry, sequence: int) -> bytes:
    return _TELEMETRY.pack(1, Type.TELEMETRY, sequence, f.tick, f.law_id, f.law_version) + _words(f.words)


def _pack_event(f: Event, sequence: int) -> bytes:
    return _EVENT.pack(1, Type.EVENT, sequence, f.tick, f.code, 0, f.a, f.b)


def _pack_hello(f: Hello, sequence: int) -> bytes:
    build = f.build.encode("ascii")
    if len(build) > 24 or not f.build.isprintable():
        raise ValueError(f"build {f.build!r} is not at most 24 printable ASCII characters")
    return _HELLO.pack(1, Type.HELLO, sequence, NO_TICK, *f[:6], build)


def _pack_ready(f: Ready, sequence: int) -> bytes:
    return _READY.pack(1, Type.READY, sequence, NO_TICK, *f)


def _pack_tick(f: Tick, sequence: int) -> bytes:
    return _TICK.pack(1, Type.TICK, sequence, f.tick)


def _pack_timing(f: Timing, sequence: int) -> bytes:
    return _TIMING.pack(1, Type.TIMING, sequence, *f)


def _pack_stop(f: Stop, sequence: int) -> bytes:
    return _STOP.pack(1, Type.STOP, sequence, NO_TICK, f.reason, 0)


_PACKERS: dict[type, Callable[[Any, int], bytes]] = {
    Config: _pack_config,
    Sample: _pack_sample,
    Command: _pack_command,
    Telemetry: _pack_telemetry,
    Event: _pack_event,
    Hello: _pack_hello,
    Ready: _pack_ready,
    Tick: _pack_tick,
    Timing: _pack_timing,
    Stop: _pack_stop,
}


# -- unpack: (packet, tick) -> frame ---------------------------------------------------------------------------------


def _exactly(form: struct.Struct, packet: bytes) -> tuple[Any, ...]:
    """Body fields (after the header's four) of a packet whose length is fixed."""
    if len(packet) != form.size + 4:
        raise BadLength(packet[1], len(packet), form.size + 4)
    return form.unpack_from(packet)[4:]


def _with_words(form: struct.Struct, packet: bytes) -> tuple[tuple[Any, ...], tuple[int, ...]]:
    count, odd = divmod(len(packet) - form.size - 4, 4)
    if count < 0 or odd:
        raise BadLength(packet[1], len(packet), f"{form.size + 4} + 4 n")
    return form.unpack_from(packet)[4:], _WORDS[count].unpack_from(packet, form.size)


def _tickless(type_: Type, tick: int) -> None:
    if tick != NO_TICK:
        raise BadValue(type_, "tick", tick, "NO_TICK")


def _ticked(type_: Type, tick: int) -> None:
    if tick == NO_TICK:
        raise BadValue(type_, "tick", tick, "a tick")


def _read_config(packet: bytes, tick: int) -> Config:
    (part, parts, offset, reserved), words = _with_words(_CONFIG, packet)
    _tickless(Type.CONFIG, tick)
    if part >= parts:
        raise BadValue(Type.CONFIG, "part", part, f"less than parts = {parts}")
    if reserved:
        raise BadValue(Type.CONFIG, "reserved", reserved, "0")
    return Config(part, parts, offset, words)


def _read_sample(packet: bytes, tick: int) -> Sample:
    if len(packet) <= _PRESENT_AT + 6:
        raise BadLength(Type.SAMPLE, len(packet), _SAMPLES[0].size + 4)
    present = packet[_PRESENT_AT]
    if present > 7:
        raise BadValue(Type.SAMPLE, "present", present, "bits 0 to 2")
    form = _SAMPLES[present]
    if len(packet) != form.size + 4:
        raise BadLength(Type.SAMPLE, len(packet), form.size + 4)
    v = form.unpack_from(packet)
    source, valid = v[15], v[17]
    if source > HELD or valid & ~present or v[18] or tick == NO_TICK:
        raise _bad_sample(tick, source, present, valid, v[18])
    at = 19
    readings: list[Reading | None] = [None, None, None]
    for bit, size in _SHAPES[present]:
        readings[bit] = Reading(v[at], v[at + 1 : at + size])
        at += size
    return Sample(tick, v[4:7], v[7:10], v[10:13], v[13], v[14], source, valid, tuple(readings))  # type: ignore[arg-type]


_SHAPES = tuple(
    tuple((r.bit, 1 + r.fields[1].length) for r in READINGS if present >> r.bit & 1) for present in range(8)
)


def _bad_sample(tick: int, source: int, present: int, valid: int, reserved: int) -> BadPacket:
    if tick == NO_TICK:
        return BadValue(Type.SAMPLE, "tick", tick, "a tick")
    if source > HELD:
        return BadValue(Type.SAMPLE, "source", source, "0, 1 or 2")
    if valid & ~present:
        return BadValue(Type.SAMPLE, "valid", valid, f"a part of present = {present:#x}")
    return BadValue(Type.SAMPLE, "reserved", reserved, "0")


def _read_command(packet: bytes, tick: int) -> Command:
    x, y, z, flags, follows, used = _exactly(_COMMAND, packet)
    _ticked(Type.COMMAND, tick)
    if not USED <= used <= REUSED:
        raise BadValue(Type.COMMAND, "used", used, "1, 2, 3, 4 or 5")
    return Command(tick, (x, y, z), flags, follows, used)


def _read_telemetry(packet: bytes, tick: int) -> Telemetry:
    (law_id, law_version), words = _with_words(_TELEMETRY, packet)
    _ticked(Type.TELEMETRY, tick)
    return Telemetry(tick, law_id, law_version, words)


def _read_event(packet: bytes, tick: int) -> Event:
    code, reserved, a, b = _exactly(_EVENT, packet)
    _ticked(Type.EVENT, tick)
    if reserved:
        raise BadValue(Type.EVENT, "reserved", reserved, "0")
    return Event(tick, code, a, b)


def _read_hello(packet: bytes, tick: int) -> Hello:
    version, role, flags, layout_hash, nonce, rate, raw = _exactly(_HELLO, packet)
    _tickless(Type.HELLO, tick)
    text = raw.rstrip(b"\0")
    if role > ROLE_BOARD:
        raise BadValue(Type.HELLO, "role", role, "0 or 1")
    if not all(0x20 <= byte <= 0x7E for byte in text):
        raise BadValue(Type.HELLO, "build", raw, "printable ASCII, padded with NUL")
    return Hello(version, role, flags, layout_hash, nonce, rate, text.decode("ascii"))


def _read_ready(packet: bytes, tick: int) -> Ready:
    ready = Ready(*_exactly(_READY, packet))
    _tickless(Type.READY, tick)
    return ready


def _read_tick(packet: bytes, tick: int) -> Tick:
    _exactly(_TICK, packet)
    _ticked(Type.TICK, tick)
    return Tick(tick)


def _read_timing(packet: bytes, tick: int) -> Timing:
    timing = Timing(tick, *_exactly(_TIMING, packet))
    _ticked(Type.TIMING, tick)
    return timing


def _read_stop(packet: bytes, tick: int) -> Stop:
    reason, reserved = _exactly(_STOP, packet)
    _tickless(Type.STOP, tick)
    if reserved:
        raise BadValue(Type.STOP, "reserved", reserved, "0")
    return Stop(reason)


_READERS: dict[int, Callable[[bytes, int], Frame]] = {
    Type.CONFIG: _read_config,
    Type.SAMPLE: _read_sample,
    Type.COMMAND: _read_command,
    Type.TELEMETRY: _read_telemetry,
    Type.EVENT: _read_event,
    Type.HELLO: _read_hello,
    Type.READY: _read_ready,
    Type.TICK: _read_tick,
    Type.TIMING: _read_timing,
    Type.STOP: _read_stop,
}
