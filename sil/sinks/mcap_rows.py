"""Journal records to MCAP messages: the rows of run.mcap (RunRows) and of timing.mcap (TimingRows)."""

from __future__ import annotations

import json
import math
from array import array
from collections import Counter
from collections.abc import Mapping
from itertools import groupby
from typing import Any

from mcap.writer import Writer

from protocol import frames
from protocol.events import REFERENCE_RESTART
from protocol.frames import Type
from sil.pointing import Quaternion
from sil.sinks import events, layouts, viewer
from sil.sinks import journal as jn
from sil.sinks.decoding import DEG_PER_BAM, Decoder
from sil.sinks.frames import BODY, HORIZON, HORIZON_IN_ORBITAL, INERTIAL, ORBITAL, REFERENCE, Frames
from sil.sinks.journal import Direction, Fate, Kind, PacketRecord, Record
from sil.sinks.scene import Parts, scene

_DEG = 180.0 / math.pi
_TYPE_AT, _SEQUENCE_AT, _TICK_AT = 1, slice(2, 4), slice(4, 8)
_RANK: dict[int, int] = {Fate.DELIVERED: 0, Fate.LATE: 1, Fate.IN_FLIGHT: 2, Fate.CORRUPTED: 3, Fate.DROPPED: 4}
_FIXED_TOPICS = (
    ("/session", layouts.SESSION),
    ("/packet/up", layouts.PACKET),
    ("/packet/down", layouts.PACKET),
    ("/sample", layouts.SAMPLE),
    ("/command", layouts.COMMAND),
    ("/truth", layouts.TRUTH),
    ("/event", layouts.EVENT),
)


