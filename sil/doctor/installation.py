"""Checks of the installation: Python, our three packages and who shadows them, dependencies, compiled code."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib import metadata
from pathlib import Path

import sil
from sil.doctor.findings import NOTE, OK, PROBLEM, Finding, Surroundings, size_text

OLDEST, TOO_NEW = (3, 11), (3, 14)
OURS = ("protocol", "firmware_sim", "sil")
DISTRIBUTION = "attitude-sil"
HOME = Path(sil.__file__).resolve().parents[1]
# Modules of our dependencies that a script of a user's might be called after.
BORROWED = frozenset(("cobs", "google", "matplotlib", "mcap", "numba", "numpy", "pydantic", "rich", "serial", "typer"))
MINIMUM = re.compile(r"^([A-Za-z0-9._-]+)\s*>=\s*([0-9][0-9.]*)")
ASK_CACHES = (
    "import sil.jit, firmware_sim.jit as board; print(sil.jit.cache_directory()); print(board.cache_directory())"
)
ASK_CACHES_S = 15.0
KEEP_OLD = 5  # caches of former sources that are no matter


def python(around: Surroundings) -> Finding:
    """The interpreter: 3.11 to 3.13, because numba has to know it."""
    return judge_python(sys.version_info[:3], sys.executable)


def judge_python(version: tuple[int, int, int], executable: str) -> Finding:
    found = f"{'.'.join(map(str, version))} at {executable}"
    data = {"version": ".".join(map(str, version)), "executable": executable}
    if OLDEST <= version[:2] < TOO_NEW:
        return Finding(OK, found, data=data)
    commands = ("python3.12 -m venv .venv && .venv/bin/pip install attitude-sil",)
    return Finding(
        PROBLEM, f"{found}; expected 3.11 to 3.13", "make an environment with one of these", commands, (), data
    )


# -- packages ---------------------------------------------------------------------------------------------------------


def packages(around: Surroundings) -> Finding:
    """Our three packages come from one place, and no other module of their name, or of a library's, is before them."""
    places = {name: place_of(name) for name in OURS}
    return (
        judge_packages(places, HOME, around)
        or _two_distributions()
        or Finding(OK, f"{', '.join(OURS)} from {HOME}", data={"home": str(HOME)})
    )


def place_of(name: str) -> Path | None:
    """The directory that holds the module `name`, as Python would import it now; None when there is none."""
    spec = importlib.util.find_spec(name)
    if spec is None:
        return None
    if spec.origin and not spec.submodule_search_locations:  # a plain module, protocol.py
        return Path(spec.origin).resolve()
    where = next(iter(spec.submodule_search_locations or ()), "")
    return Path(where).resolve().parent


def judge_packages(places: Mapping[str, Path | None], home: Path, around: Surroundings) -> Finding | None:
    """The first thing that is wrong with where modules come from, or None."""
    data = {"home": str(home), "places": {name: str(place) for name, place in places.items()}}
    wrong = [f"{name} from {place or 'nowhere'}" for name, place in places.items() if place != home]
    if wrong:
        return Finding(
            PROBLEM,
            f"{'; '.join(wrong)}; expected all three from {home}: another module of that name comes first",
            "rename or uninstall the other one, or start with the command that does not look in the working directory",
            ("sil doctor", "python -P -m sil doctor"),
            data=data,
        )
    before = list(shadows(_before(around.search_path, home, around.folder), OURS, home))
    here = _is_searched(around.search_path, around.folder)
    clash = [*before, *shadows([around.folder], (*OURS, *sys.stdlib_module_names, *BORROWED), home)]
    if not clash:
        return None
    names = ", ".join(str(path) for path in dict.fromkeys(clash))
    return Finding(
        PROBLEM if before or here else NOTE,
        f"{names}: a module of that name is ours or a library's",
        "rename it: Python started here with -m, or a script that lies here, imports it in place of the real one",
        ("python -P -m sil doctor",),
        data={**data, "clashes": [str(path) for path in clash]},
    )


def shadows(directories: Iterable[Path], names: Iterable[str], home: Path) -> Iterator[Path]:
    """Modules and packages called `names` in `directories`, other than what lies in `home`."""
    known = tuple(names)
    for directory in directories:
        if directory.resolve() == home:
            continue
        for name in known:
            for path in (directory / f"{name}.py", directory / name / "__init__.py"):
                if path.is_file():
                    yield path


def _before(search_path: Sequence[str], home: Path, folder: Path) -> list[Path]:
    """The directories in which Python looks before it comes to `home`; none where home is found otherwise."""
    directories = [Path(entry) if entry else folder for entry in search_path]
    resolved = [directory.resolve() for directory in directories]
    return directories[: resolved.index(home)] if home in resolved else []


def _is_searched(search_path: Sequence[str], folder: Path) -> bool:
    return any((Path(entry) if entry else folder).resolve() == folder.resolve() for entry in search_path)


def _two_distributions() -> Finding | None:
    """Another installed distribution with a package of our name: whichever was installed last has won."""
    owners = metadata.packages_distributions()
    others = sorted({owner for name in OURS for owner in owners.get(name, ()) if owner != DISTRIBUTION})
    if not others:
        return None
    commands = tuple(f"{sys.executable} -m pip uninstall {name}" for name in others)
    return Finding(
        NOTE, f"{', '.join(others)} installs a package of our name, too", "remove what you need less", commands
    )


# -- dependencies -----------------------------------------------------------------------------------------------------


