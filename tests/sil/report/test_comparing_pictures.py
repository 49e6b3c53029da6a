"""Pictures of chosen signals and of several runs: the right curves, differences at common instants, labels."""

from __future__ import annotations

import errno
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "sinks"))

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image
from synthetic import synthetic_journal

from sil import cli
from sil.report.colours import DARK, LIGHT
from sil.report.facts import facts, labels
from sil.report.overlay import Ensemble, common
from sil.report.plot import PlotError, default_out, pages, plot
from sil.report.signals import SignalError, chosen, signals_of
from sil.runs import Run, open_run
from sil.sinks.seal import seal


def made(folder: Path, **options: object) -> Run:
    seal(synthetic_journal(folder, **options))  # type: ignore[arg-type]
    return open_run(folder)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Run, Run]:
    folder = tmp_path_factory.mktemp("overlays")
    return made(folder / "first"), made(folder / "altered", alter={77: 40_000_000})


def lines_of(figure: object) -> list[list[np.ndarray]]:
    """The drawn curves of every panel, guides and zero lines (two points) left out."""
    panels = figure.axes  # type: ignore[attr-defined]
    return [[line.get_xydata() for line in ax.get_lines() if len(line.get_xydata()) > 2] for ax in panels]


# -- one run -----------------------------------------------------------------------------------------------------------


def test_signals_choose_the_panels(runs: tuple[Run, Run]) -> None:
    made_pages = pages(runs[:1], ["rate", "torque"])
    assert [page.name for page in made_pages] == ["overview", "rate", "torque"]
    assert [ax.get_ylabel() for ax in made_pages[0].figure.axes] == ["rate in deg/s", "torque in mN m"]


def test_an_unknown_signal_names_the_known_ones(runs: tuple[Run, Run]) -> None:
    with pytest.raises(SignalError, match=r"got 'torqe'; known: attitude, error, torque, .*lateness, answer"):
        pages(runs[:1], ["torqe"])


def test_times_are_those_of_timing_mcap(runs: tuple[Run, Run]) -> None:
    """The script writes 1000 + k ns of lateness and 50 us of answer time."""
    signals = signals_of(runs[0])
    assert np.allclose(signals["lateness"].read(runs[0]), (1000 + np.arange(200)) / 1000.0)
    assert np.all(signals["answer"].read(runs[0]) == 50.0)
    assert len(pages(runs[:1], ["lateness"])[0].figure.axes) == 1


def test_a_run_without_timing_has_no_times(tmp_path: Path) -> None:
    run = made(tmp_path / "a", ticks=20)
    (run.directory / "timing.mcap").write_bytes(b"no MCAP")
    with pytest.raises(SignalError, match=r"timing\.mcap: cannot be read by this version"):
        pages([run], ["lateness"])
    (run.directory / "timing.mcap").unlink()
    assert "lateness" not in signals_of(run)


def test_identification_is_all_a_law_tells_of_it(runs: tuple[Run, Run]) -> None:
    run = runs[0]
    names = [f"{name}_{axis}" for name in ("g", "P") for axis in "xyz"]
    run.telemetry.update({name: np.linspace(1.0, 2.0, len(run)) for name in names})
    picked = [signal.name for signal in chosen([run], ["identification", "error"], ())]
    named = [page.name for page in pages([run], ["identification"])]
    for name in names:
        del run.telemetry[name]
    assert picked == ["g", "P", "error"]
    assert named == ["overview", "identification"]


def test_dark_paper_is_dark(runs: tuple[Run, Run], tmp_path: Path) -> None:
    plot(runs, tmp_path / "dark.png", dark=True)
    with Image.open(tmp_path / "dark.png") as image:
        assert image.convert("RGB").getpixel((3, 3)) == tuple(bytes.fromhex(DARK.paper[1:]))


# -- several runs ------------------------------------------------------------------------------------------------------


def test_each_run_is_a_curve_in_the_panel_of_its_axis(runs: tuple[Run, Run]) -> None:
    overview = pages(runs, ["error", "torque"])[0].figure
    curves = lines_of(overview)
    assert len(curves) == 6
    for axis in range(3):
        for curve, run in zip(curves[axis], runs, strict=True):
            assert np.array_equal(curve, np.column_stack([run.t_s, run.error_deg[:, axis]]))
        for curve, run in zip(curves[3 + axis], runs, strict=True):
            assert np.allclose(curve[:, 1], run.applied_Nm[:, axis] * 1000)
    assert [ax.get_title(loc="left") for ax in overview.axes[:3]] == ["roll", "pitch", "yaw"]


