"""One table over several runs: the metrics of each, in any width, for people and programs; scenarios are run first."""

from __future__ import annotations

import csv
import io
import json
import math
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "sinks"))

import numpy as np
import pytest
from rich.console import Console
from synthetic import synthetic_journal

from sil import cli
from sil.metrics import measure
from sil.report import compare
from sil.runs import Run, open_run
from sil.sinks.seal import seal


def made(folder: Path, **options: object) -> Run:
    seal(synthetic_journal(folder, **options))  # type: ignore[arg-type]
    return open_run(folder)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[Run]:
    folder = tmp_path_factory.mktemp("compare")
    made_runs = [made(folder / "good"), made(folder / "lossy", lose=(60, 61, 62), late=(70,)), made(folder / "wild")]
    angles = made_runs[2].attitude_deg.copy()
    angles[100:, 0] = 120.0
    made_runs[2]._columns["attitude_deg"] = angles
    (folder / "good" / "summary.json").write_text(json.dumps({"verdict": "passed"}))
    return made_runs


def shown(found: list[compare.Row], width: int) -> list[str]:
    console = Console(width=width, file=io.StringIO(), highlight=False)
    console.print(compare.table(found, width))
    return console.file.getvalue().splitlines()  # type: ignore[attr-defined]


@pytest.mark.parametrize("width", [80, 120, 160])
def test_the_table_fits_and_nothing_is_cut(runs: list[Run], width: int) -> None:
    found = compare.rows(runs)
    lines = shown(found, width)
    assert max(map(len, lines)) <= width
    assert "…" not in "".join(lines)
    columns = [column for column in compare.COLUMNS if width >= compare.WIDE or not column.wide]
    first = next(i for i, line in enumerate(lines) if line.startswith("good"))
    for axis in range(3):
        cells = lines[first + axis].replace("good", "").split()[1:]
        metrics = measure(runs[0])
        for cell, column in zip(cells, columns, strict=False):
            value = metrics[column.metric][axis]
            assert cell == "-" if value is None else float(cell) == pytest.approx(value * column.factor, rel=1e-3)


def test_rows_say_what_became_of_each_run(runs: list[Run]) -> None:
    found = compare.rows(runs, {1: "failed"})
    assert [row.label for row in found] == ["good", "lossy", "wild"]
    assert [row.verdict for row in found] == ["passed", "failed", None]
    text = "\n".join(shown(found, 80))
    assert "at 50 s" in text
    assert "1 late" in text
    assert "never" in text
    assert any(line.startswith("never: it did not stay within 2 %") for line in compare.notes(found))


def test_the_smallest_is_marked_only_among_runs_that_can_be_compared(runs: list[Run], tmp_path: Path) -> None:
    good, lossy, wild = (row._replace(metrics=dict(row.metrics)) for row in compare.rows(runs))
    good.metrics["effort_Nms"], lossy.metrics["effort_Nms"] = [1.0, 2.0, 3.0], [2.0, 1.0, 3.0]
    wild.metrics["effort_Nms"] = [0.5, 0.5, 0.5]
    column = next(column for column in compare.COLUMNS if column.metric == "effort_Nms")
    best = [compare._best([good, lossy, wild], "effort_Nms", axis) for axis in range(3)]
    assert best == [1.0, 1.0, None]
    assert [str(span.style) for span in compare._cells(good, column, best).spans if span.style] == ["bold"]
    assert not [span for span in compare._cells(wild, column, [0.5] * 3).spans if span.style]
    short = compare.rows([made(tmp_path / "short", ticks=100)])[0]
    assert compare._best([good, lossy, short], "effort_Nms", 0) is None
    assert any(line.startswith("not over the same time: ") for line in compare.notes([good, short]))


def test_a_run_without_board_has_no_error_to_compare(tmp_path: Path) -> None:
    run = made(tmp_path / "a", ticks=40)
    run.config_words.clear()
    run.commands = run.commands[:0]
    row = compare.rows([run])[0]
    assert row.metrics["rms_error_deg"] is None
    assert row.metrics["effort_Nms"][0] > 0
    assert row.as_dict()["metrics"]["settled"] == [None, None, None]
    assert any("-" in line for line in shown([row], 80))