class RunRows:
    """Writes the rows of run.mcap, one tick at a time. Every channel has a schema."""

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self._decoder = Decoder()
        self._channels = _register(writer, _FIXED_TOPICS)
        for topic in ("/tf", "/scene", "/log"):
            self._channels[topic] = _register_viewers(writer, topic)
        self._sees(None)
        self._reported: tuple[int, ...] | None = None  # TELEMETRY's words of this tick
        self._shown: Parts | None = None  # in the last /scene
        self._sessions = 0
        self._end_ns: int | None = None  # what arrives then or later is in flight
        self.fates: Counter[tuple[int, int, str, bool]] = Counter()  # of copies: direction, fate, cause, a further one
        self.messages = 0
        self.undecoded = 0

    # -- identity ------------------------------------------------------------------------------------------------

    def meta(self, content: Mapping[str, Any]) -> None:
        """META: metadata `run`, and the resolved scenario as an attachment."""
        rest = {key: value for key, value in content.items() if key != "scenario"}
        self._decoder.describe(content)
        self._sees(content.get("scenario"))
        self._writer.add_metadata("run", _texts(rest))
        if "scenario" in content:
            text = json.dumps(content["scenario"], indent=2, sort_keys=True, ensure_ascii=False) + "\n"
            self._writer.add_attachment(0, 0, "scenario.json", "application/json", text.encode())

    def end(self, content: Mapping[str, Any]) -> None:
        """Metadata `config`: the words that the board was sent; metadata `end`: END."""
        if self._decoder.words:
            self._writer.add_metadata("config", _texts(self._decoder.named_words()))
        self._writer.add_metadata("end", _texts(content))

    # -- one tick ------------------------------------------------------------------------------------------------

    def tick(self, tick: int, t_ns: int, records: list[Record]) -> None:
        """All rows of one tick, in the order that seal.py promises."""
        packets = sorted(
            (jn.read_packet(record.payload) for record in records if record.kind == Kind.PACKET), key=_packet_order
        )
        for record in records:
            if record.kind == Kind.SESSION:
                self._add("/session", tick, t_ns, layouts.SESSION.pack(tick, self._sessions))
                self._sessions += 1
                self._frames.session()
        for _, copies in groupby(map(self._at_the_end, packets), key=_frame_order):
            self._copies(tick, t_ns, list(copies))
        for record in records:
            if record.kind == Kind.TRUTH:
                self._truth(tick, t_ns, jn.read_truth(record.payload))
        self._late_reference(tick, t_ns)
        for code, a, b in sorted(jn.read_event(record.payload) for record in records if record.kind == Kind.LAB_EVENT):
            self._event(tick, t_ns, 0, code, a, b)

    def _truth(self, tick: int, t_ns: int, truth: jn.Truth) -> None:
        q, w, h, euler, applied, setpoint, source = truth
        x, y, z = euler
        rx, ry, rz = setpoint
        degrees = (x * _DEG, y * _DEG, z * _DEG, *applied, rx * DEG_PER_BAM, ry * DEG_PER_BAM, rz * DEG_PER_BAM)
        row = layouts.TRUTH.pack(*q, *w, *h, *euler, *degrees, tick, source)
        self._add("/truth", tick, t_ns, row)
        self._add("/tf", tick, t_ns, self._transforms.pack(t_ns, self._turns(t_ns, truth)))
        if self._wheels is not None:
            self._add("/joint_states", tick, t_ns, self._wheels.pack(t_ns, h, w, applied))
        if self._parts() != self._shown:
            self._add("/scene", tick, t_ns, self.scene(t_ns))
            self._shown = self._parts()

    def ends_at(self, end_ns: int) -> None:
        """The run is over at end_ns; the ticks that follow here are its last ones."""
        self._end_ns = end_ns

    # -- for viewers ---------------------------------------------------------------------------------------------

    def scene(self, t_ns: int) -> bytes:
        """The message /scene as it is now; for viewers that come later it may be sent again at any time."""
        return scene(t_ns, self._parts())

    def _sees(self, scenario: Mapping[str, Any] | None) -> None:
        """What viewers are shown of this scenario; None: nothing is known of it, as of one that makes no sense."""
        try:
            self._frames, self._wheels = Frames(scenario), viewer.wheels_of(scenario)
        except (AttributeError, TypeError, ValueError, ArithmeticError):  # whoever opens the log is told
            self._frames, self._wheels = Frames(None), None
        reference_in = self._frames.parent_of_reference
        parents = {BODY: INERTIAL, ORBITAL: INERTIAL, HORIZON: ORBITAL, REFERENCE: reference_in}
        self._transforms = viewer.Transforms(parents)
        if self._wheels is not None:
            self._channels.update(_register(self._writer, [("/joint_states", layouts.JointStateLayout)]))

    def _parts(self) -> Parts:
        known = self._frames.orbital_is_known
        return Parts(self._wheels is not None, known and self._decoder.tells_reference, known)

    def _turns(self, t_ns: int, truth: jn.Truth) -> dict[str, Quaternion]:
        """The rotations of a tick by frame."""
        turns = {}
        if (body := self._frames.body(truth)) is not None:
            turns[BODY] = body
        if (orbital := self._frames.orbital(t_ns, truth)) is not None:
            turns[ORBITAL] = orbital
            turns[HORIZON] = HORIZON_IN_ORBITAL
        if (reference := self._reference()) is not None:
            turns[REFERENCE] = reference
        elif self._decoder.follows_setpoint and (setpoint := self._frames.pointed(truth.setpoint_bam)) is not None:
            turns[REFERENCE] = setpoint
        return turns

    def _reference(self) -> Quaternion | None:
        """The reference that was reported since the last call."""
        words, self._reported = self._reported, None
        return None if words is None else self._frames.reported(words)

    def _late_reference(self, tick: int, t_ns: int) -> None:
        """A TELEMETRY that came without its tick's truth, in a live view: a transform of its own."""
        if (reference := self._reference()) is not None:
            self._add("/tf", tick, t_ns, self._transforms.pack(t_ns, {REFERENCE: reference}))

    # -- frames --------------------------------------------------------------------------------------------------

    def _at_the_end(self, record: PacketRecord) -> PacketRecord:
        """What would have arrived once the run was over is in flight, in time or not."""
        arrives = record.fate in (Fate.DELIVERED, Fate.LATE)
        if self._end_ns is None or not arrives or record.arrival_ns < self._end_ns:
            return record
        return record._replace(fate=Fate.IN_FLIGHT)

    def _copies(self, tick: int, t_ns: int, copies: list[PacketRecord]) -> None:
        """All copies of one frame, and its decoded row, where it can be unpacked, with the best of their fates."""
        for record in copies:
            self._packet(t_ns, record)
        best = min((record.fate for record in copies), key=lambda fate: _RANK.get(fate, len(_RANK)))
        for record in copies:
            if not record.copy:
                self._frame(tick, t_ns, record, best)

    def _frame(self, tick: int, t_ns: int, record: PacketRecord, fate: int) -> None:
        _, type_, sequence = _frame_order(record)
        try:
            frame = frames.unpack(record.packet).frame
        except frames.BadPacket:
            self.undecoded += 1
            return
        self._decoded(tick, t_ns, type_, fate, sequence, frame)

    def _packet(self, t_ns: int, record: PacketRecord) -> None:
        direction, fate, packet, encoded, cause, copy, arrival_ns = record
        _, type_, sequence = _frame_order(record)
        header_tick = int.from_bytes(packet[_TICK_AT], "little")
        topic = "/packet/down" if direction == Direction.DOWN else "/packet/up"
        row = layouts.PACKET.pack(header_tick, sequence, type_, fate, packet, encoded, cause, copy, arrival_ns)
        self._add(topic, sequence, t_ns, row)
        self.fates[direction, fate, cause, copy > 0] += 1

    def _decoded(self, tick: int, t_ns: int, type_: int, fate: int, sequence: int, frame: Any) -> None:
        if type_ == Type.COMMAND:
            self._add("/command", sequence, t_ns, self._decoder.command(frame, fate))
        elif type_ == Type.SAMPLE:
            self._add("/sample", sequence, t_ns, self._decoder.sample(frame, fate))
        elif type_ == Type.TELEMETRY:
            self._telemetry(sequence, t_ns, frame, fate)
        elif type_ == Type.EVENT:
            if frame.code == REFERENCE_RESTART:
                self._frames.reference_begins()
            self._event(tick, t_ns, 1, frame.code, frame.a, frame.b)
        elif type_ == Type.CONFIG:
            self._decoder.config(frame)

    def _telemetry(self, sequence: int, t_ns: int, frame: frames.Telemetry, fate: int) -> None:
        table = self._decoder.telemetry_table(frame)
        if "/telemetry" not in self._channels:
            names = [name for name, _ in table.words]
            units = json.dumps(dict(table.words))
            metadata = {"law": table.law, "names": json.dumps(names), "units": units}
            self._channels.update(_register(self._writer, [("/telemetry", table.layout)], metadata))
        self._add("/telemetry", sequence, t_ns, table.pack(frame, fate))
        self._reported = frame.words

    def _event(self, tick: int, t_ns: int, origin: int, code: int, a: int, b: int) -> None:
        level, text = events.describe(code, a, b)
        self._add("/event", tick, t_ns, layouts.EVENT.pack(tick, a, b, code, origin))
        name = "board" if origin else "laboratory"
        self._add("/log", tick, t_ns, viewer.log(t_ns, level, name, text))

    def _add(self, topic: str, sequence: int, t_ns: int, data: bytes) -> None:
        self._writer.add_message(self._channels[topic], t_ns, data, t_ns, sequence)
        self.messages += 1

    # -- what an answer consists of --------------------------------------------------------------------------------

    @staticmethod
    def is_sample(packet: bytes) -> bool:
        """The packet is a SAMPLE."""
        return len(packet) > _TYPE_AT and packet[_TYPE_AT] == Type.SAMPLE

    @staticmethod
    def answer_frames(packet: bytes) -> int:
        """How many frames the answer has that this COMMAND opens, itself included; 0 for other frames."""
        if len(packet) <= _TYPE_AT or packet[_TYPE_AT] != Type.COMMAND:
            return 0
        try:
            return 1 + int(frames.unpack(packet).frame.follows)
        except frames.BadPacket:
            return 1


