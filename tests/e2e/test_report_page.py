"""The page of `sil report` in a real browser: it draws without a complaint, asks nobody for anything, and moves.

And where it points: at yaw +90 deg the nose (+x of the body) is along +y of the reference frame, written as literals.
Needs Debian's chromium-headless-shell (tools/install-system); without it skipped, in CI it fails instead.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from sil import open_run
from sil.report.page import report
from sil.runner import run_scenario
from sil.scenario import load_scenario
from tools.browser import Browser

DESKTOP, PHONE, SMALL_PHONE = (1400, 900), (390, 844), (320, 700)
READY_MS = 1000.0  # what the page may take until it can be used, by the browser's own clock
POINTED = {  # angles (roll, pitch, yaw) in deg, and where x, y, z of the body point in the reference frame then
    "roll": ((90, 0, 0), (1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "pitch": ((0, 90, 0), (0, 0, -1), (0, 1, 0), (1, 0, 0)),
    "yaw": ((0, 0, 90), (0, 1, 0), (-1, 0, 0), (0, 0, 1)),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("pages")


def flown(folder: Path, scenario: str, *sets: str) -> Path:
    """The run directory."""
    common = ("clock=lockstep", *(("board=inproc", "link.url=inproc") if scenario != "rigid-open-loop" else ()))
    run_scenario(load_scenario(scenario, [*common, *sets]), folder)
    return folder


@pytest.fixture(scope="module")
def pages(folder: Path) -> dict[str, Path]:
    """Two runs and a page of each, and one of both."""
    faults = ("link.faults={drop: 0.05, bit_error_rate: 1.0e-5}", "events=[{at_s: 40, do: link.disconnect, for_s: 5}]")
    runs = {
        "clean": open_run(flown(folder / "clean", "mrac-rs232", "duration_s=600")),
        "faulty": open_run(flown(folder / "faulty", "appc-rs232", "duration_s=100", *faults)),
    }
    made = {name: report([run], folder / f"{name}.html") for name, run in runs.items()}
    return made | {"both": report(list(runs.values()), folder / "both.html")}


@pytest.mark.parametrize(
    ("page", "size", "dark"),
    [
        ("clean", DESKTOP, False),
        ("clean", PHONE, True),
        ("faulty", PHONE, False),
        ("both", DESKTOP, True),
        ("both", SMALL_PHONE, False),
    ],
)
def test_no_complaint_no_request_no_sideways(
    browser: Browser, pages: dict[str, Path], page: str, size: tuple[int, int], dark: bool
) -> None:
    browser.open(pages[page], *size, dark)
    browser.ask("SIL.charts.forEach((chart) => chart.make())")
    browser.frames()
    assert browser.console == []
    assert browser.requests == []
    assert browser.ask("document.documentElement.scrollWidth") <= size[0]
    assert browser.ask("SIL.charts.filter((chart) => chart.u).length") == browser.ask("SIL.data.plots.length") > 5


def test_the_negative_control_a_request_and_an_error_are_seen(browser: Browser, tmp_path: Path) -> None:
    page = tmp_path / "bad.html"
    page.write_text('<img src="http://127.0.0.1:9/x.png"><script>undefined_thing()</script>')
    browser.open(page)
    assert browser.requests == ["http://127.0.0.1:9/x.png"]
    assert any("undefined_thing" in line for line in browser.console)


def test_it_is_small_and_soon_ready(browser: Browser, pages: dict[str, Path]) -> None:
    assert pages["clean"].stat().st_size < 3_000_000
    ready_ms = []
    for _ in range(4):  # the first one also warms the browser up; others may want the machine meanwhile
        browser.open(pages["clean"])
        ready_ms.append(browser.ask("SIL.readyAfter_ms"))
    assert min(ready_ms) < READY_MS


def test_slider_keys_and_pointer_move_satellite_and_plots(browser: Browser, pages: dict[str, Path]) -> None:
    browser.open(pages["clean"])
    at_start = browser.ask("SIL.scene.axes().x")
    browser.ask("Object.assign(document.getElementById('time'), { value: 240 }).dispatchEvent(new Event('input'))")
    assert browser.ask("SIL.shown()") == 120.0
    turned = browser.ask("SIL.scene.axes().x")
    assert np.linalg.norm(np.subtract(turned, at_start)) > 0.05
    browser.press("ArrowRight")
    assert browser.ask("SIL.shown()") == 120.5
    shown = browser.ask("document.querySelector('.readout tbody tr td').textContent")
    run = open_run(pages["clean"].parent / "clean")
    assert float(shown.replace("\u2212", "-")) == pytest.approx(run["phi_deg"][241], abs=0.01)
    head = browser.ask("document.querySelector('.playhead').style.transform").removeprefix("translateX(")
    at_px = browser.ask("SIL.charts[0].u.valToPos(120.5, 'x')")
    assert float(head.removesuffix("px)")) == pytest.approx(at_px, abs=0.01)
    box = browser.ask("(({ x, y, width }) => [x, y, width])(document.querySelector('.u-over').getBoundingClientRect())")
    browser.mouse("mouseMoved", box[0] + box[2] / 2, box[1] + 40)
    browser.frames()
    assert 290 < browser.ask("SIL.shown()") < 310  # a look at the time under the pointer
    browser.mouse("mouseMoved", 3, 3)
    browser.frames()
    assert browser.ask("SIL.shown()") == 120.5
    browser.press(" ")
    browser.until("SIL.shown() > 121")
    browser.press(" ")
    assert browser.console == []


def test_the_page_prints(browser: Browser, pages: dict[str, Path]) -> None:
    browser.open(pages["faulty"])
    assert browser.pdf().startswith(b"%PDF")
    assert browser.console == []


@pytest.fixture(scope="module")
def pointed(folder: Path) -> dict[str, Path]:
    """A satellite that stands at 90 deg about each axis, nobody controlling it."""
    made = {}
    for name, (angles, *_) in POINTED.items():
        sets = (f"plant.initial.attitude_deg={list(angles)}", "plant.initial.rate_degps=[0, 0, 0]", "duration_s=2")
        frame = ("plant.initial.frame=lvlh", "attitude.frame=lvlh", "plant.initial.rate_kind=body_relative")
        free = ("plant.initial.q=null", "require=[]", "schedule=null")
        run = flown(folder / name, "rigid-open-loop", *sets, *frame, *free)
        made[name] = report([open_run(run)], folder / f"{name}.html")
    return made


@pytest.mark.parametrize("name", list(POINTED))
def test_where_the_body_axes_point(browser: Browser, pointed: dict[str, Path], name: str) -> None:
    """Seen in the page: view (axes as drawn) and plot (the angle)."""
    _, x, y, z = POINTED[name]
    browser.open(pointed[name])
    assert browser.ask("SIL.data.runs[0].view.frame") == "lvlh"
    axes = browser.ask("SIL.scene.axes()")
    for axis, expected in zip("xyz", (x, y, z), strict=True):
        assert np.allclose(axes[axis], expected, atol=1e-4), (name, axis)
    drawn = browser.ask("['phi', 'theta', 'psi'].map((_, i) => SIL.column(0, SIL.data.plots[0].lines[i][0][1])[0])")
    assert drawn[list(POINTED).index(name)] == pytest.approx(90.0, abs=1e-3)
    # On the canvas: nadir (+z) is down, the nose's pixel is where the camera puts that vector.
    down = np.subtract(browser.ask("SIL.scene.pixel([0, 0, 1])"), browser.ask("SIL.scene.pixel([0, 0, 0])"))
    assert down[1] > abs(down[0])
    assert browser.ask("SIL.scene.pixel(SIL.scene.axes().x)") == pytest.approx(
        browser.ask(f"SIL.scene.pixel({json.dumps(x)})"), abs=0.2
    )
