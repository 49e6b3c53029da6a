"""Topics that viewers understand: /tf and /log in the foxglove protobuf schemas, /joint_states as ROS 2 has it.

/tf is one message a tick with every transform of the tick, the body first: so a viewer that plots it by index finds
each frame at one place. A rotation maps child to parent components, as our quaternions do; only the order differs:
x, y, z, w. /joint_states are the wheels, as joints that turn about the body axes. /scene is made in scene.py.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf.descriptor_pb2 import FileDescriptorSet

from sil.pointing import Quaternion
from sil.sinks.layouts import JointStateLayout

ENCODING = SCHEMA_ENCODING = "protobuf"
WHEELS = ("wheel_x", "wheel_y", "wheel_z")
LEVELS = {"debug": 1, "info": 2, "warning": 3, "error": 4}
NS = 1_000_000_000
TYPES: dict[str, Any] = {"/tf": FrameTransforms, "/scene": SceneUpdate, "/log": Log}


class Transforms:
    """Serialises FrameTransforms: one reused object for each set of frames (three times faster than new ones)."""

    def __init__(self, parents: Mapping[str, str]) -> None:
        self._parents = parents
        self._made: dict[tuple[str, ...], tuple[Any, tuple[tuple[Any, Any], ...]]] = {}

    def pack(self, t_ns: int, turns: Mapping[str, Quaternion]) -> bytes:
        """/tf at t_ns; turns: by frame, in the order they are to have, (4,) scalar first."""
        frames = tuple(turns)
        message, parts = self._made.get(frames) or self._make(frames)
        seconds, nanos = divmod(t_ns, NS)
        for (stamp, rotation), q in zip(parts, turns.values(), strict=True):
            stamp.seconds, stamp.nanos = seconds, nanos
            rotation.w, rotation.x, rotation.y, rotation.z = q
        return bytes(message.SerializeToString(deterministic=True))

    def _make(self, frames: tuple[str, ...]) -> tuple[Any, tuple[tuple[Any, Any], ...]]:
        message = FrameTransforms()
        for frame in frames:
            added = message.transforms.add(parent_frame_id=self._parents[frame], child_frame_id=frame)
            added.translation.SetInParent()
        parts = tuple((added.timestamp, added.rotation) for added in message.transforms)
        self._made[frames] = message, parts
        return message, parts


class Wheels:
    """The three wheels as JointStates.

    velocity = h / Js - omega_BN_B, the speed relative to the body, rad/s (h is absolute: h = Js (Omega + omega));
    not known without spin inertia. effort = -applied, the motor's torque on the wheel, N m. No positions: between two
    ticks a wheel turns more than once.
    """

    def __init__(self, inertia_kgm2: Sequence[float]) -> None:
        known = any(inertia > 0.0 for inertia in inertia_kgm2)
        self._layout = JointStateLayout(WHEELS, known)
        self._per_momentum = [1.0 / inertia if inertia > 0.0 else math.nan for inertia in inertia_kgm2] if known else []

    def pack(
        self, t_ns: int, momentum_B: Sequence[float], omega_BN_B: Sequence[float], applied_Nm: Sequence[float]
    ) -> bytes:
        """/joint_states at t_ns; (3,) each, body axes."""
        parts = zip(self._per_momentum, momentum_B, omega_BN_B, strict=False)
        return self._layout.pack(t_ns, [h * per - w for per, h, w in parts], [0.0 - torque for torque in applied_Nm])


def wheels_of(scenario: Mapping[str, Any] | None) -> Wheels | None:
    """The wheels of a resolved scenario; None: it has thrusters, or nothing is known of it.

    Raises AttributeError, TypeError or ValueError for a scenario that makes no sense.
    """
    actuators = (scenario or {}).get("actuators") or {}
    if actuators.get("kind") != "wheels":
        return None
    x, y, z = map(float, (actuators.get("wheels") or {}).get("inertia_kgm2") or (0.0, 0.0, 0.0))
    return Wheels((x, y, z))


def log(t_ns: int, level: str, origin: str, text: str) -> bytes:
    """/log: one line; level debug, info, warning or error; origin `board`, `laboratory` or `host`."""
    message = Log(message=text, name=origin)
    message.level = LEVELS[level]  # type: ignore[assignment]
    message.timestamp.seconds, message.timestamp.nanos = divmod(t_ns, NS)
    return bytes(message.SerializeToString(deterministic=True))


def schema_of(topic: str) -> tuple[str, bytes]:
    """(schema name, FileDescriptorSet bytes with all dependencies, in order of need)."""
    descriptor = TYPES[topic].DESCRIPTOR
    return descriptor.full_name, _descriptor_set(descriptor)


def _descriptor_set(descriptor: Any) -> bytes:
    result = FileDescriptorSet()
    seen: set[str] = set()

    def add(file: Any) -> None:
        if file.name in seen:
            return
        seen.add(file.name)
        for dependency in file.dependencies:
            add(dependency)
        result.file.add().ParseFromString(file.serialized_pb)  # as generated, whatever the protobuf runtime makes of it

    add(descriptor.file)
    return bytes(result.SerializeToString(deterministic=True))
