"""Topics a 3D viewer understands: /tf, /scene and /log in the foxglove protobuf schemas.

/tf is the transform from `inertial` (parent) to `body` (child): rotation q_BN reordered to x, y, z, w, because q_BN
already maps body (child) components to inertial (parent) ones. /scene is sent once: a box for the body and one arrow
along each body axis, all fixed to the frame `body`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf.descriptor_pb2 import FileDescriptorSet

ENCODING = SCHEMA_ENCODING = "protobuf"
INERTIAL, BODY = "inertial", "body"
BODY_SIZE_m = (0.6, 0.5, 0.4)  # only a picture: no scenario says how large the satellite is
BODY_COLOUR = (0.55, 0.60, 0.68, 0.9)
AXIS_COLOURS = ((0.84, 0.37, 0.0, 1.0), (0.0, 0.62, 0.45, 1.0), (0.0, 0.45, 0.70, 1.0))  # roll, pitch, yaw as in plots
ARROW_LENGTH_m = 0.7
HALF = 0.5**0.5
AXIS_TURNS = ((0.0, 0.0, 0.0, 1.0), (0.0, 0.0, HALF, HALF), (0.0, -HALF, 0.0, HALF))  # x,y,z,w: arrow's x to the axis
LEVELS = {"debug": 1, "info": 2, "warning": 3, "error": 4}
NS = 1_000_000_000


class Transforms:
    """Serialises FrameTransform messages into one reused object (three times faster than new ones)."""

    def __init__(self) -> None:
        self._message = FrameTransform(parent_frame_id=INERTIAL, child_frame_id=BODY)
        self._message.translation.SetInParent()

    def pack(self, t_ns: int, q_BN: Sequence[float]) -> bytes:
        """/tf at t_ns; q_BN (4,) scalar first."""
        message = self._message
        message.timestamp.seconds, message.timestamp.nanos = divmod(t_ns, NS)
        rotation = message.rotation
        rotation.w, rotation.x, rotation.y, rotation.z = q_BN
        return bytes(message.SerializeToString(deterministic=True))


def scene(t_ns: int) -> bytes:
    """/scene: the satellite as a box with its three axes."""
    update = SceneUpdate()
    entity = update.entities.add()
    entity.timestamp.seconds, entity.timestamp.nanos = divmod(t_ns, NS)
    entity.frame_id, entity.id, entity.frame_locked = BODY, "satellite", True
    cube = entity.cubes.add()
    cube.pose.orientation.w = 1.0
    cube.size.x, cube.size.y, cube.size.z = BODY_SIZE_m
    _paint(cube.color, BODY_COLOUR)
    for turn, colour in zip(AXIS_TURNS, AXIS_COLOURS, strict=True):
        arrow = entity.arrows.add()
        orientation = arrow.pose.orientation
        orientation.x, orientation.y, orientation.z, orientation.w = turn
        arrow.shaft_length, arrow.shaft_diameter = 0.85 * ARROW_LENGTH_m, 0.02
        arrow.head_length, arrow.head_diameter = 0.15 * ARROW_LENGTH_m, 0.05
        _paint(arrow.color, colour)
    return bytes(update.SerializeToString(deterministic=True))


def log(t_ns: int, level: str, origin: str, text: str) -> bytes:
    """/log: one line; level debug, info, warning or error; origin `board` or `laboratory`."""
    message = Log(message=text, name=origin)
    message.level = LEVELS[level]  # type: ignore[assignment]
    message.timestamp.seconds, message.timestamp.nanos = divmod(t_ns, NS)
    return bytes(message.SerializeToString(deterministic=True))


def schemas() -> dict[str, tuple[str, bytes]]:
    """topic -> (schema name, FileDescriptorSet bytes with all dependencies, in order of need)."""
    types: dict[str, Any] = {"/tf": FrameTransform, "/scene": SceneUpdate, "/log": Log}
    return {topic: (type_.DESCRIPTOR.full_name, _descriptor_set(type_)) for topic, type_ in types.items()}


def _descriptor_set(message_type: Any) -> bytes:
    result = FileDescriptorSet()
    seen: set[str] = set()

    def add(file: Any) -> None:
        if file.name in seen:
            return
        seen.add(file.name)
        for dependency in file.dependencies:
            add(dependency)
        result.file.add().ParseFromString(file.serialized_pb)  # as generated, whatever the protobuf runtime makes of it

    add(message_type.DESCRIPTOR.file)
    return bytes(result.SerializeToString(deterministic=True))


def _paint(colour: Any, rgba: Sequence[float]) -> None:
    colour.r, colour.g, colour.b, colour.a = rgba
