"""What viewers are shown of a journal: the rows of the log, and of ticks that are passed over what happened once."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

from mcap.reader import make_reader

from sil.live.following import Following, Step
from sil.live.played import finished, played
from sil.sinks.journal import read_journal
from sil.sinks.mcap_rows import RunRows, TimingRows

ONCE = {"/event", "/log", "/session"}


class Shown:
    """A writer that keeps messages by topic."""

    def __init__(self) -> None:
        self.topics: list[str] = []
        self.messages: defaultdict[str, list[tuple[int, bytes]]] = defaultdict(list)

    def register_schema(self, *_: Any) -> int:
        return 0

    def register_channel(self, topic: str, *_: Any) -> int:
        self.topics.append(topic)
        return len(self.topics) - 1

    def add_message(self, channel: int, log_time: int, data: bytes, *_: Any) -> None:
        self.messages[self.topics[channel]].append((log_time, data))

    def add_metadata(self, *_: Any) -> None:
        pass

    add_attachment = add_metadata


def followed(folder: Path) -> tuple[Shown, Shown, Following]:
    """(rows of the run, rows of the host, what follows the journal of this run)."""
    run, timing = Shown(), Shown()
    following = Following(RunRows(run), TimingRows(timing))  # type: ignore[arg-type]
    following.follow(read_journal(folder / "run.journal").follow())
    return run, timing, following


def steps_of(following: Following) -> list[Step]:
    found = []
    while steps := following.new():
        found += steps
    return found


def logged(file: Path) -> dict[str, list[tuple[int, bytes]]]:
    messages: defaultdict[str, list[tuple[int, bytes]]] = defaultdict(list)
    with open(file, "rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages():
            messages[channel.topic].append((message.log_time, message.data))
    return messages


def test_all_that_is_shown_is_what_is_logged(flown):
    run, timing, following = followed(flown)
    for step in steps_of(following):
        following.show(step)
    assert following.over
    assert run.messages == logged(flown / "run.mcap")
    assert timing.messages["/timing"] == logged(flown / "timing.mcap")["/timing"]


def test_of_ticks_that_are_passed_over_every_event_is_shown_and_nothing_twice(flown):
    run, _, following = followed(flown)
    steps = steps_of(following)
    assert sum(step.is_tick for step in steps) == 40
    for step in steps:
        following.show(step.once())
    log = logged(flown / "run.mcap")
    assert len(log["/event"]) > 3
    for topic in ONCE:
        assert run.messages[topic] == log[topic]
    assert not run.messages["/truth"] and not run.messages["/sample"]
    following.show([step for step in steps if step.is_tick][-1].rest())
    assert run.messages["/truth"] == log["/truth"][-1:]
    assert run.messages["/event"] == log["/event"]


def test_a_journal_that_grows_a_byte_at_a_time_is_shown_the_same(flown, tmp_path):
    """Also where a look falls into the middle of a record."""
    whole = (flown / "run.journal").read_bytes()
    (tmp_path / "run.journal").write_bytes(whole[:12])
    run, _, following = followed(tmp_path)
    with open(tmp_path / "run.journal", "ab", buffering=0) as growing:
        for at in range(12, len(whole), 97):
            growing.write(whole[at : at + 97])
            for step in following.new():
                following.show(step)
    assert following.over and run.messages == logged(flown / "run.mcap")


def test_a_run_that_is_over_is_played_at_its_speed(flown, monkeypatch):
    now = [100.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    assert finished(read_journal(flown / "run.journal"))
    records = played(read_journal(flown / "run.journal"), speed=2.0)
    seen = []
    for _ in range(10_000):
        record = next(records, "end")
        if record == "end":
            break
        if record is None:
            now[0] += 0.05
        elif record.kind == 255:
            seen.append((record.tick, round(now[0] - 100.0, 9)))
    assert seen[-1][0] == 39
    assert all(tick * 0.25 <= at < tick * 0.25 + 0.06 for tick, at in seen)
