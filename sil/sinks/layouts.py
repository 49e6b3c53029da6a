"""The messages of our own topics in run.mcap and timing.mcap: one table each gives schema, encoder and numpy dtype.

Encoding is CDR (little endian, XCDR1: four header bytes, then every field aligned to its size) with ros2msg schemas.
Fields stand in falling size, so there is no padding and `np.frombuffer(rows, layout.dtype)` reads messages of fixed
size in bulk once the four header bytes are taken off. Field names are lower case because ros2msg wants it; the suffix
is the unit, which also stands in brackets before the meaning. `fate` is a sil.sinks.journal.Fate everywhere.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

CDR_HEADER = b"\x00\x01\x00\x00"
ENCODING = "cdr"
SCHEMA_ENCODING = "ros2msg"

_CODES = {
    "float64": ("d", 8),
    "int64": ("q", 8),
    "uint32": ("I", 4),
    "int32": ("i", 4),
    "uint16": ("H", 2),
    "uint8": ("B", 1),
}


class Field(NamedTuple):
    """One field: ros2msg type, name, number of elements (1: a scalar) and what it means."""

    type: str
    name: str
    size: int
    about: str


class Layout:
    """A message of fixed size. `pack(*values)` takes all elements flat, in field order."""

    def __init__(self, name: str, about: str, fields: Sequence[Field]) -> None:
        sizes = [_CODES[field.type][1] for field in fields]
        assert sizes == sorted(sizes, reverse=True), f"{name}: fields must stand in falling size"
        self.name = name
        self.fields = tuple(fields)
        self._struct = struct.Struct("<4s" + "".join(f"{f.size}{_CODES[f.type][0]}" for f in fields))
        self.size = self._struct.size
        self.schema = _schema(about, fields).encode()
        self.dtype = np.dtype([(f.name, "<" + np.dtype(f.type).str[1:], _shape(f)) for f in fields])
        assert self.dtype.itemsize == self.size - len(CDR_HEADER)

    def pack(self, *values: float | int) -> bytes:
        """The CDR bytes of one message."""
        return self._struct.pack(CDR_HEADER, *values)


def _shape(field: Field) -> tuple[int, ...]:
    return () if field.size == 1 else (field.size,)


def _schema(about: str, fields: Sequence[Field]) -> str:
    lines = [f"# {about}"]
    for f in fields:
        size = "" if f.size == 1 else f"[{f.size}]"
        lines.append(f"{f.type}{size} {f.name}  # {f.about}")
    return "\n".join(lines) + "\n"


TRUTH = Layout(
    "sil/msg/Truth",
    "The plant at the tick and the torque that acts from this tick on. Frames: N inertial, B body, v_N = q v_B q*.",
    [
        Field("float64", "q_bn", 4, "attitude of the body in inertial space, scalar first"),
        Field("float64", "omega_bn_b_radps", 3, "[rad/s] body rate, body axes"),
        Field("float64", "momentum_nms", 3, "[N m s] absolute wheel momentum, body axes"),
        Field("float64", "euler_rad", 3, "[rad] attitude angles x, y, z relative to attitude.frame"),
        Field("float64", "euler_deg", 3, "[deg] the same"),
        Field("float64", "applied_nm", 3, "[N m] torque on the body after limits, body axes"),
        Field("float64", "setpoint_deg", 3, "[deg] set-point as the laboratory resolved it"),
        Field("uint32", "tick", 1, "tick number"),
        Field("uint8", "source", 1, "applied torque: 0 zero, 1 fresh, 2 held"),
    ],
)

SAMPLE = Layout(
    "sil/msg/Sample",
    "A decoded SAMPLE frame. A reading that was not sent is NaN with age 0xffffffff.",
    [
        Field("float64", "setpoint_deg", 3, "[deg] set-point"),
        Field("float64", "applied_nm", 3, "[N m] torque on the body from this tick on"),
        Field("float64", "momentum_nms", 3, "[N m s] absolute wheel momentum"),
        Field("float64", "euler_deg", 3, "[deg] reading: attitude angles"),
        Field("float64", "quaternion", 4, "reading: attitude quaternion, scalar first"),
        Field("float64", "rate_radps", 3, "[rad/s] reading: body rates"),
        Field("uint32", "tick", 1, "tick number"),
        Field("uint32", "ack", 1, "source tick of the command that acts now, 0xffffffff before the first"),
        Field("uint32", "transit_us", 1, "[us] modelled transit time"),
        Field("uint32", "age_us", 3, "[us] age of the readings at t_k: angles, quaternion, rates"),
        Field("uint8", "source", 1, "applied torque: 0 zero, 1 fresh, 2 held"),
        Field("uint8", "present", 1, "bit mask of readings sent: 0 angles, 1 quaternion, 2 rates"),
        Field("uint8", "valid", 1, "bit mask of valid readings"),
        Field("uint8", "fate", 1, "0 delivered, 1 late, 2 dropped, 3 corrupted, 4 in flight"),
    ],
)

COMMAND = Layout(
    "sil/msg/Command",
    "A decoded COMMAND frame.",
    [
        Field("float64", "torque_nm", 3, "[N m] commanded torque on the body, body axes"),
        Field("uint32", "tick", 1, "tick it was computed at"),
        Field("int32", "torque_lsb", 3, "[2^-torque_bits N m] the same in wire units"),
        Field("uint16", "flags", 1, "bits as in protocol/SPEC.md"),
        Field("uint8", "used", 1, "1 sample used, 2 propagated, 3 repeated, 4 restarted, 5 reused"),
        Field("uint8", "follows", 1, "number of TELEMETRY and EVENT frames that follow"),
        Field("uint8", "fate", 1, "0 delivered, 1 late, 2 dropped, 3 corrupted, 4 in flight"),
    ],
)

EVENT = Layout(
    "sil/msg/Event",
    "Something worth knowing; /log has it in words.",
    [
        Field("uint32", "tick", 1, "tick number"),
        Field("int32", "a", 1, "first number, meaning by code"),
        Field("int32", "b", 1, "second number, meaning by code"),
        Field("uint16", "code", 1, "event code"),
        Field("uint8", "origin", 1, "0 laboratory, 1 board"),
    ],
)

SESSION = Layout(
    "sil/msg/Session",
    "A board session started at this tick: a replay starts a fresh board here.",
    [
        Field("uint32", "tick", 1, "tick number"),
        Field("uint32", "index", 1, "0 for the first session of the run"),
    ],
)

TIMING = Layout(
    "sil/msg/Timing",
    "Wall-clock behaviour of one tick on this machine.",
    [
        Field("int64", "lateness_ns", 1, "[ns] wake-up after the deadline"),
        Field("int64", "answer_ns", 1, "[ns] from SAMPLE sent to COMMAND received; -1: no answer"),
        Field("int64", "work_ns", 1, "[ns] CPU time the laboratory took for the tick before; 0 in lockstep"),
        Field("int64", "gc_ns", 1, "[ns] of it (wall time): garbage collection"),
        Field("int64", "log_ns", 1, "[ns] of it (wall time): the journal's write"),
        Field("uint32", "tick", 1, "tick number"),
        Field("uint32", "cause", 1, "late by: 0 nothing, 1 machine, 2 own work, 3 collection, 4 log, 5 answer, 6 link"),
    ],
)


class PacketLayout:
    """A packet with its fate; of variable size, so it is read one by one."""

    name = "sil/msg/Packet"
    schema = (
        b"# A deterministic frame as it stood on the link, header to CRC, before COBS.\n"
        b"uint32 tick  # tick in the header, 0xffffffff for frames that belong to no tick\n"
        b"uint16 sequence  # sequence in the header\n"
        b"uint8 type  # frame type\n"
        b"uint8 fate  # 0 delivered, 1 late, 2 dropped, 3 corrupted, 4 in flight\n"
        b"uint8[] packet  # header to CRC\n"
        b"uint8[] encoded  # bytes on the wire where a byte fault altered them, else empty\n"
        b"string cause  # why it was lost, altered or late, else empty\n"
        b"uint8 copy  # 0 the frame's own, 1 of a duplicate\n"
        b"int64 arrival_ns  # [ns] modelled, on the simulation's clock, had it not been lost; -1 not modelled\n"
    )
    _HEAD = struct.Struct("<4sIHBBI")
    _LENGTH = struct.Struct("<I")
    _ARRIVAL = struct.Struct("<q")
    _PAD = (b"", b"\0\0\0", b"\0\0", b"\0")  # up to a multiple of four, by len % 4

    def pack(
        self,
        tick: int,
        sequence: int,
        type: int,
        fate: int,
        packet: bytes,
        encoded: bytes,
        cause: str = "",
        copy: int = 0,
        arrival_ns: int = -1,
    ) -> bytes:
        """The CDR bytes of one message."""
        head = self._HEAD.pack(CDR_HEADER, tick, sequence, type, fate, len(packet))
        said = cause.encode("ascii") + b"\0"
        parts = (
            head, packet, self._PAD[len(packet) % 4],
            self._LENGTH.pack(len(encoded)), encoded, self._PAD[len(encoded) % 4],
            self._LENGTH.pack(len(said)), said, bytes((copy,)),
        )  # fmt: skip
        body = b"".join(parts)
        return body + bytes(-(len(body) - len(CDR_HEADER)) % 8) + self._ARRIVAL.pack(arrival_ns)

    def unpack(self, data: bytes) -> tuple[int, int, int, int, bytes, bytes, str, int, int]:
        """(tick, sequence, type, fate, packet, encoded, cause, copy, arrival_ns) of the CDR bytes.

        A log of an older version ends with `encoded`.
        """
        _, tick, sequence, type_, fate, length = self._HEAD.unpack_from(data)
        start = self._HEAD.size
        second = start + length + len(self._PAD[length % 4])
        (size,) = self._LENGTH.unpack_from(data, second)
        packet, encoded = data[start : start + length], data[second + 4 : second + 4 + size]
        if len(packet) != length or len(encoded) != size:
            raise ValueError(f"packet message of {len(data)} bytes is cut off")
        third = second + 4 + size
        if third == len(data):
            return tick, sequence, type_, fate, packet, encoded, "", 0, -1
        third += len(self._PAD[size % 4])
        (said,) = self._LENGTH.unpack_from(data, third)
        cause, copy = data[third + 4 : third + 4 + said], data[third + 4 + said]
        (arrival_ns,) = self._ARRIVAL.unpack(data[-self._ARRIVAL.size :])
        return tick, sequence, type_, fate, packet, encoded, cause[:-1].decode("ascii"), copy, arrival_ns


PACKET = PacketLayout()


class HousekeepingLayout:
    """A housekeeping packet with the host's time; of variable size."""

    name = "sil/msg/Housekeeping"
    schema = (
        b"# A housekeeping frame, header to CRC, before COBS.\n"
        b"int64 host_ns  # [ns] CLOCK_MONOTONIC of the laboratory\n"
        b"uint8[] packet  # header to CRC\n"
    )
    _HEAD = struct.Struct("<4sqI")

    def pack(self, host_ns: int, packet: bytes) -> bytes:
        """The CDR bytes of one message."""
        return self._HEAD.pack(CDR_HEADER, host_ns, len(packet)) + packet

    def unpack(self, data: bytes) -> tuple[int, bytes]:
        """(host_ns, packet) of the CDR bytes."""
        _, host_ns, length = self._HEAD.unpack_from(data)
        return host_ns, data[self._HEAD.size : self._HEAD.size + length]


