"""The plan of a sweep: base scenario, axes and every point with its values, decided and written before anything runs.

Listed axes are combined into a grid, the last one fastest. Drawn axes are drawn n times, and each cell of the grid
flies the same n draws, so that cells are compared under the same conditions. A draw that the scenario refuses in every
cell (a triangle inequality of inertia, say) is drawn again and counted; any other refused point stays in the plan with
its reason.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from sil.campaign import provenance
from sil.campaign.axes import MOST_POINTS, Axis, parse_axis
from sil.campaign.conditions import Conditions
from sil.campaign.draws import rows
from sil.campaign.keys import canonical_key, held_at, path_of, refuse_overlaps, variable_values
from sil.checks import check
from sil.scenario import Scenario, load_values
from sil.scenario_errors import UNKNOWN_KEY, ScenarioInvalid
from sil.trouble import UsageError

Planning = Callable[[int, int], None]

FORMAT = 1
MOST_REFUSED = 1000  # draws in a row
SEED_KEY = "seed"
_ITEM_MISSING = "a list with an item"


class Point(NamedTuple):
    """One run to be: its number from 1, the value of every varied key, and why it cannot be flown ("": it can)."""

    number: int
    values: dict[str, Any]
    refused: str = ""


@dataclass(frozen=True)
class Plan:
    """Everything that decides the results of a sweep; `content` is what plan.json holds, points aside."""

    name: str
    scenario: dict[str, Any]
    directory: str  # where relative file names of the scenario start
    axes: tuple[Axis, ...]
    points: tuple[Point, ...]
    sample: dict[str, Any] = field(default_factory=dict)  # kind, draws, seed, redrawn; {} where nothing is drawn
    provenance: dict[str, Any] = field(default_factory=dict)

    @property
    def keys(self) -> list[str]:
        """The varied keys in order."""
        return [axis.key for axis in self.axes]

    @property
    def cell_keys(self) -> list[str]:
        """The keys that tell cells apart: those of listed axes; the seed repeats a cell, it does not make another."""
        return [axis.key for axis in self.axes if axis.draw is None and axis.values and axis.key != SEED_KEY]

    def text(self) -> str:
        """plan.json: one line a point."""
        head = {
            "format": FORMAT,
            "name": self.name,
            "provenance": self.provenance,
            "directory": self.directory,
            "axes": [{"key": axis.key, "spec": axis.spec, "listed": list(axis.values)} for axis in self.axes],
            "sample": self.sample,
            "scenario": self.scenario,
        }
        points = ",\n".join(f"    {json.dumps(_entry(point), allow_nan=False)}" for point in self.points)
        return (
            json.dumps(head, indent=2, allow_nan=False).removesuffix("\n}") + f',\n  "points": [\n{points}\n  ]\n}}\n'
        )


def make_plan(
    scenario: Scenario,
    conditions: Conditions,
    planning: Planning = lambda done, of: None,
    wanted: Callable[[dict[str, Any]], bool] = lambda cell: True,
) -> Plan:
    """The plan of a sweep of `scenario` under `conditions`; raises UsageError where it makes no sense.

    planning: told how far it is, (points, of how many); 100,000 points take minutes. wanted: whether a cell of the grid
    is flown; the others are no points of the plan.
    """
    directory = provenance.directory_of(scenario)
    base = variable_values({**scenario.resolved(), "out": None})
    axes = _axes(base, conditions)
    made = _Maker(base, Path(directory))
    made.refuse_unknown(axes)
    drawn = [axis for axis in axes if axis.draw is not None]
    grid = _cells([axis for axis in axes if axis.draw is None], conditions.draws if drawn else 1)
    cells = [cell for cell in grid if wanted(cell)]
    if drawn:
        if conditions.draws is None:
            raise UsageError(f"-n: expected how many draws to make, since {drawn[0].key} is drawn; got nothing")
        draws = _drawn(made, cells, drawn, conditions, planning)
    elif conditions.draws is not None or conditions.sample is not None:
        known = "uniform(a,b), log(a,b), normal(m,s), choice(a,b)"
        raise UsageError(f"--sample, -n: expected a drawn axis to sample, got listed values only; known: {known}")
    else:
        draws = [{}]
    combined = [{**cell, **draw} for cell in cells for draw in draws]
    ordered = [{axis.key: values[axis.key] for axis in axes} for values in combined]
    points = tuple(_points(made, ordered, planning))
    if all(point.refused for point in points):
        raise UsageError(f"no point of the sweep can be flown; the first: {points[0].refused}")
    sample = {}
    if drawn:
        sample = {"kind": conditions.sample or "random", "draws": conditions.draws, "seed": conditions.seed}
        sample |= {"redrawn": made.redrawn, "redrawn_first_reason": made.first_reason}
    return Plan(scenario.name, base, directory, tuple(axes), points, sample, provenance.of(scenario))


def read_plan(text: str, where: str) -> Plan:
    """A plan that was written by text(); raises UsageError. The axes of a plan that was read cannot be drawn again."""
    try:
        data = json.loads(text)
        if data["format"] != FORMAT:
            raise UsageError(f"{where}: expected a plan of format {FORMAT}, got {data['format']}")
        points = tuple(Point(p["point"], p["values"], p.get("refused", "")) for p in data["points"])
        axes = tuple(Axis(a["key"], a["spec"], tuple(a["listed"])) for a in data["axes"])
        return Plan(data["name"], data["scenario"], data["directory"], axes, points, data["sample"], data["provenance"])
    except (ValueError, KeyError, TypeError) as error:
        raise UsageError(f"{where}: expected the plan of a sweep, got {type(error).__name__}: {error}") from None


def sets_of(values: dict[str, Any]) -> list[str]:
    """Values of a point as overrides KEY=VALUE."""
    return [f"{key}={json.dumps(value)}" for key, value in values.items()]


def _entry(point: Point) -> dict[str, Any]:
    entry = {"point": point.number, "values": point.values}
    return entry | {"refused": point.refused} if point.refused else entry


def _axes(base: dict[str, Any], conditions: Conditions) -> list[Axis]:
    axes = []
    for spec in conditions.specs:
        key = canonical_key(spec.key, base, spec.where)
        axes.append(parse_axis(key, spec.spec, held_at(base, path_of(key)), spec.where))
    refuse_overlaps([axis.key for axis in axes])
    return axes


def _cells(listed: Sequence[Axis], draws: int | None) -> list[dict[str, Any]]:
    count = draws or 1
    for axis in listed:
        count *= len(axis.values)
    if count > MOST_POINTS:
        raise UsageError(f"--vary: expected at most {MOST_POINTS} points in all, got {count}")
    return [
        dict(zip([axis.key for axis in listed], values, strict=True))
        for values in itertools.product(*(axis.values for axis in listed))
    ]


class _Maker:
    """Holds points against the scenario."""

    def __init__(self, base: dict[str, Any], directory: Path) -> None:
        self._base, self._directory = base, directory
        self.redrawn = 0
        self.first_reason = ""

    def refusal(self, values: dict[str, Any]) -> str:
        """Why the scenario cannot be flown with these values; "" if it can."""
        try:
            scenario = load_values(self._base, sets_of(values), "scenario", self._directory)
        except ScenarioInvalid as error:
            return _as_axis(str(error.problems[0]))
        return next((_as_axis(str(found)) for found in check(scenario) if found.severity == "error"), "")

    def refuse_unknown(self, axes: Sequence[Axis]) -> None:
        """A key nobody knows is a mistake, not a point that cannot be flown. (Another law has other law.params.)"""
        laws_vary = any(axis.key in ("law", "law.name") for axis in axes)
        for axis in axes:
            if laws_vary and axis.key.startswith("law."):
                continue
            first = axis.values[0] if axis.draw is None else axis.draw(0.5)
            try:
                load_values(self._base, sets_of({axis.key: first}), "scenario", self._directory)
            except ScenarioInvalid as error:
                for problem in error.problems:
                    if problem.got == UNKNOWN_KEY or problem.expected.startswith(_ITEM_MISSING):
                        raise UsageError(_as_axis(str(problem))) from None


def _points(made: _Maker, values: Sequence[dict[str, Any]], planning: Planning) -> Iterator[Point]:
    for number, each in enumerate(values, start=1):
        planning(number, len(values))
        yield Point(number, each, made.refusal(each))


def _drawn(
    made: _Maker, cells: list[dict[str, Any]], drawn: Sequence[Axis], conditions: Conditions, planning: Planning
) -> list[dict[str, Any]]:
    """n draws, each of which at least one cell can fly."""
    assert conditions.draws is not None
    accepted: list[dict[str, Any]] = []
    in_a_row = 0
    keys = [axis.key for axis in drawn]
    for row in rows(conditions.sample or "random", conditions.seed, keys, conditions.draws):
        draw = {axis.key: axis.draw(u) for axis, u in zip(drawn, row, strict=True) if axis.draw is not None}
        planning(len(accepted), conditions.draws)
        reasons = _until_one_flies(made, cells, draw)
        if not reasons:
            accepted.append(draw)
            in_a_row = 0
            if len(accepted) == conditions.draws:
                return accepted
            continue
        made.redrawn += 1
        made.first_reason = made.first_reason or reasons
        in_a_row += 1
        if in_a_row == MOST_REFUSED:
            got = f"{MOST_REFUSED} in a row that it refuses; the last: {reasons}"
            raise UsageError(f"--vary: expected draws that the scenario accepts, got {got}")
    raise AssertionError("rows end by themselves")


def _until_one_flies(made: _Maker, cells: list[dict[str, Any]], draw: dict[str, Any]) -> str:
    """ "" as soon as a cell flies with this draw, else why the first one does not."""
    reasons: Iterator[str] = (made.refusal({**cell, **draw}) for cell in cells)
    first = next(reasons)
    return first if first and all(reasons) else ""


def _as_axis(text: str) -> str:
    """The scenario speaks of --set, the user said --vary."""
    return text.replace("--set ", "--vary ", 1)
