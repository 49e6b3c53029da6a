"""/scene: the satellite for the 3-D panel of a viewer, as the report draws it. No scenario says how large it is.

    in body         box, orange nose along +x, solar panels along y, the wheels, the three axes with their names
    in reference    the same satellite's outline, translucent: where it ought to point
    in orbital      nadir and velocity, as arrows with their names

Everything is fixed to its frame, so one message does for a whole run; it may be sent again at any time.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

from sil.sinks.frames import BODY, ORBITAL, REFERENCE

NS = 1_000_000_000
RGBA = tuple[float, float, float, float]
XYZ = tuple[float, float, float]

BODY_SIZE_m: XYZ = (0.6, 0.5, 0.4)
PANEL_SIZE_m: XYZ = (0.34, 0.62, 0.015)
PANEL_AT_m = 0.64  # middle of a panel, on either side along y
ARM_SIZE_m: XYZ = (0.03, 0.1, 0.03)  # from the body to a panel
ARM_AT_m = 0.29
NOSE_m, NOSE_RADIUS_m = 0.2, 0.11
WHEEL_RADIUS_m, WHEEL_HEIGHT_m = 0.1, 0.04
WHEELS_AT_m: tuple[XYZ, ...] = ((0.16, 0.0, 0.0), (-0.03, 0.14, 0.0), (-0.12, -0.06, 0.08))
AXES_m = ((0.5, 0.36), (0.95, 0.2), (0.2, 0.46))  # where the arrow of an axis begins, and its length
DIRECTIONS: tuple[tuple[str, int], ...] = (("velocity", 0), ("nadir", 2))  # and the axis of O

AXIS_COLOURS: tuple[RGBA, ...] = ((0.84, 0.37, 0.0, 1.0), (0.0, 0.62, 0.45, 1.0), (0.0, 0.45, 0.7, 1.0))  # as in plots
NAME_COLOURS: tuple[RGBA, ...] = ((0.94, 0.49, 0.18, 1.0), (0.18, 0.78, 0.6, 1.0), (0.34, 0.71, 0.91, 1.0))
BODY_COLOUR: RGBA = (0.75, 0.78, 0.82, 0.75)
EDGE_COLOUR: RGBA = (0.35, 0.38, 0.43, 1.0)
PANEL_COLOUR: RGBA = (0.13, 0.22, 0.42, 1.0)
GHOST_COLOUR: RGBA = (0.8, 0.47, 0.65, 0.9)
DIRECTION_COLOUR: RGBA = (0.6, 0.6, 0.6, 1.0)

_HALF = 0.5**0.5
_X_TO: tuple[tuple[float, float, float, float], ...] = (  # x, y, z, w: turns +x to +x, +y, +z
    (0.0, 0.0, 0.0, 1.0),
    (0.0, 0.0, _HALF, _HALF),
    (0.0, -_HALF, 0.0, _HALF),
)
_Z_TO: tuple[tuple[float, float, float, float], ...] = (  # the same for +z
    (0.0, _HALF, 0.0, _HALF),
    (-_HALF, 0.0, 0.0, _HALF),
    (0.0, 0.0, 0.0, 1.0),
)


class Parts(NamedTuple):
    """What there is to be shown beside the body."""

    wheels: bool
    reference: bool
    orbital: bool


def scene(t_ns: int, parts: Parts) -> bytes:
    """The message /scene, a foxglove.SceneUpdate; it replaces the one before."""
    update = SceneUpdate()
    _satellite(_entity(update, t_ns, BODY, "satellite"), parts.wheels)
    if parts.reference:
        _ghost(_entity(update, t_ns, REFERENCE, "reference"))
    if parts.orbital:
        _directions(_entity(update, t_ns, ORBITAL, "directions"))
    return bytes(update.SerializeToString(deterministic=True))


def _entity(update: Any, t_ns: int, frame: str, name: str) -> Any:
    entity = update.entities.add(frame_id=frame, id=name, frame_locked=True)
    entity.timestamp.seconds, entity.timestamp.nanos = divmod(t_ns, NS)
    return entity


def _satellite(entity: Any, wheels: bool) -> None:
    _box(entity, (0.0, 0.0, 0.0), BODY_SIZE_m, BODY_COLOUR)
    for side in (1.0, -1.0):
        _box(entity, (0.0, side * PANEL_AT_m, 0.0), PANEL_SIZE_m, PANEL_COLOUR)
        _box(entity, (0.0, side * ARM_AT_m, 0.0), ARM_SIZE_m, EDGE_COLOUR)
    _lines(entity, _edges(BODY_SIZE_m), EDGE_COLOUR, 1.5)
    nose = _cylinder(entity, (BODY_SIZE_m[0] / 2 + NOSE_m / 2, 0.0, 0.0), 0, NOSE_RADIUS_m, NOSE_m, AXIS_COLOURS[0])
    nose.top_scale = 0.0
    for axis, ((start, length), colour, said) in enumerate(zip(AXES_m, AXIS_COLOURS, NAME_COLOURS, strict=True)):
        _arrow(entity, axis, start, length, colour)
        _text(entity, "xyz"[axis], _along(axis, start + length + 0.07), said)
    for axis, at in enumerate(WHEELS_AT_m if wheels else ()):
        _cylinder(entity, at, axis, WHEEL_RADIUS_m, WHEEL_HEIGHT_m, AXIS_COLOURS[axis])


def _ghost(entity: Any) -> None:
    """Edges of the body, the nose and the panels, and a haze within."""
    x, y, z = (side / 2 for side in BODY_SIZE_m)
    _box(entity, (0.0, 0.0, 0.0), (2.02 * x, 2.02 * y, 2.02 * z), (*GHOST_COLOUR[:3], 0.12))
    lines = _edges(BODY_SIZE_m)
    tip = (x + NOSE_m, 0.0, 0.0)
    for corner in ((x, y, z), (x, y, -z), (x, -y, z), (x, -y, -z)):
        lines += [corner, tip]
    along, across = PANEL_SIZE_m[0] / 2, PANEL_SIZE_m[1] / 2
    for side in (1.0, -1.0):
        near, far = side * (PANEL_AT_m - across), side * (PANEL_AT_m + across)
        corners = [(-along, near, 0.0), (along, near, 0.0), (along, far, 0.0), (-along, far, 0.0)]
        for i, corner in enumerate(corners):
            lines += [corner, corners[(i + 1) % 4]]
    _lines(entity, lines, GHOST_COLOUR, 2.0)


def _directions(entity: Any) -> None:
    for name, axis in DIRECTIONS:
        _arrow(entity, axis, 0.6, 0.6, DIRECTION_COLOUR)
        _text(entity, name, _along(axis, 1.3), DIRECTION_COLOUR)


# -- primitives ----------------------------------------------------------------------------------------------------


def _along(axis: int, length: float) -> XYZ:
    x, y, z = (length if axis == i else 0.0 for i in range(3))
    return x, y, z


def _edges(size: XYZ) -> list[XYZ]:
    """The twelve edges of a box, two points each."""
    x, y, z = (side / 2 for side in size)
    pairs = []
    for a in (-1.0, 1.0):
        for b in (-1.0, 1.0):
            pairs += [(-x, a * y, b * z), (x, a * y, b * z)]
            pairs += [(a * x, -y, b * z), (a * x, y, b * z)]
            pairs += [(a * x, b * y, -z), (a * x, b * y, z)]
    return pairs


def _box(entity: Any, at: XYZ, size: XYZ, colour: RGBA) -> None:
    cube = entity.cubes.add()
    _place(cube, at, (0.0, 0.0, 0.0, 1.0), colour)
    cube.size.x, cube.size.y, cube.size.z = size


def _cylinder(entity: Any, at: XYZ, axis: int, radius: float, height: float, colour: RGBA) -> Any:
    cylinder = entity.cylinders.add(bottom_scale=1.0, top_scale=1.0)
    _place(cylinder, at, _Z_TO[axis], colour)
    cylinder.size.x, cylinder.size.y, cylinder.size.z = 2 * radius, 2 * radius, height
    return cylinder


def _arrow(entity: Any, axis: int, start: float, length: float, colour: RGBA) -> None:
    arrow = entity.arrows.add(shaft_length=length - 0.1, shaft_diameter=0.02, head_length=0.1, head_diameter=0.05)
    _place(arrow, _along(axis, start), _X_TO[axis], colour)


def _lines(entity: Any, points: Sequence[XYZ], colour: RGBA, pixels: float) -> None:
    lines = entity.lines.add(type=LinePrimitive.LINE_LIST, thickness=pixels, scale_invariant=True)
    _place(lines, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), colour)
    for x, y, z in points:
        lines.points.add(x=x, y=y, z=z)


def _text(entity: Any, words: str, at: XYZ, colour: RGBA) -> None:
    text = entity.texts.add(text=words, billboard=True, font_size=14.0, scale_invariant=True)
    _place(text, at, (0.0, 0.0, 0.0, 1.0), colour)


def _place(primitive: Any, at: XYZ, turn: Sequence[float], colour: RGBA) -> None:
    position, orientation, paint = primitive.pose.position, primitive.pose.orientation, primitive.color
    position.x, position.y, position.z = at
    orientation.x, orientation.y, orientation.z, orientation.w = turn
    paint.r, paint.g, paint.b, paint.a = colour
