"""Fixtures of the timing contract's tests: a board bench and a lab bench (benches.py)."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from benches import BoardBench, LabBench


@pytest.fixture
def bench() -> Callable[..., BoardBench]:
    """bench("appc", **CONFIG values): an open board."""
    return lambda law="appc", clock_rate_q16=0, **values: BoardBench(law, clock_rate_q16, **values).open()


@pytest.fixture
def lab() -> Callable[..., LabBench]:
    """lab(channel, **scenario values)."""
    return LabBench
