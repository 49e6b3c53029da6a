"""docs/reference/topics.md: every topic of run.mcap and timing.mcap with its fields, units and when it is written.

Made of the schemas as they stand in the files: RunRows and TimingRows are asked which channels they open. What the
messages for viewers carry, and when a topic is written, is said here; a topic or a field that is not said is an error.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from protocol.frames import Telemetry
from protocol.law_tables import LAWS, TELEMETRY_COMMON, LawTable
from sil.sinks import viewer
from sil.sinks.decoding import Decoder
from sil.sinks.mcap_rows import RunRows, TimingRows
from tools.spec_tables import table

HEAD = """# Topics of the logs

Made by `python -m tools.reference --write` of the schemas in the code; a test keeps it current. How to open a log:
[read a run and its logs](../how-to/read-logs.md). How it comes about: [determinism](../concepts/determinism.md).

A run leaves two [MCAP](https://mcap.dev) files. `run.mcap` holds what was simulated and what went over the link, and
depends on nothing else: the same scenario gives the same bytes. `timing.mcap` holds what belongs to this machine.
In both, `log_time` = `publish_time` = t_k = tick x period in ns, counted from 0, so that a viewer shows them together.

- Chunks of 256 KiB, LZ4, a CRC each; indexed, with statistics. `library` is `attitude-sil`, `profile` is empty.
- Our own topics and `/joint_states` are CDR (XCDR1, little endian) with a `ros2msg` schema, the others for viewers are
  protobuf with a `FileDescriptorSet`. Every channel has its schema in the file.
- `sequence` is the frame's where the message is a frame, else the tick.
- Within a tick: sessions, frames (up before down, by type, then sequence) each with its decoded form, truth, `/tf`,
  `/joint_states`, `/scene`, events. A frame is filed under the tick it belongs to, not under the one it arrived in.
- `fate` everywhere: 0 delivered, 1 late, 2 dropped, 3 corrupted, 4 in flight when the run ended.
"""

IN_THE_FILES = """## What else is in the files

| in | name | what |
|---|---|---|
| `run.mcap` | attachment `scenario.json` | the resolved scenario as it was flown; no clock, board, link |
| `run.mcap` | metadata `run` | name, seed, `period_ns`, ticks planned, versions that decide numbers, law, hashes |
| `run.mcap` | metadata `config` | what the board was sent by CONFIG: COMMON's words by name, all in `words` |
| `run.mcap` | metadata `end` | `reason`: finished, interrupted, failed, diverged or truncated; `ticks` flown |
| `run.mcap` | metadata of the channel `/telemetry` | `law`, `names` of its words, `units` |
| `timing.mcap` | metadata `host` | clock, link, board and its build, Python, machine, libraries that made the logs |

Values in metadata are text; what is not plain text is JSON.

## run.journal

Both logs are made of `run.journal`, and can be made again: `sil recover`. It is written while the run goes on, one
write per tick: records of length, tick, kind, payload and CRC-32 (`sil/sinks/journal.py`).

| record | goes to | what |
|---|---|---|
| META | `run.mcap` | JSON: everything that decides the numbers, the scenario included |
| SESSION | `run.mcap` | a board session starts at this tick |
| PACKET | `run.mcap` | a frame with its fate and the cause, and its bytes on the wire where a fault altered them |
| TRUTH | `run.mcap` | the plant at t_k and what acts from t_k on |
| LAB_EVENT | `run.mcap` | an event of the laboratory; those of this machine's clock: `timing.mcap` |
| END | `run.mcap` | JSON: why the run ended, and after how many ticks |
| HOST | `timing.mcap` | JSON: this machine, this link, this board |
| TIMING | `timing.mcap` | when the tick woke, and why late |
| HOUSEKEEPING | `timing.mcap` | a frame outside every comparison, with host time |
| COMMIT | | the tick is whole: what follows the last one is left out |

## What was checked, and how

- **Foxglove, Lichtblick**: every message of real runs, of `timing.mcap` and of every law's TELEMETRY is decoded in CI
  with the TypeScript libraries that these viewers decode with, and values are compared bit for bit
  (`tests/e2e/test_independent_reader.py`). Opened in Lichtblick 1.28: 3-D panel, plots, log, raw messages. An empty
  profile is right: `ros2` would promise CDR on every channel, and Lichtblick takes from it only that slashes before the
  names of frames do not count.
- **PlotJuggler**: its parser of ROS messages (rosx_introspection 3.1), built from source, reads all CDR topics of such
  runs to the last byte. Its MCAP loader (of version 3, by its source) looks for a parser by message encoding (`cdr`,
  `protobuf`), then by schema encoding, and never at the profile. Leave its use of timestamps in messages off: log time
  is simulated time. Every byte of `/packet/*` becomes a curve of its own: leave these topics out. PlotJuggler itself
  was not run.
- **Python**: `mcap`, `mcap-ros2-support`, `mcap-protobuf-support` read everything (`tests/sil/sinks/test_seal.py`).
"""

WHEN = {
    "/session": "when a board session starts",
    "/packet/up": "each copy of a frame to the board",
    "/packet/down": "each copy of a frame from the board",
    "/sample": "each SAMPLE",
    "/command": "each COMMAND that can be unpacked",
    "/telemetry": "each TELEMETRY that can be unpacked: every `telemetry_every` ticks",
    "/truth": "every tick",
    "/tf": "every tick",
    "/joint_states": "every tick, of a satellite with wheels",
    "/scene": "at the first tick, and when what there is to be shown changes",
    "/event": "each event, of laboratory and board",
    "/log": "each event, in words",
    "/timing": "every tick",
    "/housekeeping/up": "each housekeeping frame to the board",
    "/housekeeping/down": "each housekeeping frame from the board",
}
ONLY_OF_THE_HOST = {"/event": "each event of this machine's clock", "/log": "the same in words"}

VIEWERS: dict[str, tuple[str, tuple[tuple[str, str, str, str], ...]]] = {
    "/tf": (
        "Rotations between frames, in this order. `body` in `inertial`: q_BN of `/truth`. `orbital` in `inertial`: x "
        "along-track, y = -orbit normal, z nadir. `horizon` in `orbital`: the same with z up, so that the Earth is "
        "below in a viewer that displays it. `reference`, where the body ought to point, in `orbital` or, where "
        "`attitude.frame` is inertial, in `inertial`: what TELEMETRY of the same tick reports, from the tick on in "
        "which the board's reference model began; the set-point where the board has no model that differs from it; "
        "otherwise there is no such transform. Signs are continuous.",
        (
            ("transforms[].timestamp", "google.protobuf.Timestamp", "s, ns", "t_k"),
            ("transforms[].parent_frame_id", "string", "", "`inertial` or `orbital`"),
            ("transforms[].child_frame_id", "string", "", "`body`, `orbital`, `horizon`, `reference`"),
            ("transforms[].translation", "foxglove.Vector3", "m", "zero"),
            ("transforms[].rotation", "foxglove.Quaternion", "1", "x, y, z, w: v_parent = q v_child q*"),
        ),
    ),
    "/scene": (
        "Only a picture: no scenario says how large the satellite is. In `body`: box, nose along +x, solar panels "
        "along y, the wheels, the axes x, y, z in the colours of roll, pitch, yaw. In `reference`: its outline, "
        "translucent, where a board tells its reference. In `orbital`: nadir and velocity.",
        (
            ("entities[].timestamp", "google.protobuf.Timestamp", "s, ns", "t_k at which it was sent"),
            ("entities[].frame_id", "string", "", "`body`, `reference`, `orbital`"),
            ("entities[].id", "string", "", "`satellite`, `reference`, `directions`"),
            ("entities[].frame_locked", "bool", "", "true: it moves with its frame"),
            ("entities[].cubes, cylinders, arrows, lines, texts", "foxglove.*Primitive", "m", "what is drawn"),
        ),
    ),
    "/log": (
        "Each `/event` in words.",
        (
            ("timestamp", "google.protobuf.Timestamp", "s, ns", "t_k"),
            ("level", "foxglove.Log.Level", "", "2 info, 3 warning, 4 error"),
            ("message", "string", "", "the event's name, what it means, its two numbers"),
            ("name", "string", "", "`board`, `laboratory`; in `timing.mcap` `host`"),
        ),
    ),
}
JOINTS = """The schema is ROS 2's own, because Foxglove, Lichtblick and PlotJuggler know joints by it. Position is never
given: between two ticks a wheel turns more than once. velocity = h / Js - omega_BN_B, with h and omega of `/truth` and
Js = `actuators.wheels.inertia_kgm2`.
"""
FIELD = re.compile(r"^(\S+) (\w+)  # (?:\[([^\]]*)\] ?)?(.*)$")
COLUMNS = ("field", "type", "unit", "meaning")


class Channel(NamedTuple):
    """A channel as it is opened."""

    topic: str
    encoding: str
    type: str
    schema: bytes


class Opened:
    """A writer that only notes which channels are opened."""

    def __init__(self) -> None:
        self.channels: list[Channel] = []
        self._schemas: list[tuple[str, bytes]] = []

    def register_schema(self, name: str, encoding: str, data: bytes) -> int:
        self._schemas.append((name, data))
        return len(self._schemas) - 1

    def register_channel(self, topic: str, encoding: str, schema: int, metadata: object = None) -> int:
        self.channels.append(Channel(topic, encoding, *self._schemas[schema]))
        return len(self.channels)

    def add_metadata(self, name: str, data: object) -> None: ...

    def add_attachment(self, *_: object) -> None: ...


def channels_of_a_run() -> list[Channel]:
    """Of run.mcap, with wheels and with TELEMETRY, whose type depends on the law, in the order of WHEN."""
    opened = Opened()
    rows: Any = RunRows(opened)  # type: ignore[arg-type]
    rows.meta({"scenario": {"actuators": {"kind": "wheels"}}})
    channels = [*opened.channels, Channel("/telemetry", "cdr", "sil/msg/Telemetry*LAW*", b"")]
    return sorted(channels, key=lambda channel: list(WHEN).index(channel.topic))


def channels_of_timing() -> list[Channel]:
    """Of timing.mcap."""
    opened = Opened()
    TimingRows(opened)  # type: ignore[arg-type]
    return opened.channels


def markdown() -> str:
    """The whole page."""
    run, timing = channels_of_a_run(), channels_of_timing()
    own = {channel.topic: channel for channel in timing if channel.topic not in ONLY_OF_THE_HOST}
    parts = [HEAD, "## run.mcap\n", _overview(run, {}), "## timing.mcap\n", _overview(timing, ONLY_OF_THE_HOST)]
    parts += [part for channel in (*run, *own.values()) for part in _topic(channel)]
    return "\n".join([*parts, IN_THE_FILES])


def _overview(channels: list[Channel], differs: Mapping[str, str]) -> str:
    rows = [
        (f"`{c.topic}`", f"`{c.type.replace('*LAW*', 'LAW')}`", c.encoding, differs.get(c.topic, WHEN[c.topic]))
        for c in channels
    ]
    return table(("topic", "type", "encoding", "written"), rows)


def _topic(channel: Channel) -> Iterator[str]:
    if channel.topic in ("/packet/down", "/housekeeping/down"):  # as its fellow
        return
    yield f"## {channel.topic}" + (f" and {channel.topic[:-2]}down" if channel.topic.endswith("/up") else "") + "\n"
    if channel.topic == "/telemetry":
        yield from _telemetry()
    elif channel.topic in VIEWERS:
        about, fields = VIEWERS[channel.topic]
        yield about + "\n"
        yield table(COLUMNS, [(f"`{name}`", kind, unit, meaning) for name, kind, unit, meaning in fields])
    else:
        first, *lines = channel.schema.decode().split("=" * 80)[0].splitlines()
        yield first.removeprefix("# ") + "\n"
        if channel.topic == "/joint_states":
            yield JOINTS
        yield table(COLUMNS, [_row(line) for line in lines])


def _row(line: str) -> tuple[str, str, str, str]:
    found = FIELD.match(line)
    if found is None:
        raise ValueError(f"a field of a schema: expected `type name  # [unit] meaning`, got {line!r}")
    kind, name, unit, meaning = found.groups()
    return f"`{name}`", f"`{kind}`", unit or "", meaning


def _telemetry() -> Iterator[str]:
    yield "A decoded TELEMETRY frame: the words that every law has, then its own, then tick, law and fate.\n"
    words = _words(LAWS[1, max(v for i, v in LAWS if i == 1)])
    yield table(COLUMNS, [*words[: _common(words)], *_tail()])
    for law in sorted(_newest(), key=lambda law: law.law_id):
        mine = _words(law)
        yield f"### Words of {law.name}\n"
        yield table(COLUMNS, mine[_common(mine) :])


def _newest() -> list[LawTable]:
    return [law for (law_id, version), law in LAWS.items() if version == max(v for i, v in LAWS if i == law_id)]


def _words(law: LawTable) -> list[tuple[str, str, str, str]]:
    """All words of a law's TELEMETRY; a triple is one row."""
    count = len(TELEMETRY_COMMON) + len(law.telemetry)
    layout = Decoder().telemetry_table(Telemetry(0, law.law_id, law.version, (0,) * count)).layout
    rows: dict[str, tuple[str, str, str, str]] = {}
    for field in layout.fields[:count]:
        name, kind, unit, meaning = _row(f"{field.type} {field.name}  # {field.about}")
        stem, _, axis = name.strip("`").rpartition("_")
        if stem and axis in ("x", "y", "z"):
            name, meaning = f"`{stem}_x`, `_y`, `_z`", meaning.removesuffix(f", {axis}")
        rows[name] = name, kind, unit, meaning
    return list(rows.values())


def _common(rows: list[tuple[str, str, str, str]]) -> int:
    """How many rows are every law's."""
    return 1 + [row[0] for row in rows].index("`saturations`")


def _tail() -> list[tuple[str, str, str, str]]:
    layout = Decoder().telemetry_table(Telemetry(0, 1, 1, ())).layout
    return [_row(f"{field.type} {field.name}  # {field.about}") for field in layout.fields if field.type != "float64"]


def undescribed() -> list[str]:
    """Fields in VIEWERS that the schemas do not have."""
    wrong = []
    for topic, (_, fields) in VIEWERS.items():
        for path, *_ in fields:
            whole, _, last = path.rpartition(".")
            for name in last.split(", "):
                descriptor = viewer.TYPES[topic].DESCRIPTOR
                for part in (*whole.split("."), name) if whole else (name,):
                    field = descriptor.fields_by_name.get(part.removesuffix("[]")) if descriptor is not None else None
                    if field is None:
                        wrong.append(f"{topic}: {path}")
                        break
                    descriptor = field.message_type
    return wrong