class TimingRows:
    """Writes the rows of timing.mcap: host times, laid on simulation time so that a viewer shows both logs together."""

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        topics = (
            ("/timing", layouts.TIMING),
            ("/event", layouts.EVENT),
            ("/housekeeping/up", layouts.HOUSEKEEPING),
            ("/housekeeping/down", layouts.HOUSEKEEPING),
        )
        self._channels = _register(writer, topics)
        self._channels["/log"] = _register_viewers(writer, "/log")
        self.answers_ns = array("q")  # SAMPLE to COMMAND, of every tick whose answer came

    def host(self, content: Mapping[str, Any]) -> None:
        """HOST: metadata `host`."""
        self._writer.add_metadata("host", _texts(content))

    def tick(self, tick: int, t_ns: int, records: list[Record]) -> None:
        """TIMING, HOUSEKEEPING and the host's own events of one tick, in the order they happened."""
        for record in records:
            if record.kind == Kind.LAB_EVENT:
                code, a, b = jn.read_event(record.payload)
                data, topic = layouts.EVENT.pack(tick, a, b, code, 0), "/event"
                text = viewer.log(t_ns, events.level_of(code), "host", events.describe(code, a, b)[1])
                self._writer.add_message(self._channels["/log"], t_ns, text, t_ns, tick)
            elif record.kind == Kind.TIMING:
                *times_ns, cause = timing = jn.read_timing(record.payload)
                data, topic = layouts.TIMING.pack(*times_ns, tick, cause), "/timing"
                if timing.answer_ns != jn.NO_ANSWER:
                    self.answers_ns.append(timing.answer_ns)
            else:
                direction, host_ns, packet = jn.read_housekeeping(record.payload)
                data = layouts.HOUSEKEEPING.pack(host_ns, packet)
                topic = "/housekeeping/down" if direction == Direction.DOWN else "/housekeeping/up"
            self._writer.add_message(self._channels[topic], t_ns, data, t_ns, tick)


