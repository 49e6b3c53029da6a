"""The report's page as data: no peak is lost, bad input is one line, nothing points outside, it ships."""

from __future__ import annotations

import base64
import json
import os
import shutil
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "sinks"))

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic import synthetic_journal

from sil.cli import invoke
from sil.report.page import ASSETS, MOST_RUNS, SCRIPTS, ReportError, content, default_out, page, report
from sil.report.page.attitudes import directions
from sil.report.page.columns import extremes, spans
from sil.runner import run_scenario
from sil.runs import EventRow, Run, open_run
from sil.scenario import load_scenario
from sil.sinks.seal import seal
from tools import vendored


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("page")


@pytest.fixture(scope="module")
def run(folder: Path) -> Run:
    seal(synthetic_journal(folder / "a", 300, late=(50,), lose=(60,)))
    return open_run(folder / "a")


# -- numbers -----------------------------------------------------------------------------------------------------------


@settings(max_examples=100)
@given(st.lists(st.floats(-1e6, 1e6) | st.just(float("nan")), min_size=7, max_size=80), st.integers(2, 7))
def test_bins_keep_smallest_and_largest_in_their_order(numbers: list[float], size: int) -> None:
    values = np.array(numbers)
    starts = np.arange(len(values) // size) * size
    drawn = extremes(values, starts, size).reshape(-1, 2)
    for pair, inside in zip(drawn, np.split(values, starts[1:]), strict=True):
        known = inside[np.isfinite(inside)]
        if known.size:
            assert sorted(pair) == [known.min(), known.max()]
        else:
            assert np.isnan(pair).all()
    first = values[:size]
    if np.isfinite(first).all() and len(starts) > 1 and first.min() < first.max():
        assert (drawn[0, 0] < drawn[0, 1]) == (first.argmin() < first.argmax())


def test_spans_are_exact_while_few_and_bounded_when_many() -> None:
    t = np.arange(10_000) * 0.5
    few = np.isin(np.arange(10_000), (3, 4, 5, 9_999))
    assert spans(few, t, 0.5) == [[1.5, 3.0], [4999.5, 5000.0]]
    assert 0 < len(spans(np.arange(10_000) % 2 == 0, t, 0.5, most=100)) <= 100


def test_nadir_and_velocity_of_an_inertial_frame(run: Run) -> None:
    """Equatorial orbit at its ascending node on +x: down is -x, forward is +y; a quarter of an orbit on, -y and -x."""
    quarter_s = 0.25 * 2 * np.pi * np.sqrt(7.0e6**3 / 4.0e14)
    orbit = {"radius_m": 7.0e6, "mu": 4.0e14, "inclination_deg": 0.0, "u0_deg": 0.0}
    turned = Run.__new__(Run)
    turned.scenario = {"attitude": {"frame": "inertial"}, "plant": {"orbit": orbit}}
    nadir, velocity = directions(turned, np.array([0.0, quarter_s]))
    assert np.allclose(nadir, [[-1, 0, 0], [0, -1, 0]], atol=1e-12)
    assert np.allclose(velocity, [[0, 1, 0], [-1, 0, 0]], atol=1e-12)


def test_the_page_has_the_runs_numbers(run: Run) -> None:
    made = content([run])
    (attitude,) = (plot for plot in made["plots"] if plot["id"] == "attitude")
    column = made["runs"][0]["data"]["columns"][attitude["lines"][2][0][1]]
    drawn = np.frombuffer(base64.b64decode(column), "<f4")
    assert np.array_equal(drawn, run["psi_deg"].astype(np.float32))
    down = made["runs"][0]["link"]["ways"][1]
    fates = dict(zip(made["runs"][0]["link"]["fates"], down["counts"], strict=True))
    assert fates["late"] == sum(row.fate == "late" for row in run.packets) > 0


def test_the_same_run_gives_the_same_bytes(run: Run, tmp_path: Path) -> None:
    assert report([run], tmp_path / "a.html").read_bytes() == report([run], tmp_path / "b.html").read_bytes()


def test_the_marks_of_events_reach_farther_than_their_list(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    many = [EventRow(tick, tick * 0.5, code, "board", 0, 0, "") for tick in range(300) for code in (2, 3, 7)]
    monkeypatch.setitem(run.__dict__, "events", many)
    events = content([run])["runs"][0]["events"]
    assert max(row[0] for row in events["rows"]) < 80.0
    assert events["marks"][0] == 0.0 and events["marks"][-1] >= 149.0
    assert sum(count for _, count in events["counts"]) == 900


def test_without_a_law_or_a_wheel_nothing_is_said_of_them(folder: Path) -> None:
    """An error to a reference that nobody follows or that only the board knows, a momentum that nobody has."""
    run_scenario(load_scenario("rigid-open-loop", ["duration_s=5"]), folder / "open")
    sets = ["duration_s=0.2", "board=inproc", "link.url=inproc", "telemetry_every=0"]
    run_scenario(load_scenario("delay-picosat", sets), folder / "thrusters")
    said = {}
    for name in ("open", "thrusters"):
        made = content([open_run(folder / name)])
        of_run = made["runs"][0]
        said[name] = {row[0] for row in (*of_run["metrics"], *of_run["facts"])} | {plot["id"] for plot in made["plots"]}
    assert {"momentum", "peak wheel momentum"} <= said["open"] and "rms torque" in said["thrusters"]
    assert not {"rms error to reference", "settling", "error", "transport delay"} & said["open"]
    assert not {"momentum", "peak wheel momentum", "rms error to reference"} & said["thrusters"]
    assert "peak error to set-point" in said["thrusters"]


def test_nothing_in_the_data_can_end_the_script(run: Run) -> None:
    run.scenario["about"] = "</script><script>alert(1)</script>"
    try:
        text = page([run])
    finally:
        del run.scenario["about"]
    assert "<script>alert" not in text
    data = text.partition('id="data">')[2].partition("</script>")[0]
    assert json.loads(data)["runs"][0]["about"].startswith("</script>")


def test_a_path_that_is_no_text_can_be_reported(folder: Path, run: Run) -> None:
    odd = folder / os.fsdecode(b"\xff{{DATA}}")
    shutil.copytree(run.directory, odd)
    text = report([open_run(odd)], folder / "odd.html").read_text()
    assert text.count('"made_by"') == 1
    data = text.partition('id="data">')[2].partition("</script>")[0]
    assert json.loads(data)["runs"][0]["path"] == str(odd / "run.mcap")


def test_nothing_points_outside(run: Run) -> None:
    text = page([run])
    assert "default-src 'none'" in text
    for word in ("src=", "@import", "url(", "fetch(", "XMLHttpRequest", "import("):
        assert word not in text.partition('id="data">')[0] + text.partition("</script>")[2], word


# -- bad input ---------------------------------------------------------------------------------------------------------


def one_line(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert invoke(["report", *words]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    return said


def test_what_is_no_run_is_one_line(folder: Path, run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = run.path.read_bytes()
    synthetic_journal(tmp_path / "open", 5, end=False)
    assert "`sil recover" in one_line(capsys, str(tmp_path / "open"))
    synthetic_journal(tmp_path / "cut", 5)
    (tmp_path / "cut" / "run.mcap").write_bytes(whole[: len(whole) // 2])
    said = one_line(capsys, str(tmp_path / "cut"))
    assert "is cut off" in said and "`sil recover" in said
    (tmp_path / "empty.mcap").write_bytes(b"")
    assert "empty.mcap: is empty" in one_line(capsys, str(tmp_path / "empty.mcap"))
    (tmp_path / "text.mcap").write_text("tick,t_s\n")
    assert "expected an MCAP log" in one_line(capsys, str(tmp_path / "text.mcap"))
    assert "expected a run directory" in one_line(capsys, str(tmp_path))
    assert "got the directory" in one_line(capsys, str(run.directory), "--out", str(tmp_path))
    assert "cannot write the page" in one_line(capsys, str(run.directory), "--out", str(tmp_path / "no" / "a.html"))


def test_too_many_and_too_short_runs_are_refused(run: Run, tmp_path: Path) -> None:
    with pytest.raises(ReportError, match=f"at most {MOST_RUNS} runs"):
        report([run] * (MOST_RUNS + 1), tmp_path / "a.html")
    seal(synthetic_journal(tmp_path / "none", 0))
    with pytest.raises(ReportError, match="no ticks to show"):
        report([open_run(tmp_path / "none")], tmp_path / "a.html")


def test_a_damaged_timing_file_is_said_and_no_more(run: Run) -> None:
    timing = run.directory / "timing.mcap"
    before = timing.read_bytes()
    timing.write_bytes(before[:100])
    try:
        assert "cannot be read" in content([run])["runs"][0]["times"]["why"]
    finally:
        timing.write_bytes(before)


def test_where_it_goes(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    assert default_out([run]) == run.directory / "report.html"
    assert default_out([run, run]) == Path("report-a-a.html")
    assert invoke(["report", str(run.directory)]) == 0
    assert capsys.readouterr().out == f"{run.directory / 'report.html'}\n"


# -- what ships --------------------------------------------------------------------------------------------------------


def test_every_script_is_used_and_vendored_files_are_as_noted() -> None:
    assert {path.stem for path in ASSETS.glob("*.js")} == set(SCRIPTS)
    assert vendored.is_as_noted(), "renew with python -m tools.vendored --write VERSION"
