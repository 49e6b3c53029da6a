"""A scenario: one YAML file that says everything about a test, validated into a frozen model with units and defaults.

`load_scenario("mrac-rs232", ["duration_s=60"])` reads a built-in or a file, applies `extends` and the overrides, and
raises ScenarioInvalid with one line per problem. The sections and their defaults are in scenario_sections.py, those of
sensors and wheels in scenario_instruments.py, the timeline in scenario_events.py; how keys have to fit each other in
scenario_cross.py.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path as FilePath
from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr, ValidationError

from protocol.law_tables import INT32_MAX, LawTable, Variant, variant_of
from sil import scenario_law as laws
from sil.profiles import SetpointRow, setpoints
from sil.scenario_cross import cross_problems, problem
from sil.scenario_errors import Problem, ScenarioInvalid, Where
from sil.scenario_events import Event
from sil.scenario_instruments import Actuators, Sensors
from sil.scenario_link import Link
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
from sil.timeline import setpoint_rows

# How it is run, not what is run.
NOT_IDENTITY = ("clock", "timing", "link", "board", "restart_limit", "out", "variants")


class Scenario(Section):
    """One test. Times in s, angles in deg, triples [x, y, z]; see the sections for what is inside each."""

    name: Name = "scenario"
    """What the run directory is called after; default: the file's name, - for what a name cannot have."""
    about: str = ""
    """One line for `sil scenarios`."""
    seed: Annotated[int, Field(ge=0, lt=2**64)] = 0
    """Of everything random: noise, jitter, what the link loses. The same seed gives the same bytes."""
    duration_s: Annotated[float, Field(gt=0, le=2.6e11)] = 600.0
    """A whole number of periods."""
    period_s: Annotated[float, Field(ge=0.001, le=60)] = 0.5
    """T_s, a whole number of microseconds."""
    transport_delay_ticks: Annotated[int, Field(ge=0, le=4)] = 1
    """n: COMMAND(k) acts from t_(k+n) on; 0 only in lockstep."""
    clock: Clock = Clock()
    timing: Timing = Timing()
    board: Board = "process"
    """process: the Python board in a process of its own; inproc: in this one; native, cortex-m, qemu: the C firmware;
    none: no board flies, but `schedule`; or where a board that already runs listens."""
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
    """TELEMETRY in every so many ticks; 0: never, and then only the board knows where its reference model is"""
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
    found += [*_law_problems(scenario, source, user_table), *cross_problems(scenario)]
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


# -- the law ----------------------------------------------------------------------------------------------------------


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
        yield problem(scenario, "law.version", table.removeprefix("law.version "), scenario.law.version)
    else:
        yield problem(scenario, "law.name", table, scenario.law.name)


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
