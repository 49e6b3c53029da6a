"""For all tests: no time limit on a generated example, in CI the same examples every time; and a browser."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest
from hypothesis import settings

from tools.browser import Browser, program

IN_CI = os.environ.get("CI", "").lower() in ("1", "true")

settings.register_profile("here", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True, print_blob=True)
settings.load_profile("ci" if IN_CI else "here")


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """A Chromium; skipped where there is none, in CI a failure."""
    path = program()
    if path is None:
        reason = "no Chromium: apt-get install chromium-headless-shell"
        pytest.fail(reason) if IN_CI else pytest.skip(reason)
    with Browser(path) as started:
        yield started
