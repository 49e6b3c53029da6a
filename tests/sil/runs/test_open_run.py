"""Opening a run: arrays by name aligned to ticks; damaged or foreign files are refused in one clear line."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "sinks"))

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import Writer
from synthetic import PERIOD_S, START_DEG, synthetic_journal

import sil.runs
from sil.run_columns import COLUMNS
from sil.runs import Run, RunError, open_run
from sil.sinks.seal import seal

HEADER = (
    "tick,t_s,phi_deg,theta_deg,psi_deg,ref_phi_deg,ref_theta_deg,ref_psi_deg,command_x_Nm,command_y_Nm,command_z_Nm,"
    "applied_x_Nm,applied_y_Nm,applied_z_Nm,w_x_radps,w_y_radps,w_z_radps,h_x_Nms,h_y_Nms,h_z_Nms,q_s,q_x,q_y,q_z"
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = synthetic_journal(tmp_path_factory.mktemp("runs") / "a", lose=(30, 31), late=(50,))
    seal(made)
    return made


@pytest.fixture(scope="module")
def run(folder: Path) -> Run:
    return open_run(folder)


def test_names_and_units(run: Run) -> None:
    assert ",".join(COLUMNS) == HEADER
    assert all(len(run[name]) == 200 for name in run.names)
    assert run.units["reference_x"] == "deg"
    assert run.units["saturations"] == ""
    with pytest.raises(KeyError, match=r"'roll' is not in this run; known: tick, t_s, phi_deg"):
        run["roll"]


def test_a_notebook_shows_figures_of_numbers_only_and_nothing_of_the_file_is_markup(run: Run) -> None:
    """Protects: ticks without a COMMAND or a reference make no figure NaN; a name cannot write into the page."""
    torque = 1e3 * np.sqrt((run.applied_Nm**2).mean(axis=0))
    shown = run._repr_html_()
    assert "rms torque, mN m</th>" + "".join(f"<td>{value:.4g}</td>" for value in torque) in shown
    assert "nan" not in shown and f"{len(run.names)} names" in shown
    named = open_run(run.path)
    named.name = "<script>alert(1)</script>"
    assert "<script>" not in named._repr_html_()


def test_truth_and_time(run: Run) -> None:
    assert np.array_equal(run["tick"], np.arange(200))
    assert np.array_equal(run["t_s"], np.arange(200) * PERIOD_S)
    assert np.allclose(run.attitude_deg[0], START_DEG, atol=1e-12)
    assert run["phi_deg"][0] == run.attitude_deg[0, 0]
    assert run.setpoint_deg[199].tolist() == pytest.approx([25, -30, 0], abs=1e-7)


def test_commands_stand_at_the_tick_they_were_computed_at(run: Run) -> None:
    """One tick of transport delay: what was computed at k acts from k+1 on; held where it was missing or late."""
    command, applied = run.command_Nm, run.applied_Nm
    assert np.isnan(command[[30, 31]]).all()
    assert np.isfinite(np.delete(command, [30, 31], axis=0)).all()
    regular = [k for k in range(199) if k not in (30, 31, 50)]
    assert np.array_equal(applied[[k + 1 for k in regular]], command[regular])
    assert np.array_equal(applied[[31, 32]], applied[[30, 30]])
    assert np.array_equal(applied[51], applied[50])
    assert int((run.commands["fate"] == 1).sum()) == 1


def test_reference_is_the_boards_within_its_quantisation(run: Run) -> None:
    assert np.nanmax(np.abs(run.reference_deg - run.reported("reference"))) <= 360 / 2**32


def test_packets_events_scenario(run: Run) -> None:
    assert [p.direction for p in run.packets[:3]] == ["up", "up", "down"]
    assert {p.fate for p in run.packets} == {"delivered", "late"}
    assert [p.tick for p in run.packets] == sorted(p.tick for p in run.packets)
    assert [(e.tick, e.origin) for e in run.events] == [(0, "board"), (50, "laboratory")]
    assert run.scenario["law"] == {"name": "pd"}
    assert run.end == {"reason": "finished", "ticks": 200}
    assert run.summary == {}
    assert run.sessions == [0]
    assert run.config_words["torque_bits"] == 30


def test_summary_beside_the_log(folder: Path) -> None:
    (folder / "summary.json").write_text('{"verdict": "passed"}')
    assert open_run(folder / "run.mcap").summary == {"verdict": "passed"}
    (folder / "summary.json").write_text("[1")
    assert open_run(folder).summary == {}
    (folder / "summary.json").unlink()


def test_a_quaternion_that_changes_sign_is_made_continuous() -> None:
    angle = np.linspace(0.0, 4.0 * np.pi, 50)
    q = np.column_stack([np.cos(angle / 2), np.sin(angle / 2), 0 * angle, 0 * angle])
    flipped = q * np.where(np.cos(angle / 2) < 0, -1.0, 1.0)[:, None]
    assert np.allclose(sil.runs._continuous(flipped), q)


# -- what is no run ----------------------------------------------------------------------------------------------------


def foreign(path: Path) -> None:
    with open(path, "wb") as file:
        writer = Writer(file)
        writer.start(library="somebody else")
        writer.finish()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda p: None, "No such file or directory"),
        (lambda p: p.write_bytes(b""), "is empty"),
        (lambda p: p.write_bytes(b"tick,t_s\n0,0\n"), "expected an MCAP log"),
        (lambda p: p.write_bytes(b"\x89MCAP0\r\n"), "is cut off: 8 bytes"),
        (foreign, "an MCAP log (of somebody else), but not one of a run"),
        (lambda p: p.mkdir(), "expected a run directory, found neither run.mcap nor run.journal"),
    ],
)
def test_one_line_for_what_is_no_run(tmp_path: Path, make: object, message: str) -> None:
    path = tmp_path / "run.mcap"
    make(path)  # type: ignore[operator]
    with pytest.raises(RunError) as error:
        open_run(path)
    assert message in str(error.value)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_an_unsealed_run_says_how_to_seal_it(tmp_path: Path) -> None:
    synthetic_journal(tmp_path / "a", 5, end=False)
    with pytest.raises(RunError, match=r"no run.mcap yet; `sil recover .*a` makes it"):
        open_run(tmp_path / "a")


@settings(max_examples=300, deadline=None)
@given(st.data())
def test_any_flipped_bit_is_noticed(
    folder: Path, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    """The stock reader's default reads on silently; here no damaged log opens, nor does one that was cut off."""
    content = bytearray((folder / "run.mcap").read_bytes())
    bit = data.draw(st.integers(0, len(content) * 8 - 1))
    content[bit // 8] ^= 1 << bit % 8
    damaged = tmp_path_factory.mktemp("flip") / "run.mcap"
    damaged.write_bytes(content)
    with pytest.raises(RunError):
        open_run(damaged)
    damaged.write_bytes(content[: data.draw(st.integers(0, len(content) - 1))])
    with pytest.raises(RunError):
        open_run(damaged)