def dependencies(around: Surroundings) -> Finding:
    """Every dependency is there, and new enough; and `serial` is pyserial's."""
    wanted = minimums(requirements())
    have = {name: installed(name) for name in wanted}
    return (
        judge_dependencies(wanted, have)
        or _wrong_serial()
        or Finding(
            OK,
            f"{len(wanted)} of {len(wanted)} new enough: numpy {have.get('numpy')}, numba {have.get('numba')}",
            data={"installed": have},
        )
    )


def requirements() -> list[str]:
    """What the installed distribution requires; run from the sources alone, what pyproject.toml says."""
    try:
        return list(metadata.requires(DISTRIBUTION) or ())
    except metadata.PackageNotFoundError:
        return list(tomllib.loads((HOME / "pyproject.toml").read_text())["project"]["dependencies"])


def minimums(lines: Iterable[str]) -> dict[str, str]:
    """`numpy>=2.0` -> {"numpy": "2.0"}; what belongs to an extra is left out."""
    found = {}
    for line in lines:
        match = MINIMUM.match(line)
        if match and "extra ==" not in line:
            found[match[1]] = match[2]
    return found


def installed(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def judge_dependencies(wanted: Mapping[str, str], have: Mapping[str, str | None]) -> Finding | None:
    """The ones that are missing or too old, or None."""
    bad = [name for name, least in wanted.items() if release(have.get(name) or "") < release(least)]
    if not bad:
        return None
    said = "; ".join(f"{name} {have.get(name) or 'is missing'}, expected {wanted[name]} or later" for name in bad)
    command = " ".join([sys.executable, "-m pip install", *(f"'{name}>={wanted[name]}'" for name in bad)])
    return Finding(PROBLEM, said, "install them into this environment", (command,), data={"installed": dict(have)})


def release(version: str) -> tuple[int, ...]:
    """2.10.1rc1 -> (2, 10, 1); () for nothing. Zeros at the end do not count."""
    match = re.match(r"\d+(\.\d+)*", version)
    numbers = [int(part) for part in match[0].split(".")] if match else []
    while numbers and numbers[-1] == 0:
        numbers.pop()
    return tuple(numbers) if match is None or numbers else (0,)


def _wrong_serial() -> Finding | None:
    """The distribution `serial` installs a module of pyserial's name that has no serial ports."""
    import serial

    if hasattr(serial, "Serial"):
        return None
    pip = f"{sys.executable} -m pip"
    return Finding(
        PROBLEM,
        f"module serial is not pyserial's: {getattr(serial, '__file__', None)}",
        "another distribution overwrote it",
        (f"{pip} uninstall serial", f"{pip} install --force-reinstall pyserial"),
    )


# -- compiled code ----------------------------------------------------------------------------------------------------


def compiled_code(around: Surroundings) -> Finding:
    """The directories where numba keeps what it compiled, of the laboratory and of the board.

    Asked of a process that is started as a board process is: it has to start, and may see other things than we do.
    """
    from sil.launched import child_environment

    command = [sys.executable, "-P", "-c", ASK_CACHES]
    done = subprocess.run(command, env=child_environment(), capture_output=True, text=True, timeout=ASK_CACHES_S)
    said = done.stdout.splitlines()
    if done.returncode or len(said) != 2:
        last = [line for line in done.stderr.splitlines() if line.strip()][-1:]
        return Finding(PROBLEM, f"numba does not start in a process of its own: {' '.join(last)}")
    return judge_cache({"sil": Path(said[0]), "firmware_sim": Path(said[1])})


def judge_cache(directories: Mapping[str, Path]) -> Finding:
    """Where it lies and what is in it; old directories are those of sources that have changed since."""
    kernels = {name: sum(1 for _ in directory.glob("**/*.nbi")) for name, directory in directories.items()}
    size = sum(_size(directory) for directory in directories.values())
    root = next(iter(directories.values())).parent
    data = {
        "directories": {name: str(directory) for name, directory in directories.items()},
        "compiled": kernels,
        "bytes": size,
    }
    what = ", ".join(f"{name} {count}" for name, count in kernels.items())
    found = f"{root}: functions of {what}, {size_text(size)}"
    passing = [path for path in directories.values() if not path.is_dir() or _is_passing(path)]
    if passing:
        advice = "give it a directory of yours that may be written to; until then every start compiles again"
        return Finding(NOTE, f"no lasting cache: {passing[0]}", advice, ("export XDG_CACHE_HOME=~/.cache",), (), data)
    old = [path for path in root.glob("*-*") if path.is_dir() and path not in directories.values()]
    if len(old) > KEEP_OLD:
        spent = f"; {len(old)} directories of older sources, {size_text(sum(map(_size, old)))}"
        advice = "delete it all while no run is under way: the next one compiles again"
        return Finding(NOTE, found + spent, advice, (f"rm -r {root}",), (), {**data, "old": len(old)})
    if not all(kernels.values()):
        return Finding(OK, f"{found} (the first run compiles, which takes a minute)", data=data)
    return Finding(OK, found, data=data)


def _is_passing(directory: Path) -> bool:
    """Whether it is in a temporary place: sil/jit.py found no better one."""
    temp = Path(tempfile.gettempdir()).resolve()
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache").resolve()
    return temp in directory.resolve().parents and cache not in directory.resolve().parents


def _size(directory: Path) -> int:
    """Bytes of all files below; one that goes away meanwhile counts nothing."""
    total = 0
    for path in directory.rglob("*"):
        try:
            total += path.stat().st_size if path.is_file() else 0
        except OSError:
            continue
    return total