def test_json_and_csv_have_every_metric(runs: list[Run]) -> None:
    found = compare.rows(runs)
    content = json.loads(json.dumps([row.as_dict() for row in found], allow_nan=False))
    table = list(csv.DictReader(io.StringIO(compare.csv(found))))
    for run, as_json, as_csv in zip(runs, content, table, strict=True):
        metrics = measure(run)
        assert as_json["metrics"]["effort_Nms"] == metrics["effort_Nms"]
        assert [float(as_csv[f"effort_Nms.{axis}"]) for axis in ("roll", "pitch", "yaw")] == metrics["effort_Nms"]
        assert float(as_csv["missed"]) == metrics["missed"]
    assert math.isinf(float(table[2]["settling_s.roll"]))
    assert content[2]["metrics"]["settling_s"][0] is None
    assert content[2]["metrics"]["settled"] == [False, True, None]
    assert table[2]["settling_s.yaw"] == ""


# -- the verb ----------------------------------------------------------------------------------------------------------

SHORT = ["--set", "duration_s=5", "--set", "guidance.profile=hold"]


def test_a_scenario_is_run_first_and_leaves_nothing_behind(
    runs: list[Run], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr("tempfile.tempdir", None)
    assert cli.invoke(["compare", str(runs[0].directory), "pd-root-locus", *SHORT, "--json"]) == 0
    told = capsys.readouterr()
    rows = json.loads(told.out)["runs"]
    assert [row["scenario"] for row in rows] == ["synthetic", "pd-root-locus"]
    assert rows[1]["ticks"] == 10
    assert [row["run"] for row in rows] == [str(runs[0].path), None]
    assert rows[1]["verdict"] == "failed"
    assert "running pd-root-locus (1 of 1)" in told.err
    assert [path.name for path in tmp_path.iterdir()] == ["tmp"]
    assert not any((tmp_path / "tmp").iterdir())


def test_what_is_printed_does_not_depend_on_the_temporary_directory(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also where a run of the same scenario has the number that a temporary one would have."""
    arguments = ["compare", "pd-root-locus", *SHORT]
    assert cli.invoke([*arguments, "--keep", str(tmp_path)]) == 0
    mine = [arguments[0], str(tmp_path / "pd-root-locus-001"), *arguments[1:]]
    capsys.readouterr()
    for form in ("--json", "--csv"):
        told = []
        for _ in range(2):
            assert cli.invoke([*mine, form]) == 0
            told.append(capsys.readouterr().out)
        assert told[0] == told[1]
        assert "sil-compare-" not in told[0]
    assert list(csv.DictReader(io.StringIO(told[0])))[1]["run"] == ""


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("runs/nowhere", "compare: expected a run directory, a scenario file or one of appc-rs232, "),
        ("mrac-rs323", "(did you mean mrac-rs232?), got 'mrac-rs323'"),
        ("", "compare: expected a run or a scenario, got an empty text"),
    ],
)
def test_what_is_neither_run_nor_scenario(name: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.invoke(["compare", name]) == 2
    assert said in capsys.readouterr().err


def test_runs_are_kept_where_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["compare", "pd-root-locus", "pd-root-locus", *SHORT, "--keep", str(tmp_path / "kept"), "--csv"]
    assert cli.invoke(arguments) == 0
    kept = sorted(path.name for path in (tmp_path / "kept").iterdir())
    assert kept == ["pd-root-locus-001", "pd-root-locus-002"]
    lines = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    assert [line["label"] for line in lines] == kept
    assert np.array_equal(*(open_run(tmp_path / "kept" / name).attitude_deg for name in kept))


def test_everything_is_looked_up_before_anything_is_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.invoke(["compare", "pd-root-locus", "no-such-thing", "--keep", str(tmp_path / "kept")]) == 2
    assert "no-such-thing" in capsys.readouterr().err
    assert not (tmp_path / "kept").exists()
    assert cli.invoke(["compare", "pd-root-locus", "--json", "--csv"]) == 2


def test_an_interrupted_comparison_shows_what_is_complete(
    runs: list[Run], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sil.runner.run_scenario", lambda *_: {"exit_code": 130})
    arguments = ["compare", str(runs[0].directory), "pd-root-locus", str(runs[1].directory), "--json"]
    assert cli.invoke(arguments) == 130
    assert [row["label"] for row in json.loads(capsys.readouterr().out)["runs"]] == ["synthetic"]


def test_overrides_without_a_scenario_are_refused(runs: list[Run], capsys: pytest.CaptureFixture[str]) -> None:
    """A directory with the name of a built-in scenario is a run: --set would silently change nothing."""
    assert cli.invoke(["compare", str(runs[0].directory), "--set", "seed=2"]) == 2
    assert "expected a scenario among the names" in capsys.readouterr().err
