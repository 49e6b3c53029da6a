"""Faults of instruments in a scenario: one line with key and line for what they cannot mean; what the log will say."""

from __future__ import annotations

import pytest

from protocol import events as codes
from sil import scenario_faults
from sil.checks import check_scenario
from sil.scenario import load_values
from sil.scenario_errors import ScenarioInvalid
from sil.sinks.events import describe

A, Q, R, W = "sensors.attitude", "sensors.quaternion", "sensors.rate", "actuators.wheels"
# what: (section, faults, key behind the section, expected, got), the last two as parts of the text
BROKEN = {
    "unknown kind": (A, "{kind: stick}", "[0].kind", "did you mean stuck?", "stick"),
    "no kind": (A, "{at_s: 1}", "[0].kind", "a value", "nothing"),
    "unknown key": (A, "{kind: off, axes: x}", "[0].axes", "did you mean axis?", "unknown key"),
    "unknown axis": (A, "{kind: off, axis: [x, w]}", "[0].axis", "x, y or z, or a list of these", "['x', 'w']"),
    "an axis twice": (A, "{kind: off, axis: [x, x]}", "[0].axis", "x, y or z", "['x', 'x']"),
    "no axis at all": (A, "{kind: off, axis: []}", "[0].axis", "x, y or z", "[]"),
    "before the start": (W, "{kind: off, at_s: -2}", "[0].at_s", "not below 0", "-2"),
    "after the end": (A, "{kind: off, at_s: 100}", "[0].at_s", "at most 99.5 s", "100"),
    "beyond the end": (W, "{kind: off, at_s: 90, for_s: 20}", "[0].for_s", "at most 10 s: the run ends at 100 s", "20"),
    "between ticks": (A, "{kind: off, at_s: 9.1, for_s: 0.2}", "[0].for_s", "covers a tick, one every 0.5 s", "0.2"),
    "a probability above 1": (A, "{kind: intermittent, fraction: 1.5}", "[0].fraction", "not above 1", "1.5"),
    "a probability below 0": (W, "{kind: intermittent, fraction: -0.1}", "[0].fraction", "not below 0", "-0.1"),
    "a bias without bounds": (A, "{kind: wrong, bias_deg: 1.0e+305}", "[0].bias_deg", "not above 1e+06", "1e+305"),
    "a moment without bounds": (A, "{kind: off, at_s: 1.0e+305}", "[0].at_s", "not above 1e+12", "1e+305"),
    "off for no time": (A, "{kind: intermittent, on_s: 1, off_s: 0}", "[0].off_s", "not below 1e-06", "0"),
    "no delay": (A, "{kind: delayed}", "[0].delay_s", "above 0 for delayed", "null"),
    "a delay of another kind": (A, "{kind: stuck, delay_s: 1}", "[0].delay_s", "it goes with delayed", "1"),
    "a bias of another kind": (R, "{kind: off, bias_degps: 1}", "[0].bias_degps", "it goes with wrong", "1"),
    "a bias of another instrument": (R, "{kind: wrong, bias_deg: 1, scale: 1}", "[0].bias_deg", "bias_degps", "unkn"),
    "wrong by nothing": (A, "{kind: wrong}", "[0].kind", "scale or bias_deg beside it", "wrong"),
    "wheels wrong by nothing": (W, "{kind: wrong}", "[0].kind", "scale or bias_Nm beside it", "wrong"),
    "slow without a period": (A, "{kind: slow}", "[0].period_s", "at least the run's period (0.5)", "null"),
    "slow but faster": (A, "{kind: slow, period_s: 0.4}", "[0].period_s", "at least the run's period (0.5)", "0.4"),
    "intermittent, never said when": (A, "{kind: intermittent}", "[0].kind", "fraction, or on_s and off_s", "none"),
    "intermittent, half said": (A, "{kind: intermittent, on_s: 2}", "[0].kind", "fraction, or on_s and off_s", "on_s"),
    "intermittent, said twice": (
        W, "{kind: intermittent, on_s: 2, off_s: 2, fraction: 0.1}", "[0].kind", "fraction, or on_s", "fraction and",
    ),
    "a quaternion stuck on one axis": (Q, "{kind: stuck, axis: x}", "[0].axis", "a quaternion is one reading", "x"),
    "a quaternion scaled": (Q, "{kind: wrong, scale: 2}", "[0].scale", "no scale of a quaternion", "2"),
    "garbage without a limit": (W, "{kind: garbage}", "[0].kind", "a torque_max_Nm", "garbage"),
    "off and stuck": (
        A, "{kind: stuck, at_s: 5}, {kind: off, at_s: 9, for_s: 1, axis: y}", "[1].kind", "no overlap with fau", "off",
    ),
    "stuck at garbage": (
        W, "{kind: stuck, axis: x}, {kind: garbage, axis: [x, y]}", "[1].kind", "faults[0], which is stuck", "garbage",
    ),
    "slow twice": (
        A, "{kind: slow, period_s: 2}, {kind: slow, period_s: 3}", "[1].kind", "no overlap with faults[0]", "slow",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_one_line_each(tmp_path, name):
    section, faults, key, expected, got = BROKEN[name]
    top, instrument = section.split(".")
    more = "enabled: true" if top == "sensors" else f"torque_max_Nm: [{'null' if 'without' in name else 0.1}, 0.1, 0.1]"
    file = tmp_path / "faulty.yaml"
    file.write_text(f"duration_s: 100\n{top}:\n  {instrument}:\n    {more}\n    faults: [{faults}]\n")
    errors = [finding for finding in check_scenario(str(file)) if finding.severity == "error"]
    assert len(errors) == 1, "\n".join(map(str, errors))
    assert (errors[0].key, errors[0].line) == (f"{section}.faults{key}", 5)
    assert expected in errors[0].expected
    assert got in errors[0].got
    assert "\n" not in str(errors[0])


def test_a_sensor_that_is_not_there_has_no_faults(tmp_path):
    file = tmp_path / "faulty.yaml"
    file.write_text("sensors:\n  rate:\n    faults:\n      - {kind: off}\n")
    (error,) = check_scenario(str(file))
    assert (error.key, error.line) == ("sensors.rate.faults", 3)
    assert "sensors.rate.enabled: true" in error.expected


COMPATIBLE = {
    "one after the other": [{"kind": "off", "at_s": 5, "for_s": 5}, {"kind": "stuck", "at_s": 10}],
    "on different axes": [{"kind": "off", "axis": "x"}, {"kind": "garbage", "axis": ["y", "z"]}],
    "one on top of the other": [
        {"kind": "wrong", "bias_deg": 1}, {"kind": "delayed", "delay_s": 1}, {"kind": "intermittent", "fraction": 0.1},
    ],
}  # fmt: skip


@pytest.mark.parametrize("name", COMPATIBLE)
def test_what_goes_together(name):
    made = load_values({"sensors": {"attitude": {"faults": COMPATIBLE[name]}}})
    assert len(made.sensors.attitude.faults) == len(COMPATIBLE[name])
    assert load_values(made.resolved()).resolved() == made.resolved()


def test_what_the_log_will_say():
    made = load_values(
        {
            "duration_s": 100,
            "sensors": {"attitude": {"faults": [{"kind": "stuck", "at_s": 10, "for_s": 1}]}},
            "actuators": {"wheels": {"faults": [{"kind": "wrong", "scale": 0.5}]}},
        }
    )
    instruments = scenario_faults.given(made.sensors, made.actuators)
    said = list(scenario_faults.notices(instruments, made.period_us, made.ticks))
    assert said == [(20, codes.FAULT_BEGINS, 0, 1), (22, codes.FAULT_ENDS, 0, 1), (0, codes.FAULT_BEGINS, 3, 3)]
    lines = [describe(code, a, b) for _, code, a, b in said]
    assert lines[0] == (
        "warning",
        "FAULT_BEGINS: a fault of an instrument, on purpose (of: attitude sensor, kind: stuck)",
    )
    assert lines[1] == ("info", "FAULT_ENDS: it works again (of: attitude sensor, kind: stuck)")
    assert lines[2][1].endswith("(of: wheels, kind: wrong)")


def test_thousands_of_faults_or_events_are_one_line_and_not_minutes():
    """Each is held against every other, so their number is bounded."""
    faults = [{"kind": "stuck", "at_s": float(at), "for_s": 0.5} for at in range(1001)]
    events = [{"do": "link.disconnect", "at_s": float(at), "for_s": 0.5} for at in range(1001)]
    for values, said in (
        ({"sensors": {"attitude": {"faults": faults}}}, "sensors.attitude.faults: expected at most 1000 faults"),
        ({"events": events}, "events: expected at most 1000 events"),
    ):
        with pytest.raises(ScenarioInvalid) as refused:
            load_values({"duration_s": 2000, **values})
        assert len(refused.value.problems) == 1 and said in str(refused.value)
    load_values({"duration_s": 2000, "sensors": {"attitude": {"faults": faults[:1000]}}, "events": events[:1000]})