def _packet_order(record: PacketRecord) -> tuple[int, int, int, int, int, bytes, bytes]:
    return *_frame_order(record), record.copy, record.fate, record.packet, record.encoded


def _frame_order(record: PacketRecord) -> tuple[int, int, int]:
    """(direction, type, sequence)."""
    packet = record.packet
    type_ = packet[_TYPE_AT] if len(packet) > _TYPE_AT else 0
    return record.direction, type_, int.from_bytes(packet[_SEQUENCE_AT], "little")


def _register(writer: Writer, topics: Any, metadata: dict[str, str] | None = None) -> dict[str, int]:
    """Channels of our own layouts; layouts that share a name share a schema."""
    ids: dict[str, int] = {}
    channels = {}
    for topic, layout in topics:
        if layout.name not in ids:
            ids[layout.name] = writer.register_schema(layout.name, layouts.SCHEMA_ENCODING, layout.schema)
        channels[topic] = writer.register_channel(topic, layouts.ENCODING, ids[layout.name], metadata or {})
    return channels


def _register_viewers(writer: Writer, topic: str) -> int:
    """A channel of one of the foxglove schemas."""
    name, descriptors = viewer.schema_of(topic)
    schema = writer.register_schema(name, viewer.SCHEMA_ENCODING, descriptors)
    channel: int = writer.register_channel(topic, viewer.ENCODING, schema)
    return channel


def _texts(content: Mapping[str, Any]) -> dict[str, str]:
    """MCAP metadata is text to text: values become canonical JSON, except text that cannot be taken for JSON."""
    return {key: value if _is_plain(value) else _json(value) for key, value in sorted(content.items())}


def _is_plain(value: Any) -> bool:
    if not isinstance(value, str):
        return False
    try:
        json.loads(value)
    except ValueError:
        return True
    return False


def _json(value: Any) -> str:
    return json.dumps(value, sort_keys=True, ensure_ascii=False)
