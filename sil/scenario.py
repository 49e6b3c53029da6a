"""A scenario: one YAML file that says everything about a test, validated into a frozen model with units and defaults.

`load_scenario("mrac-rs232", ["duration_s=60"])` reads a built-in or a file, applies `extends` and the overrides, and
raises ScenarioInvalid with one line per problem. The sections and their defaults are in scenario_sections.py, those of
sensors and wheels in scenario_instruments.py, the timeline in scenario_events.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path as FilePath
from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr, ValidationError

from protocol.law_tables import INT32_MAX, LawTable, Variant, variant_of
from sil import scenario_law as laws
from sil.plants import PLANTS
from sil.profiles import PROFILES, SetpointRow, setpoints
from sil.scenario_errors import Path, Problem, ScenarioInvalid, Where, key_of, one_of, shown
from sil.scenario_events import Event
from sil.scenario_events import findings as event_findings
from sil.scenario_faults import findings as fault_findings
from sil.scenario_instruments import Actuators, Sensors
from sil.scenario_link import Link, faults_problems
from sil.scenario_metrics import refused_metric
from sil.scenario_sampling import findings as sampling_findings
from sil.scenario_sections import (
    Attitude,
    Board,
    Clock,
    Guidance,
    Law,
    Metrics,
    Name,
    Plant,
    Requirement,
    Section,
    Timing,
    Wire,
)
from sil.scenario_source import Source, from_values, read_scenario
from sil.scenario_validation import problems_of, unknown_keys
from sil.scenarios import is_file
from sil.sensors import SENSORS
from sil.timeline import setpoint_rows
from sil.user_plant import is_user_plant
from sil.user_plant import refused as refused_plant

# How it is run, not what is run.
NOT_IDENTITY = ("clock", "timing", "link", "board", "restart_limit", "out", "variants")
MOST_TICKS = 0xFFFFFFFE  # the last tick number that a header can carry


class Scenario(Section):
    """One test. Times in s, angles in deg, triples [x, y, z]; see the sections for what is inside each."""

    name: Name = "scenario"
    """What the run directory is called after; default: the file's name, - for what a name cannot have."""
    about: str = ""
    """One line for `sil scenarios`."""
    seed: Annotated[int, Field(ge=0, lt=2**64)] = 0
    duration_s: Annotated[float, Field(gt=0, le=2.6e11)] = 600.0
    """A whole number of periods."""
    period_s: Annotated[float, Field(ge=0.001, le=60)] = 0.5
    """T_s, a whole number of microseconds."""
    transport_delay_ticks: Annotated[int, Field(ge=0, le=4)] = 1
    """n: COMMAND(k) acts from t_(k+n) on; 0 only in lockstep."""
    clock: Clock = Clock()
    timing: Timing = Timing()
    board: Board = "process"
    """process, inproc, none, or where a board that already runs listens"""
    link: Link = Link()
    out: str | None = None
    """Run directory; null: runs/NAME-NNN"""
    law: Law = Law()
    guidance: Guidance = Guidance()
    attitude: Attitude = Attitude()
    sensors: Sensors = Sensors()
    plant: Plant = Plant()
    actuators: Actuators = Actuators()
    schedule: str | None = None
    """For board none: CSV t,u1,u2,u3, relative to the scenario file: motor torques on the wheels, or what thrusters are
    told."""
    wire: Wire = Wire()
    hold_limit: Annotated[int, Field(ge=0, le=1_000_000)] = 10
    """Misses in a row that hold the last torque; then zero."""
    link_limit: Annotated[int, Field(ge=1, le=1_000_000)] = 20
    """Ticks without a SAMPLE until the board commands zero."""
    stale: Literal["propagate", "reuse"] = "propagate"
    """Without a usable SAMPLE the law propagates its model; reuse gives it the last reading again as if it were fresh,
    to show what harm that does."""
    restart_limit: Annotated[int, Field(ge=0, le=1000)] = 0
    """Unasked restarts of the board that the run survives in a new session; one more ends it with exit code 3."""
    sample_timeout_s: Annotated[float, Field(ge=0, le=60)] | None = None
    """How late a SAMPLE may be in real time; null: 0.2 T_s"""
    answer_delay_s: Annotated[float, Field(ge=0, le=60)] = 0.0
    """Execution model: how long the board is busy with one step."""
    telemetry_every: Annotated[int, Field(ge=0, le=1_000_000)] = 1
    """TELEMETRY in every so many ticks; 0: never"""
    expect_missed: bool = False
    """True: this scenario is meant to miss its deadlines, `sil check` accepts it."""
    events: tuple[Event, ...] = ()
    """What happens in mid-run on purpose."""
    metrics: Metrics = Metrics()
    require: tuple[Requirement, ...] = ()
    """What decides the verdict."""
    variants: dict[str, dict[str, Any]] = {}
    """Name to keys that replace those above, merged as over a scenario that is extended: {pd: {law: {name: pd}}}"""
    variant: str | None = None
    """Which of the variants this is, also `--variant`; null: none. The run is called NAME-VARIANT."""

    _source: Source = PrivateAttr()
    _table: LawTable = PrivateAttr()

    # -- derived ------------------------------------------------------------------------------------------------------

    @property
    def period_us(self) -> int:
        """T_s in us, exact."""
        return round(self.period_s * 1e6)

    @property
    def period_ns(self) -> int:
        """T_s in ns, exact."""
        return self.period_us * 1000

    @property
    def ticks(self) -> int:
        """Number of ticks of the run; the last one is ticks - 1."""
        return round(self.duration_s * 1e6) // self.period_us

    @property
    def sample_timeout_us(self) -> int:
        """sample_timeout_s with its default, in us."""
        return self.period_us // 5 if self.sample_timeout_s is None else round(self.sample_timeout_s * 1e6)

    @property
    def clock_scale(self) -> float:
        """Simulated seconds per wall second: 1 for realtime, N for scaled:N, 0 for lockstep."""
        return {"lockstep": 0.0, "realtime": 1.0}.get(self.clock.mode) or float(self.clock.mode.partition(":")[2] or 0)

    @property
    def torque_bits(self) -> int:
        """wire.torque_bits with its default: 30, lowered until the torque limit fits, 20 without a limit."""
        largest = self.actuators.largest_on_the_wire
        if self.wire.torque_bits is not None:
            return self.wire.torque_bits
        if largest is None:
            return 20
        return next((bits for bits in range(30, 8, -1) if round(largest * 2**bits) < INT32_MAX), 8)

    @property
    def law_table(self) -> LawTable:
        """The table of the law and version that fly."""
        return self._table

    @property
    def law_variant(self) -> Variant:
        """The design of the law that law.params choose: delays, leads, readings."""
        return variant_of(self._table, self.law_values())

    def law_values(self) -> dict[str, Any]:
        """law.params as protocol.law_tables.config_words() takes them."""
        return laws.wire_values(self._table, self.law.params)

    def setpoints(self) -> tuple[SetpointRow, ...]:
        """The guidance profile, and the set-points among `events`, as rows (tick, set-point in deg)."""
        more = setpoint_rows(self.events, self.period_us, self.ticks)
        return setpoints(self.guidance, self.period_s, self.ticks, more)

    def file_of(self, key: str) -> FilePath | None:
        """The file that `schedule`, `law.name` or `plant.kind` names (without :CLASS), from the file which says so."""
        named = {"law.name": self.law.name, "plant.kind": self.plant.kind}
        text = self.schedule if key == "schedule" else named[key].rpartition(":")[0] or None
        return None if text is None else self._source.directory_of(tuple(key.split("."))) / text

    def where(self, key: str) -> Where:
        """File and line (or --set) that decided `key`, such as events.0.at_s, or the nearest section above it."""
        return self._source.where_of(tuple(int(part) if part.isdecimal() else part for part in key.split(".")))

    # -- out ----------------------------------------------------------------------------------------------------------

    def resolved(self) -> dict[str, Any]:
        """Every key with its value, defaults included, in a fixed order; loads again with load_values()."""
        values = self.model_dump(mode="json")
        unsaid = [key for key in ("variant", "variants") if not values[key]]
        return {key: value for key, value in values.items() if key not in unsaid}

    def identity(self) -> dict[str, Any]:
        """resolved() without NOT_IDENTITY: what the numbers of a run depend on. Of the link its faults, if any."""
        values = self.resolved()
        faults = {"link": {"faults": values["link"]["faults"]}} if self.link.faults.any else {}
        return {key: value for key, value in values.items() if key not in NOT_IDENTITY} | faults


