"""A series of benches: known names only, one failure does not end it, Ctrl-C keeps what is finished, no orphans."""

from __future__ import annotations

import inspect
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from sil import bench, plugins
from sil.bench import BENCHES, series
from sil.bench.book import Book, Plan
from sil.bench.children import ChildFailed, run_child
from sil.bench.series import Unavailable, Watch, chosen, run_series
from sil.trouble import UsageError


class Fake:
    """A bench that does what its class says."""

    about = "nothing"

    def expected_s(self, plan: Plan) -> float:
        return 1.0

    def measure(self, plan: Plan, book: Book) -> None:
        for _ in plan.rounds("fake"):
            book.line("case", "us").add(1.0)


class Absent(Fake):
    def measure(self, plan: Plan, book: Book) -> None:
        raise Unavailable("cyclictest is not here")


class Interrupted(Fake):
    def measure(self, plan: Plan, book: Book) -> None:
        super().measure(plan, book)
        raise KeyboardInterrupt


class Terminated(Fake):
    def measure(self, plan: Plan, book: Book) -> None:
        super().measure(plan, book)
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(5.0)


@pytest.fixture
def fakes(monkeypatch: pytest.MonkeyPatch) -> None:
    here = {cls.__name__.lower(): f"{__name__}:{cls.__name__}" for cls in (Absent, Fake, Interrupted, Terminated)}
    monkeypatch.setattr(series, "BENCHES", here)


@pytest.mark.parametrize("name", BENCHES)
def test_every_bench_says_what_it_compares_and_how_long_it_takes(name: str) -> None:
    one = plugins.load(BENCHES, "bench", name)()
    assert one.about
    assert inspect.getdoc(type(one))
    quick, whole = one.expected_s(Plan(1, quick=True)), one.expected_s(Plan(5))
    assert 0 < quick < whole


def test_every_file_with_a_bench_is_registered() -> None:
    assert bench.__file__ is not None
    with_bench = {p.stem for p in Path(bench.__file__).parent.glob("*.py") if "\n    def measure(" in p.read_text()}
    assert {entry.partition(":")[0].rpartition(".")[2] for entry in BENCHES.values()} == with_bench - {"series"}


def test_an_unknown_name_is_one_line_with_the_known_ones() -> None:
    with pytest.raises(UsageError, match=r"^NAMES: expected benches, got 'plan'; known: codec, recorder, law, plant,"):
        chosen(["plan"])
    assert chosen([]) == list(BENCHES)
    assert chosen(["wakeup", "codec"]) == ["codec", "wakeup"]


@pytest.mark.usefixtures("fakes")
def test_what_cannot_be_measured_is_said_and_the_others_go_on() -> None:
    (absent, fake), interrupted = run_series(["absent", "fake"], Plan(2))
    assert (absent.skipped, absent.finished, interrupted) == ("cyclictest is not here", False, False)
    assert (fake.finished, fake.lines[0].ours) == (True, [1.0, 1.0])


@pytest.mark.usefixtures("fakes")
@pytest.mark.parametrize("how", ["interrupted", "terminated"])
def test_ctrl_c_and_sigterm_keep_what_was_measured(how: str) -> None:
    (fake, ended), interrupted = run_series(["fake", how], Plan(1))
    assert interrupted
    assert fake.finished
    assert (ended.finished, ended.lines[0].ours) == (False, [1.0])
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


@pytest.mark.usefixtures("fakes")
def test_a_watch_hears_of_everything() -> None:
    heard: list[str] = []

    class Ear(Watch):
        def starts(self, expected: dict[str, float]) -> None:
            heard.append(f"{expected}")

        def bench(self, name: str) -> None:
            heard.append(name)

        def doing(self, line: str) -> None:
            heard.append(line)

        def done(self, book: Book) -> None:
            heard.append(f"done {book.name}")

    run_series(["fake"], Plan(1), Ear())
    assert heard == ["{'fake': 1.0}", "fake", "fake, repeat 1 of 1", "done fake"]


# -- children ---------------------------------------------------------------------------------------------------------


def test_a_child_that_fails_is_one_line_with_its_last_words() -> None:
    with pytest.raises(ChildFailed, match=r"exit code 3: no such law$"):
        run_child([sys.executable, "-c", "import sys; print('no such law', file=sys.stderr); sys.exit(3)"], 30.0)
    with pytest.raises(ChildFailed, match=r"^/no/such/program: No such file"):
        run_child(["/no/such/program"], 30.0)


def test_a_child_does_not_outlive_its_time() -> None:
    with pytest.raises(ChildFailed, match="expected it to end within"):
        run_child([sys.executable, "-c", "import time; time.sleep(60)"], 0.2)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGKILL])
def test_no_child_outlives_a_bench_that_is_ended(number: int, tmp_path: Path) -> None:
    """SIGKILL leaves the bench no time for anything; the kernel ends the child."""
    program = (
        "from sil.bench.children import run_child\nfrom sil.stopping import terminated_like_interrupted\n"
        "with terminated_like_interrupted():\n"
        "    run_child(['sh', '-c', 'echo $$ > pid; exec sleep 60'], 90.0)\n"
    )
    parent = subprocess.Popen([sys.executable, "-c", program], cwd=tmp_path, stderr=subprocess.DEVNULL)
    try:
        pid = _written(tmp_path / "pid")
        parent.send_signal(number)
        parent.wait(20.0)
    finally:
        parent.kill()
        parent.wait()
    assert _gone(pid)


def _written(file: Path) -> int:
    for _ in range(200):
        if file.exists() and (text := file.read_text().strip()):
            return int(text)
        time.sleep(0.05)
    raise AssertionError("the child did not start")


def _gone(pid: int) -> bool:
    for _ in range(100):
        stat = Path(f"/proc/{pid}/stat")
        if not stat.exists() or stat.read_text().rpartition(")")[2].split()[0] == "Z":
            return True
        time.sleep(0.05)
    return False
