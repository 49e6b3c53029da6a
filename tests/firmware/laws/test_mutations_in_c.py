"""The comparison sees what it is there to see: each of these edits of the C or of the Python form makes it fail."""

from __future__ import annotations

import os
import pickle
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import c_build
import pytest
from comparison import Difference, compare, run
from episodes import Episode, episodes

import firmware_sim
from protocol.laws import IN_C

HERE = Path(__file__).parent
EPISODES = 24

ROUND = "sum64(x, (int64_t)(UINT64_C(1) << (n - 1))) >> n"
KEEP32 = "        *flag = 1;\n    }\n    return sat32(x);"
QUOTIENT = "(a < 0) == (b < 0) ? (int64_t)quotient : difference64(0, (int64_t)quotient)"
THREE = ("pd", "mrac", "appc")
# file, what stands there once, what shall stand there, laws in which it has to show
MUTATIONS = {
    "shift_round truncates": ("fixed.h", ROUND, "x >> n", IN_C),
    "a C division for the shift": ("fixed.h", ROUND, f"{ROUND[:-5]} / (int64_t)(UINT64_C(1) << n)", IN_C),
    "keep32 wraps": ("fixed.h", KEEP32, KEEP32.replace("sat32", "wrap32"), THREE),
    "sat32 lets through what is too small": ("fixed.h", "x < INT32_MIN ? INT32_MIN :", "0 ? INT32_MIN :", ("appc",)),
    "division rounds down": ("fixed.c", QUOTIENT, QUOTIENT.replace("0, ", "n % d == 0 ? 0 : -1, "), THREE),
    "mul_wide forgets the upper half": ("fixed.h", "sum64(high, low >> 32)", "low >> 32", ("mrac",)),
    "one coefficient of the sine is off by one": ("fixed.c", "35791394", "35791395", ("mrac", "appc")),
    "identification one tick early": ("mrac.c", "s->steps >= 3", "s->steps >= 2", ("mrac",)),
    "covariance not mirrored": ("rls.c", "F[5 * m + n] = F[5 * n + m] =", "F[5 * m + n] =", ("mrac",)),
    "a loss forgotten": ("appc.c", "in->good_run >= smaller(3, s->steps + 1)", "1", ("appc",)),
    "the derivative not over the gap": ("pd.c", "div_trunc(change[i], s->gap)", "change[i]", ("pd",)),
    "half a turn the long way": ("attitude_error.c", "w >= 0 ? z : -z", "z", ("pd",)),
    "angles of the other sequence": ("attitude_error.c", "sequence != COMMON", "sequence == COMMON", ("pd",)),
    "a state without an end": ("state_space.c", "clip(x, -STATE_MAX, STATE_MAX)", "x", ("state_space",)),
    "the reference of the other lead": ("reference.c", "s->lead == 2", "s->lead != 2", IN_C),
}


@pytest.fixture(scope="module")
def recorded() -> dict[str, list[Episode]]:
    return {law: list(episodes(law, EPISODES)) for law in IN_C}


@pytest.mark.parametrize("name", MUTATIONS)
def test_an_edit_of_the_c_is_seen(name: str, recorded: dict[str, list[Episode]], tmp_path: Path) -> None:
    file, before, after, laws = MUTATIONS[name]
    core = c_build.mutated(tmp_path, file, before, after)
    program = c_build.program(tmp_path, ("-O0",), core)
    for law in laws:
        found = compare(recorded[law], run(program, recorded[law]))
        print(f"{name}, {law}: {found.differing} of {found.steps} steps differ; first: {found.first}")
        assert found.differing > 0


@pytest.mark.parametrize(
    ("file", "before", "after"),
    [
        ("pd.c", "wide(ref->state.now[i]) - in->euler[i]", "ref->state.now[i] - in->euler[i]"),
        ("reference.c", "wide(in->setpoint[i]) - in->euler[i]", "in->setpoint[i] - in->euler[i]"),
        ("fixed.h", "(int64_t)((uint64_t)x << -n)", "x << -n"),
    ],
)
def test_undefined_behaviour_ends_the_sanitized_build(
    file: str, before: str, after: str, recorded: dict[str, list[Episode]], tmp_path: Path
) -> None:
    """Also where the numbers come out right all the same, as those of the first two do."""
    core = c_build.mutated(tmp_path, file, before, after)
    program = c_build.program(tmp_path, c_build.sanitized(), core)
    with pytest.raises(AssertionError, match=r"ended with|runtime error"):
        run(program, recorded["pd"])


def test_an_edit_of_fixed_py_is_seen(recorded: dict[str, list[Episode]], tmp_path: Path) -> None:
    """Though the compiled code of the unedited sources is in the cache: numba alone would not look at that file."""
    packages, cache = tmp_path / "packages", tmp_path / "cache"
    for package in ("firmware_sim", "protocol"):
        shutil.copytree(Path(firmware_sim.__file__).parents[1] / package, packages / package)
    traces = run(c_build.program(tmp_path), recorded["pd"])
    assert python_beside(recorded["pd"], traces, packages, cache).differing == 0
    assert list(cache.rglob("*.nbc"))  # warm
    fixed = packages / "firmware_sim" / "fixed.py"
    before, after = "        state[flag] = 1\n    return sat32(x)", "        state[flag] = 1\n    return wrap32(x)"
    assert before in fixed.read_text()
    fixed.write_text(fixed.read_text().replace(before, after))
    found = python_beside(recorded["pd"], traces, packages, cache)
    print(f"fixed.py edited, pd: {found.differing} of {found.steps} steps differ; first: {found.first}")
    assert found.differing > 0
    assert ".par." not in found.first  # in compiled code, that is, not in the parameters, which no cache serves


def python_beside(recorded: list[Episode], traces: list[bytes], packages: Path, cache: Path) -> Difference:
    """C's traces beside what the packages in that directory make of the same inputs."""
    asked, answer = packages / "asked", packages / "answer"
    asked.write_bytes(pickle.dumps([replace(episode, expected=None) for episode in recorded]))
    paths = os.pathsep.join(map(str, (packages, HERE)))
    environment = {**os.environ, "PYTHONPATH": paths, "XDG_CACHE_HOME": str(cache)}
    code = "import episodes, firmware_sim; print(firmware_sim.__file__); episodes.main()"
    command = [sys.executable, "-P", "-c", code, str(asked), str(answer)]
    done = subprocess.run(command, env=environment, cwd=packages, capture_output=True, text=True, check=True)
    assert Path(done.stdout.strip()).parents[1] == packages
    expected = pickle.loads(answer.read_bytes())
    return compare([replace(e, expected=x) for e, x in zip(recorded, expected, strict=True)], traces)