def load_scenario(
    name_or_path: str | FilePath, sets: Iterable[str] = (), user_table: laws.UserTable = laws.table_of_user_law
) -> Scenario:
    """A built-in scenario or a file, with overrides `a.b=value`; raises ScenarioInvalid.

    `user_table(file, class_name)` gives the parameter table of a user's own law.
    """
    return _build(read_scenario(str(name_or_path), tuple(sets)), user_table)


def load_values(
    values: dict[str, Any],
    sets: Iterable[str] = (),
    where: str = "recorded scenario",
    directory: FilePath | None = None,
    user_table: laws.UserTable = laws.table_of_user_law,
) -> Scenario:
    """A scenario from plain values, such as the resolved one of a log; `where` names them in messages."""
    return _build(from_values(values, where, directory or FilePath(), tuple(sets)), user_table)


def json_schema() -> dict[str, Any]:
    """JSON Schema of a scenario file, for editors."""
    schema = Scenario.model_json_schema()
    schema["properties"]["extends"] = {"type": "string", "description": "Scenario this one starts from: name or path."}
    return schema


def _build(source: Source, user_table: laws.UserTable) -> Scenario:
    found = list(unknown_keys(Scenario, source.data, source.where_of))
    try:
        scenario = Scenario.model_validate(source.data)
    except ValidationError as error:
        raise ScenarioInvalid(_sorted([*found, *problems_of(error, source.where_of)])) from None
    scenario._source = source
    found += [*_law_problems(scenario, source, user_table), *_cross_problems(scenario)]
    if found:
        raise ScenarioInvalid(_sorted(found))
    table = scenario._table
    law = scenario.law.model_copy(
        update={"version": table.version, "params": laws.complete(table, scenario.law.params)}
    )
    whole = scenario.model_copy(update={"law": law})
    whole._source, whole._table = source, table
    return whole


