"""The doctor's checks of the installation: where modules come from, which versions, what was compiled."""

from __future__ import annotations

from pathlib import Path

import pytest
from fake_machine import machine
from hypothesis import given
from hypothesis import strategies as st

from sil.doctor import NOTE, OK, PROBLEM, Surroundings
from sil.doctor import installation as checks

HERE = {"protocol": Path("/src"), "firmware_sim": Path("/src"), "sil": Path("/src")}


@pytest.mark.parametrize(
    ("version", "status"), [((3, 10, 9), PROBLEM), ((3, 11, 0), OK), ((3, 13, 7), OK), ((3, 14, 0), PROBLEM)]
)
def test_python(version: tuple[int, int, int], status: str) -> None:
    found = checks.judge_python(version, "/usr/bin/python3")
    assert found.status == status
    assert bool(found.commands) == (status == PROBLEM)


# -- packages ---------------------------------------------------------------------------------------------------------


def test_three_packages_from_one_place_are_no_finding(tmp_path: Path) -> None:
    assert checks.judge_packages(HERE, Path("/src"), machine(tmp_path)) is None


@pytest.mark.parametrize("place", [Path("/somewhere/protocol.py"), Path("/site-packages"), None])
def test_a_package_from_elsewhere_is_a_problem_that_names_it(tmp_path: Path, place: Path | None) -> None:
    found = checks.judge_packages({**HERE, "protocol": place}, Path("/src"), machine(tmp_path))
    assert found is not None
    assert found.status == PROBLEM
    assert found.found.startswith(f"protocol from {place or 'nowhere'}; expected all three from /src")


@pytest.mark.parametrize("name", ["protocol.py", "sil/__init__.py", "random.py", "numpy.py"])
def test_a_module_in_the_working_directory_is_a_note_until_python_looks_there(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    path.touch()
    harmless = checks.judge_packages(HERE, Path("/src"), machine(tmp_path))
    assert harmless is not None
    assert harmless.status == NOTE
    assert str(path) in harmless.found
    searched = Surroundings(root=tmp_path, folder=tmp_path, search_path=("", "/src"))
    shadowed = checks.judge_packages(HERE, Path("/src"), searched)
    assert shadowed is not None
    assert shadowed.status == PROBLEM


def test_a_directory_before_ours_on_the_path_is_looked_into_and_one_after_is_not(tmp_path: Path) -> None:
    for name in ("before", "ours", "after"):
        (tmp_path / name / "protocol").mkdir(parents=True)
        (tmp_path / name / "protocol" / "__init__.py").touch()
    home = tmp_path / "ours"
    path = tuple(str(tmp_path / name) for name in ("before", "ours", "after"))
    found = checks.judge_packages(dict.fromkeys(HERE, home), home, Surroundings(tmp_path, tmp_path, path))
    assert found is not None
    assert found.status == PROBLEM
    assert found.data["clashes"] == [str(tmp_path / "before/protocol/__init__.py")]


def test_the_clone_itself_is_a_good_working_directory() -> None:
    around = Surroundings(folder=checks.HOME, search_path=("", str(checks.HOME)))
    assert checks.judge_packages(dict.fromkeys(HERE, checks.HOME), checks.HOME, around) is None


# -- dependencies -----------------------------------------------------------------------------------------------------


def test_minimums_of_what_is_required_and_not_of_extras() -> None:
    lines = ["numpy>=2.0", "foxglove-schemas-protobuf >= 0.4", 'pytest>=8; extra == "test"', "types-PyYAML"]
    assert checks.minimums(lines) == {"numpy": "2.0", "foxglove-schemas-protobuf": "0.4"}


def test_every_dependency_of_the_product_has_a_minimum_that_is_met_here() -> None:
    wanted = checks.minimums(checks.requirements())
    assert {"numpy", "numba", "pyserial", "pydantic", "mcap"} <= set(wanted)
    assert checks.judge_dependencies(wanted, {name: checks.installed(name) for name in wanted}) is None


def test_old_and_missing_dependencies_are_named_with_the_command() -> None:
    wanted = {"numpy": "2.0", "numba": "0.61", "rich": "13"}
    found = checks.judge_dependencies(wanted, {"numpy": "1.26.4", "numba": None, "rich": "13.0"})
    assert found is not None
    assert found.status == PROBLEM
    assert found.found == "numpy 1.26.4, expected 2.0 or later; numba is missing, expected 0.61 or later"
    assert found.commands[0].endswith("-m pip install 'numpy>=2.0' 'numba>=0.61'")


@given(st.lists(st.integers(0, 300), min_size=1, max_size=4), st.lists(st.integers(0, 300), min_size=1, max_size=4))
def test_releases_are_ordered_as_numbers(a: list[int], b: list[int]) -> None:
    """2.10 comes after 2.9, and 2.0 is 2."""
    width = max(len(a), len(b))
    first, second = (numbers + [0] * (width - len(numbers)) for numbers in (a, b))
    one, other = (checks.release(".".join(map(str, numbers))) for numbers in (a, b))
    assert [one > other, one == other] == [first > second, first == second]


def test_a_release_candidate_and_nothing() -> None:
    assert checks.release("2.1.0rc1") == (2, 1)
    assert checks.release("0.0") > checks.release("")


# -- compiled code ----------------------------------------------------------------------------------------------------


def cache(root: Path, *names: str) -> dict[str, Path]:
    for name in names:
        (root / name / "sub").mkdir(parents=True)
        (root / name / "sub" / "kernel.nbi").write_bytes(bytes(1000))
        (root / name / "sub" / "kernel.1.nbc").write_bytes(bytes(1048))
    return {"sil": root / names[0], "firmware_sim": root / names[1]}


@pytest.fixture(autouse=True)
def cache_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    return tmp_path / "home" / "attitude-sil"


def test_cache_with_compiled_functions(cache_home: Path) -> None:
    found = checks.judge_cache(cache(cache_home, "sil-1", "firmware_sim-1"))
    assert found.status == OK
    assert found.found == f"{cache_home}: functions of sil 1, firmware_sim 1, 4.0 KiB"
    assert found.data["compiled"] == {"sil": 1, "firmware_sim": 1}


def test_an_empty_cache_says_that_the_first_run_compiles(cache_home: Path) -> None:
    directories = cache(cache_home, "sil-1", "firmware_sim-1")
    (directories["sil"] / "sub" / "kernel.nbi").unlink()
    found = checks.judge_cache(directories)
    assert found.status == OK
    assert "the first run compiles" in found.found


def test_many_old_caches_are_worth_a_note(cache_home: Path) -> None:
    found = checks.judge_cache(cache(cache_home, "sil-9", "firmware_sim-9", *(f"sil-{n}" for n in range(8))))
    assert found.status == NOTE
    assert "8 directories of older sources" in found.found
    assert found.commands == (f"rm -r {cache_home}",)


def test_a_cache_in_the_temporary_directory_does_not_last(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checks.tempfile, "gettempdir", lambda: str(tmp_path / "temp"))
    found = checks.judge_cache(cache(tmp_path / "temp" / "attitude-sil-0", "sil-1", "firmware_sim-1"))
    assert found.status == NOTE
    assert found.found.startswith("no lasting cache")
