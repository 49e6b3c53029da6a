"""docs/reference/topics.md has the topics that logs have, no others, and no field that a schema has not."""

from __future__ import annotations

import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "sil" / "sinks"))

import pytest
from synthetic import synthetic_journal

from sil import mcap_file
from sil.sinks.seal import seal
from tools.reference import topics_page

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "topics.md"


def listed(file: str) -> dict[str, tuple[str, str]]:
    """Type and encoding by topic, of the overview of a file."""
    text = PAGE.read_text(encoding="utf-8").partition(f"\n## {file}\n")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| `(/[^`]+)` \| `([^`]+)` \| (\w+) \|", text, re.MULTILINE)
    return {topic: (kind, encoding) for topic, kind, encoding in rows}


def test_the_topics_are_those_of_a_run(tmp_path: Path) -> None:
    seal(synthetic_journal(tmp_path / "a", 5))
    for file in ("run.mcap", "timing.mcap"):
        channels = mcap_file.read(tmp_path / "a" / file, ()).channels
        found = {topic: channel.message_encoding for topic, channel in channels.items()}
        assert found == {topic: encoding for topic, (_, encoding) in listed(file).items()}
    assert listed("run.mcap")["/joint_states"][0] == "sensor_msgs/msg/JointState"


def test_every_field_is_in_its_schema(monkeypatch: pytest.MonkeyPatch) -> None:
    assert topics_page.undescribed() == []
    monkeypatch.setitem(topics_page.VIEWERS, "/log", ("", (("level", "", "", ""), ("levels", "", "", ""))))
    assert topics_page.undescribed() == ["/log: levels"]


def test_every_number_says_its_unit() -> None:
    """A field whose name ends with a unit has it in the column; every word of TELEMETRY has one."""
    units = {"_deg": "deg", "_rad": "rad", "_radps": "rad/s", "_nm": "N m", "_nms": "N m s", "_ns": "ns", "_us": "us"}
    rows = re.findall(r"^\| `(\w+)`[^|]*\| `(\S+)` \| ([^|]*) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(rows) > 80
    for name, kind, unit in rows:
        ending = next((end for end in sorted(units, key=len, reverse=True) if name.endswith(end)), "")
        assert unit.strip() == units.get(ending, unit.strip()), name
        assert unit.strip() or kind != "float64", name