def test_residuals_are_the_second_minus_the_first(runs: tuple[Run, Run]) -> None:
    figure = pages(runs, ["attitude"], residuals=True)[0].figure
    curve = lines_of(figure)[3][0]
    assert np.array_equal(curve[:, 1], runs[1].attitude_deg[:, 0] - runs[0].attitude_deg[:, 0])
    assert curve[:, 1].any()
    assert "difference to first at the 200 common ticks" in figure.texts[1].get_text()
    assert [page.name for page in pages(runs, ["error"], residuals=True)] == ["overview", "error", "error-residual"]


def test_residual_angles_are_modulo_a_turn(runs: tuple[Run, Run], tmp_path: Path) -> None:
    a, b = runs[0], made(tmp_path / "b")
    a_angles, b_angles = a.attitude_deg.copy(), b.attitude_deg.copy()
    a_angles[:, 2], b_angles[:, 2] = -179.0, 179.0
    before = a.attitude_deg
    a._columns["attitude_deg"], b._columns["attitude_deg"] = a_angles, b_angles
    residual = Ensemble([a, b], LIGHT).residuals(signals_of(a)["attitude"])[0].values
    a._columns["attitude_deg"] = before
    assert np.allclose(residual[:, 2], -2.0)


def of_period(run: Run, period_ns: int, folder: Path) -> Run:
    """The same rows, told to be of another period."""
    other = open_run(run.path)
    other.period_ns, other.period_s = period_ns, period_ns * 1e-9
    other._columns["t_s"] = other.tick * other.period_s
    return other


def test_runs_of_other_periods_are_compared_at_the_instants_both_have(runs: tuple[Run, Run], tmp_path: Path) -> None:
    a, b = runs[0], of_period(runs[0], 300_000_000, tmp_path)
    rows_a, rows_b = common(a, b)
    assert np.array_equal(a.t_s[rows_a], np.round(b.t_s[rows_b], 9))
    assert np.array_equal(a.t_s[rows_a], np.arange(40) * 1.5)
    text = pages([a, b], ["rate"], residuals=True)[0].figure.texts[1].get_text()
    assert "40 instants that both have (the periods differ)" in text
    with pytest.raises(SignalError, match="expected instants that both runs have, got 1"):
        common(a, of_period(a, 500_000_001, tmp_path))


def test_a_run_that_diverged_does_not_squeeze_the_others(runs: tuple[Run, Run], tmp_path: Path) -> None:
    wild = made(tmp_path / "wild")
    angles = wild.attitude_deg.copy()
    angles[50:, 0] = 170.0
    wild._columns["attitude_deg"] = angles
    figure = pages([runs[0], wild], ["attitude"])[0].figure
    assert figure.axes[0].get_ylim()[1] < 80
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert any("(diverged at 25 s)" in text for text in texts)


def test_a_signal_of_one_run_only_is_drawn_for_that_one(runs: tuple[Run, Run]) -> None:
    names = [f"g_{axis}" for axis in "xyz"]
    runs[1].telemetry.update({name: np.linspace(1.0, 2.0, 200) for name in names})
    figure = pages(runs, ["g"])[0].figure
    for name in names:
        del runs[1].telemetry[name]
    assert [len(curves) for curves in lines_of(figure)] == [1, 1, 1]


def test_what_the_first_run_has_alone_has_no_residual(runs: tuple[Run, Run], tmp_path: Path) -> None:
    """Such as the error beside a run without a board: no row of differences, and no traceback."""
    names = [f"g_{axis}" for axis in "xyz"]
    runs[1].telemetry.update({name: np.linspace(1.0, 2.0, 200) for name in names})
    try:
        both = pages(runs, ["g", "rate"], residuals=True)
        assert [len(curves) for curves in lines_of(both[0].figure)] == [1, 1, 1, 2, 2, 2, 1, 1, 1]
        assert [page.name for page in both] == ["overview", "g", "rate", "rate-residual"]
        with pytest.raises(PlotError, match=r"--residuals: expected a signal that .* and another run have, got none"):
            plot(runs, tmp_path / "a.png", ["g"], residuals=True)
    finally:
        for name in names:
            del runs[1].telemetry[name]


