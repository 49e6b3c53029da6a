"""`events:` of a scenario: ticks they mean, rows they add, and one line with key and line for what they cannot mean."""

from __future__ import annotations

import pytest

from protocol import events as codes
from sil import timeline
from sil.checks import check_scenario
from sil.configure import orders
from sil.scenario import load_values
from sil.scenario_events import Span, span

HEAD = "duration_s: 100\nevents:\n"
# what: (lines of the list, key, line, expected, got), the last two as parts of the text
BROKEN = {
    "unknown verb": (
        "  - {at_s: 1, do: link.disconect, for_s: 1}\n",
        "events[0].do", 3, "one of link.disconnect, board.restart, setpoint (did you mean link.dis", "disconect",
    ),
    "no verb": ("  - {at_s: 1}\n", "events[0].do", 3, "a value", "nothing"),
    "no time": ("  - {do: setpoint, deg: [1, 0, 0]}\n", "events[0].at_s", 3, "a value", "nothing"),
    "unknown key": ("  - {at_s: 1, do: setpoint, degs: 1, deg: [1, 0, 0]}\n", "events[0].degs", 3, "deg", "unknown"),
    "too late": ("  - {at_s: 1.0e+305, do: link.disconnect}\n", "events[0].at_s", 3, "not above 1e+12", "1e+305"),
    "angles to turn on": (
        "  - {at_s: 1, do: setpoint, deg: [0, 0, 1.0e+20]}\n", "events[0].deg", 3, "within +-3.6e+08", "1e+20",
    ),
    "before the start": ("  - {at_s: -1, do: link.disconnect}\n", "events[0].at_s", 3, "not below 0", "-1"),
    "at the end": ("  - {at_s: 100, do: link.disconnect}\n", "events[0].at_s", 3, "at most 99.5 s", "100"),
    "after the last tick": ("  - {at_s: 99.7, do: link.disconnect}\n", "events[0].at_s", 3, "at most 99.5 s", "99.7"),
    "beyond the end": (
        "  - {at_s: 1, do: setpoint, deg: [1, 0, 0]}\n  - at_s: 90\n    do: board.restart\n    for_s: 11\n",
        "events[1].for_s", 6, "at most 10 s: the run ends at 100 s", "11",
    ),
    "disconnect beyond the end": (
        "  - {at_s: 90, do: link.disconnect, for_s: 11}\n", "events[0].for_s", 3, "at most 10 s", "11",
    ),
    "no time at all": ("  - {at_s: 9, do: link.disconnect, for_s: 0}\n", "events[0].for_s", 3, "not below 1e-06", "0"),
    "restart without end": ("  - {at_s: 9, do: board.restart}\n", "events[0].for_s", 3, "how long the board", "null"),
    "restart between ticks": (
        "  - {at_s: 9.1, do: board.restart, for_s: 0.1}\n", "events[0].for_s", 3, "covers a tick, one every 0.5", "0.1",
    ),
    "overlapping restarts": (
        "  - {at_s: 9, do: board.restart, for_s: 3}\n  - {at_s: 5, do: board.restart, for_s: 4.5}\n",
        "events[1].at_s", 4, "no overlap with events[0] (9 s)", "5",
    ),
    "overlapping disconnects": (
        "  - {at_s: 9, do: link.disconnect}\n  - {at_s: 50, do: link.disconnect, for_s: 4.5}\n",
        "events[1].at_s", 4, "no overlap with events[0] (9 s)", "50",
    ),
    "two set-points at once": (
        "  - {at_s: 9, do: setpoint, deg: [1, 0, 0]}\n  - {at_s: 8.9, do: setpoint, deg: [2, 0, 0]}\n",
        "events[1].at_s", 4, "no overlap with events[0]", "8.9",
    ),
    "set-point without angles": ("  - {at_s: 9, do: setpoint}\n", "events[0].deg", 3, "3 numbers in deg", "null"),
    "two angles": ("  - {at_s: 9, do: setpoint, deg: [1, 2]}\n", "events[0].deg", 3, "3 numbers in deg", "[1, 2]"),
    "set-point that ends": (
        "  - {at_s: 9, do: setpoint, deg: [1, 2, 3], for_s: 2}\n", "events[0].for_s", 3, "lasts until the next", "2",
    ),
    "angles of a disconnect": (
        "  - {at_s: 9, do: link.disconnect, deg: [1, 2, 3]}\n", "events[0].deg", 3, "no such key with link.dis", "[1.0",
    ),
    "without a board": (
        "  - {at_s: 9, do: link.disconnect}\nboard: none\n", "events[0].do", 3, "a run with a board", "link.disconnect",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_one_line_each(tmp_path, name):
    text, key, line, expected, got = BROKEN[name]
    file = tmp_path / "timeline.yaml"
    file.write_text(HEAD + text)
    errors = [finding for finding in check_scenario(str(file)) if finding.severity == "error"]
    assert len(errors) == 1, "\n".join(map(str, errors))
    assert (errors[0].key, errors[0].line) == (key, line)
    assert expected in errors[0].expected
    assert got in errors[0].got


def test_what_touches_does_not_overlap():
    both = [{"at_s": 9, "do": "board.restart", "for_s": 3}, {"at_s": 12, "do": "board.restart", "for_s": 1}]
    made = load_values({"events": both})
    assert timeline.restarts(made.events, made.period_us, made.ticks) == ((18, 24), (24, 26))


@pytest.mark.parametrize(
    ("at_s", "for_s", "expected"),
    [
        (10, 2, Span(20, 24)),
        (10.1, 2, Span(21, 25)),  # 10.5 s .. 12 s
        (10.1, 0.1, Span(21, 21)),
        (0, 0.5, Span(0, 1)),
        (10, None, Span(20, 200)),
        (99.5, 0.5, Span(199, 200)),
    ],
)
def test_ticks_of_a_span(at_s, for_s, expected):
    assert span(at_s, for_s, 500_000, 200) == expected


def test_no_rounding_moves_a_tick():
    """0.1 s in binary is a little more: three of them are still the third tick."""
    assert [span(k * 0.1, 0.1, 100_000, 1000) for k in range(500)] == [Span(k, k + 1) for k in range(500)]


def test_a_set_point_holds_until_the_profile_changes_it():
    at = [{"at_s": 70, "do": "setpoint", "deg": [5, 0, 1]}, {"at_s": 110, "do": "setpoint", "deg": [0, 0, 2]}]
    made = load_values({"events": at, "duration_s": 120})
    assert made.setpoints() == (
        (120, (25.0, 0.0, 0.0)),
        (140, (5.0, 0.0, 1.0)),
        (220, (0.0, 0.0, 2.0)),  # where manoeuvre A has a row, too
    )
    assert [row[0] for row in orders(made).configuration.rows] == [120, 140, 220]


def test_a_profile_that_repeats_itself_still_ends_a_set_point():
    rows = [{"t_s": 0, "attitude_deg": [1, 0, 0]}, {"t_s": 10, "attitude_deg": [1, 0, 0]}]
    made = load_values(
        {"guidance": {"profile": "steps", "rows": rows}, "events": [{"at_s": 5, "do": "setpoint", "deg": [2, 0, 0]}]}
    )
    assert made.setpoints() == ((0, (1.0, 0.0, 0.0)), (10, (2.0, 0.0, 0.0)), (20, (1.0, 0.0, 0.0)))


def test_by_sample_the_rows_stay_with_the_laboratory():
    at = [{"at_s": 70, "do": "setpoint", "deg": [5, 0, 1]}]
    made = orders(load_values({"events": at, "guidance": {"setpoint_source": "sample"}}))
    assert made.configuration.rows == ()
    assert [row[0] for row in made.rows][:2] == [120, 140]


def test_what_the_log_will_say():
    at = [
        {"at_s": 10, "do": "link.disconnect"},
        {"at_s": 20.2, "do": "board.restart", "for_s": 1},
        {"at_s": 7, "do": "setpoint", "deg": [1, 0, 0]},
        {"at_s": 4, "do": "link.disconnect", "for_s": 1},
    ]
    made = load_values({"events": at, "duration_s": 100})
    assert sorted(timeline.notices(made.events, made.period_us, made.ticks)) == [
        (8, codes.LINK_DOWN, 8, 2),
        (10, codes.LINK_UP, 10, 2),
        (14, codes.SETPOINT, 14, 2),
        (20, codes.LINK_DOWN, 20, 180),
        (41, codes.BOARD_OFF, 41, 2),
        (43, codes.BOARD_ON, 43, 2),
    ]