def _sorted(problems: Sequence[Problem]) -> list[Problem]:
    return sorted(problems, key=lambda problem: (problem.where.partition(":")[0], problem.line))


# -- what one key alone cannot tell -----------------------------------------------------------------------------------


def _law_problems(scenario: Scenario, source: Source, user_table: laws.UserTable) -> Iterator[Problem]:
    """Finds the law's table (scenario._table) and checks law.params against it."""
    table: LawTable | str
    if laws.is_user_law(scenario.law.name):
        table = _user_table(scenario, user_table)
    else:
        table = laws.built_in_table(scenario.law.name, scenario.law.version)
    if isinstance(table, LawTable):
        scenario._table = table
        yield from laws.problems(table, scenario.law.params, source.where_of)
    elif table.startswith("law.version "):
        yield _problem(scenario, "law.version", table.removeprefix("law.version "), scenario.law.version)
    else:
        yield _problem(scenario, "law.name", table, scenario.law.name)


def _user_table(scenario: Scenario, user_table: laws.UserTable) -> LawTable | str:
    file, class_name = scenario.file_of("law.name"), scenario.law.name.rpartition(":")[2]
    assert file is not None
    if not is_file(file):
        return "a file that exists"
    try:
        return user_table(file, class_name)
    except (ValueError, TypeError, OSError, SyntaxError, OverflowError, RecursionError, MemoryError) as error:
        reason = " ".join(str(error).split())
        return f"class {class_name} with PARAMS = {{name: (default, unit, lsb)}} ({reason})"


def _cross_problems(scenario: Scenario) -> Iterator[Problem]:
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
    yield from dict.fromkeys(problem for check in checks for problem in check(scenario))  # each of them once


def _times(scenario: Scenario) -> Iterator[Problem]:
    period, duration = scenario.period_s, scenario.duration_s
    if abs(period * 1e6 - scenario.period_us) > 1e-6 * max(1.0, period):
        nearest = f"a whole number of microseconds, nearest {scenario.period_us * 1e-6:.6f} s"
        yield _problem(scenario, "period_s", nearest, period)
        return
    ticks = max(1, round(duration * 1e6 / scenario.period_us))
    if abs(duration * 1e6 - ticks * scenario.period_us) > 0.5:
        nearest = f"a whole number of periods of {period:g} s, nearest {ticks * scenario.period_us / 1e6:g} s"
        yield _problem(scenario, "duration_s", nearest, duration)
    elif ticks > MOST_TICKS:
        yield _problem(scenario, "duration_s", f"at most {MOST_TICKS} ticks", duration)
    elif scenario.metrics.from_tick >= ticks:
        yield _problem(scenario, "metrics.from_tick", f"a tick below {ticks}, the end", scenario.metrics.from_tick)


def _names(scenario: Scenario) -> Iterator[Problem]:
    kind, profile, file = scenario.plant.kind, scenario.guidance.profile, scenario.file_of("plant.kind")
    if profile not in PROFILES:
        yield _problem(scenario, "guidance.profile", one_of(PROFILES, profile), profile)
    if file is None or not is_user_plant(kind):
        expected = None if kind in PLANTS else f"{one_of(PLANTS, kind)}, or ./FILE.py:CLASS"
    else:
        expected = refused_plant(file, kind)
    if expected is not None:
        yield _problem(scenario, "plant.kind", expected, kind)


