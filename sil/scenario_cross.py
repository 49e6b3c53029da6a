"""What one key of a scenario alone cannot tell: whether keys fit each other, as problems with file and line."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from protocol.law_tables import INT32_MAX
from sil.plants import PLANTS
from sil.profiles import PROFILES
from sil.scenario_errors import Path, Problem, key_of, one_of, shown
from sil.scenario_events import findings as event_findings
from sil.scenario_faults import findings as fault_findings
from sil.scenario_link import faults_problems
from sil.scenario_metrics import refused_metric
from sil.scenario_sampling import findings as sampling_findings
from sil.scenarios import is_file
from sil.sensors import SENSORS
from sil.user_plant import is_user_plant
from sil.user_plant import refused as refused_plant

if TYPE_CHECKING:
    from sil.scenario import Scenario

MOST_TICKS = 0xFFFFFFFE  # the last tick number that a header can carry


def cross_problems(scenario: Scenario) -> Iterator[Problem]:
    """All of them, each once; law.params are held against the law's table elsewhere."""
    checks: tuple[Callable[[Scenario], Iterator[Problem]], ...] = (
        _times,
        _names,
        _steps,
        _requirements,
        _inertia,
        _torque_scale,
        _misalignment,
        _sampling,
        _files,
        _events,
        _link_faults,
    )
    yield from dict.fromkeys(found for check in checks for found in check(scenario))


def problem(scenario: Scenario, key: str | Path, expected: str, got: object) -> Problem:
    """One problem with `key`, such as plant.kind or ("require", 0, "metric"), at the place that decided it."""
    return _problem_as_told(scenario, key, expected, shown(got))


def _times(scenario: Scenario) -> Iterator[Problem]:
    period, duration = scenario.period_s, scenario.duration_s
    if abs(period * 1e6 - scenario.period_us) > 1e-6 * max(1.0, period):
        nearest = f"a whole number of microseconds, nearest {scenario.period_us * 1e-6:.6f} s"
        yield problem(scenario, "period_s", nearest, period)
        return
    ticks = max(1, round(duration * 1e6 / scenario.period_us))
    if abs(duration * 1e6 - ticks * scenario.period_us) > 0.5:
        nearest = f"a whole number of periods of {period:g} s, nearest {ticks * scenario.period_us / 1e6:g} s"
        yield problem(scenario, "duration_s", nearest, duration)
    elif ticks > MOST_TICKS:
        yield problem(scenario, "duration_s", f"at most {MOST_TICKS} ticks", duration)
    elif scenario.metrics.from_tick >= ticks:
        yield problem(scenario, "metrics.from_tick", f"a tick below {ticks}, the end", scenario.metrics.from_tick)


def _names(scenario: Scenario) -> Iterator[Problem]:
    kind, profile, file = scenario.plant.kind, scenario.guidance.profile, scenario.file_of("plant.kind")
    if profile not in PROFILES:
        yield problem(scenario, "guidance.profile", one_of(PROFILES, profile), profile)
    if file is None or not is_user_plant(kind):
        expected = None if kind in PLANTS else f"{one_of(PLANTS, kind)}, or ./FILE.py:CLASS"
    else:
        expected = refused_plant(file, kind)
    if expected is not None:
        yield problem(scenario, "plant.kind", expected, kind)


def _steps(scenario: Scenario) -> Iterator[Problem]:
    rows = scenario.guidance.rows
    if rows and scenario.guidance.profile != "steps":
        yield problem(scenario, "guidance.rows", "rows with profile steps only", scenario.guidance.profile)
    if not rows and scenario.guidance.profile == "steps":
        yield problem(scenario, "guidance.rows", "at least one {t_s, attitude_deg} for profile steps", ())
    for index in range(1, len(rows)):
        if rows[index].t_s <= rows[index - 1].t_s:
            expected = f"a number in s above {rows[index - 1].t_s:g}, the row before"
            yield problem(scenario, ("guidance", "rows", index, "t_s"), expected, rows[index].t_s)


