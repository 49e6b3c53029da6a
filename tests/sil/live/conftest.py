"""A run that the tests of the live view share."""

from __future__ import annotations

from pathlib import Path

import pytest

from sil.runner import run_scenario
from sil.scenario import load_scenario

KEYS = ["duration_s=20", "board=inproc", "link.url=inproc", "link.faults.drop=0.1", "require=[]"]


@pytest.fixture(scope="session")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The directory of a run of 40 ticks with a link that loses frames, so that there are events."""
    folder = tmp_path_factory.mktemp("flown")
    run_scenario(load_scenario("mrac-rs232", KEYS), folder)
    return folder
