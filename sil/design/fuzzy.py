"""Mamdani inference as tables: triangular sets, min for and, clipped outputs, their exact centroid.

The union of clipped triangles is piecewise linear, so that its area and its moment are sums over its pieces, without a
grid: on [x0, x1] with values y0, y1 the area is h (y0 + y1) / 2, the moment about 0
h (y0 (2 x0 + x1) + y1 (x0 + 2 x1)) / 6.

For sets that add up to 1, peaks at -E, 0, E and -L, 0, L, it is in closed form (paper 000, study 3.1):
z = -sgn(e) L a^2 (3 - a) / (3 (2 - a^2)), a = min(|e| / E, 1).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sil.design.linear import Array
from sil.trouble import UsageError

AGGREGATIONS = ("max", "sum")
SHAPES = ("ruspini", "matlab")
ENTRIES = 65


class Triangle(NamedTuple):
    """0 up to `left`, 1 at `peak`, 0 from `right` on; left < peak < right."""

    left: float
    peak: float
    right: float

    def __call__(self, x: float) -> float:
        rising, falling = (x - self.left) / (self.peak - self.left), (self.right - x) / (self.right - self.peak)
        return max(min(rising, falling), 0.0)


Sets = tuple[Triangle, ...]


class Inference(NamedTuple):
    """inputs: sets of each input, on +-ranges; outputs: sets on +-reach; rules[i], rules[i, j]: number of an output."""

    inputs: tuple[Sets, ...]
    ranges: tuple[float, ...]
    outputs: Sets
    reach: float
    rules: Array
    aggregation: str = "max"

    def __call__(self, *values: float) -> float:
        """The centroid, 0 where no set is touched. Values beyond an input's range count as its end."""
        grades = [
            np.array([each(float(np.clip(value, -end, end))) for each in sets])
            for value, end, sets in zip(values, self.ranges, self.inputs, strict=True)
        ]
        strengths = grades[0] if len(grades) == 1 else np.minimum.outer(grades[0], grades[1])
        fired = [(self.outputs[int(rule)], grade) for rule, grade in zip(self.rules.flat, strengths.flat, strict=True)]
        return centroid(*aggregated([(each, h) for each, h in fired if h > 0.0], self.reach, self.aggregation))


def evenly(count: int, reach: float, shape: str = "ruspini") -> Sets:
    """Sets with their peaks spread over +-reach: sums of 1 (ruspini), or feet 0.8 of the distance away (matlab)."""
    if shape not in SHAPES:
        raise UsageError(f"sets: expected one of {', '.join(SHAPES)}, got {shape}")
    step = 2.0 * reach / (count - 1)
    width = step * (0.8 if shape == "matlab" else 1.0)
    return tuple(Triangle(peak - width, peak, peak + width) for peak in np.linspace(-reach, reach, count).tolist())


def one_input(
    E: float, L: float, inputs: str = "ruspini", outputs: str = "ruspini", aggregation: str = "max"
) -> Inference:
    """Experiments 2 and 3: e is N Z P, the output L N H; N -> H, Z -> N, P -> L."""
    _aggregation(aggregation)
    return Inference((evenly(3, E, inputs),), (E,), evenly(3, L, outputs), L, np.array([2, 1, 0]), aggregation)


def two_inputs(E: float, angle: float, L: float, aggregation: str = "max") -> Inference:
    """Experiment 1: e and the angle itself are N Z P, the output VL L N H VH.

    Rules by e, for an angle N Z P: P: N L VL; Z: H N L; N: VH H N. So an angle that is held gives a torque without any
    error, which is the steady error of that experiment.
    """
    _aggregation(aggregation)
    rules = np.array([[4, 3, 2], [3, 2, 1], [2, 1, 0]])
    return Inference((evenly(3, E), evenly(3, angle)), (E, angle), evenly(5, L), L, rules, aggregation)


def _aggregation(name: str) -> None:
    if name not in AGGREGATIONS:
        raise UsageError(f"aggregation: expected one of {', '.join(AGGREGATIONS)}, got {name}")


def half_table(inference: Inference, entries: int = ENTRIES) -> Array:
    """-z / reach at e = 0 ... range of an odd inference with one input: the table of law fvsc, not negative."""
    errors = np.linspace(0.0, inference.ranges[0], entries)
    return np.array([-inference(error) / inference.reach + 0.0 for error in errors])


def plane_table(inference: Inference, entries: int = ENTRIES) -> Array:
    """z / reach (entries, entries) at e from -range to range, by row, and at the angle, by column."""
    errors, angles = (np.linspace(-end, end, entries) for end in inference.ranges)
    return np.array([[inference(error, angle) / inference.reach for angle in angles] for error in errors])


def closed_form(a: float) -> float:
    """-z / L of `one_input` with ruspini sets, for 0 <= a <= 1."""
    return a * a * (3.0 - a) / (3.0 * (2.0 - a * a))


# -- the union and its centroid --------------------------------------------------------------------------------------


def aggregated(fired: Sequence[tuple[Triangle, float]], reach: float, aggregation: str) -> tuple[Array, Array]:
    """(x, y): corners of the union, or the sum, of triangles clipped at their strengths, on +-reach."""
    corners = [corner for each, height in fired for corner in _corners(each, height)]
    x = np.unique(np.clip([-reach, reach, *corners], -reach, reach))
    y = np.array([np.minimum([each(float(place)) for place in x], height) for each, height in fired])
    if not len(fired):
        return x, np.zeros(len(x))
    if aggregation == "sum":
        return x, y.sum(axis=0)
    crossings = [place for i in range(len(fired)) for k in range(i) for place in _meetings(x, y[i], y[k])]
    every = np.union1d(x, crossings)
    return every, np.max([np.interp(every, x, row) for row in y], axis=0)


def _corners(each: Triangle, height: float) -> tuple[float, float, float, float]:
    rise, fall = each.peak - each.left, each.right - each.peak
    return each.left, each.left + height * rise, each.right - height * fall, each.right


def _meetings(x: Array, a: Array, b: Array) -> list[float]:
    """Where two piecewise linear functions with these corners cross."""
    d = a - b
    i = np.flatnonzero(d[:-1] * d[1:] < 0.0)
    return (x[i] + (x[i + 1] - x[i]) * d[i] / (d[i] - d[i + 1])).tolist()  # type: ignore[no-any-return]


def centroid(x: Array, y: Array) -> float:
    """Of the area under a piecewise linear function; 0 if there is none."""
    h = np.diff(x)
    area = np.sum(h * (y[:-1] + y[1:])) / 2.0
    moment = np.sum(h * (y[:-1] * (2.0 * x[:-1] + x[1:]) + y[1:] * (x[:-1] + 2.0 * x[1:]))) / 6.0
    return float(moment / area) if area > 0.0 else 0.0
