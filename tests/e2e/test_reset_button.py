"""Accidents of the emulated board in mid-run: its reset button (SIGUSR1), and a hang that its watchdog ends."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Container, Iterator
from pathlib import Path
from typing import Any

import pytest
from subprocesses import REPO, quiet

from sil import open_run
from sil import rig as lab_rig
from sil.replay import replay
from sil.rig import Rig
from sil.runner import run_scenario
from sil.scenario import Scenario, load_scenario
from sil.signals import Motion
from sil.watch import Watch
from tools.firmware_image import build

LAWS = {"pd": "pd-root-locus", "mrac": "mrac-rs232", "appc": "appc-rs232"}


class Finger(Watch):
    """Presses the button as each of these ticks is over."""

    def __init__(self, at: Container[int]) -> None:
        self._at = at
        self._pid = 0

    def plugged(self, scenario: Scenario, rig: Rig) -> None:
        assert rig.host is not None
        assert rig.host.pid is not None
        self._pid = rig.host.pid

    def tick(self, tick: int, ticks: int, motion: Motion) -> None:
        if tick in self._at:
            os.kill(self._pid, signal.SIGUSR1)


def fly(folder: Path, law: str, at: Container[int], limit: int, *sets: str) -> dict[str, Any]:
    values = ["board=cortex-m", "duration_s=60", "require=[]", f"restart_limit={limit}", *sets]
    return run_scenario(load_scenario(LAWS[law], values), folder, Finger(at))


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("link", ["pty", "udp"])
def test_the_run_goes_on_and_replays_on_either_board(tmp_path: Path, law: str, link: str) -> None:
    made = fly(tmp_path, law, (2, 50), 2, f"link.url={link}", "sensors.attitude.noise_deg=0.02")
    assert made["failure"] == ""
    assert (made["exit_code"], made["ticks"], made["reproducible"]) == (0, 120, False)
    assert made["link"]["restarts"] == 2
    run = open_run(tmp_path)
    assert len(run.sessions) == 3
    assert run.sessions[1] in (3, 4, 5)
    assert run.sessions[2] in (51, 52, 53)
    for board in ("inproc", "cortex-m"):
        report = replay(run, (), board)
        assert report.first is None, board
        assert (report.ticks + report.lost, report.sessions) == (120, 3)


def test_by_default_it_ends_the_run(tmp_path: Path) -> None:
    made = fly(tmp_path, "pd", (50,), 0)
    assert (made["exit_code"], made["link"]["restarts"]) == (3, 1)
    assert made["failure"].startswith("board: restarted at tick 5")


def test_a_finger_that_stays_on_the_button_ends_the_run(tmp_path: Path) -> None:
    made = fly(tmp_path, "pd", range(10, 120), 3)
    assert (made["exit_code"], made["link"]["restarts"]) == (3, 4)
    assert "restarted 4 times, at ticks 1" in made["failure"]


# -- a firmware that hangs -------------------------------------------------------------------------------------------

STEP = "static void step(board *b, const sample *s) {\n"


@pytest.fixture(scope="module")
def hanging(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The firmware's image, but for an endless loop in tick 30."""
    folder = tmp_path_factory.mktemp("hanging")
    shutil.copytree(REPO / "firmware", folder / "firmware", ignore=shutil.ignore_patterns("build", "images"))
    source = folder / "firmware" / "core" / "board.c"
    text = source.read_text(encoding="utf-8")
    assert text.count(STEP) == 1
    loop = "    for (volatile int here = 0; b->next_tick == 30; here = here) {}\n"
    source.write_text(text.replace(STEP, STEP + loop), encoding="utf-8")
    return build("mps2-an386", folder / "built", "-C", str(folder / "firmware"))


@pytest.fixture
def board(hanging: Path) -> Iterator[str]:
    """URL of the emulated board with that image."""
    command = [sys.executable, "-P", "-m", "sil.pil.cortex_m", "--link", "udp://127.0.0.1:0", "--image", str(hanging)]
    process = subprocess.Popen(command, cwd=REPO, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    yield process.stdout.readline().split()[1]
    quiet(process.pid)
    process.communicate()


@pytest.mark.parametrize(("limit", "code", "ticks"), [(1, 0, 120), (0, 3, 31)])
def test_its_watchdog_resets_it_and_the_run_goes_on_if_it_may(
    tmp_path: Path, board: str, limit: int, code: int, ticks: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lab_rig, "DEAD_AFTER_S", 60.0)  # its watchdog counts processor time, of which it may get little
    values = [f"board={board}", "duration_s=60", "require=[]", f"restart_limit={limit}"]
    made = run_scenario(load_scenario("pd-root-locus", values), tmp_path)
    assert (made["exit_code"], made["ticks"], made["restarted_at_ticks"]) == (code, ticks, [30])
    run = open_run(tmp_path)
    assert run.sessions == [0, 31][: 1 + limit]
    report = replay(run)
    assert report.identical
    assert report.ticks == ticks - 1
