"""The layout that ships for viewers: every panel is placed once, and every path in it exists in what a run shows."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mcap.reader import make_reader
from typer.testing import CliRunner

from sil.cli import app
from sil.live_view import LAYOUT

FIELD = re.compile(r"^(\w+)(?:\[(\d*)\])? (\w+)", re.MULTILINE)
PATH = re.compile(r"(/[a-z_/]+)\.(\w+)(?:\[(\d+)\])?")
KINDS = {"3D", "Plot", "StateTransitions", "RosOut"}  # as Foxglove and Lichtblick name them

CONTENT: dict[str, Any] = json.loads(LAYOUT.read_text(encoding="utf-8"))
PANELS: dict[str, Any] = CONTENT["configById"]


def leaves(node: Any) -> Iterator[str]:
    if isinstance(node, str):
        yield node
        return
    assert node["direction"] in ("row", "column") and 0 < node["splitPercentage"] < 100
    yield from leaves(node["first"])
    yield from leaves(node["second"])


def schemas(folder: Path) -> dict[str, tuple[str, str, bytes]]:
    """(name, encoding, schema) by topic, of both logs: all that viewers are shown."""
    found = {}
    for name in ("run.mcap", "timing.mcap"):
        with open(folder / name, "rb") as stream:
            summary = make_reader(stream).get_summary()
            assert summary is not None
            for channel in summary.channels.values():
                schema = summary.schemas[channel.schema_id]
                found[channel.topic] = (schema.name, schema.encoding, schema.data)
    return found


def test_every_panel_is_placed_once_and_known():
    placed = list(leaves(CONTENT["layout"]))
    assert sorted(placed) == sorted(PANELS)
    assert {name.partition("!")[0] for name in placed} == KINDS


def test_every_path_exists_in_what_a_run_shows(flown):
    topics = schemas(flown)
    paths = [series["value"] for panel in PANELS.values() for series in panel.get("paths", ())]
    assert len(paths) > 10
    for path in paths:
        found = PATH.fullmatch(path)
        assert found, path
        topic, field, index = found.groups()
        assert topics[topic][1] == "ros2msg", path
        sizes = {name: size for _, size, name in FIELD.findall(topics[topic][2].decode())}
        assert field in sizes, path
        assert (index is None) == (sizes[field] == "") and int(index or 0) < int(sizes[field] or 1), path


def test_what_is_drawn_and_told_has_the_schema_its_panel_needs(flown):
    topics = schemas(flown)
    drawn = [topic for panel in PANELS.values() for topic in panel.get("topics", ())]
    assert {topics[topic][0] for topic in drawn} <= {
        "foxglove.FrameTransform",
        "foxglove.FrameTransforms",
        "foxglove.SceneUpdate",
    }
    assert {"/tf", "/scene"} <= set(drawn)
    assert topics[PANELS["RosOut!log"]["topicToRender"]][0] == "foxglove.Log"


def test_the_command_prints_it():
    printed = CliRunner().invoke(app, ["live", "--layout"])
    assert printed.exit_code == 0 and printed.stdout == LAYOUT.read_text(encoding="utf-8")
