"""Export, info, diff and pictures: the numbers are the run's, the first difference is the right one."""

from __future__ import annotations

import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "sinks"))

import numpy as np
import pytest
from PIL import Image
from synthetic import synthetic_journal

from sil.report import diff, info
from sil.report.export import ExportError, export
from sil.report.plot import PlotError, pages, plot
from sil.run_columns import COLUMNS
from sil.runs import Run, open_run
from sil.sinks.seal import seal


def made(folder: Path, **options: object) -> Run:
    seal(synthetic_journal(folder, **options))  # type: ignore[arg-type]
    return open_run(folder)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("reports")


@pytest.fixture(scope="module")
def run(folder: Path) -> Run:
    return made(folder / "a")


# -- export ------------------------------------------------------------------------------------------------------------


def test_csv_reads_back_to_the_same_float64(run: Run, tmp_path: Path) -> None:
    assert export(run, tmp_path / "out.csv") == 200
    lines = (tmp_path / "out.csv").read_text().splitlines()
    assert lines[0] == ",".join(COLUMNS)
    assert len(lines) == 201
    back = np.genfromtxt(tmp_path / "out.csv", delimiter=",", names=True)
    for name in COLUMNS:
        assert np.array_equal(back[name], run[name], equal_nan=True), name
    assert lines[1].startswith("0,0.0,10.0,10.0,5.0,")


def test_missing_commands_are_nan(tmp_path: Path) -> None:
    run = made(tmp_path / "a", lose=(3,))
    export(run, tmp_path / "out.csv")
    assert ",nan,nan,nan," in (tmp_path / "out.csv").read_text().splitlines()[4]


