"""Columns of a run as the page carries them: little-endian floats in base64; of long runs extremes of bins.

A run of up to `points` ticks goes in as it is. Of a longer one every bin of equally many ticks (the last one takes the
rest) leaves two points, its smallest and its largest value in the order they came, at the bin's first and middle tick.
So every peak is there, half a bin of time wrong at most.
"""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

from sil.runs import Array, Run


class Columns:
    """The columns of one run on one grid of times; `content` is what the page gets."""

    def __init__(self, run: Run, points: int) -> None:
        self.size = 1 if len(run) <= points else -(-2 * len(run) // points)  # ticks to a bin
        self._starts = np.arange(len(run) // self.size) * self.size if self.size > 1 else np.arange(len(run))
        self._packed: dict[str, str] = {}
        self._t_s = run.t_s

    @property
    def rows(self) -> Array:
        """(M,) rows of the run that the 3-D view shows: all, or the first of each bin, and the last."""
        return self._starts if self.size == 1 else np.append(self._starts, len(self._t_s) - 1)

    def add(self, name: str, values: Array) -> str:
        """(N,) values, one per tick; returns the name."""
        drawn = values if self.size == 1 else extremes(values, self._starts, self.size)
        self._packed[name] = packed(drawn, np.float32)
        return name

    def content(self) -> dict[str, Any]:
        """Times of the points and of the view's rows, s (float64), and the columns (float32)."""
        t, at = self._t_s, self._starts
        points = t if self.size == 1 else np.column_stack([t[at], t[at + self.size // 2]]).ravel()
        return {
            "bin": self.size,
            "t": packed(points, np.float64),
            "t_view": packed(t[self.rows], np.float64),
            "columns": self._packed,
        }


def extremes(values: Array, starts: Array, size: int) -> Array:
    """(2 M,) of (N,): smallest and largest of each bin in the order they came; what is not a number is left out.

    The last bin reaches to the end. A bin without numbers gives NaN.
    """
    low, high = np.fmin.reduceat(values, starts), np.fmax.reduceat(values, starts)
    blocks = values[: len(starts) * size].reshape(-1, size)
    known = np.isfinite(blocks)
    falls = np.where(known, blocks, -np.inf).argmax(axis=1) < np.where(known, blocks, np.inf).argmin(axis=1)
    return np.column_stack([np.where(falls, high, low), np.where(falls, low, high)]).ravel()


def packed(values: Array, kind: Any) -> str:
    """Little-endian numbers of this kind in base64."""
    return base64.b64encode(np.ascontiguousarray(values, np.dtype(kind).newbyteorder("<")).tobytes()).decode("ascii")


def spans(mask: Array, t_s: Array, period_s: float, most: int = 1500) -> list[list[float]]:
    """[[from, to], ...] in s in which mask (N,) is true; near ones are joined where there are more than `most`."""
    size = max(1, -(-len(mask) // most))
    starts = np.arange(0, len(mask), size)
    if size > 1 and np.count_nonzero(np.diff(mask)) > most:
        mask = np.repeat(np.logical_or.reduceat(mask, starts), size)[: len(mask)]
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    begins, ends = edges[::2], edges[1::2] - 1
    return np.column_stack([t_s[begins], t_s[ends] + period_s]).round(6).tolist() if len(begins) else []