def _requirements(scenario: Scenario) -> Iterator[Problem]:
    for index, line in enumerate(scenario.require):
        if expected := refused_metric(line.metric):
            yield problem(scenario, ("require", index, "metric"), expected, line.metric)
        said = [name for name in ("below", "above", "between") if getattr(line, name) is not None]
        if len(said) != 1:
            got = " and ".join(said) or "none of them"
            yield _problem_as_told(scenario, ("require", index), "exactly one of below, above, between", got)


def _inertia(scenario: Scenario) -> Iterator[Problem]:
    inertia, wheels = scenario.plant.inertia_kgm2, scenario.actuators.wheels.inertia_kgm2
    principal = [inertia[i][i] for i in range(3)]
    for i in range(3):
        if principal[i] > principal[i - 1] + principal[i - 2] + 1e-12:
            limit = f"no moment of inertia above the sum of the other two ({principal[i - 1] + principal[i - 2]:g})"
            yield problem(scenario, "plant.inertia_kgm2", limit, principal[i])
        if scenario.plant.inertia_includes_wheels and wheels[i] >= principal[i]:
            limit = f"less than plant.inertia_kgm2 ({principal[i]:g}), which includes the wheels"
            yield problem(scenario, "actuators.wheels.inertia_kgm2", limit, wheels[i])


def _torque_scale(scenario: Scenario) -> Iterator[Problem]:
    limits = [limit for limit in scenario.actuators.chosen.torque_max_Nm if limit is not None]
    largest = scenario.actuators.largest_on_the_wire or max(limits, default=0.0)
    if largest * 2**scenario.torque_bits >= INT32_MAX:
        fits = math.floor(math.log2(INT32_MAX / largest))
        if scenario.wire.torque_bits is not None:
            expected = f"at most {fits}, for a limit of {largest:g} N m"
            yield problem(scenario, "wire.torque_bits", expected, scenario.torque_bits)
        else:
            key = f"actuators.{scenario.actuators.kind}.torque_max_Nm"
            yield problem(scenario, key, f"at most {INT32_MAX / 2**8:.0f} N m", largest)


def _misalignment(scenario: Scenario) -> Iterator[Problem]:
    thrusters = scenario.actuators.thrusters
    if thrusters.misalignment is not None and thrusters.misalignment_percent:
        expected = "0 beside misalignment, which says all of it"
        yield problem(scenario, "actuators.thrusters.misalignment_percent", expected, thrusters.misalignment_percent)


def _sampling(scenario: Scenario) -> Iterator[Problem]:
    sensors = scenario.sensors
    for name in (name for name in SENSORS if getattr(sensors, name).enabled):
        own = getattr(sensors, name).sampling
        for path, expected, got in sampling_findings(name, sensors.sampling, own, scenario.period_us):
            yield problem(scenario, path, expected, got)


def _files(scenario: Scenario) -> Iterator[Problem]:
    if scenario.schedule is None:
        return
    if scenario.board != "none":
        yield problem(scenario, "schedule", "a schedule with board none only", f"board {scenario.board}")
        return
    file = scenario.file_of("schedule")
    if file is None or not is_file(file):
        yield problem(scenario, "schedule", "a CSV file that exists", scenario.schedule)


def _events(scenario: Scenario) -> Iterator[Problem]:
    if not scenario.ticks:
        return
    period_us, ticks = scenario.period_us, scenario.ticks
    for path, expected, got in (
        *event_findings(scenario.events, scenario.board, period_us, ticks),
        *fault_findings(scenario.sensors, scenario.actuators, period_us, ticks),
    ):
        yield problem(scenario, path, expected, got)


def _link_faults(scenario: Scenario) -> Iterator[Problem]:
    url = scenario.board if "://" in scenario.board else scenario.link.url
    around = (scenario.board, url, scenario.period_s, scenario.duration_s)
    for path, expected, got in faults_problems(scenario.link.faults, *around):
        yield problem(scenario, ("link", "faults", *path), expected, got)


def _problem_as_told(scenario: Scenario, key: str | Path, expected: str, got: str) -> Problem:
    path = tuple(key.split(".")) if isinstance(key, str) else key
    place = scenario.where(".".join(map(str, path)))
    return Problem(str(place), key_of(path), expected, got, place.line)