def test_csv_to_standard_output(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    export(run, "-")
    assert capsys.readouterr().out.count("\n") == 201


def test_export_to_nowhere_is_one_line(run: Run, tmp_path: Path) -> None:
    with pytest.raises(ExportError, match="cannot write the CSV: No such file"):
        export(run, tmp_path / "no" / "out.csv")


# -- info --------------------------------------------------------------------------------------------------------------


def test_info_is_json_and_has_the_facts(run: Run) -> None:
    content = info.info(run)
    json.dumps(content, allow_nan=False)
    assert content["ticks"] == 200
    assert content["law"]["name"] == "pd"
    assert content["packets"] == {
        "down COMMAND": 200, "down EVENT": 1, "down TELEMETRY": 200, "up CONFIG": 1, "up SAMPLE": 200
    }  # fmt: skip
    assert content["events"]["REFERENCE_RESTART"] == {"count": 1, "first_tick": 0, "last_tick": 0}
    assert content["host"]["link"] == "pty"
    assert all(line["passed"] for line in content["require"])


def test_info_text_is_readable(run: Run) -> None:
    page = info.text(info.info(run))
    assert "finished after 200 ticks (100 s)" in page
    assert "rms_error_deg.roll < 30" in page
    assert max(map(len, page.splitlines())) < 120


def test_info_text_leaves_out_what_is_empty(run: Run) -> None:
    content = info.info(run)
    content["identity"] |= {"law_file_sha256": "", "zero": 0}
    keys = [line.split(" ")[0] for line in info.text(content).splitlines()]
    assert "law_file_sha256" not in keys
    assert "zero" in keys


# -- diff --------------------------------------------------------------------------------------------------------------


def test_identical_runs(run: Run, folder: Path) -> None:
    found = diff.diff(run, made(folder / "again"))
    assert found.identical
    assert found.same_file
    assert diff.text(found) == "identical: 200 ticks, 601 frames, truth bit for bit; same file bytes"


def test_one_altered_command_is_found_at_its_tick(run: Run, folder: Path) -> None:
    found = diff.diff(run, made(folder / "altered", alter={77: 1}))
    assert not found.identical
    assert found.packet is not None
    assert (found.packet.tick, found.packet.what, found.packet.differing) == (77, "COMMAND, down", ["torque"])
    assert found.truth is not None
    assert found.truth.first_tick == 78
    assert 0 < found.truth.max_attitude_deg < 1e-6
    json.dumps(found.as_dict(), allow_nan=False)
    page = diff.text(found)
    assert "differs at tick 77: COMMAND, down" in page
    assert "\n* torque " in page


def test_a_frame_that_is_missing_in_one_run(run: Run, folder: Path) -> None:
    found = diff.diff(run, made(folder / "lost", lose=(60,)))
    assert found.packet is not None
    assert (found.packet.tick, found.packet.what) == (60, "COMMAND, down")
    assert found.packet.b == {}
    assert "it is only in a" in diff.text(found)


def test_a_shorter_run_is_another_one(run: Run, folder: Path) -> None:
    found = diff.diff(run, made(folder / "killed", kill_at=100))
    assert not found.identical
    assert found.ticks == (200, 99)
    assert found.packet is not None
    assert found.packet.tick == 99
    assert found.truth is None
    assert "ticks: 200 and 99" in diff.text(found)


def test_identity_differences_are_named(run: Run, folder: Path) -> None:
    found = diff.diff(run, made(folder / "longer", ticks=201))
    assert ("scenario.duration_s", 100.0, 100.5) in found.identity
    assert "scenario.duration_s" in diff.text(found)


def test_another_parameter_is_a_config_difference_and_what_it_led_to(run: Run, folder: Path) -> None:
    found = diff.diff(run, made(folder / "sparse", telemetry_every=2))
    assert found.config == [("telemetry_every", 1, 2)]
    assert found.packet is not None
    assert (found.packet.tick, found.packet.what, found.packet.differing) == (1, "COMMAND, down", ["follows"])
    assert diff.text(found).startswith("CONFIG differs: telemetry_every: 1 and 2\ndiffers at tick 1: COMMAND, down")


# -- pictures ----------------------------------------------------------------------------------------------------------


def test_every_page_is_drawn(run: Run, tmp_path: Path) -> None:
    files = plot([run], tmp_path / "pictures")
    assert [f.stem for f in files] == ["overview", "attitude", "error", "torque", "momentum"]
    for file in files:
        with Image.open(file) as image:
            assert image.width == 1200
            assert len(image.convert("RGB").getcolors(1 << 24) or ()) > 50


def test_identification_has_a_page_where_a_law_tells_of_it(run: Run) -> None:
    names = [f"{name}_{axis}" for name in ("g", "trace") for axis in "xyz"]
    run.telemetry.update({name: np.linspace(1.0, 2.0, len(run)) for name in names})
    made_pages = pages([run])
    for name in names:
        del run.telemetry[name]
    assert made_pages[-1].name == "identification"
    assert len(made_pages[-1].figure.axes) == 2
    assert len(made_pages[0].figure.axes) == 5


def test_one_file_by_suffix(run: Run, tmp_path: Path) -> None:
    assert plot([run], tmp_path / "run.pdf")[0].read_bytes().startswith(b"%PDF")
    assert plot([run], tmp_path / "run.png")[0].read_bytes().startswith(b"\x89PNG")
    with pytest.raises(PlotError, match=r"expected one of \.png, \.pdf or a directory, got \.gif"):
        plot([run], tmp_path / "run.gif")
    with pytest.raises(PlotError, match="No such file"):
        plot([run], tmp_path / "no" / "run.png")


def test_a_run_without_reference_is_drawn_against_its_setpoint(tmp_path: Path) -> None:
    run = made(tmp_path / "a", ticks=40, lose=(5, 6), telemetry_every=7)
    run.telemetry.clear()
    run.__dict__.update(_reference_deg=np.full((40, 3), np.nan), _error_deg=np.full((40, 3), np.nan))
    assert [page.name for page in pages([run])] == ["overview", "attitude", "error", "torque", "momentum"]
    assert "set-point" in pages([run])[2].figure.texts[0].get_text()


def test_a_run_without_board_has_no_error_to_show(tmp_path: Path) -> None:
    run = made(tmp_path / "a", ticks=40)
    run.config_words.clear()
    run.commands = run.commands[:0]
    run.__dict__.update(_reference_deg=np.full((40, 3), np.nan), _error_deg=np.full((40, 3), np.nan))
    assert [page.name for page in pages([run])] == ["overview", "attitude", "torque", "momentum"]
    assert "none: torque from a schedule" in pages([run])[0].figure.texts[1].get_text()
