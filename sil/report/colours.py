"""Colours on light and dark paper, names of the axes, units that suit the numbers: what pictures and pages share.

The colours are Okabe and Ito's, which colour-blind readers can tell apart; on dark paper lighter ones of the same hues.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sil.runs import Array

AXIS_NAMES = ("roll", "pitch", "yaw")
_MILLI_BELOW = 0.2  # of the unit: 0.15 N m is drawn as 150 mN m
_MICRO_MAX = 20_000.0  # µs


class Look(NamedTuple):
    """Paper, text and lines. `axes` are the colours of roll, pitch, yaw, `over` those of a line drawn over them."""

    paper: str
    ink: str
    faint: str
    grid: str
    axes: tuple[str, str, str]
    over: tuple[str, str, str]
    runs: tuple[str, ...]
    span_s: tuple[float, float] = (-math.inf, math.inf)  # the part of the time that is drawn

    def window(self, first_s: float, last_s: float) -> tuple[float, float]:
        """Limits of a time axis for data from first_s to last_s."""
        return max(first_s, self.span_s[0]), min(last_s, self.span_s[1])


LIGHT = Look(
    paper="white",
    ink="#222222",
    faint="#7A7A7A",
    grid="#DDDDDD",
    axes=("#D55E00", "#009E73", "#0072B2"),
    over=("#6E2F00", "#004D38", "#002F4D"),
    runs=("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#222222"),
)
DARK = Look(
    paper="#16191D",
    ink="#E6E6E6",
    faint="#9C9C9C",
    grid="#343A41",
    axes=("#F07C2E", "#2FC79A", "#56B4E9"),
    over=("#FFD9BF", "#C4F2E3", "#D3ECFB"),
    runs=("#56B4E9", "#F07C2E", "#2FC79A", "#E595C2", "#F0E442", "#8C9EFF", "#E6E6E6"),
)


def scaled(values: Array, unit: str) -> tuple[float, str]:
    """(1000, "mN m") where everything is below 0.2 of the unit, (0.001, "ms") for many µs; other units as they are."""
    peak = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0
    if unit.startswith("N m") and peak < _MILLI_BELOW:
        return 1000.0, f"m{unit}"
    return (0.001, "ms") if unit == "µs" and peak > _MICRO_MAX else (1.0, unit)