@pytest.mark.parametrize("suffix", [".png", ".pdf"])
def test_a_picture_that_cannot_be_written_leaves_the_older_one(
    runs: tuple[Run, Run], tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A full disk is met in the middle of writing."""
    out = tmp_path / f"a{suffix}"
    out.write_bytes(b"older")

    def full(figure: Figure, file: object, **options: object) -> None:
        if isinstance(file, Path):
            file.write_bytes(b"half")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Figure, "savefig", full)
    with pytest.raises(PlotError, match="No space left on device"):
        plot(runs[:1], out)
    assert out.read_bytes() == b"older"
    assert [path.name for path in tmp_path.iterdir()] == [out.name]


def test_what_cannot_be_compared_is_one_line(runs: tuple[Run, Run], tmp_path: Path) -> None:
    with pytest.raises(PlotError, match="--residuals: expected two runs or more, got one"):
        plot(runs[:1], tmp_path / "a.png", residuals=True)
    with pytest.raises(SignalError, match="expected at most 21 runs in one picture, got 22"):
        pages([runs[0]] * 22)


def test_where_a_picture_goes_by_default(runs: tuple[Run, Run]) -> None:
    assert default_out(runs[:1]) == runs[0].directory / "plot.png"
    assert default_out(runs) == Path("plot-first-altered.png")
    assert default_out([*runs, *runs]) == Path("plot-4-runs.png")


# -- what to call them -------------------------------------------------------------------------------------------------


def named(run: Run, folder: str = "a", **changes: object) -> Run:
    """The same run with another name, seed, or keys `section__key` of the scenario."""
    other = open_run(run.path)
    other.directory = Path(folder)
    other.name = str(changes.pop("name", other.name))
    other.meta["seed"] = changes.pop("seed", other.meta["seed"])
    for key, value in changes.items():
        section, _, inner = key.partition("__")
        if inner:
            other.scenario.setdefault(section, {})[inner] = value
        else:
            other.scenario[section] = value
    return other


def test_runs_are_called_by_what_differs(runs: tuple[Run, Run]) -> None:
    run = runs[0]
    assert labels([named(run, name="x"), named(run, name="y", seed=2)]) == ["x", "y"]
    assert labels([named(run, seed=1), named(run, seed=2)]) == ["seed 1", "seed 2"]
    assert labels([named(run, law__form="fixed"), named(run, law__form="float")]) == ["pd (fixed)", "pd (float)"]
    by_key = [named(run, wire__torque_bits=20), named(run, wire__torque_bits=24.0)]
    assert labels(by_key) == ["torque_bits 20", "torque_bits 24"]
    assert labels([named(run, "runs/x-001"), named(run, "runs/x-002")]) == ["x-001", "x-002"]
    assert labels([named(run, name="x"), named(run, "d-1", name="y"), named(run, "d-2", name="y")]) == [
        "x", "y, d-1", "y, d-2"
    ]  # fmt: skip
    assert labels([run, run]) == ["(1)", "(2)"]
    two_keys = [named(run, f"d{i}{j}", wire__torque_bits=i, wire__rate_bits=j) for i in (1, 2) for j in (1, 2)]
    assert labels(two_keys) == ["d11", "d12", "d21", "d22"]


def test_facts_are_what_the_runs_share(runs: tuple[Run, Run]) -> None:
    assert facts(runs) == "   ·   ".join(
        ["law pd", "sampling 0.5 s", "transport delay 1 tick", "200 ticks", "finished"]
    )
    assert "law" not in facts([runs[0], named(runs[0], law__form="float")])


# -- a part of the time ------------------------------------------------------------------------------------------------


def test_a_part_of_the_time_is_drawn_at_its_own_scale(runs: tuple[Run, Run], tmp_path: Path) -> None:
    """Around 60 s the pitch error is far below its peak at the step of 20 s; hidden data must not set the scale."""
    look = LIGHT._replace(span_s=(60.0, 70.0))
    for many, axes in ((runs, 3), (runs[:1], 1)):
        whole, part = (pages(many, ["error"], look=each)[0].figure.axes[:axes] for each in (LIGHT, look))
        assert part[0].get_xlim() == (60.0, 70.0)
        for wide, narrow in zip(whole, part, strict=True):
            assert np.ptp(narrow.get_ylim()) < 0.5 * np.ptp(wide.get_ylim())
    with pytest.raises(PlotError, match="--time: expected a part of the runs, got 1000:inf s"):
        plot(runs, tmp_path / "a.png", span_s=(1000.0, np.inf))


@pytest.mark.parametrize(("given", "code"), [("60:70", 0), (":70", 0), ("60:", 0), ("60", 2), ("70:60", 2), ("a:b", 2)])
def test_the_part_is_read_as_from_to(runs: tuple[Run, Run], tmp_path: Path, given: str, code: int) -> None:
    out = tmp_path / "a.png"
    arguments = ["plot", str(runs[0].directory), "--time", given, "--signals", "rate,error", "--out", str(out)]
    assert cli.invoke(arguments) == code
    assert out.exists() == (code == 0)
