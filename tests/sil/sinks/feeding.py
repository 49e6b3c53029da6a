"""What RunRows writes, taken apart as it comes: a writer that decodes the topics for viewers; records to feed it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from mcap_ros2._dynamic import generate_dynamic
from synthetic import meta

from protocol import config, events, frames
from protocol.law_tables import config_words
from protocol.laws.pd import PD
from sil.sinks import journal as jn
from sil.sinks.journal import Direction, Fate, Kind, Record
from sil.sinks.layouts import JointStateLayout
from sil.sinks.mcap_rows import RunRows

PROTOBUF = {"/tf": FrameTransforms, "/scene": SceneUpdate, "/log": Log}
PERIOD_NS = 500_000_000
BAM_PER_DEG = 2**32 / 360.0
ZERO = (0.0, 0.0, 0.0)


class Row(NamedTuple):
    """One message: topic, log time, and what the bytes say (of our own topics the bytes)."""

    topic: str
    t_ns: int
    said: Any


class Sheet:
    """A writer with the five calls that RunRows makes; `rows` as they came."""

    def __init__(self) -> None:
        self.topics: list[str] = []
        self.rows: list[Row] = []
        name, text = JointStateLayout.name, JointStateLayout.schema.decode()
        self._joints = generate_dynamic(name, text)[name]

    def register_schema(self, name: str, encoding: str, data: bytes) -> int:
        return len(self.topics) + 1

    def register_channel(self, topic: str, encoding: str, schema: int, metadata: object = None) -> int:
        self.topics.append(topic)
        return len(self.topics) - 1

    def add_message(self, channel: int, log_time: int, data: bytes, publish_time: int, sequence: int) -> None:
        topic = self.topics[channel]
        said: Any = data
        if topic in PROTOBUF:
            said = PROTOBUF[topic].FromString(data)
        elif topic == "/joint_states":
            said = self._joints(data)
        self.rows.append(Row(topic, log_time, said))

    def add_metadata(self, name: str, data: object) -> None:
        pass

    def add_attachment(self, *_: object) -> None:
        pass

    def of(self, topic: str) -> list[Any]:
        """What was said on a topic."""
        return [row.said for row in self.rows if row.topic == topic]


class Feed:
    """Records for RunRows, tick by tick; `scenario` is laid over the synthetic run's."""

    def __init__(self, scenario: dict[str, Any] | None = None, known: bool = True) -> None:
        self.sheet = Sheet()
        self.rows = RunRows(self.sheet)  # type: ignore[arg-type]
        content = dict(meta(100))
        content["scenario"] = {**content["scenario"], **(scenario or {})}  # type: ignore[dict-item]
        if not known:
            del content["scenario"]
        self.rows.meta(content)
        self._down = 0

    def tick(self, k: int, *records: Record) -> None:
        self.rows.tick(k, k * PERIOD_NS, list(records))

    def transforms(self) -> list[dict[str, Any]]:
        """Of each /tf: by frame, (parent, (w, x, y, z))."""
        return [
            {
                part.child_frame_id: (part.parent_frame_id, tuple(getattr(part.rotation, c) for c in "wxyz"))
                for part in said.transforms
            }
            for said in self.sheet.of("/tf")
        ]

    def down(self, frame: frames.Frame) -> Record:
        self._down += 1
        payload = jn.packet_payload(Direction.DOWN, Fate.DELIVERED, frames.pack(frame, self._down))
        return Record(Kind.PACKET, frame.tick, payload, 0)  # type: ignore[union-attr]

    def telemetry(self, k: int, reference_deg: Sequence[float]) -> Record:
        words = (*(round(angle * BAM_PER_DEG) for angle in reference_deg), *[0] * 13)
        return self.down(frames.Telemetry(k, PD.law_id, PD.version, words))

    def begins(self, k: int) -> Record:
        return self.down(frames.Event(k, events.REFERENCE_RESTART, 7, 1))


def session(k: int) -> Record:
    return Record(Kind.SESSION, k, jn.json_payload({"tick": k}), 0)


def configured(**values: Any) -> list[Record]:
    """CONFIG with these values of COMMON."""
    parts = config.split(config_words(PD, {"form": "float", **values}))
    packets = [frames.pack(part, i) for i, part in enumerate(parts)]
    return [Record(Kind.PACKET, 0, jn.packet_payload(Direction.UP, Fate.DELIVERED, packet), 0) for packet in packets]


def truth(
    k: int,
    q_BN: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
    omega: Sequence[float] = ZERO,
    momentum: Sequence[float] = ZERO,
    euler_rad: Sequence[float] = ZERO,
    applied: Sequence[float] = ZERO,
    setpoint_deg: Sequence[float] = ZERO,
) -> Record:
    setpoint = tuple(round(angle * BAM_PER_DEG) for angle in setpoint_deg)
    return Record(Kind.TRUTH, k, jn.truth_payload(q_BN, omega, momentum, euler_rad, applied, setpoint, 1), 0)