def _steps(scenario: Scenario) -> Iterator[Problem]:
    rows = scenario.guidance.rows
    if rows and scenario.guidance.profile != "steps":
        yield _problem(scenario, "guidance.rows", "rows with profile steps only", scenario.guidance.profile)
    if not rows and scenario.guidance.profile == "steps":
        yield _problem(scenario, "guidance.rows", "at least one {t_s, attitude_deg} for profile steps", ())
    for index in range(1, len(rows)):
        if rows[index].t_s <= rows[index - 1].t_s:
            expected = f"a number in s above {rows[index - 1].t_s:g}, the row before"
            yield _problem(scenario, ("guidance", "rows", index, "t_s"), expected, rows[index].t_s)


def _requirements(scenario: Scenario) -> Iterator[Problem]:
    for index, line in enumerate(scenario.require):
        if expected := refused_metric(line.metric):
            yield _problem(scenario, ("require", index, "metric"), expected, line.metric)
        said = [name for name in ("below", "above", "between") if getattr(line, name) is not None]
        if len(said) != 1:
            got = " and ".join(said) or "none of them"
            place = scenario._source.where_of(("require", index))
            key = key_of(("require", index))
            yield Problem(str(place), key, "exactly one of below, above, between", got, place.line)


def _inertia(scenario: Scenario) -> Iterator[Problem]:
    inertia, wheels = scenario.plant.inertia_kgm2, scenario.actuators.wheels.inertia_kgm2
    principal = [inertia[i][i] for i in range(3)]
    for i in range(3):
        if principal[i] > principal[i - 1] + principal[i - 2] + 1e-12:
            limit = f"no moment of inertia above the sum of the other two ({principal[i - 1] + principal[i - 2]:g})"
            yield _problem(scenario, "plant.inertia_kgm2", limit, principal[i])
        if scenario.plant.inertia_includes_wheels and wheels[i] >= principal[i]:
            limit = f"less than plant.inertia_kgm2 ({principal[i]:g}), which includes the wheels"
            yield _problem(scenario, "actuators.wheels.inertia_kgm2", limit, wheels[i])


def _torque_scale(scenario: Scenario) -> Iterator[Problem]:
    limits = [limit for limit in scenario.actuators.chosen.torque_max_Nm if limit is not None]
    largest = scenario.actuators.largest_on_the_wire or max(limits, default=0.0)
    if largest * 2**scenario.torque_bits >= INT32_MAX:
        fits = math.floor(math.log2(INT32_MAX / largest))
        if scenario.wire.torque_bits is not None:
            expected = f"at most {fits}, for a limit of {largest:g} N m"
            yield _problem(scenario, "wire.torque_bits", expected, scenario.torque_bits)
        else:
            key = f"actuators.{scenario.actuators.kind}.torque_max_Nm"
            yield _problem(scenario, key, f"at most {INT32_MAX / 2**8:.0f} N m", largest)


def _misalignment(scenario: Scenario) -> Iterator[Problem]:
    thrusters = scenario.actuators.thrusters
    if thrusters.misalignment is not None and thrusters.misalignment_percent:
        expected = "0 beside misalignment, which says all of it"
        yield _problem(scenario, "actuators.thrusters.misalignment_percent", expected, thrusters.misalignment_percent)


def _sampling(scenario: Scenario) -> Iterator[Problem]:
    sensors = scenario.sensors
    for name in (name for name in SENSORS if getattr(sensors, name).enabled):
        own = getattr(sensors, name).sampling
        for path, expected, got in sampling_findings(name, sensors.sampling, own, scenario.period_us):
            yield _problem(scenario, path, expected, got)


def _files(scenario: Scenario) -> Iterator[Problem]:
    if scenario.schedule is None:
        return
    if scenario.board != "none":
        yield _problem(scenario, "schedule", "a schedule with board none only", f"board {scenario.board}")
        return
    file = scenario.file_of("schedule")
    if file is None or not is_file(file):
        yield _problem(scenario, "schedule", "a CSV file that exists", scenario.schedule)


def _events(scenario: Scenario) -> Iterator[Problem]:
    if not scenario.ticks:
        return
    period_us, ticks = scenario.period_us, scenario.ticks
    for path, expected, got in (
        *event_findings(scenario.events, scenario.board, period_us, ticks),
        *fault_findings(scenario.sensors, scenario.actuators, period_us, ticks),
    ):
        yield _problem(scenario, path, expected, got)


def _link_faults(scenario: Scenario) -> Iterator[Problem]:
    url = scenario.board if "://" in scenario.board else scenario.link.url
    around = (scenario.board, url, scenario.period_s, scenario.duration_s)
    for path, expected, got in faults_problems(scenario.link.faults, *around):
        yield _problem(scenario, ("link", "faults", *path), expected, got)


def _problem(scenario: Scenario, key: str | Path, expected: str, got: object) -> Problem:
    path = tuple(key.split(".")) if isinstance(key, str) else key
    place = scenario._source.where_of(path)
    return Problem(str(place), key_of(path), expected, shown(got), place.line)