HOUSEKEEPING = HousekeepingLayout()


class JointStateLayout:
    """sensor_msgs/msg/JointState of the same joints all along: the message that viewers know joints by.

    Positions are never known, velocities of all joints or of none: as the message wants it, its arrays are then empty.
    """

    name = "sensor_msgs/msg/JointState"
    schema = (
        b"# Wheels as joints about the body axes. Arrays are empty where nothing is known.\n"
        b"std_msgs/Header header  # stamp: simulation time; frame_id: body\n"
        b"string[] name  # wheel_x, wheel_y, wheel_z\n"
        b"float64[] position  # [rad] empty\n"
        b"float64[] velocity  # [rad/s] relative to the body; empty without spin inertia, NaN of one wheel without\n"
        b"float64[] effort  # [N m] motor torque on the wheel: the negative of what acts on the body\n"
        + b"=" * 80
        + b"\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
        + b"=" * 80
        + b"\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    )

    def __init__(self, names: Sequence[str] = (), with_velocity: bool = True) -> None:
        known = len(names) if with_velocity else 0
        frame = _aligned(b"", "body") + struct.pack("<I", len(names))
        self._between = _aligned(frame, *names) + struct.pack("<II", 0, known)  # no positions, then the velocities
        self._count = len(names)
        at = struct.calcsize(self._format(0, 0)) - len(CDR_HEADER)
        first = -at % 8 if known else 0
        second = -(at + first + 8 * known + 4) % 8
        self._struct = struct.Struct(self._format(first, second, known))

    def pack(self, t_ns: int, velocity: Sequence[float], effort: Sequence[float]) -> bytes:
        """The CDR bytes of one message; `velocity` is empty where the layout is without."""
        seconds, nanos = divmod(t_ns, 1_000_000_000)
        return self._struct.pack(CDR_HEADER, seconds, nanos, self._between, *velocity, self._count, *effort)

    def _format(self, first: int, second: int, known: int | None = None) -> str:
        head = f"<4siI{len(self._between)}s"
        return head if known is None else f"{head}{first}x{known}dI{second}x{self._count}d"


def _aligned(before: bytes, *texts: str) -> bytes:
    """`before` and after it these strings, each up to a multiple of four."""
    for text in texts:
        data = text.encode("ascii") + b"\0"
        before += struct.pack("<I", len(data)) + data + bytes(-len(data) % 4)
    return before


def telemetry(law: str, words: Sequence[tuple[str, str]], abouts: Sequence[str] = ()) -> Layout:
    """The TELEMETRY layout of one law: a float64 per word, given as (name, unit), then tick, law and fate.

    abouts: what each word means; a reader can do without.
    """
    said = [*abouts, *[""] * (len(words) - len(abouts))]
    fields = [
        Field("float64", _ros_name(name), 1, f"[{unit or '1'}] {about}".rstrip())
        for (name, unit), about in zip(words, said, strict=True)
    ]
    tail = [
        Field("uint32", "tick", 1, "tick number"),
        Field("uint16", "law_id", 1, "law"),
        Field("uint16", "law_version", 1, "its version"),
        Field("uint8", "fate", 1, "0 delivered, 1 late, 2 dropped, 3 corrupted, 4 in flight"),
    ]
    camel = "".join(part.capitalize() for part in _ros_name(law).split("_"))
    return Layout(f"sil/msg/Telemetry{camel}", f"A decoded TELEMETRY frame of law {law}.", fields + tail)


def _ros_name(name: str) -> str:
    """Lower case letters, digits and single underscores; starts with a letter."""
    cleaned = "".join(c if c.isalnum() else "_" for c in name.lower()).strip("_")
    while "__" in cleaned:
        cleaned = cleaned.replace("__", "_")
    return cleaned if cleaned[:1].isalpha() else f"w_{cleaned}"
